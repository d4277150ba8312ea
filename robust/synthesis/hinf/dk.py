"""D-K iteration: a controller for several uncertainties and robust performance.

Each round designs a controller for D_L P D_R^-1, computes the scalings with the least upper bound
of mu for the loop with this controller, and fits the scalings by stable, minimum-phase functions of
limited order. Neither step increases the bound, but progress becomes slow. Then the scalings are
improved along the gradient of the least norm (`robust.synthesis.hinf.descent`). The result is the
loop with the smallest mu for the original structure.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import control
import numpy as np

from nlfrf._base.arguments import format_count, require_integer, require_nonnegative
from nlfrf._base.values import value
from robust._base.types import Blocks, LinearSystem, Weight
from robust.lti.connections import biproper_inverse, block_diagonal, lower_lft, weighted_plant
from robust.lti.grids import structure_grid
from robust.lti.lti import response, response_by_channel, timebase
from robust.lti.norms import continuous_image, to_discrete
from robust.lti.realisation import multivariable
from robust.lti.truncation import weighted_candidates
from robust.models.fit.weight_search import minimum_phase
from robust.models.sets.interconnection import UncertainSystem
from robust.models.sets.model import UncertaintyModel, has_several_channels
from robust.mu.blocks import BlockStructure, structure_for
from robust.mu.certification import certify
from robust.mu.scalings import upper
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability
from robust.synthesis.hinf.descent import descend, least_level
from robust.synthesis.hinf.design import Unpacked, describe_controller
from robust.synthesis.hinf.hinfsyn import synthesise
from robust.synthesis.hinf.mixsyn import weight_on_time_base

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_FIT_TOLERANCE = 1.01  # gain with fitted over wanted scalings at which a lower order is accepted
_CHANGE_OUTSIDE = 0.01  # share of the change of the scalings outside the band of their fit
_N_FITTED = 150
_SYNTHESIS_FACTOR = 1.001  # gamma over the least norm: ten times that excess shows in mu
_LEAST_PROGRESS = 1e-3  # fall of mu below which a round does not count
_PATIENCE = 1  # such rounds in a row that are tolerated: the quality of fits varies
_SLOW_PROGRESS = 0.01  # fall of mu below which the scalings are moved along the gradient instead
# growth of the step of the scalings after a better round, and its limit
_STRETCH = 2.0
_LONGEST_STRETCH = 8.0


@value
class DkDesign(Unpacked):
    """Result of D-K iteration; unpacks as K, CL, mu, info = dk_iteration(P, ...).

    Fields
    ------
    K : control.StateSpace
        Controller u = K y, with positive feedback as usual for a generalised plant; for a set u = K
        (r - y). Zero if none was found.
    mu : float
        Peak of the upper bound of mu over omega with this controller; inf if none was found.
    omega, curve : (W,) ndarray
        Frequencies [rad/s], and the upper bound of mu at these frequencies.
    history : tuple of (float, float, int)
        For each round the norm of the synthesis, the peak of mu, and the order of its scalings.
    certificate : Certificate
        Proof that mu is below 1.01 times its peak at all frequencies, or the reason why there is no
        proof.
    reason : str
        Reason why the iteration ended.
    CL : control.StateSpace or None
        F_l(P, K), the closed loop without the perturbations; None if no controller was found.

    References
    ----------
    SP 8.12.

    Examples
    --------
    A lag whose gain is uncertain by 50 %, with a sensitivity that has to stay below two:

    >>> A, B, C = [[-1.0]], [[1.0, 0.0, 1.0]], [[0.0], [-0.5], [-1.0]]
    >>> P = control.ss(A, B, C, [[0, 0, 0.5], [0, 0.5, 0], [0, 1, 0]])
    >>> found = dk_iteration(P, [(1, 1), (1, 1)], 1, 1, n_rounds=1)
    >>> bool(found.mu < 1), found.K.nstates > 0
    (True, True)
    >>> print(found)
    controller of order 1, continuous: mu 0.5417 (robust performance), proved below 0.5472 at all frequencies
      1 round made
    """

    K: control.StateSpace
    mu: float
    omega: np.ndarray
    curve: np.ndarray
    history: tuple[tuple[float, float, int], ...]
    certificate: Certificate | None
    reason: str
    CL: control.StateSpace | None = None

    LEVEL = "mu"

    def __str__(self) -> str:
        if not np.isfinite(self.mu):
            return f"no controller: {self.reason}"
        proved = self.certificate is not None and self.certificate.holds
        if self.mu < 1:
            below = "robust performance"
        else:
            below = "no robust performance, because mu is not below 1"
        return (
            f"{describe_controller(self.K)}: mu {self.mu:.4g} ({below}),"
            f" {f'proved below {1.01 * self.mu:.4g} at all frequencies' if proved else 'on a grid, not proved'}\n"
            f"  {self.reason}"
        )


#: A function that scales a block, and its inverse.
Scaling: TypeAlias = tuple[control.StateSpace, control.StateSpace]


def dk_iteration(
    P: UncertaintyModel | UncertainSystem | LinearSystem,
    blocks: Blocks | None = None,
    n_y: int = 0,
    n_u: int = 0,
    *,
    w_P: Weight | None = None,
    w_u: Weight | None = None,
    order: int = 4,
    n_rounds: int = 30,
    mu_min: float = 0.0,
    most_states: int | None = None,
    omega: ArrayLike | None = None,
) -> DkDesign:
    """Design a controller that minimises mu by D-K iteration.

    Use this for several uncertainties, or for robust performance with several channels.

    Parameters
    ----------
    P : UncertaintyModel, UncertainSystem or control.StateSpace
        A set with several channels; an `interconnection` without the controller; or a generalised
        plant from (inputs of perturbations and performance, u) to (outputs of perturbations and
        performance, y).
    blocks : list
        For a generalised plant: blocks as in `robust.mu.upper`, with the performance as a full
        block. The design treats repeated and real blocks as full complex blocks; the final bound
        uses their kind.
    n_y, n_u : int
        For a generalised plant or an interconnection: number of measured outputs y and of
        controlled inputs u, which are the last outputs and inputs.
    w_P, w_u : control system or float, optional
        Performance weights for a set: mu < 1 means that the norm of [w_P S; w_u K S] is below one
        for all its plants. Each is one weight that is used for every channel, or a matrix. w_P is
        required.
    order : int
        Largest order of a scaling; a lower order is used if it fits nearly as well.
    n_rounds : int
        Largest number of rounds. The iteration ends earlier if mu falls by less than 0.001 in two
        rounds.
    mu_min : float
        Sufficient mu: the iteration ends once mu is this small.
    most_states : int, optional
        Largest order of K. A controller of higher order is reduced, and mu is computed again.
    omega : (W,) ndarray, optional
        Frequencies [rad/s] for mu; by default chosen from the poles of the loop.

    Returns
    -------
    DkDesign

    Raises
    ------
    ValueError
        Blocks that do not add up to P, a set without w_P, a plant that no controller can stabilise.

    References
    ----------
    SP 8.12; Doyle 1982, 1985; Balas, Doyle, Glover, Packard & Smith, *mu-Analysis and Synthesis
    Toolbox*.

    Examples
    --------
    >>> A, B, C = [[-1.0]], [[1.0, 0.0, 1.0]], [[0.0], [-0.5], [-1.0]]
    >>> P = control.ss(A, B, C, [[0, 0, 0.5], [0, 0.5, 0], [0, 1, 0]])
    >>> bool(dk_iteration(P, [(1, 1), (1, 1)], 1, 1, n_rounds=1).mu < 1)
    True

    The same problem with named signals. K is from e to u, which are the last output and the last
    input:

    >>> from robust.models import Block, interconnection
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs="u", outputs="y")
    >>> drive = control.ss([], [], [], [[1.0]], inputs="u_in", outputs="u")      # what the block reads
    >>> error = control.summing_junction(["r", "-y"], "e")
    >>> weight = control.ss([], [], [], [[0.5]], inputs="e", outputs="z")
    >>> system = interconnection([lag, drive, error, weight], {"gain": Block("u", "u", 0.5)},
    ...                          inputs=["r", "u_in"], outputs=["z", "e"])
    >>> bool(dk_iteration(system, n_y=1, n_u=1, n_rounds=1).mu < 1)
    True

    Notes
    -----
    Without `omega` the frequencies follow from the poles of the loop in each round. Each round also
    tries extrapolated scalings, because successive rounds change the scalings in the same
    direction. After the first round that lowers mu by less than 0.01, each round is a step along
    the gradient. For the distillation column of SP 8.11.3, mu falls to 0.980 in eleven rounds; SP
    8.12.4 reaches 1.02 and lower, and the least known value is 0.974.
    """
    if has_several_channels(P):
        P, blocks, n_y, n_u = _performance_plant(P, w_P, w_u=w_u, blocks=blocks)
    elif w_P is not None or w_u is not None:
        raise ValueError(
            "w_P and w_u must be left out except for an UncertaintyModel with several channels: for"
            " a system they are part of P"
        )
    elif isinstance(P, UncertainSystem):
        P, blocks = _open_interconnection(P, blocks, n_y=n_y, n_u=n_u)
    problem = _checked_problem(P, blocks, n_y=n_y, n_u=n_u, omega=omega)
    order = require_integer("order", order, least=0)
    n_rounds = require_integer("n_rounds", n_rounds, least=1)
    mu_min = require_nonnegative("mu_min", mu_min)
    found, history, reason = _iterate(problem, order=order, n_rounds=n_rounds, mu_min=mu_min)
    best = found.design
    if most_states is not None and best.K.nstates > require_integer(
        "most_states", most_states, least=0
    ):
        best = _reduce_by_mu(problem, found, most_states)
        if np.isfinite(best.mu):
            reason += f"; reduced from order {found.design.K.nstates}"
        else:
            reason += "; not reduced"
    CL, certificate = None, None
    if np.isfinite(best.mu):
        CL = lower_lft(problem.P, best.K)
        certificate = certify(CL, problem.blocks, 1.01 * best.mu)
    return replace(best, history=tuple(history), certificate=certificate, reason=reason, CL=CL)


@value(copy=False)
class _Problem:
    """What is the same in all rounds: the plant, its blocks, the frequencies for mu."""

    P: control.StateSpace
    blocks: Blocks
    structure: BlockStructure
    sizes: tuple[int, int]  # n_y, n_u
    omega: ArrayLike | None  # [rad/s], as given

    @property
    def nothing(self) -> DkDesign:
        """The result before the first round."""
        return DkDesign(
            K=control.StateSpace([], [], [], np.zeros(self.sizes[::-1]), self.P.dt),
            mu=np.inf,
            omega=np.zeros(0),
            curve=np.zeros(0),
            history=(),
            certificate=None,
            reason="no controller was found",
        )

    def judge(self, K: control.StateSpace) -> DkDesign:
        """Return the loop with a controller, judged by the upper bound of mu with the original
        structure.
        """
        N = lower_lft(self.P, K)
        if self.omega is None:
            at = structure_grid(N)[1:]
        else:
            at = np.asarray(self.omega, dtype=float)
        curve = upper(response_by_channel(N, at), self.blocks).value
        return replace(self.nothing, K=K, mu=float(curve.max()), omega=at, curve=curve, reason="")

    def scaled(self, scaling: list[Scaling]) -> control.StateSpace:
        """Return D_L P D_R^-1 from one function per block with its inverse, y and u unscaled."""
        dt, s = timebase(self.P), self.structure
        left = [
            d
            for (d, _), row in zip(scaling, s.rows, strict=True)
            for _ in range(row.stop - row.start)
        ]
        right = [
            d
            for (_, d), col in zip(scaling, s.cols, strict=True)
            for _ in range(col.stop - col.start)
        ]
        y, u = (control.StateSpace([], [], [], np.eye(n), dt) for n in self.sizes)
        return block_diagonal([*left, y], dt) * self.P * block_diagonal([*right, u], dt)

    def attempt(
        self, scaling: list[Scaling], *, order: int, share: float = 1.0
    ) -> tuple[list[_Attempt], str]:
        """Return the loop with the controller of the scaled plant, or the reason of a failure."""
        found = synthesise(self.scaled(scaling), *self.sizes, factor=_SYNTHESIS_FACTOR)
        if not found.found:
            return [], f"the synthesis failed: {found.reason}"
        plain = decide_stability(lower_lft(self.P, found.K))
        if not plain.stable:
            return [], f"the loop without its scalings is {plain}"
        one = _Attempt(
            design=self.judge(found.K),
            gamma=found.gamma,
            scaling=scaling,
            order=order,
            share=share,
        )
        return [one], ""


def _checked_problem(
    P: LinearSystem, blocks: Blocks | None, *, n_y: int, n_u: int, omega: ArrayLike | None
) -> _Problem:
    """Return the problem of a generalised plant; refuse sizes that do not fit."""
    P = multivariable("P", P)
    n_y, n_u = require_integer("n_y", n_y, least=1), require_integer("n_u", n_u, least=1)
    if blocks is None:
        blocks = ()
    structure = structure_for(
        "blocks", blocks, (P.noutputs - n_y, P.ninputs - n_u), of="P without y and u"
    )
    return _Problem(P=P, blocks=blocks, structure=structure, sizes=(n_y, n_u), omega=omega)


@value(copy=False)
class _Attempt:
    """A loop, the norm of its synthesis, and the scalings behind it: their order, the size of their
    move.
    """

    design: DkDesign
    gamma: float
    scaling: list[Scaling]
    order: int = 0
    share: float = 1.0


def _iterate(
    problem: _Problem, *, order: int, n_rounds: int, mu_min: float
) -> tuple[_Attempt, list[tuple[float, float, int]], str]:
    """Return the loop of least mu, the history of the rounds, and the reason why they ended."""
    plain = [_identity_scaling(timebase(problem.P))] * len(problem.structure.kinds)
    best = last = _Attempt(design=problem.nothing, gamma=0.0, scaling=plain)
    history: list[tuple[float, float, int]] = []
    idle, moves = 0, None
    for _ in range(n_rounds):
        try:
            if moves is None:
                tried, failed = _alternate(problem, last, order=order, best=best.design.mu)
            else:
                tried, failed = _move_scalings(problem, moves)
        except (ValueError, np.linalg.LinAlgError) as error:
            if not history:
                raise
            tried, failed = [], f"the next round failed: {error}"
        if not tried:
            return best, history, failed
        last = min(tried, key=lambda each: each.design.mu)
        history.append((last.gamma, last.design.mu, last.order))
        fall = best.design.mu - last.design.mu
        if last.design.mu < best.design.mu:
            best = last
        if fall > _LEAST_PROGRESS:
            idle = 0
        else:
            idle = idle + 1
        if best.design.mu <= mu_min:
            return best, history, f"mu reached {mu_min:g}"
        if moves is None and fall < _SLOW_PROGRESS:
            moves, idle = _start_descent(problem, best), 0
        if idle > _PATIENCE:
            return best, history, "mu no longer decreased"
    return best, history, f"{format_count(n_rounds, 'round')} made"


def _alternate(
    problem: _Problem, last: _Attempt, *, order: int, best: float
) -> tuple[list[_Attempt], str]:
    """Return the loops with the scalings for the last one, the first time without any; or the
    reason of a failure.
    """
    is_first, failed = not np.isfinite(last.design.mu), ""
    tried: list[_Attempt] = []
    if not last.order:
        stretch = 1.0
    else:
        stretch = min(_STRETCH * last.share, _LONGEST_STRETCH)
    for share, highest in _scaling_attempts(is_first, stretch, order):
        if any(each.design.mu < best for each in tried) and share < 1:
            break
        if is_first:
            wanted, used = last.scaling, 0
        else:
            wanted, used = fit_scalings(
                last.design,
                problem.P,
                s=problem.structure,
                scaling=last.scaling,
                stretch=share,
                order=highest,
            )
        found, failed = problem.attempt(wanted, order=used, share=share)
        tried += found
    return tried, failed


def _start_descent(problem: _Problem, best: _Attempt) -> Iterator[list[control.StateSpace]]:
    """Yield scalings from those of the best loop along the gradient of the least norm."""
    near = [best.gamma]

    def least_norm(functions: list[control.StateSpace]) -> float:
        scaled = problem.scaled([(d, biproper_inverse(d)) for d in functions])
        found = least_level(scaled, *problem.sizes, near[0])
        near[0] = found if np.isfinite(found) else near[0]
        return found

    return descend(least_norm, [d for d, _ in best.scaling])


def _move_scalings(
    problem: _Problem, moves: Iterator[list[control.StateSpace]]
) -> tuple[list[_Attempt], str]:
    """Return the loop with the scalings of the next step, or the reason why there is none."""
    functions = next(moves, None)
    if functions is None:
        return [], "mu no longer decreased"
    scaling: list[Scaling] = [(d, biproper_inverse(d)) for d in functions]
    return problem.attempt(scaling, order=max(d.nstates for d in functions))


def _reduce_by_mu(problem: _Problem, best: _Attempt, n: int) -> DkDesign:
    """Return the loop of least mu with a controller of n states, truncated with the weight of the
    scaled loop.
    """
    P, K, (n_y, n_u) = problem.P, best.design.K, problem.sizes
    scaled = problem.scaled(best.scaling)
    n_w, n_z = scaled.ninputs - n_u, scaled.noutputs - n_y
    ports = (
        [*range(scaled.ninputs), *range(n_w, scaled.ninputs)],
        [*range(scaled.noutputs), *range(n_z, scaled.noutputs)],
    )
    twice = control.StateSpace(
        scaled.A,
        scaled.B[:, ports[0]],
        scaled.C[ports[1]],
        scaled.D[np.ix_(ports[1], ports[0])],
        scaled.dt,
    )
    A, B, C, D = continuous_image(
        lower_lft(twice, K)
    )  # from w and the signal added to u, to z and y
    before = (A, B[:, :n_w], C[n_z:], D[n_z:, :n_w])
    behind = (A, B[:, n_w:], C[:n_z], D[:n_z, n_w:])
    found = problem.nothing
    for _, order, small in weighted_candidates(continuous_image(K), before, behind):
        if order != n:
            continue
        one = control.StateSpace(*(to_discrete(*small) if timebase(P) else small), P.dt)
        if decide_stability(lower_lft(P, one)).stable:
            judged = problem.judge(one)
            if judged.mu < found.mu:
                found = judged
    return found


def _scaling_attempts(is_first: bool, stretch: float, order: int) -> list[tuple[float, int]]:
    """Return steps of the scalings with largest orders of their fits; steps below one are for lack
    of progress.
    """
    if is_first:
        return [(1.0, 0)]
    if stretch <= 1:
        whole = [(1.0, order)]
    else:
        whole = [(stretch, order), (1.0, order)]
    return [*whole, (0.5, order), (0.5, order // 2)]


def _performance_plant(
    model: UncertaintyModel, w_P: Weight | None, *, w_u: Weight | None, blocks: Blocks | None
) -> tuple[control.StateSpace, Blocks, int, int]:
    """Return the generalised plant of a set with its performance: from (d, r, u) to (z, weighted e
    and u, e).
    """
    if w_P is None or blocks is not None:
        raise ValueError(
            "w_P must be given for an UncertaintyModel, and blocks left out: the model has its own"
        )
    n_y, n_u, dt = model.n_outputs, model.n_inputs, timebase(model.nominal)
    weights = [("e", weight_on_time_base("w_P", w_P, dt=dt, n=n_y))]
    weights += [] if w_u is None else [("u", weight_on_time_base("w_u", w_u, dt=dt, n=n_u))]
    P = weighted_plant(model.open_loop(), n_y, n_u=n_u, weights=weights)
    of_performance = (sum(w.noutputs for _, w in weights), n_y)
    return P, [*model.structure, of_performance], n_y, n_u


def _open_interconnection(
    system: UncertainSystem, blocks: Blocks | None, *, n_y: int, n_u: int
) -> tuple[control.StateSpace, Blocks]:
    """Return P and blocks of an interconnection whose last inputs and outputs belong to the
    controller.
    """
    performance = len(system.outputs) - n_y, len(system.inputs) - n_u
    if blocks is not None:
        raise ValueError("blocks must be left out for an interconnection, which has its own")
    if min(n_y, n_u, *performance) < 1 and performance != (0, 0):
        raise ValueError(
            "n_y and n_u must be the number of last outputs, of"
            f" {', '.join(system.outputs) or 'none'}, that K reads, and of last inputs, of"
            f" {', '.join(system.inputs) or 'none'}, that it drives, got {n_y} and {n_u}; those"
            " before them are the performance, and K is not among the systems"
        )
    return system.N, [*system.structure, *[performance] * (performance != (0, 0))]


def _identity_scaling(dt: float) -> Scaling:
    one = control.StateSpace([], [], [], [[1.0]], dt)
    return one, one


def fit_scalings(
    found: DkDesign,
    P: control.StateSpace,
    *,
    s: BlockStructure,
    scaling: list[Scaling],
    stretch: float,
    order: int,
) -> tuple[list[Scaling], int]:
    """Return the fitted scalings for a loop, the last block unscaled, and their order: the lowest
    that suffices.

    The logarithms move from the previous scalings (`scaling`) `stretch` times the way to the wanted
    ones: successive rounds move them by a little in the same direction.
    """
    omega, dt = found.omega, timebase(P)
    response_ = response_by_channel(lower_lft(P, found.K), omega)
    full = [(r.stop - r.start, c.stop - c.start) for r, c in zip(s.rows, s.cols, strict=True)]
    own = upper(response_, full).scaling
    assert own is not None
    d = np.array([np.abs(own[0][row.start, row.start]) for row in s.rows])
    before = _scaling_sizes(scaling, omega)
    d = before * (d / d[-1] / before) ** stretch
    goal = _scaled_gains(response_, d, s)
    at, wanted = _resample_scalings(omega, d)
    best: tuple[float, list[Scaling], int] = (np.inf, [], 0)
    for k in range(min(order, 12) + 1):
        fits = [minimum_phase(at, each, dt=dt, order=k) for each in wanted[:-1]] + [
            _identity_scaling(dt)
        ]
        misfit = float(np.linalg.norm(np.log(_scaling_sizes(fits, at) / wanted)))
        if misfit < best[0]:  # a fit of higher order may have ended in a worse local optimum
            best = misfit, fits, k
        if (
            _scaled_gains(response_, _scaling_sizes(fits, omega), s) <= _FIT_TOLERANCE * goal
        ).all():
            break
    return best[1], best[2]


def _resample_scalings(omega: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and scalings (blocks, W) to fit, in even steps where they change and a
    decade beyond.
    """
    change = np.append(0.0, np.cumsum(np.abs(np.diff(np.log(d), axis=1)).sum(axis=0)))
    if not change[-1] > 0:
        return omega, d
    low, high = np.interp(
        np.array([_CHANGE_OUTSIDE, 1 - _CHANGE_OUTSIDE]) * change[-1], change, np.log(omega)
    )
    low, high = max(low - np.log(10), np.log(omega[0])), min(high + np.log(10), np.log(omega[-1]))
    at = np.linspace(low, high, _N_FITTED)
    return np.exp(at), np.exp([np.interp(at, np.log(omega), np.log(each)) for each in d])


def _scaling_sizes(scaling: list[Scaling], omega: np.ndarray) -> np.ndarray:
    """Return (blocks, W) moduli of one function per block."""
    return np.array([np.abs(response(d, omega)) for d, _ in scaling])


def _scaled_gains(response_: np.ndarray, d: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return (W,) largest singular value with one number per block and frequency as scaling."""
    left, right = (
        np.repeat(d, [p.stop - p.start for p in parts], axis=0) for parts in (s.rows, s.cols)
    )
    scaled = left[:, None] * response_ / right[None]
    return np.asarray(np.linalg.norm(np.moveaxis(scaled, 2, 0), 2, axis=(1, 2)))
