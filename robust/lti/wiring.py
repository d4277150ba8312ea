"""Systems connected by the names of their signals, with ports for tuned blocks and for FRFs."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from nlfrf._base.arguments import join_names
from nlfrf._base.values import value
from robust.lti.connections import block_diagonal
from robust.lti.lti import is_clockless, timebase

#: Least determinant of I - D K for an algebraic loop with a solution.
_WELL_POSED = 1e-9


@value
class Port:
    """A place in a wiring for a later part: the signals that the part reads, and those that it
    drives.
    """

    reads: tuple[str, ...]
    drives: tuple[str, ...]


def join_by_name(
    parts: Sequence[control.StateSpace],
    ports: Sequence[Port],
    *,
    external: Sequence[str],
    looked_at: Sequence[str],
) -> control.StateSpace:
    """Join parts and ports by name: an input is the sum of all outputs and external inputs of its
    name.

    The result is from (external inputs, signals that the ports drive) to (signals in `looked_at`,
    signals that the ports read). A signal in `looked_at` is the sum of all outputs of its name,
    without the external input of that name, as in `control.interconnect`.

    Raises
    ------
    ValueError
        An unknown signal, an input of a port that no output drives, sampling times that differ, or
        an algebraic loop among the fixed parts that has no solution.
    """
    dt = shared_timebase(parts)
    part_in = [label for part in parts for label in part.input_labels]
    part_out = [label for part in parts for label in part.output_labels]
    port_in = [label for port in ports for label in port.reads]
    port_out = [label for port in ports for label in port.drives]
    _require_signals(
        part_in,
        part_out,
        port_in=port_in,
        port_out=port_out,
        external=external,
        looked_at=looked_at,
    )
    G = block_diagonal(parts, dt)
    into_parts, into_ports = _same_name(part_in, external), _same_name(port_in, external)
    parts_from_ports = _same_name(part_in, port_out)
    ports_from_parts = _same_name(port_in, part_out)
    seen_parts, seen_ports = _same_name(looked_at, part_out), _same_name(looked_at, port_out)
    inside = _same_name(part_in, part_out)
    around = np.eye(len(part_out)) - G.D @ inside
    if not is_well_posed(around):
        raise ValueError(
            "systems must form loops that are well posed, got an algebraic loop of gain one. Break it"
            " with a delay, or remove a part of it"
        )
    # inputs i = inside o + drive v, outputs o = C x + D i, with v the external inputs and the
    # outputs of the ports
    drive = np.hstack([into_parts, parts_from_ports])
    o_x, o_v = np.linalg.solve(around, G.C), np.linalg.solve(around, G.D @ drive)
    sense = np.vstack([seen_parts, ports_from_parts])
    D = sense @ o_v
    D[: len(looked_at), len(external) :] += seen_ports
    D[len(looked_at) :, : len(external)] += into_ports
    D[len(looked_at) :, len(external) :] += _same_name(port_in, port_out)
    A, B = G.A + G.B @ inside @ o_x, G.B @ (inside @ o_v + drive)
    return control.StateSpace(A, B, sense @ o_x, D, dt, remove_useless_states=False)


def is_well_posed(around: np.ndarray) -> bool:
    """Return whether I - D K can be inverted, by its determinant, which does not depend on units of
    the signals.
    """
    return bool(abs(np.linalg.det(around)) > _WELL_POSED)


def _require_signals(
    part_in: list[str],
    part_out: list[str],
    *,
    port_in: list[str],
    port_out: list[str],
    external: Sequence[str],
    looked_at: Sequence[str],
) -> None:
    inputs, outputs = {*part_in, *port_in}, {*part_out, *port_out}
    for label in external:
        if label not in inputs:
            raise ValueError(
                f"inputs must be inputs of a system, plant or block ({join_names(sorted(inputs))}),"
                f" got {label!r}"
            )
    for label in looked_at:
        if label not in outputs:
            raise ValueError(
                "outputs must be outputs of a system, plant or block"
                f" ({join_names(sorted(outputs))}), got {label!r}"
            )
    for label in port_in:
        if label not in outputs and label not in external and label not in part_in:
            raise ValueError(
                "reads must name outputs of the systems, plant and blocks, or external inputs, got"
                f" {label!r}, which no output drives"
            )
    for label in port_out:
        if label not in inputs and label not in looked_at:
            raise ValueError(
                "drives must name inputs of the systems, plant and blocks, or outputs of a limit,"
                f" got {label!r}, which no input reads"
            )


def shared_timebase(parts: Sequence[control.StateSpace]) -> float:
    """Return the sampling time [s] of all parts that have one; refuse two that differ."""
    steps = sorted({timebase(part) for part in parts if not is_clockless(part)})
    if len(steps) > 1 and max(abs(step / steps[-1] - 1) for step in steps) > 1e-9:
        raise ValueError(
            "systems must have one sampling time (0: continuous), got"
            f" {join_names([f'{step:g} s' for step in steps])}"
        )
    if steps:
        return steps[-1]
    return 0.0


def _same_name(rows: Sequence[str], columns: Sequence[str]) -> np.ndarray:
    """Return a matrix with ones where the names agree."""
    ones = [[float(row == column) for column in columns] for row in rows]
    return np.array(ones).reshape(len(rows), len(columns))
