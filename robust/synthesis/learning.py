r"""Iterative learning control: the input of the next trial from the error of the previous trial.

    u_next = Q (u + L e),    e = S_p r - J_p u,    J_p = G_p S_p from u at the plant input to y; the feedback stays

Over the set G_p = (G + g Delta)/(1 + a Delta), |Delta| <= 1, with b of `robust.models.sets.forms`,

    J_p = S (G + g Delta)/(1 + b Delta),    a disc with the centre c = S (G - g b*)/(1 - |b|^2)
                                            and the radius rho = |S| |g - G b|/(1 - |b|^2).

In each trial the distance to the final error is multiplied by Q (1 - L J_p), at most |Q| (|1 - L c|
+ |L| rho) over the set. For x = rho/|c| < 1 the best L is 1/c, with the factor x; for x >= 1 it is
zero. A jump of L over frequency would make its impulse response long, so L decreases gradually: L =
k/c with k = min(1, (1 - x)/(1 - factor)). The factor is then 1 - k (1 - x).
"""

from __future__ import annotations

import warnings
from functools import cached_property

import control
import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from nlfrf._base.arguments import format_hertz, require_positive, short_form
from nlfrf._base.values import value
from robust._base.types import Controller, LinearSystem, SystemField
from robust._base.warnings import DesignWarning
from robust.analysis.curves import Curves
from robust.analysis.loop import Loop, assemble_loop
from robust.analysis.loop_proofs import stability_claim
from robust.analysis.robustness import check
from robust.lti.grids import extend_grid
from robust.lti.lti import replace_infinite, require_sampling_time, response, to_s_plane
from robust.lti.realisation import state_space
from robust.models.sets.forms import plant_numerator
from robust.models.sets.model import UncertaintyModel, require_one_channel
from robust.proofs.exact.learning import LearningClaim, prove_learning

_SET, _NOMINAL = "set", "nominal"
_TIME_CAP = 20.0  # processor time [s] for the proof
_BELOW = 3e-3  # relative distance of the factor on the grid below the level to be proved
_PADDED = 3  # length of the padded trial for zero-phase filters, in trials
_END = 3  # time constants at the end of a trial over which the learned input fades to a constant


@value
class Learning:
    """Filters L and Q of an iterative learning control, with their effect on every plant of a set.

    Fields
    ------
    model : UncertaintyModel
        The set.
    K : control.StateSpace
        The sampled feedback controller, which stays in the loop.
    delay : float
        Computation delay [s], in addition to the delay of the model.
    L : "set", "nominal" or control.StateSpace
        Filter from the error to the input. "set": the best filter for the whole set. "nominal":
        1/J, with the transfer function J from the learned input to the output of the nominal loop.
        Or a filter of your own.
    omega_Q : float
        Cut-off frequency of the zero-phase low-pass filter Q [rad/s]. Q is 1 up to omega_Q, and
        then falls as cos^2 to zero at twice omega_Q.
    factor : float
        Bound on the factor by which the error changes in a trial, for every plant of the set; at
        every frequency if `proved`.
    full : float
        Largest x = rho/|c| at which L "set" is 1/c, with centre c and radius rho of the disc of J
        over the set. Above it L decreases, to zero at x = 1.
    u_max : float
        Limit of |u|; inf without a limit.
    reason : str
        Reason why the factor is not proved between the frequencies of the grid; empty if it is
        proved.

    References
    ----------
    Bristow, Tharayil & Alleyne, *A survey of iterative learning control*, IEEE Control Systems
    26(3), 2006.

    Examples
    --------
    >>> import robust
    >>> lag, w = robust.sampled(control.tf([1], [1, 1]), 0.1), control.ss([], [], [], [[0.2]], 0.1)
    >>> model = robust.UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.2, 0.2]),
    ...     perturbation="LTI")
    >>> K = control.ss([], [], [], [[1.0]], 0.1)
    >>> learning = Learning(model=model, K=K, delay=0.0, L="set", omega_Q=np.inf, factor=0.8, full=0.8)
    >>> centre, radius = learning.disc(np.array([1e-3]))
    >>> round(float(centre[0].real), 3), round(float(radius[0]), 3)                     # near T = 1/2 and w |T S|
    (0.495, 0.051)
    """

    model: UncertaintyModel
    K: control.StateSpace
    delay: float
    L: SystemField
    omega_Q: float
    factor: float
    full: float
    u_max: float = np.inf
    reason: str = "not tried"

    def __post_init__(self) -> None:
        require_one_channel(self.model, "learning is for one loop", "to learn on")
        loop = self.loop
        if not loop.dt:
            raise ValueError(
                "K must be sampled, because a trial consists of samples, got a continuous"
                " controller: discretize(K, dt)"
            )
        if self.model.perturbation == "operator":
            raise ValueError(
                "model must be a set of linear plants, because only they give a disc at each"
                ' frequency, got the class "operator". With perturbation="LTI" you claim that'
                " the plants are linear"
            )
        if loop.aliases is not None and loop.aliases.inverse:
            raise ValueError(
                "model must be multiplicative or additive for a sampled K on a continuous"
                f" nominal, got {loop.form}, with which the sampled plants are no disc at a"
                " frequency"
            )
        if not self.u_max > 0:
            raise ValueError(f"u_max must be a positive limit of |u|, got {short_form(self.u_max)}")
        if not isinstance(self.L, str):
            self.__dict__["L"] = L = state_space("L", self.L)
            require_sampling_time("L", L, reference="the loop", wanted=loop.dt)
        elif self.L not in (_SET, _NOMINAL):
            raise ValueError(
                f'L must be "{_SET}", "{_NOMINAL}" or a system, got {short_form(self.L)}'
            )

    @property
    def proved(self) -> bool:
        """Return whether the factor is proved at every frequency."""
        return not self.reason

    @cached_property
    def loop(self) -> Loop:
        """Return the loop of the trials."""
        return assemble_loop(self.model, self.K, w_P=None, delay=self.delay)

    @property
    def dt(self) -> float:
        """Return the sampling time [s]."""
        return self.loop.dt

    @cached_property
    def omega(self) -> np.ndarray:
        """Return the frequencies (W,) [rad/s], up to Nyquist, at which the set is evaluated."""
        return extend_grid(self.loop.grid(self.model.omega), self.loop.omega_max)[1:]

    @cached_property
    def settling(self) -> float:
        """Return the longest time constant of the nominal loop, or one period of the cut-off of Q
        if longer [s].
        """
        rates = -to_s_plane(self.loop.poles[0].astype(complex), self.dt).real
        slowest = min(rates.min(initial=np.inf), self.omega_Q / (2 * np.pi))
        return float(1 / max(slowest, 1e-300))

    def disc(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return centre and radius (W,) of the disc of J_p over the set at omega [rad/s]."""
        return _disc(self.loop, self.loop.curves(omega))

    def Q(self, omega: np.ndarray) -> np.ndarray:
        """Return the response (W,) of Q, which is real."""
        return np.asarray(
            np.cos(np.pi / 2 * np.clip(np.asarray(omega) / self.omega_Q - 1, 0, 1)) ** 2
        )

    def filter(self, omega: np.ndarray) -> np.ndarray:
        """Return the response (W,) of L."""
        if not isinstance(self.L, str):
            return response(self.L, omega)
        if self.L == _NOMINAL:
            curves = self.loop.curves(omega)
            return 1 / (replace_infinite(curves.G) * curves.S)
        centre, radius = self.disc(omega)
        return np.clip((1 - radius / np.abs(centre)) / (1 - self.full), 0, 1) / centre

    def without_Q(self, omega: np.ndarray) -> np.ndarray:
        """Return the largest |1 - L J_p| (W,) over the set."""
        (centre, radius), L = self.disc(omega), self.filter(omega)
        return np.asarray(np.abs(1 - L * centre) + np.abs(L) * radius)

    def contraction(self, omega: np.ndarray) -> np.ndarray:
        """Return the factor (W,) of the error per trial: max |Q (1 - L J_p)| over the set."""
        Q = self.Q(omega)
        return Q * np.where(Q > 0, self.without_Q(omega), 0.0)

    def left(self, omega: np.ndarray) -> np.ndarray:
        """Return an upper bound (W,) of the final error, divided by the error without learning."""
        return (1 - self.Q(omega)) / (1 - self.contraction(omega))

    def update(self, u: np.ndarray, e: np.ndarray) -> np.ndarray:
        """Return the input of the next trial.

        Parameters
        ----------
        u : (n,) or (n, 1) ndarray
            Learned input of this trial, which is added to the controller output at the plant input;
            zeros in the first trial.
        e : (n,) or (n, 1) ndarray
            Error r - y of this trial, sampled at the same instants.

        Returns
        -------
        (n,) or (n, 1) ndarray
            Q (u + L e), within `u_max`.

        Raises
        ------
        ValueError
            Arrays of different lengths, with several columns, or that are not finite.

        Warns
        -----
        DesignWarning
            A trial shorter than the longest time constant of the loop and the filters.
        """
        samples, error = _trial("u", u), _trial("e", e)
        n = samples.size
        if error.size != n:
            raise ValueError(f"e must have a sample for each of the {n} of u, got {error.size}")
        if n * self.dt < self.settling:
            warnings.warn(
                f"a trial of {n * self.dt:.3g} s is shorter than the longest time constant of"
                f" the loop and the filters, {self.settling:.3g} s, so the factor per trial may"
                " not hold: extend the trial with a time at rest",
                DesignWarning,
                stacklevel=2,
            )
        total = next_fast_len(_PADDED * n, real=True)
        omega = 2 * np.pi * rfftfreq(total, self.dt)
        L, order = self._without_poles(omega)
        # differences are zero before and after the trial: the learned input begins at rest and is
        # held at the end
        k = max(order, 1)
        change, error = _differences(samples, k), _differences(error, k - order)
        learned = irfft(self.Q(omega) * (rfft(change, total) + L * rfft(error, total)), total)[:n]
        learned = learned * _end_window(n, self.settling / self.dt)
        for _ in range(k):
            learned = np.cumsum(learned)
        return np.clip(learned, -self.u_max, self.u_max).reshape(np.shape(u))

    def _without_poles(self, omega: np.ndarray) -> tuple[np.ndarray, int]:
        """Return L (W,) without its poles at zero frequency, and their number:

        J is zero there if K integrates.
        """
        inside = (omega > 0) & (omega < min(2 * self.omega_Q, self.loop.omega_max))
        low = omega[1] / 8 * np.array([1.0, 2.0])
        at = np.concatenate([low, omega[inside]])
        found = self.filter(at)
        sizes = np.abs(found[:2])
        if sizes.all():
            n = max(round(float(np.log2(sizes[0] / sizes[1]))), 0)
        else:
            n = 0
        found = found * (1 - np.exp(-1j * at * self.dt)) ** n
        L = np.zeros(omega.size, dtype=complex)
        L[inside], L[0] = found[2:], found[0].real
        return L, n

    def __str__(self) -> str:
        omega, (low, high) = self.omega, self.loop.band
        seen = f"on {omega.size} frequencies up to Nyquist"
        shrinks = omega[np.maximum.accumulate(np.divide(*np.abs(self.disc(omega)[::-1]))) < 1]
        if shrinks.size:
            end = format_hertz(shrinks[-1])
        else:
            end = "no frequency"
        top, zero = format_hertz(min(self.omega_Q, self.loop.omega_max)), 2 * self.omega_Q
        if zero < self.loop.omega_max:
            last = f" and nothing above {format_hertz(zero)} (Q = 0)"
        else:
            last = ""
        where = "at every frequency: proved, rigorous"
        if not self.proved:
            where = f"{seen}, not proved between them: {self.reason}"
        most = "no more than without learning"  # (1 - Q)/(1 - Q f) with f <= 1
        if self.L != _SET:
            most = f"at most {self.left(omega).max():.3g} of that without learning, {seen}"
        lines = [
            f"learns everything up to {top} (Q = 1){last}, sampled at {1 / self.dt:g} Hz",
            (
                f"factor per trial: at most {self.factor:.3g} for every linear plant of the set,"
                f" {where}"
            ),
            (
                "rule: the loop is robustly stable, so learning can contract exactly at"
                " frequencies where the disc of J_p excludes zero (multiplicative set: |w| < 1):"
                f" up to {end}, {seen}"
            ),
            f"final error: none up to {top}; elsewhere {most}",
            (
                "assumed: trials begin in the same state, repeat except for noise, and have no"
                f" end. Let a trial run on at rest for {_END * self.settling:.2g} s, over which the"
                " learned input becomes constant"
            ),
            (
                f"measured: the set from {format_hertz(low)} to {format_hertz(high)}; it is assumed"
                " elsewhere"
            ),
        ]
        if self.model.perturbation == "statistical":
            lines.append(
                "the set is statistical: it contains measured FRFs, and no theorem extends it to"
                " the machine"
            )
        return "\n".join(lines)


def design_learning(
    model: UncertaintyModel,
    K: Controller,
    *,
    factor: float = 0.8,
    L: str | LinearSystem = _SET,
    omega_Q: float | None = None,
    delay: float = 0.0,
    u_max: float = np.inf,
) -> Learning:
    """Design an iterative learning control, u_next = Q (u + L e), for a loop with repeated trials.

    Use this if feedback alone leaves an error that is the same in every trial, as with friction.
    The error of a trial is reduced by at least a given factor from one trial to the next, for every
    plant of the set.

    Parameters
    ----------
    model : UncertaintyModel
        Set with one input and output and a parametric nominal.
    K : control.StateSpace, TransferFunction or float
        Sampled controller, u = K (r - y), that stabilises every plant of the set. It stays in the
        loop.
    factor : float
        Required bound on the factor by which the error changes in a trial, for every plant of the
        set; between 0 and 1.
    L : "set", "nominal", control.StateSpace or TransferFunction
        Filter from the error to the input. J is the transfer function from the learned input to the
        output; over the set its values fill a disc at each frequency. "set": the best filter for
        the set, 1 over the centre of this disc. "nominal": 1/J of the nominal loop. Or a filter of
        your own with the sampling time of the loop.
    omega_Q : float, optional
        Cut-off frequency of Q [rad/s]. By default the highest frequency in the measured band up to
        which the bound `factor` is met.
    delay : float
        Computation delay [s], in addition to the delay of the model.
    u_max : float
        Limit of the learned input, in the unit of u. The factor holds for inputs within this limit.

    Returns
    -------
    Learning
        Filters and factor. For L "set" the factor is proved, except for a set of the coprime form.
        Otherwise it holds on a frequency grid, whose size is printed.

    Raises
    ------
    ValueError
        A model with several channels or with an FRF as nominal, a continuous K, a loop that is not
        robustly stable, a set of class "operator", an inverse form with a continuous nominal, or an
        `omega_Q` for which the factor is one or more.

    References
    ----------
    Bristow, Tharayil & Alleyne, IEEE Control Systems 26(3), 2006: Q and L in the frequency domain,
    theorem 6.

    Examples
    --------
    A lag with an uncertain gain. At low frequency T is near 1/2, and the factor is 0.2/2/(1 -
    0.04/2).

    >>> import robust
    >>> lag, w = robust.sampled(control.tf([1], [1, 1]), 0.1), control.ss([], [], [], [[0.2]], 0.1)
    >>> model = robust.UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.2, 0.2]),
    ...     perturbation="LTI")
    >>> learning = design_learning(model, control.ss([], [], [], [[1.0]], 0.1))
    >>> learning.proved, round(float(learning.contraction(np.array([1e-3]))[0]), 4)
    (True, 0.102)
    """
    require_one_channel(model, "learning is for one loop", "to learn on")
    factor = require_positive("factor", factor)
    if factor >= 1:
        raise ValueError(
            f"factor must be below 1, because the error decreases only then, got {factor:g}"
        )
    K = state_space("K", K)
    made = {"model": model, "K": K, "delay": delay, "L": L, "full": factor, "u_max": u_max}
    widest = Learning(**made, omega_Q=np.inf, factor=1.0)
    report = check(model, K, delay=delay)
    if not report.margins.rs > 1:
        raise ValueError(
            f"K must stabilise every plant of the set, got {report.verdict}: {report.reason}"
        )
    if omega_Q is None:
        omega_Q = _largest_cutoff(widest, factor)
        if omega_Q < widest.loop.band[0]:
            raise ValueError(
                f"factor must be achievable in the measured band, got {factor:g}, which is"
                f" achievable up to {format_hertz(omega_Q)} only. The band begins at"
                f" {format_hertz(widest.loop.band[0])}. Use a smaller set, or give omega_Q"
            )
    omega_Q = require_positive("omega_Q", omega_Q)
    filtered = Learning(**made, omega_Q=omega_Q, factor=1.0)
    largest, where = filtered.loop.peak(filtered.contraction, filtered.omega, filtered.loop.band)
    level = largest * (1 + _BELOW)
    if level >= 1:
        raise ValueError(
            f"omega_Q must give a factor per trial below 1, got {largest:.3g} at"
            f" {format_hertz(where)}"
        )
    if L != _SET:
        reason = 'only L "set" has a proof'
    elif not report.proofs.robustly_stable:
        reason = f"robust stability is not proved: {report.reason}"
    else:
        loop = stability_claim(model, K, w_P=None, delay=delay)
        found = prove_learning(
            LearningClaim(loop=loop, omega_Q=omega_Q, full=factor, level=level), time_cap=_TIME_CAP
        )
        reason = "" if found.holds else found.reason
    return Learning(**made, omega_Q=omega_Q, factor=level, reason=reason)


def _largest_cutoff(learning: Learning, factor: float) -> float:
    """Return the highest cut-off [rad/s] of Q for which the factor per trial stays below the
    required one.

    At a frequency where |1 - L J_p| reaches f > factor, Q has to be factor/f, and this gives the
    cut-off.
    """

    def inverse_cutoff(omega: np.ndarray) -> np.ndarray:
        need = np.arccos(np.sqrt(np.minimum(factor / learning.without_Q(omega), 1.0)))
        return np.where(need > 0, (1 + 2 / np.pi * need) / omega, 0.0)

    least = learning.loop.peak(inverse_cutoff, learning.omega, learning.loop.band).value
    # nothing was measured above the band, and for omega_Q at the Nyquist frequency Q is one
    # everywhere
    return float(
        min((1 - 2 * _BELOW) / max(least, 1e-300), learning.loop.band[1], learning.loop.omega_max)
    )


def _disc(loop: Loop, curves: Curves) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and radius (W,) of J_p over the set, from the curves of its loop."""
    G, S = replace_infinite(curves.G), curves.S
    if loop.aliases is None:
        g, b = plant_numerator(loop.form, curves.w, G=G, W=curves.W), curves.b
    # for a continuous set: a disc about the sampled plant whose radius sums those of its aliases
    else:
        g = loop.aliases.sampled_radius(curves.omega, curves.G)
        b = g * curves.K_S
    inside = 1 - np.abs(b) ** 2
    return S * (G - g * np.conj(b)) / inside, np.abs(S) * np.abs(g - G * b) / inside


def _trial(name: str, samples: np.ndarray) -> np.ndarray:
    """Return the samples (n,) of a trial with one channel; refuse others."""
    found = np.asarray(samples)
    if (
        found.dtype.kind not in "fiu"
        or found.shape not in ((found.size,), (found.size, 1))
        or found.size < 2
    ):
        raise ValueError(
            f"{name} must be real samples of one channel, (n,) or (n, 1), got {short_form(samples)}"
        )
    if not np.isfinite(found).all():
        raise ValueError(
            f"{name} must be finite, got {found.ravel()[~np.isfinite(found.ravel())][0]}"
        )
    return found.ravel().astype(float)


def _differences(samples: np.ndarray, order: int) -> np.ndarray:
    """Return differences (n,) of samples that are zero before the first."""
    return np.diff(samples, order, prepend=np.zeros(order))


def _end_window(n: int, settling: float) -> np.ndarray:
    """Return (n,) ones that fall as cos^2 to zero over the last time constants.

    An error after the end is not measured. Late inputs that cause it may grow if they are learned.
    """
    length = int(min(_END * settling, n / 3)) + 1
    return np.minimum(
        1.0, np.sin(np.pi / 2 * np.clip(np.arange(n, 0, -1) - 1, 0, length) / length) ** 2
    )
