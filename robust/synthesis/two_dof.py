"""Two degrees of freedom: a prefilter for a reference model, with the error over the set.

    r --->[ F ]--->(+)-- e -->[ K ]-- u -->[ G ]---+--> y        y = T_p F r,   wanted: T_ref r
                   -^                              |
                    +------------------------------+

F is outside the loop, so stability and margins depend on K alone. (SP 9.4.3 designs K and F
together.) Over a set, T_p F fills a disc at each frequency for one channel; for several channels
the largest error is bounded by skewed mu (SP 8.10.3).
"""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import block_diag

from nlfrf._base.arguments import require_nonnegative, require_positive
from nlfrf._base.values import value
from robust._base.types import Controller, LinearSystem, Weight
from robust.analysis.loop import Loop, assemble_loop, decide_nominal_stability
from robust.analysis.loop_of_channels import performance_loop, set_gain
from robust.analysis.sampled_set import set_on_controller_time_base
from robust.lti.connections import block_diagonal, in_parallel, in_series
from robust.lti.grids import structure_grid
from robust.lti.lti import is_constant, is_stable, response, response_by_channel, timebase
from robust.lti.norms import continuous_image, to_discrete
from robust.lti.realisation import rightmost_pole, stable_weight
from robust.lti.sampling import discretize
from robust.lti.truncation import balanced_candidates
from robust.models.sets.forms import plant_numerator
from robust.models.sets.model import UncertaintyModel, has_several_channels, require_one_channel
from robust.proofs.search.certificate import Certificate
from robust.synthesis.hinf.hinfsyn import hinfsyn
from robust.synthesis.hinf.synthesis import Synthesis

_REDUCTION_TOLERANCE = 0.01  # largest change of T F by removed states of F
# singular value of T at zero frequency over the largest, below which T has no gain in a direction
_ROUNDING = 1e-9


@value
class _ReferenceFilter:
    """A prefilter or a feedforward filter, with the error of the loop relative to its reference
    model.

    Fields
    ------
    F : control.StateSpace
        Stable, on the time base of the loop. Prefilter: the loop input is F r. Feedforward: u = K
        (T_ref r - y) + F r.
    gamma, gamma_min : float
        Norm of [T_ref - T F; effort F] before the reduction of F (feedforward: with G in place of
        T), and a lower bound for any F.
    certificate : Certificate or None
        The proof of gamma, or the reason why there is none.
    omega : (W,) ndarray
        Frequencies [rad/s].
    error, error_worst : (W,) ndarray
        |T_ref - T_yr| of the nominal loop, with T_yr from r to y; and the largest value over the
        set, which is inf where rs reaches one. For several channels the largest singular value, and
        an upper bound of it over the set.
    error_without : (W,) ndarray or None
        For a feedforward filter: the largest error over the set with F = 0.
    n_lines : int
        For several channels 0 if the largest `error_worst` is proved at all frequencies, otherwise
        the number of frequencies of the grid.

    References
    ----------
    SP 5.4 (limits of feedforward by uncertainty), 9.4.3; for several channels SP 8.10.3.

    Examples
    --------
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.1], [1])
    >>> from robust import UncertaintyModel
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI")
    >>> found = prefilter(model, control.tf([2, 2], [1, 0]), control.tf([1], [1, 1]))          # T = 2/(s + 2)
    >>> round(float(found.F.dcgain()), 3), bool(found.error.max() < 0.03 < found.error_worst.max())
    (1.0, True)
    >>> found = feedforward_filter(model, 2.0, control.tf([1], [0.5, 1]))
    >>> bool(found.error.max() < found.error_worst.max() < 0.1 < found.error_without.max())
    True
    """

    F: control.StateSpace
    gamma: float
    gamma_min: float
    certificate: Certificate | None
    omega: np.ndarray
    error: np.ndarray
    error_worst: np.ndarray
    error_without: np.ndarray | None = None
    n_lines: int = 0


def prefilter(
    model: UncertaintyModel,
    K: control.StateSpace | control.TransferFunction | np.ndarray | float,
    reference: control.StateSpace | control.TransferFunction,
    *,
    effort: float = 0.01,
    delay: float = 0.0,
) -> _ReferenceFilter:
    """Design a prefilter for a reference model, and bound the error over the whole set.

    Use this after the design of K, if the response to r has to follow a reference model T_ref. The
    prefilter F minimises the difference between T F and T_ref.

    Parameters
    ----------
    model : UncertaintyModel
        Plant with its set, with a parametric nominal.
    K : control.StateSpace, TransferFunction
        Controller, negative feedback. A sampled K on a continuous nominal is treated as in `check`.
    reference : control.StateSpace, TransferFunction
        Stable transfer function T_ref, the wanted response from r to y. For a sampled loop a
        continuous T_ref is converted by the bilinear map. For several channels a square matrix, or
        one transfer function for every output.
    effort : float
        Weight of the prefilter F relative to the error.
    delay : float
        Computation delay [s].

    Returns
    -------
    ReferenceFilter
        The prefilter F and the bound. F is reduced to the fewest states that change T F by less
        than 0.01. At zero frequency T F = T_ref, if T has an inverse at zero frequency.

    Raises
    ------
    ValueError
        An unstable loop, an unstable reference, sampling times that differ.

    References
    ----------
    SP 9.4.3 (where K and F are designed together); Hoyle, Hyde & Limebeer 1991; Limebeer, Kasenally
    & Perkins 1993.

    Examples
    --------
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.1], [1])
    >>> from robust import UncertaintyModel
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI")
    >>> found = prefilter(model, control.tf([2, 2], [1, 0]), control.tf([2], [1, 2]))          # T as it is
    >>> found.F.nstates, round(float(found.F.D[0, 0]), 2)
    (0, 1.0)
    """
    effort = require_positive("effort", effort)
    if has_several_channels(model):
        return _prefilter_matrix(model, K, reference=reference, effort=effort, delay=delay)
    loop = _reference_loop(model, K, delay)
    T_ref = _on_time_base(reference, loop.dt)
    T = loop.closed_loop(("y",), ("r",))
    found = _synthesise_matching(T_ref, T, effort=effort)
    omega = loop.grid(model.omega)
    F = _exact_at_zero(_fewest_states(found.K, T, omega=omega, dt=loop.dt), T, T_ref)
    error, worst = _tracking_errors(
        loop, response(F, omega), wanted=response(T_ref, omega), omega=omega
    )
    return _ReferenceFilter(
        F=F,
        gamma=found.gamma,
        gamma_min=found.gamma_min,
        certificate=found.certificate,
        omega=omega,
        error=error,
        error_worst=worst,
    )


def _prefilter_matrix(
    model: UncertaintyModel, K: Controller, *, reference: Weight, effort: float, delay: float
) -> _ReferenceFilter:
    """Return the prefilter for several channels, with its error over the set bounded by
    `gain_bound`.

    With e = r - y, the loop with its perturbations pulled out is N = [N11 N12; N21 S]: see
    `_error_loop`.
    """
    model, _ = set_on_controller_time_base(model, K, delay)
    system = performance_loop(model, K, None)
    n, dt = model.n_outputs, timebase(model.nominal)
    T_ref = _on_time_base(reference, dt, n)
    if T_ref.noutputs != n:
        raise ValueError(f"reference must have {n} outputs, as the plant has, got {T_ref.noutputs}")
    S = system.N[-n:, -n:]
    T = control.StateSpace(S.A, S.B, -S.C, np.eye(n) - S.D, dt)
    found = _synthesise_matching(T_ref, T, effort=effort)
    F = _exact_at_zero(_fewest_states(found.K, T, omega=structure_grid(T)[1:], dt=dt), T, T_ref)
    with_F = _error_loop(system.N, F, T_ref)
    worst = set_gain(with_F, system.structure)
    error = response_by_channel(with_F[-n:, -n:], worst.omega)
    return _ReferenceFilter(
        F=F,
        gamma=found.gamma,
        gamma_min=found.gamma_min,
        certificate=found.certificate,
        omega=worst.omega,
        error=np.linalg.norm(error, 2, axis=(0, 1)),
        error_worst=worst.gain,
        n_lines=worst.n_lines,
    )


def _error_loop(
    N: control.StateSpace, F: control.StateSpace, T_ref: control.StateSpace
) -> control.StateSpace:
    """Return [N11 N12 F; N21 E] of a loop N = [N11 N12; N21 S] with a prefilter, E = S F + T_ref -
    F.
    """
    n, n_d = T_ref.noutputs, N.ninputs - F.noutputs
    passed = control.StateSpace([], [], [], np.eye(n_d), N.dt)
    onto, taken = np.eye(N.noutputs)[:, -n:], np.eye(n_d + n)[-n:]
    rest = in_parallel(T_ref, control.StateSpace(F.A, F.B, -F.C, -F.D, F.dt))
    rest = control.StateSpace(rest.A, rest.B @ taken, onto @ rest.C, onto @ rest.D @ taken, N.dt)
    return in_parallel(in_series(block_diagonal([passed, F], N.dt), N), rest)


def _synthesise_matching(
    T_ref: control.StateSpace, T: control.StateSpace, *, effort: float, name: str = "prefilter"
) -> Synthesis:
    """Return the F that makes [T_ref - T F; effort F] small, as the K of a synthesis; refuse if
    there is none.
    """
    found = hinfsyn(_matching_plant(T_ref, T, effort=effort, dt=T.dt), T_ref.ninputs, T.ninputs)
    if not found.found:
        raise ValueError(
            f"reference must be a transfer function for which a {name} exists, got"
            f" none: {found.reason}"
        )
    return found


def _reference_loop(model: UncertaintyModel, K: Controller, delay: float) -> Loop:
    """Return the loop that has to follow a reference; refuse an unstable one."""
    instead = "use prefilter, or dk_iteration or hinfsyn with the reference among the inputs of K"
    require_one_channel(model, instead, "to follow a reference model")
    loop = assemble_loop(model, K, w_P=None, delay=require_nonnegative("delay", delay))
    nominal = decide_nominal_stability(loop)
    if not nominal.stable:
        raise ValueError(
            "K must stabilise the plant, because only a stable loop can follow a reference,"
            f" got a loop that is {nominal}"
        )
    return loop


def _on_time_base(reference: Weight, dt: float, n: int = 1) -> control.StateSpace:
    """Return the stable reference model for n channels, on the time base of the loop."""
    T_ref = stable_weight("reference", reference, dt=dt, n=n)
    if dt and not timebase(T_ref) and not is_constant(T_ref):
        return discretize(T_ref, dt)
    return T_ref


def _matching_plant(
    T_ref: control.StateSpace, T: control.StateSpace, *, effort: float, dt: float
) -> control.StateSpace:
    """Return the system from (r, u) to (T_ref r - T u, effort u; r)."""
    n_r, n_u, n_y = T_ref.ninputs, T.ninputs, T.noutputs
    A = block_diag(T_ref.A, T.A)
    B = block_diag(T_ref.B, T.B)
    C = np.vstack([np.hstack([T_ref.C, -T.C]), np.zeros((n_u + n_r, A.shape[0]))])
    D = np.block(
        [
            [T_ref.D, -T.D],
            [np.zeros((n_u, n_r)), effort * np.eye(n_u)],
            [np.eye(n_r), np.zeros((n_r, n_u))],
        ]
    )
    return control.StateSpace(A, B, C.reshape(n_y + n_u + n_r, -1), D, dt)


def _fewest_states(
    F: control.StateSpace, T: control.StateSpace, *, omega: np.ndarray, dt: float
) -> control.StateSpace:
    """Return F without the states that hardly affect T F."""
    T_response, whole = (response_by_channel(each, omega) for each in (T, F))
    for _, _, small in balanced_candidates(continuous_image(F)):
        less = control.StateSpace(*(to_discrete(*small) if dt else small), dt)
        change = np.einsum("ijw,jkw->ikw", T_response, response_by_channel(less, omega) - whole)
        if np.linalg.norm(change, 2, axis=(0, 1)).max() < _REDUCTION_TOLERANCE:
            return less
    return F


def _exact_at_zero(
    F: control.StateSpace, T: control.StateSpace, T_ref: control.StateSpace
) -> control.StateSpace:
    """Return X F with T X F = T_ref at zero frequency, so that a constant reference is followed
    exactly.

    X is used if it is nearer to one than to zero. Otherwise T or T_ref has no gain there, and F is
    left unchanged.
    """
    at_zero, f, wanted = (
        response_by_channel(each, np.zeros(1))[:, :, 0].real for each in (T, F, T_ref)
    )
    if np.linalg.cond(at_zero) > 1 / _ROUNDING:
        return F
    X = np.linalg.solve(at_zero, wanted @ np.linalg.pinv(at_zero @ f, rcond=_ROUNDING) @ at_zero)
    if not np.linalg.norm(X - np.eye(T.ninputs), 2) < 1:
        return F
    return control.StateSpace(F.A, F.B, X @ F.C, X @ F.D, T.dt)


def _tracking_errors(
    loop: Loop, f: np.ndarray, *, wanted: np.ndarray, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W,) |T_ref - T F| and the largest |T_ref - T_p F|:

    S_p fills a disc, and T_p = 1 - S_p.
    """
    curves = loop.curves(omega)
    S, a, b = curves.S, curves.a, curves.b
    with np.errstate(all="ignore"):
        margin = 1 - np.abs(b) ** 2
        middle, radius = S * (1 - a * b.conj()) / margin, np.abs(S) * np.abs(a - b) / margin
        worst = np.abs(wanted - (1 - middle) * f) + np.abs(f) * radius
    return np.abs(wanted - (1 - S) * f), np.where(np.abs(b) < 1, worst, np.inf)


# ---- Feedforward from the model, with its error over the set of plants.
#
#     r --->[T_ref]--->(+)-- e -->[ K ]--->(+)-- u -->[ G ]---+--> y       wanted: T_ref r
#      |               -^                   ^                 |
#      |                +-------------------|-----------------+
#      +-------------->[ F ]----------------+
#
# With F = T_ref/G the nominal loop follows exactly. A plant of the set has the error T_ref S_p (1 -
# G_p/G) instead of T_ref S_p: feedforward helps where the relative error of the plant is below one,
# and harms where it is not.


def feedforward_filter(
    model: UncertaintyModel,
    K: Controller,
    reference: LinearSystem,
    *,
    effort: float = 1e-3,
    delay: float = 0.0,
) -> _ReferenceFilter:
    """Design a feedforward filter from r to u for a reference model, and bound the error over a
    set.

    Use this for a stable plant; `prefilter` is for any stable loop. The output F r of the filter is
    added to the plant input u.

    Parameters
    ----------
    model : UncertaintyModel
        Plant with its set, with a stable parametric nominal.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback from T_ref r - y. A sampled K on a continuous nominal is
        treated as in `check`.
    reference : control.StateSpace, TransferFunction
        Stable transfer function T_ref, the wanted response from r to y. For a sampled loop a
        continuous T_ref is converted by the bilinear map.
    effort : float
        Weight of the filter F relative to the error, in the unit of the error over u.
    delay : float
        Computation delay [s].

    Returns
    -------
    ReferenceFilter

    Raises
    ------
    ValueError
        An unstable plant, reference or loop, sampling times that differ.

    References
    ----------
    SP 5.4.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.1], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI")
    >>> found = feedforward_filter(model, 2.0, control.tf([1], [0.5, 1]))   # (s + 1)/(s/2 + 1): sqrt(5/2) at 2 rad/s
    >>> round(float(found.F.dcgain()), 2), bool(abs(abs(found.F(2j)) - np.sqrt(5 / 2)) < 0.02)
    (1.0, True)
    """
    effort, loop = require_positive("effort", effort), _reference_loop(model, K, delay)
    # in T_ref - G F the filter acts on G in open loop, and cannot stabilise it
    if not is_stable(loop.G):
        raise ValueError(
            "model must have a stable nominal for a feedforward, got a pole at"
            f" {rightmost_pole(loop.G):.4g}. Close an inner loop first (cascade), or use"
            " prefilter, which needs a stable loop only; for a free mass use"
            " robust.servo.feedforward"
        )
    T_ref = _on_time_base(reference, loop.dt)
    found = _synthesise_matching(T_ref, loop.G, effort=effort, name="feedforward")
    omega = loop.grid(model.omega)
    # Not exact at zero frequency, unlike a prefilter: the error is S (T_ref - G F), and S is zero
    # there if K has an integrator.
    F = _fewest_states(found.K, loop.G, omega=omega, dt=loop.dt)
    wanted = response(T_ref, omega)
    error, worst = _feedforward_errors(loop, response(F, omega), wanted=wanted, omega=omega)
    return _ReferenceFilter(
        F=F,
        gamma=found.gamma,
        gamma_min=found.gamma_min,
        certificate=found.certificate,
        omega=omega,
        error=error,
        error_worst=worst,
        error_without=_feedforward_errors(loop, np.zeros_like(wanted), wanted=wanted, omega=omega)[
            1
        ],
    )


def _feedforward_errors(
    loop: Loop, f: np.ndarray, *, wanted: np.ndarray, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W,) |S (T_ref - G F)| and the largest |S_p (T_ref - G_p F)| over the set, without a
    division by K.

    S_p (T_ref - G_p F) = S (p + q Delta)/(1 + b Delta) fills a disc; inf where |b| reaches one.
    """
    curves = loop.curves(omega)
    S, a, b = curves.S, curves.a, curves.b
    g = plant_numerator(loop.form, curves.w, G=curves.G, W=curves.W)
    p, q = wanted - curves.G * f, a * wanted - g * f
    with np.errstate(all="ignore"):
        worst = np.abs(S) * (np.abs(p - q * b.conj()) + np.abs(q - p * b)) / (1 - np.abs(b) ** 2)
    return np.abs(S * p), np.where(np.abs(b) < 1, worst, np.inf)
