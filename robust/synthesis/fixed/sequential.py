"""The loops of a matrix closed one after the other by a diagonal controller, with a final check of
the whole.

With the loops C closed by K_C, the plant of loop k is

    G_k = G_kk - G_kC H G_Ck,     H = K_C (1 + G_CC K_C)^-1,

and a change dG of the matrix changes it, to first order, by x' dG z with x' = (1, -G_kC H) and z =
(1, -H G_Ck) on the channels (k, C). This gives the discs for the design of each loop. The discs
neglect second-order terms, and the fact that dG is the same in all loops; the final check includes
both. If this check fails, the discs are widened and the design is repeated.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import format_hertz, require_integer, require_nonnegative
from nlfrf._base.values import value
from robust._base.states import Stability
from robust.analysis.robustness import check
from robust.lti.connections import block_diagonal
from robust.lti.grids import controller_mode_lines, interpolate_frf, structure_grid
from robust.lti.low_frequency import read_below
from robust.lti.lti import frequency_response_matrices, response, timebase, with_names
from robust.lti.stability import unstable_pole_values, unstable_poles, winding_number
from robust.models.sets.forms import ADDITIVE, ELEMENTS, INPUT
from robust.models.sets.measured import SeenLines, lines_of_bla
from robust.models.sets.model import UncertaintyModel, require_record_form
from robust.models.sets.radius import RadiusSpec, block_radii_of_record
from robust.synthesis.fixed.one_loop import LoopOptions, design_loop
from robust.synthesis.fixed.structures import ControllerStructure
from robust.synthesis.hinf.design import Design

if TYPE_CHECKING:
    import control

_SWEEPS = 6  # largest number of designs of each loop with the others closed
_TIGHTENING = 0.97  # factor on the limit of a peak, from one sweep to the next
_WIDENINGS = 3  # times the discs are widened because of the check of the whole
_N_LINES = 300  # for a parametric plant, besides those of its modes
# highest frequency for a continuous plant, over its fastest mode and the last measured line
_BAND_EXTENSION = 100.0
_CONFIDENCE = 0.95  # of the set around an FRM
_PER_LOOP_OPTIONS = ("w_P", "w_T", "w_u", "M_S", "M_T", "M_u", "omega_c", "gain", "aim", "fixed", "end_gain",
            "integrators", "filter_time", "stable", "start", "n_starts")  # fmt: skip


Structure: TypeAlias = str | int | ControllerStructure
#: Structure and demands for one loop.
LoopTask: TypeAlias = tuple[Structure, LoopOptions]


@value
class MatrixOnLines:
    """A square matrix of plants on lines, with its uncertainty."""

    omega: np.ndarray  # (W,) frequencies [rad/s]
    G: np.ndarray  # (W, n, n) complex nominal, hold and delay included
    # left, right: (W, n, p) or (W, q, n) complex factors of G + left Delta right, for a full block
    left: np.ndarray
    right: np.ndarray
    # (W, n, n) radii of single entries; zero for a full block, as left and right are for single
    # entries
    radius: np.ndarray

    def seen_from(self, k: int, K: list[control.StateSpace | None], wider: float) -> SeenLines:
        """Return the plant of loop k, with the loops closed that have a controller."""
        G, row, column = self.G, *(np.zeros(self.G.shape[:2], dtype=complex) for _ in range(2))
        row[:, k] = column[:, k] = 1.0
        C = [j for j in range(len(K)) if K[j] is not None and j != k]
        inner = G[:, k, k]
        if C:
            gains = np.stack([response(K[j], self.omega) for j in C], axis=1)
            H = gains[:, :, None] * np.linalg.inv(
                np.eye(len(C)) + G[:, C][:, :, C] * gains[:, None, :]
            )
            row[:, C] = -(G[:, [k]][:, :, C] @ H)[:, 0]
            column[:, C] = -(H @ G[:, C][:, :, [k]])[:, :, 0]
            inner = inner + np.einsum("wj,wj->w", row[:, C], G[:, C, k])
        return SeenLines(
            omega=self.omega,
            G=inner[None, None],
            form=ADDITIVE,
            w=wider * self.spread(row, column),
            W=np.ones(self.omega.size),
        )

    def with_modes(self, K: list[control.StateSpace | None]) -> MatrixOnLines:
        """Return the plant with more lines, interpolated, at lightly damped modes of
        controllers.
        """
        modes = [controller_mode_lines(one, (self.omega[0], self.omega[-1])) for one in K]
        omega = np.unique(np.concatenate([self.omega, *modes]))

        def between(x: np.ndarray) -> np.ndarray:
            entries = [
                interpolate_frf(omega, self.omega, one) for one in x.reshape(self.omega.size, -1).T
            ]
            return np.array(entries).T.reshape(omega.size, *x.shape[1:])

        parts = {name: between(getattr(self, name)) for name in ("G", "left", "right")}
        return MatrixOnLines(omega=omega, radius=np.abs(between(self.radius)), **parts)

    def spread(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return (W,) largest |row dG column| over the set."""
        entries = np.einsum("wj,wji,wi->w", np.abs(row), self.radius, np.abs(column))
        block = np.linalg.norm(row[:, None] @ self.left, axis=(1, 2)) * np.linalg.norm(
            self.right @ column[:, :, None], axis=(1, 2)
        )
        return np.asarray(entries + block)


class _Matrix(Protocol):
    """A square plant whose loops are closed in turn."""

    def clock(self, dt: float, delay: float) -> float:
        """Return the sampling time [s] of the loops; refuse a plant that they cannot be closed
        for.
        """
        ...

    def on_lines(self, dt: float, delay: float) -> MatrixOnLines:
        """Return the matrix and its set on measured lines, or at features of it and its weights."""
        ...

    def check_whole(
        self,
        on_lines: MatrixOnLines,
        *,
        K: list[control.StateSpace | None],
        order: list[int],
        dt: float,
    ) -> tuple[str, float]:
        """Return the reason why the whole set is not stable ("" if it is), and the factor up to
        which it is stable.
        """
        ...


@value(copy=False)
class _ModelledMatrix:
    """A set around a system."""

    model: UncertaintyModel

    def clock(self, dt: float, delay: float) -> float:
        step = timebase(self.model.nominal)
        if delay or (dt and dt != step):
            raise ValueError(
                f"dt and delay must be in the nominal for several channels, got {dt:g} s and"
                f" {delay:g} s in addition to a nominal at {step:g} s: use sampled()"
            )
        wild = unstable_pole_values(self.model.nominal, step)
        if wild.size:
            raise ValueError(
                "plant must be stable except for integrators, because its loops are closed one"
                f" after the other, got a pole at {wild[0]:.4g}: use dk_iteration or ncfsyn, which"
                " design a full controller"
            )
        return step

    def on_lines(self, dt: float, delay: float) -> MatrixOnLines:
        n = self.model.n_inputs
        del delay  # inside the nominal
        require_record_form(
            self.model, "to tune its loops one by one (dk_iteration takes every form)"
        )
        N = self.model.nominal
        modes = structure_grid(N)
        low, high = min(modes[1], self.model.omega[0]), max(modes[-1], self.model.omega[-1])
        if dt:
            far = np.pi / dt
        else:
            far = _BAND_EXTENSION * high
        omega = np.unique(
            np.concatenate([self.model.omega, modes, np.geomspace(low, far, _N_LINES)])
        )
        omega = omega[(omega > 0) & (omega * dt < np.pi * (1 - 1e-6))]
        G = frequency_response_matrices((N.A, N.B, N.C, N.D), omega, dt)
        right = np.abs([response(w, omega) for w in self.model.right])
        if self.model.form == ELEMENTS:
            none = np.zeros((omega.size, n, 1))
            radius = right.reshape(n, n, -1).transpose(2, 1, 0)
            return MatrixOnLines(
                omega=omega, G=G, left=none, right=none.swapaxes(1, 2), radius=radius
            )
        left = _diagonal_matrices(np.abs([response(w, omega) for w in self.model.left]))
        if self.model.form == INPUT:
            left = G @ left
        return MatrixOnLines(
            omega=omega, G=G, left=left, right=_diagonal_matrices(right), radius=np.zeros(G.shape)
        )

    def check_whole(
        self,
        on_lines: MatrixOnLines,
        *,
        K: list[control.StateSpace | None],
        order: list[int],
        dt: float,
    ) -> tuple[str, float]:
        del on_lines, order  # a set around a system is known everywhere
        try:
            report = check(self.model, block_diagonal(K, dt))
        except ValueError as error:
            return f"the whole loop cannot be checked: {error}", np.nan
        good = report.proofs.robustly_stable
        return "" if good else f"the whole set is not stable: {report.reason}", float(
            report.margins.rs
        )


@value(copy=False)
class _MeasuredMatrix:
    """A measured matrix with its bound."""

    bla: Bla

    def clock(self, dt: float, delay: float) -> float:
        del delay
        return dt

    def on_lines(self, dt: float, delay: float) -> MatrixOnLines:
        factor = lines_of_bla(self.bla).hold_and_delay_factor(self.bla.omega, dt=dt, delay=delay)
        left, right = block_radii_of_record(
            self.bla,
            self.bla.G,
            missed=np.zeros(self.bla.G.shape),
            spec=RadiusSpec(p=_CONFIDENCE),
            form=ADDITIVE,
        )
        G, left = np.moveaxis(self.bla.G * factor, 2, 0), left * np.abs(factor)
        return MatrixOnLines(
            omega=self.bla.omega,
            G=G,
            left=_diagonal_matrices(left),
            right=_diagonal_matrices(right),
            radius=np.zeros(G.shape),
        )

    def check_whole(
        self,
        on_lines: MatrixOnLines,
        *,
        K: list[control.StateSpace | None],
        order: list[int],
        dt: float,
    ) -> tuple[str, float]:
        finer = on_lines.with_modes(
            K
        )  # for all controllers: the plant of one loop contains the modes of the others
        for lines in (on_lines, finer):
            if why := check_sequential_stability(self.bla, lines, K=K, order=order, dt=dt):
                return why, np.nan
        on_lines = finer
        gains = _diagonal_matrices(np.array([response(one, on_lines.omega) for one in K]))
        N = (
            on_lines.right
            @ gains
            @ np.linalg.inv(np.eye(len(K)) + on_lines.G @ gains)
            @ on_lines.left
        )
        size = np.linalg.norm(N, 2, axis=(1, 2))
        worst = int(size.argmax())
        margin = float(1 / size[worst])
        return (
            (
                ""
                if margin > 1
                else f"the whole set is not stable at {format_hertz(on_lines.omega[worst])}"
            ),
            margin,
        )


def close_in_turn(
    plant: Bla | UncertaintyModel, structure: Structure | list[Structure], options: LoopOptions
) -> Design:
    """Return `design_frf` for a matrix: a diagonal controller, loop by loop."""
    dt, matrix = _require_plant(plant, options), _matrix_of(plant)
    dt = matrix.clock(dt, options["delay"])
    n = plant.n_inputs
    of_loops = {**options, "dt": dt, "delay": 0.0}
    each = [_loop_demands(k, n, structure=structure, options=of_loops) for k in range(n)]
    on_lines = matrix.on_lines(dt, options["delay"])
    order = sorted(range(n), key=lambda k: -_crossover_of(each[k][1]["omega_c"]))
    K: list[control.StateSpace | None] = [None] * n
    wider, history = 1.0, list[float]()
    for _ in range(_WIDENINGS):
        for sweep in range(_SWEEPS):
            for k in order:
                if (
                    K[k] is None
                    or not _evaluate_loop(on_lines, k, K=K, own=each[k], wider=wider).met
                ):
                    made = _design_loop_k(
                        plant,
                        on_lines,
                        k=k,
                        K=K,
                        own=_tighten_demands(each[k], _TIGHTENING**sweep),
                        wider=wider,
                    )
                    history += made.history
                    K[k] = made.K
            loops = [_evaluate_loop(on_lines, k, K=K, own=each[k], wider=1.0) for k in range(n)]
            if all(loop.met for loop in loops):
                break
        whole, margin = matrix.check_whole(on_lines, K=K, order=order, dt=dt)
        if not whole or not 0 < margin < np.inf:
            break
        wider *= 1.1 / margin
    bad = [f"{_loop_name(plant, k)}: {loop.reason}" for k, loop in enumerate(loops) if not loop.met]
    bad += [f"not found: {whole}"] if whole else []
    text = (
        f"loops {', '.join(str(k + 1) for k in order)} closed in this order, each judged with all"
        " others closed and designed again if it failed"
    )
    n_lines = max(loop.n_lines for loop in loops)
    text += f"; each met on {n_lines} lines, between two of which a mode may violate it" * (
        n_lines > 0
    )
    stability = None if whole else Stability.STABLE
    if any(loop.stability is Stability.UNDECIDED for loop in loops):
        stability = Stability.UNDECIDED
    return Design(
        K=with_names(block_diagonal(K, dt), plant.outputs, plant.inputs),
        gamma=float(np.max([loop.gamma for loop in loops])),
        met=not bad,
        reason="; ".join(bad)
        or f"{text}; the whole set is stable, up to {margin:.3g} times as large",
        history=tuple(history),
        stability=stability,
        n_lines=n_lines,
    )


def _matrix_of(plant: Bla | UncertaintyModel) -> _Matrix:
    if isinstance(plant, Bla):
        return _MeasuredMatrix(bla=plant)
    return _ModelledMatrix(model=plant)


def _require_plant(plant: Bla | UncertaintyModel, options: LoopOptions) -> float:
    """Return the sampling time that was asked for; refuse a plant whose loops cannot be closed in
    turn.
    """
    if plant.n_inputs != plant.n_outputs:
        raise ValueError(
            "plant must have as many inputs as outputs for a diagonal controller, got"
            f" {plant.n_inputs} inputs and {plant.n_outputs} outputs"
        )
    if options["prove"] is not None:
        raise ValueError(
            "prove must be left out of a design for a matrix: friction is proved for a single loop"
            " only"
        )
    dt = require_nonnegative("dt", options["dt"])
    require_nonnegative("delay", options["delay"])
    if n_unstable := require_integer("n_unstable", options["n_unstable"], least=0):
        raise ValueError(
            "n_unstable must be 0 for several channels, because their loops are closed one"
            f" after the other from a stable plant, got {n_unstable}"
        )
    return dt


def _loop_demands(
    k: int, n: int, *, structure: Structure | list[Structure], options: LoopOptions
) -> LoopTask:
    """Return structure and demands for one loop; a list has one entry for each loop."""
    own = {**options, "structure": structure}
    for name in (*_PER_LOOP_OPTIONS, "structure"):
        given = own[name]
        if isinstance(given, list) and len(given) != n:
            raise ValueError(
                f"{name} must have one entry for each of {n} loops if it is a list, got"
                f" {len(given)}"
            )
        own[name] = given[k] if isinstance(given, list) else given
    return own.pop("structure"), own


def _diagonal_matrices(sizes: np.ndarray) -> np.ndarray:
    return np.asarray(sizes.T[:, :, None] * np.eye(len(sizes)))


def _crossover_of(given: float | tuple[float, float] | None) -> float:
    """Return the crossover that orders the loops: the fastest is closed first."""
    if given is not None:
        return float(np.min(given))
    return 0.0


def _loop_name(plant: Bla | UncertaintyModel, k: int) -> str:
    return f"loop {k + 1} ({plant.inputs[k]} by {plant.outputs[k]})"


def _design_loop_k(
    plant: Bla | UncertaintyModel,
    on_lines: MatrixOnLines,
    *,
    k: int,
    K: list[control.StateSpace | None],
    own: LoopTask,
    wider: float,
) -> Design:
    """Return the controller of loop k, started from its present one, with the others unchanged."""
    structure, options = own
    discs = on_lines.seen_from(k, K, wider)
    try:
        if K[k] is not None:
            options = {**options, "start": K[k]}
        return design_loop(discs, structure, options)
    except ValueError as error:
        closed = (
            ", ".join(str(j + 1) for j in range(len(K)) if K[j] is not None and j != k) or "none"
        )
        raise ValueError(
            f"{_loop_name(plant, k)} must have a controller when the loops {closed} are closed"
            f" before it, but {error}"
        ) from None


def _tighten_demands(own: LoopTask, share: float) -> LoopTask:
    """Return the demands with tighter peaks and crossovers: room for later changes of the other
    loops.
    """
    structure, options = own
    M_S, M_T, M_u = (
        None if bound is None else share * bound
        for bound in (options["M_S"], options["M_T"], options["M_u"])
    )
    omega_c, gain = options["omega_c"], options["gain"]
    if omega_c is not None:
        if isinstance(omega_c, tuple):
            low, high = omega_c
        else:
            low, high = omega_c, None
        if high is None:
            omega_c = low / share
        else:
            omega_c = min(low / share, high), max(high * share, low)
    if gain is not None:
        gain = (gain[0], gain[1] / share)
    return structure, {
        **options,
        "M_S": M_S,
        "M_T": M_T,
        "M_u": M_u,
        "omega_c": omega_c,
        "gain": gain,
    }


def _evaluate_loop(
    on_lines: MatrixOnLines,
    k: int,
    *,
    K: list[control.StateSpace | None],
    own: LoopTask,
    wider: float,
) -> Design:
    """Return loop k unchanged, judged with all others closed."""
    structure, options = own
    as_it_is = {**options, "start": K[k], "n_iterations": 0}
    return design_loop(on_lines.seen_from(k, K, wider), structure, as_it_is)


def check_sequential_stability(
    plant: Bla,
    on_lines: MatrixOnLines,
    *,
    K: list[control.StateSpace | None],
    order: list[int],
    dt: float,
) -> str:
    """Return "" if det(1 + G K) has the right winding number: the product over the loops closed in
    turn.
    """
    closed: list[control.StateSpace | None] = [None] * len(K)
    for k in order:
        loop = on_lines.seen_from(k, closed, 1.0)
        G = loop.G[0, 0]
        readings = read_below(loop.omega, G, loop.w)
        turns, clear = winding_number(loop.omega, G, K=K[k], dt=dt, readings=readings)
        if not clear or turns != unstable_poles(K[k], dt):
            return (
                f"the whole loop is not shown to be stable: {_loop_name(plant, k)} winds {turns}"
                " times about zero"
            )
        closed[k] = K[k]
    return ""
