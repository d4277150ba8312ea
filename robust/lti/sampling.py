"""Discrete systems: plants with hold and delay, and discrete controllers."""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import expm

from nlfrf._base.arguments import require_nonnegative, require_positive
from robust._base.types import LinearSystem
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import balance_matrix, poles, response, timebase, with_names, zeros
from robust.lti.norms import to_discrete
from robust.lti.realisation import from_roots, multivariable

# relative distance of a zero from the mirror image of a pole of an all-pass; eigenvalues move by
# 1e-9
_ALLPASS_TOLERANCE = 1e-4
_DELAY_ORDER = 8  # of the Padé approximation of a delay in a continuous loop
_SAMPLING_TOLERANCE = 1e-6  # relative difference up to which two sampling times are equal


def sampled(system: LinearSystem, dt: float, delay: float = 0.0) -> control.StateSpace:
    """Return the exact discrete model of a continuous plant with zero-order hold, delay and
    sampler.

    Use this before the design of a sampled controller. The delay need not be a whole number of
    samples: with delay = d dt + rest, the plant input changes from u[k-d-1] to u[k-d] inside the
    sampling interval.

    Parameters
    ----------
    system : control.StateSpace or TransferFunction
        Continuous plant, with one or several inputs and outputs.
    dt : float
        Sampling time [s] of the controller.
    delay : float
        Computation delay [s].

    Returns
    -------
    control.StateSpace
        Discrete system with the sampling time dt.

    Raises
    ------
    ValueError
        A discrete system, a sampling time that is not positive, or a negative delay.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3.

    Examples
    --------
    >>> plant = sampled(control.ss(control.tf([1], [1, 0])), 0.1)            # an integrator: 0.1/(z - 1)
    >>> round(float(plant.poles()[0].real), 9), plant.dt
    (1.0, 0.1)
    """
    system = multivariable("system", system)
    if timebase(system):
        raise ValueError(f"system must be continuous, got one sampled at {timebase(system):g} s")
    require_positive("dt", dt)
    delay = require_nonnegative("delay", delay)
    whole = int(np.floor(delay / dt + 1e-9))
    rest = max(0.0, delay - whole * dt)
    if rest < 1e-9 * dt:
        rest = 0.0
    A, B, C, D = system.A, system.B, system.C, system.D
    n, m = B.shape
    # the exponential squares a matrix as often as its entries are large: those of a sum of modes in
    # companion form reach 1e50
    near, scales = balance_matrix(A) if n else (A, np.ones(0))
    drive = B / scales[:, None]
    unit = float(np.abs(drive).max(initial=0.0)) or 1.0

    def held(duration: float) -> tuple[np.ndarray, np.ndarray]:
        both = np.zeros((n + m, n + m))
        both[:n, :n], both[:n, n:] = near, drive / unit
        with np.errstate(all="ignore"):  # judged below
            both = expm(both * duration)
        return scales[:, None] * both[:n, :n] / scales, scales[:, None] * both[:n, n:] * unit

    Phi, _ = held(dt)
    after, late = held(dt - rest)
    _, early = held(rest)
    if not all(np.isfinite(part).all() for part in (Phi, after, late, early)):
        fastest = np.linalg.eigvals(A).real.max()
        raise ValueError(
            f"dt must be so short that exp(A dt) stays finite, got {dt:g} s with a pole at"
            f" {fastest:.4g} rad/s"
        )
    n_memory = whole + (rest > 0)
    if n_memory == 0:
        return with_names(
            control.StateSpace(Phi, late, C, D, dt), system.input_labels, system.output_labels
        )
    # states: x, then u[k-1], u[k-2], ..., u[k-n_memory]
    size = n + n_memory * m
    Ad, Bd, Cd = np.zeros((size, size)), np.zeros((size, m)), np.zeros((C.shape[0], size))
    Ad[:n, :n] = Phi
    Bd[n : n + m] = np.eye(m)
    Ad[n + m :, n:-m] = np.eye((n_memory - 1) * m)
    Cd[:, :n] = C
    if rest > 0:
        newest = late
    else:
        newest = held(dt)[1]
    if whole == 0:
        Bd[:n] = newest
    else:
        Ad[:n, n + (whole - 1) * m : n + whole * m] = newest
    if rest > 0:
        Ad[:n, n + whole * m : n + (whole + 1) * m] = after @ early
    Cd[:, n + (n_memory - 1) * m :] = D
    return with_names(
        control.StateSpace(Ad, Bd, Cd, np.zeros(D.shape), dt),
        system.input_labels,
        system.output_labels,
    )


def delay_samples(name: str, delay: float, dt: float) -> int:
    """Return the delay as a whole number of samples, or refuse it."""
    whole = round(delay / dt)
    if abs(delay / dt - whole) > 1e-6:
        raise ValueError(
            f"{name} must be a whole number of samples of {dt:g} s in discrete time, got {delay:g}"
            " s. A continuous model takes any delay."
        )
    return whole


def delayed(
    system: control.StateSpace, delay: float, *, order: int = _DELAY_ORDER
) -> control.StateSpace:
    """Return the system with a delay [s] at all inputs: z^-d in discrete time, otherwise Padé of
    that order.
    """
    if delay == 0:
        return system
    dt = timebase(system)
    if dt:
        whole = delay_samples("delay", delay, dt)
        if whole == 0:
            return system
        one = control.StateSpace(
            np.eye(whole, k=-1), np.eye(whole, 1), np.eye(1, whole, whole - 1), [[0.0]], dt
        )
    else:
        one = _pade(delay, order)
    return in_series(block_diagonal([one] * system.ninputs, one.dt), system)


def _pade(delay: float, order: int) -> control.StateSpace:
    """Return the all-pass Padé approximation of exp(-s delay) with equal degrees, realised section
    by section.

    Its poles are the roots of sum_k (2n-k)!/(k! (n-k)!) (s delay)^k; the zeros are their mirror
    images.
    """
    k = np.arange(order + 1)
    # coefficient ratios c_{k+1}/c_k = (n-k) / ((2n-k)(k+1)), from c_0 = 1: no factorial overflows
    ratio = (order - k[:-1]) / ((2 * order - k[:-1]) * (k[:-1] + 1.0))
    roots = np.roots(np.concatenate([[1.0], np.cumprod(ratio)])[::-1]) / delay
    parts = []
    for root in roots[roots.imag > 1e-9 * abs(roots)]:
        wn, damping = abs(root), -2 * root.real
        A = np.array([[-damping, -wn], [wn, 0.0]])
        parts.append(control.StateSpace(A, [[1.0], [0.0]], [[-2 * damping, 0.0]], [[1.0]], 0))
    for root in roots[np.abs(roots.imag) <= 1e-9 * abs(roots)].real:
        parts.append(control.StateSpace([[root]], [[1.0]], [[-2 * root]], [[-1.0]], 0))
    return in_series(*parts)


def without_pade(system: control.StateSpace) -> tuple[control.StateSpace, float]:
    """Return a continuous single-loop system without the Padé approximation in it, and the delay
    [s] of the latter.

    The all-pass factor is found by zeros that mirror poles. It counts as a delay only if its poles
    are those of the approximation of its order. A system without one is returned unchanged.

    >>> late = in_series(_pade(5e-4, 4), control.ss(control.tf([1], [1, 4, 80e3])))
    >>> G, delay = without_pade(late)
    >>> G.nstates, round(1e3 * delay, 9)
    (2, 0.5)
    """
    p, z = poles(system), zeros(system)
    with np.errstate(divide="ignore", invalid="ignore"):  # a pole at zero mirrors no zero
        distance = np.abs(p[:, None] + z.conj()[None, :]) / np.abs(p)[:, None]
    mirrored = (distance.min(axis=1, initial=1.0) < _ALLPASS_TOLERANCE) & (
        p.real < -_ALLPASS_TOLERANCE * np.abs(p)
    )
    n = int(mirrored.sum())
    delay = float(np.sum(-2 * (1 / p[mirrored]).real))
    if not n or not _roots_match(p[mirrored], poles(_pade(delay, n))):
        return system, 0.0
    kept = np.ones(z.size, bool)
    kept[np.argmin(distance[mirrored], axis=1)] = False
    far = 1e3j * np.abs(p).max()  # far above every root both systems are gain/s^excess
    gain = response(system, np.array([far.imag]))[0] * np.prod(far - p) / np.prod(far - z)
    return from_roots(z[kept], p[~mirrored], float(gain.real * (-1) ** n), 0.0), delay


def _roots_match(some: np.ndarray, other: np.ndarray) -> bool:
    """Return whether each root has one close to it in the other set."""
    distances = np.abs(some[:, None] - other[None, :]) / np.abs(some)[:, None]
    return bool(
        distances.min(axis=1).max() < _ALLPASS_TOLERANCE
        and np.unique(distances.argmin(axis=1)).size == some.size
    )


def discretize(K: LinearSystem, dt: float, *, prewarp: float = 0.0) -> control.StateSpace:
    """Discretise a continuous controller by the bilinear map (Tustin), with prewarping.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or float
        Continuous controller, with one or several inputs and outputs.
    dt : float
        Sampling time [s].
    prewarp : float
        Frequency [rad/s] at which the discrete controller has the response of the continuous one; 0
        for zero frequency.

    Returns
    -------
    control.StateSpace
        Discrete controller. Give it to `check`, which adds hold and delay. It is better to design
        the controller for the discrete plant of `sampled` from the start.

    Raises
    ------
    ValueError
        A discrete controller, a prewarp frequency above the Nyquist frequency, or a pole at 2/dt.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 8.2.

    Examples
    --------
    >>> K = discretize(control.tf([1, 2], [1, 0]), 0.1)
    >>> round(float(K.poles()[0].real), 9), round(float(K.zeros()[0].real), 9)
    (1.0, 0.818181818)
    """
    K = multivariable("K", K)
    dt, prewarp = require_positive("dt", dt), require_nonnegative("prewarp", prewarp)
    if timebase(K):
        raise ValueError(f"K must be continuous, got one sampled at {timebase(K):g} s")
    if prewarp * dt >= np.pi:
        raise ValueError(
            f"prewarp must lie below the Nyquist frequency {np.pi / dt:g} rad/s, got {prewarp:g}"
            " rad/s"
        )
    if prewarp:
        scale = prewarp / np.tan(prewarp * dt / 2)
    else:
        scale = 2 / dt
    image = to_discrete(K.A / scale, K.B / np.sqrt(scale), K.C / np.sqrt(scale), K.D)
    return with_names(control.StateSpace(*image, dt), K.input_labels, K.output_labels)


def hold_response(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return (W,) response of a zero-order hold of dt [s] and a sampler, sin(x)/x exp(-j x) with x
    = omega dt/2.

    The aliases from above the Nyquist frequency are left out: the line alone does not determine
    them.
    """
    x = np.asarray(omega, dtype=float) * dt / 2
    return np.asarray(np.sinc(x / np.pi) * np.exp(-1j * x))


def hold_correction(omega: np.ndarray, hold: str, *, fs: float, dt: float) -> np.ndarray:
    """Return (W,) the factor from an FRF measured with one hold to a model of sampling time dt (0:
    continuous).

    Parameters
    ----------
    omega : (W,) ndarray
        Frequencies [rad/s].
    hold : str
        Hold of the record: "zoh" (of 1/fs, contained in the FRF), "band-limited" (none), "unknown"
        (no correction).
    fs : float
        Sampling frequency of the record [Hz].
    dt : float
        Sampling time of the model [s].
    """
    if hold == "unknown" or (hold == "zoh" and abs(dt * fs - 1) < _SAMPLING_TOLERANCE):
        return np.ones(np.size(omega), dtype=complex)
    if dt:
        put_in = hold_response(omega, dt)
    else:
        put_in = np.ones(np.size(omega), dtype=complex)
    if hold == "zoh":
        return put_in / hold_response(omega, 1 / fs)
    return put_in
