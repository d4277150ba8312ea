"""Several uncertainties at once: systems and perturbations connected by the names of signals.

    systems   any control systems with named inputs and outputs: an input is the sum of all outputs with its name
    blocks    drives = Delta (size reads), |Delta| <= 1: perturbations from the signals `reads` to the signals `drives`

The result is the system N to which the perturbations are connected, partitioned for
`robust.mu.upper`, `robust.mu.certify` and `check_structure`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import control
import numpy as np

from nlfrf._base.arguments import require_choice, short_form
from nlfrf._base.values import value
from robust._base.types import LinearSystem, SystemField
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import is_stable
from robust.lti.realisation import multivariable
from robust.lti.wiring import join_by_name, shared_timebase
from robust.models.sets.forms import PERTURBATIONS
from robust.mu.blocks import KINDS

#: Remedy for a block that reads an input which no system drives, as in an open loop.
_PASS_ON = (
    ", which no system drives: add control.ss([], [], [], [[1]], inputs='{0}_in', outputs='{0}') to"
    " the systems, and '{0}_in' to the inputs"
)


@value(kw_only=False)
class Block:
    """One perturbation block of an interconnection: output = Delta (size input), with |Delta| <= 1.

    Fields
    ------
    reads, drives : str or list of str
        `reads`: names of the system outputs that are the input of the block. `drives`: names of the
        system inputs to which the output of the block is added.
    size : float or control.StateSpace
        Size of the perturbation: a number, or a stable weight over frequency.
    kind : str
        "full": any matrix of gain at most one. "repeated": one complex number times the identity.
        "real": one real number in [-1, 1] times the identity, a parameter.
    perturbation : str
        Class of Delta that you claim, as for `UncertaintyModel`: "LTI", "statistical" or
        "operator".

    Raises
    ------
    ValueError
        A kind or class that does not exist, an unstable size, or numbers of signals in `reads` and
        `drives` that do not fit the kind.

    References
    ----------
    SP 8.2 and 8.3.

    Examples
    --------
    >>> Block("u", "u", 0.2).shape, Block("y", "pole", 0.5, kind="real").shape
    ((1, 1), (1, 1, 'real'))
    """

    reads: Sequence[str]
    drives: Sequence[str]
    size: SystemField = 1.0
    kind: str = "full"
    perturbation: str = "LTI"

    def __post_init__(self) -> None:
        require_choice("kind", self.kind, KINDS)
        require_choice("perturbation", self.perturbation, PERTURBATIONS)
        for name in ("reads", "drives"):
            object.__setattr__(self, name, _checked_signals(name, getattr(self, name)))
        if self.kind != "full" and len(self.reads) != len(self.drives):
            raise ValueError(
                f"drives must name as many signals as reads for a {self.kind} block,"
                f" {len(self.reads)}"
            )
        size = multivariable("size", self.size)
        if (size.ninputs, size.noutputs) != (1, 1) or not is_stable(size):
            raise ValueError(
                "size must be a number or a stable weight with one input and output, got"
                f" {short_form(self.size)}"
            )
        object.__setattr__(self, "size", size)

    @property
    def shape(self) -> tuple[int, int] | tuple[int, int, str]:
        """Return the block as `robust.mu.upper` takes it: rows, columns, and a kind other than
        full.
        """
        lengths = (len(self.reads), len(self.drives))
        if self.kind == "full":
            return lengths
        return *lengths, self.kind


def _checked_signals(name: str, given: object) -> tuple[str, ...]:
    """Return signal names as a tuple; refuse anything else."""
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, Sequence) or not all(isinstance(one, str) for one in names):
        raise ValueError(f"{name} must hold names of signals, got {short_form(given)}")
    return tuple(names)


@value
class UncertainSystem:
    """A linear system N with its perturbations as external feedback blocks (SP 8.3).

    Fields
    ------
    N : control.StateSpace
        System from (outputs of the blocks, `inputs`) to (inputs of the blocks, `outputs`); it
        contains the sizes of the blocks. The names of the signals of a block begin with the name of
        the block, for example "actuator:u".
    blocks : dict of str to Block
        Perturbations by name, in the order in which they are connected to N.
    inputs, outputs : tuple of str
        Names of the signals of the performance channel; empty if only stability is of interest.

    References
    ----------
    SP 8.3 (pulling out the perturbations).

    Examples
    --------
    >>> lag = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y")
    >>> K = control.ss([], [], [], [[-4.0]], inputs="y", outputs="u")
    >>> system = interconnection([lag, K], {"pole": Block("y", "pole", 2.5, kind="real")})
    >>> system.structure, system.loop.poles().real.round(9).tolist()               # s + 1 + 4
    ([(1, 1, 'real')], [-5.0])
    """

    N: control.StateSpace
    blocks: dict[str, Block]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        N, (read, driven) = self.N, self._signals()
        held = self.__dict__
        held["N"] = control.StateSpace(
            N.A, N.B, N.C, N.D, N.dt, inputs=[*driven, *self.inputs], outputs=[*read, *self.outputs]
        )

    def _signals(self) -> tuple[list[str], list[str]]:
        """Return names for the signals that the blocks read and drive: that of the block, then that
        of the signal.
        """
        named = self.blocks.items()
        return (
            [f"{name}:{signal}" for name, block in named for signal in block.reads],
            [f"{name}:{signal}" for name, block in named for signal in block.drives],
        )

    @property
    def structure(self) -> list[tuple[int, int] | tuple[int, int, str]]:
        """Return the blocks as `robust.mu.upper` takes them."""
        return [block.shape for block in self.blocks.values()]

    @property
    def with_performance(self) -> list[tuple[int, int] | tuple[int, int, str]]:
        """Return `structure` with a full performance block; mu < 1 means a gain below one."""
        return [*self.structure, (len(self.outputs), len(self.inputs))]

    @property
    def loop(self) -> control.StateSpace:
        """Return the part of N that is connected to the perturbations (N11)."""
        rows = sum(block[0] for block in self.structure)
        cols = sum(block[1] for block in self.structure)
        N = self.N
        read, driven = self._signals()
        return control.StateSpace(
            N.A, N.B[:, :cols], N.C[:rows], N.D[:rows, :cols], N.dt, inputs=driven, outputs=read
        )

    def perturbation_by_name(self, delta: np.ndarray) -> dict[str, float]:
        """Return by name the value of each real block of a perturbation, and the norm of each other
        block.
        """
        parts, r, c = {}, 0, 0
        for name, block in self.blocks.items():
            n, m = block.shape[:2]
            part = delta[c : c + m, r : r + n]
            parts[name] = float(
                part[0, 0].real if block.kind == "real" else np.linalg.norm(part, 2)
            )
            r, c = r + n, c + m
        return parts


def interconnection(
    systems: Sequence[LinearSystem],
    blocks: Mapping[str, Block],
    *,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> UncertainSystem:
    """Connect systems by the names of their signals, with perturbations as external blocks.

    Use this for a loop with several uncertainties, or with uncertain parameters; check it with
    `check_structure`.

    Parameters
    ----------
    systems : list of control.StateSpace or TransferFunction
        Systems with named inputs and outputs (`control.ss(..., inputs=, outputs=)`,
        `control.summing_junction`). Every input is a sum: of the outputs with the same name, the
        blocks that drive it, and the external input with the same name.
    blocks : dict of str to Block
        The perturbations, by name.
    inputs, outputs : str or list of str
        External inputs and outputs. The performance is the gain between them. Performance weights
        are part of `systems`.

    Returns
    -------
    UncertainSystem

    Raises
    ------
    ValueError
        An unknown signal, an input without a source, different sampling times, or an algebraic loop
        without a solution.

    References
    ----------
    SP 8.1 and 8.2 (pulling out the perturbations), 8.2.1 (parameters).

    Examples
    --------
    A lag with uncertain pole and a multiplicative perturbation at its input, under proportional
    control:

    >>> lag = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y")
    >>> K = control.ss([], [], [], [[4.0]], inputs="e", outputs="u")
    >>> error = control.summing_junction(["-y"], "e")
    >>> system = interconnection(
    ...     [lag, K, error],
    ...     {"pole": Block("y", "pole", 0.5, kind="real"), "actuator": Block("u", "u", 0.2)})
    >>> system.structure, system.N.poles().tolist()
    ([(1, 1, 'real'), (1, 1)], [(-5+0j)])
    >>> system.N.input_labels
    ['pole:pole', 'actuator:u']
    """
    if not isinstance(systems, Sequence) or not systems:
        raise ValueError(
            f"systems must hold at least one system, as a list, got {short_form(systems)}"
        )
    if not isinstance(blocks, Mapping) or not all(
        isinstance(block, Block) for block in blocks.values()
    ):
        raise ValueError(
            f"blocks must be named blocks, {{name: Block(...)}}, got {short_form(blocks)}"
        )
    inputs, outputs = _checked_signals("inputs", inputs), _checked_signals("outputs", outputs)
    if bool(inputs) != bool(outputs):
        raise ValueError("outputs must be given together with inputs, got only one of them")
    parts = [multivariable(f"systems[{k}]", system) for k, system in enumerate(systems)]
    weights = [block.size for block in blocks.values() for _ in block.reads]
    dt = shared_timebase([*parts, *weights])
    named_in = [label for part in parts for label in part.input_labels]
    named_out = [label for part in parts for label in part.output_labels]
    read = [*(label for block in blocks.values() for label in block.reads), *outputs]
    external = [*(label for block in blocks.values() for label in block.drives), *inputs]
    _require_known_signals(named_in, named_out, read=read, external=external)
    N = join_by_name(parts, (), external=external, looked_at=read)
    if weights:
        size = block_diagonal(
            [*weights, control.StateSpace([], [], [], np.eye(len(outputs)), dt)], dt
        )
        N = in_series(N, size, dt=dt)
    return UncertainSystem(N=N, blocks=dict(blocks), inputs=inputs, outputs=outputs)


def _require_known_signals(
    named_in: list[str], named_out: list[str], *, read: list[str], external: list[str]
) -> None:
    """Refuse unknown signals, and inputs without a source."""
    for label in read:
        if label not in named_out:
            raise ValueError(
                f"blocks and outputs must read outputs of the systems ({', '.join(named_out)}), got"
                f" {label!r}" + (_PASS_ON.format(label) if label in named_in else "")
            )
    for label in external:
        if label not in named_in:
            raise ValueError(
                f"blocks and inputs must drive inputs of the systems ({', '.join(named_in)}), got"
                f" {label!r}"
            )
    for label in named_in:
        if label not in {*named_out, *external}:
            raise ValueError(
                f"systems must have a source for every input, got no output that drives {label!r}"
            )
