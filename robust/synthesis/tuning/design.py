"""The result of a tuning: the blocks with their numbers, the value of each limit, and missing
demands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, format_small_count, join_names, require_integer
from nlfrf._base.values import value
from robust.lti.lti import axis_points, evaluate_transfer, timebase, to_s_plane, with_names
from robust.lti.realisation import structurally_minimal
from robust.lti.wiring import join_by_name
from robust.models.lpv import LpvModel
from robust.synthesis.blocks import TunableBlock, parameter_values, signal_names
from robust.synthesis.tuning.friction import FrictionLimit
from robust.synthesis.tuning.limits import Limit
from robust.synthesis.tuning.plants import MeasuredPlant, Plants, see_plants

#: Units of parameters that have a unit of their own.
_UNITS = {"omega": "rad/s", "filter_time": "s", "phase": "rad"}
#: Operating points at which a schedule is compared with its blocks, its largest relative error
#: there, and the largest degree that is tried.
_BETWEEN, _LARGEST_ERROR, _MAX_DEGREE = np.linspace(-1, 1, 17), 1e-4, 12
_ROUNDING = 1e-14


class Ended(Enum):
    """Reason why a search ended.

    References
    ----------
    Lewis & Overton, *Nonsmooth optimization via quasi-Newton methods*, Mathematical Programming 141
    (2013).

    Examples
    --------
    >>> Ended.OUT_OF_TIME.value
    'time_cap was reached'
    """

    CONVERGED = "no step improves it"
    OUT_OF_TIME = "time_cap was reached"
    INTERRUPTED = "it was interrupted"


@value
class LimitValue:
    """Value of a limit on the loop around one plant.

    Fields
    ------
    limit : Limit or FrictionLimit
    hard : bool
    plant : int
        Index of the plant, counted from 0.
    plant_name : str
        Name of the plant: its operating point, or its index.
    ratio : float
        Largest gain times weight, divided by the bound; the limit is met up to one.
    omega : float
        Frequency of the largest ratio [rad/s]; inf at infinite frequency.
    n_lines : int
        Number of frequencies checked. 0 for a norm: by the Hamiltonian test, the ratio is larger at
        no frequency, to 1e-7.
    omegas, curve, before : (W,) ndarray
        Frequencies [rad/s], ratio at these frequencies, and ratio with the given blocks before
        tuning; nan if the loop with the given blocks is unstable.

    References
    ----------
    Bruinsma & Steinbuch, *A fast algorithm to compute the H-infinity norm*, Systems & Control
    Letters 14 (1990).

    Examples
    --------
    >>> found = LimitValue(limit=Limit("d", "y", 2.0), hard=True, plant=0, plant_name="plant 0", ratio=0.5, omega=3.0)
    >>> found.met, str(found)
    (True, 'hard  d -> y on plant 0: 0.5 of its bound at 0.4775 Hz, norm')
    """

    limit: Limit | FrictionLimit
    hard: bool
    plant: int
    plant_name: str
    ratio: float
    omega: float
    n_lines: int = 0
    omegas: np.ndarray | None = None
    curve: np.ndarray | None = None
    before: np.ndarray | None = None

    @property
    def met(self) -> bool:
        """True if the gain stays below its bound."""
        return bool(self.ratio <= 1)

    def __str__(self) -> str:
        kind = "hard" if self.hard else "soft"
        where = format_hertz(self.omega)
        if self.n_lines:
            how = f"on {self.n_lines} lines"
        else:
            how = "norm"
        return (
            f"{kind}  {self.limit} on {self.plant_name}: {self.ratio:.5g} of its bound at {where},"
            f" {how}"
        )


def _without_rounding(K: LpvModel) -> LpvModel:
    """Return a schedule without coefficients that are only rounding beside their entry or row."""
    parts: dict[str, Any] = {}
    for name in "ABCD":
        M = getattr(K, name)
        size = np.abs(M).max(axis=0)
        noise = _ROUNDING * np.maximum(size, 0.01 * size.max(axis=1, keepdims=True, initial=0.0))
        parts[name] = np.where(np.abs(M) <= noise, 0.0, M)
    return replace(K, **parts)


def _response_error(K: control.StateSpace, wanted: control.StateSpace) -> float:
    """Return the largest error of a response over its size, over the speeds of the poles."""
    dt = timebase(wanted)
    speeds = np.abs(to_s_plane(wanted.poles(), dt))
    speeds = np.append(
        speeds[speeds > 1e-9 * speeds.max(initial=1e-300)], 1.0 if not dt else 0.1 / dt
    )
    omega = np.geomspace(0.1 * speeds.min(), 10 * speeds.max(), 200)
    points = axis_points(np.minimum(omega, 0.99 * np.pi / dt) if dt else omega, dt)
    found, right = (evaluate_transfer(G.A, G.B, G.C, G.D, points) for G in (K, wanted))
    return float((np.abs(found - right).max((1, 2)) / np.abs(right).max((1, 2))).max())


@value
class TunedDesign:
    """Result of `tune`: the tuned blocks, and the properties of their loops.

    Nothing here is proved; `check` gives proofs.

    Fields
    ------
    blocks : dict of str to block
        The given blocks with tuned numbers.
    met : bool
        True if every loop is stable and every hard limit is met. A limit that is the norm of a
        system is checked at all frequencies, any other limit on a frequency grid.
    stable : bool
        True if every loop is stable by more than rounding errors, and has the required decay rate.
    limits : tuple of LimitValue
        Every limit with every plant: hard limits before soft limits, and the worst first.
    excess : float
        Largest real part [rad/s] of the poles that depend on a block, over all plants that are
        systems; -inf if there are none.
    ended : Ended
        Reason why the search ended.
    spread : tuple of float
        Result of every start: the worst ratio of the hard limits if one of them is missed,
        otherwise the worst ratio of the soft limits; inf if no stable loop was found. If the
        results differ, they are local optima, and more starts may help.
    at_bounds : tuple of str
        Parameters that have reached a bound, which may limit the design.
    not_asked : tuple of str
        Properties that no limit protects, and that the search may have sacrificed.
    n_evaluated : int
        Number of loops evaluated.
    broken_sets : tuple of str
        For limits with `worst`: plants whose loop is not stable with the whole set (by
        `worst_case`), with the reason.
    system : tuple of control.StateSpace
        The fixed parts.
    plant : Plants
        The plants for which the blocks were tuned.
    dt, delay : float
        Sampling time and computation delay [s].

    References
    ----------
    Apkarian & Noll, *Nonsmooth H-infinity synthesis*, IEEE Trans. Automatic Control 51 (2006).

    Examples
    --------
    >>> from robust import tune, tuning
    >>> plant = tuning.Plants(control.tf([1], [1, 1]), inputs="u", outputs="y")
    >>> error = control.summing_junction(["r", "-y"], "e")
    >>> K = tuning.Gain(K=1.0, reads="e", drives="u")
    >>> error_at_low_frequency = tuning.Limit("r", "e", 0.1, band=(0.0, 0.1))
    >>> design = tune([error], plant, {"K": K}, hard=[tuning.Limit("r", "u", 9.0)], soft=[error_at_low_frequency])
    >>> design.met, round(float(design.blocks["K"].K[0, 0]), 2)
    (True, 9.0)
    """

    blocks: dict[str, TunableBlock]
    met: bool
    stable: bool
    limits: tuple[LimitValue, ...]
    excess: float
    ended: Ended
    spread: tuple[float, ...]
    at_bounds: tuple[str, ...]
    not_asked: tuple[str, ...]
    n_evaluated: int
    system: tuple[control.StateSpace, ...]
    plant: Plants
    dt: float
    delay: float
    broken_sets: tuple[str, ...] = ()

    @property
    def gamma(self) -> float:
        """Worst ratio of the soft limits over all plants; nan without soft limits."""
        return max((one.ratio for one in self.limits if not one.hard), default=float("nan"))

    @property
    def reason(self) -> str:
        """Reason why the search ended, or the missed limits with their frequencies."""
        missed = [one for one in self.limits if one.hard and not one.met]
        if not self.limits:
            return (
                f"no stable loop was found, the slowest pole has a real part of {self.excess:.3g}"
                " rad/s"
            )
        if missed:
            entries = "; ".join(
                f"{one.limit} is missed by a factor {one.ratio:.4g} at {format_hertz(one.omega)} on"
                f" {one.plant_name}"
                for one in missed[:3]
            )
            return f"not met: {entries} ({self.ended.value})"
        if self.broken_sets:
            return f"not met: {'; '.join(self.broken_sets)}"
        if not self.stable:
            return "not met: a loop lies within rounding of the stability boundary. Require a decay"
        return self.ended.value

    def controller(
        self, inputs: str | Sequence[str], outputs: str | Sequence[str]
    ) -> control.StateSpace:
        """Return all blocks and fixed parts between two signals as one controller, outputs = -K
        inputs.

        Use it for `check`, `controller_sections` and `pid_gains`: `controller("y", "u")` with the
        outputs and inputs of the plant.
        """
        return self.controller_at(inputs, outputs, None)

    def controller_at(
        self, inputs: str | Sequence[str], outputs: str | Sequence[str], theta: float | None
    ) -> control.StateSpace:
        """Return `controller` at operating point theta in [-1, 1] (None: nothing is scheduled)."""
        inputs, outputs = signal_names("inputs", inputs), signal_names("outputs", outputs)
        open_chain = self.joined((), inputs, outputs, theta)
        K = structurally_minimal(
            (open_chain.A, open_chain.B, -open_chain.C, -open_chain.D), self.dt
        )
        return with_names(K, inputs, outputs)

    def schedule(
        self,
        inputs: str | Sequence[str],
        outputs: str | Sequence[str],
        *,
        degree: int | None = None,
    ) -> LpvModel:
        """Return `controller` as an `LpvModel`, for `prove_schedule` and `export_c`.

        The numbers of the blocks are polynomials of the operating point. The matrices of a filter
        with a scheduled frequency are not polynomials; they are interpolated by polynomials through
        d + 1 nodes. Their degree d is `degree`, or the smallest one for which the relative error of
        the response is below 1e-4 everywhere. Prove and implement the returned controller.

        Raises
        ------
        ValueError
            Plants without operating points.
        """
        at = self.plant.at
        if at is None:
            raise ValueError(
                "plant must have operating points for a schedule, got none: Plants(models, ...,"
                " at=points), or an LpvModel"
            )
        least = max((d for one in self.blocks.values() for d in one.scheduled.values()), default=0)
        tried = range(least, max(least, _MAX_DEGREE) + 1)
        if degree is not None:
            tried = range(require_integer("degree", degree, least=0), degree + 1)
        wanted = [self.controller_at(inputs, outputs, theta) for theta in _BETWEEN]
        for d in tried:
            theta = -np.cos(np.pi * np.arange(max(d, 1) + 1) / max(d, 1))
            systems = [self.controller_at(inputs, outputs, float(one)) for one in theta]
            K = _without_rounding(LpvModel.from_points(systems, at=theta, degree=d))
            if max(map(_response_error, map(K.at, _BETWEEN), wanted)) < _LARGEST_ERROR:
                break
        return replace(K, points=at, over=self.plant.over, unit=self.plant.unit)

    def loop(
        self, inputs: str | Sequence[str], outputs: str | Sequence[str], plant: int = 0
    ) -> control.StateSpace:
        """Return the closed loop around one plant, between two signals, with all its states."""
        inputs, outputs = signal_names("inputs", inputs), signal_names("outputs", outputs)
        plant = require_integer("plant", plant, least=0)
        if plant >= len(self.plant.models):
            raise ValueError(f"plant must be below {len(self.plant.models)}, got {plant}")
        seen = see_plants(self.plant, self.dt, delay=self.delay, worst=False)[plant]
        if isinstance(seen, MeasuredPlant):
            raise ValueError(
                "plant must be the index of a system or a model, because the loop around an"
                " FRF has no state space, got an FRF"
            )
        G = seen.system
        G = control.StateSpace(G.A, G.B, G.C, G.D, self.dt, remove_useless_states=False)
        machine = with_names(G, self.plant.inputs, self.plant.outputs)
        return self.joined((machine,), inputs, outputs, float(self.plant.thetas[plant]))

    def joined(
        self,
        more: Sequence[control.StateSpace],
        inputs: tuple[str, ...],
        outputs: tuple[str, ...],
        theta: float | None = None,
    ) -> control.StateSpace:
        """Return fixed parts, blocks (at theta) and further systems, connected by signal names."""
        blocks = [one if theta is None else one.at(theta) for one in self.blocks.values()]
        parts = [*self.system, *(block.system(self.dt) for block in blocks), *more]
        return with_names(
            join_by_name(parts, [], external=inputs, looked_at=outputs), inputs, outputs
        )

    def __str__(self) -> str:
        met = "met (on lines or as norms, see each limit)" if self.met else "NOT MET"
        rows = [f"tuned {format_small_count(len(self.blocks), 'block')}: {met}; {self.reason}"]
        for name, block in self.blocks.items():
            entries = [
                f"{key} ="
                f" {np.array2string(number, precision=6)}{f' {_UNITS[key]}' if key in _UNITS else ''}"
                for key, number in parameter_values(block).items()
            ]
            rows.append(f"  {name}: {', '.join(entries)}")
        rows += [f"  {one}" for one in self.limits]
        rows.append(f"  starts: {', '.join(f'{one:.5g}' for one in self.spread)}")
        if self.at_bounds:
            rows.append(f"  at a bound: {join_names(list(self.at_bounds))}")
        rows += [f"  not demanded: {one}" for one in self.not_asked]
        rows.append("  this is a search, not a proof: use check() for the whole set")
        return "\n".join(rows)
