"""Weights by formula: for S and K S, and for a neglected delay and gain error."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import require_integer, require_nonnegative, require_positive
from robust.lti.lti import response
from robust.lti.realisation import from_roots
from robust.lti.sampling import discretize


def performance_weight(
    omega_B: float, *, M_S: float = 2.0, A: float = 1e-3, order: int = 1
) -> control.StateSpace:
    """Return the performance weight w_P for the demand |S| <= 1/|w_P|.

    Use this for a bound on |S|, and `control_weight` for a bound on |K S|.

    w_P = ((s/M_S^(1/n) + omega_B)/(s + omega_B A^(1/n)))^n.

    Parameters
    ----------
    omega_B : float
        Requested bandwidth [rad/s], where the asymptote of 1/|w_P| crosses one.
    M_S : float
        Largest |S| allowed anywhere, above one (2 is usual).
    A : float
        |S| allowed at zero frequency, below M_S.
    order : int
        The n of the formula: 1/|w_P| rises by n decades per decade below omega_B.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        Numbers that are not positive.
        An A that is not below M_S, an M_S that is not above one.

    References
    ----------
    SP eq. 2.105 and 2.106 (2.8.2).

    Examples
    --------
    >>> w_P = performance_weight(10, M_S=1.5, A=1e-4)
    >>> round(float(abs(w_P(1e6j))), 4), round(float(abs(w_P(0))))
    (0.6667, 10000)
    """
    omega_B = require_positive("omega_B", omega_B)
    M_S = require_positive("M_S", M_S)
    A = require_positive("A", A)
    order = require_integer("order", order, least=1)
    if M_S <= 1:
        raise ValueError(
            f"M_S must be above 1: |S| of a real loop exceeds one somewhere, got {M_S:g}"
        )
    if A >= M_S:
        raise ValueError(f"A must be below M_S = {M_S:g}, got {A:g}")
    high, low = M_S ** (1 / order), A ** (1 / order)
    return from_roots(np.full(order, -omega_B * high), np.full(order, -omega_B * low), 1 / M_S, 0.0)


def control_weight(
    omega_bc: float, *, M_u: float = 1.0, A: float = 1e-2, order: int = 1
) -> control.StateSpace:
    """Return the control weight w_u for the demand |K S| <= 1/|w_u|.

    Use this to bound the actuator effort and to make the controller roll off. 1/|w_u| is M_u at low
    frequency and A far above omega_bc.

    w_u = ((s + omega_bc/M_u^(1/n))/(A^(1/n) s + omega_bc))^n.

    Parameters
    ----------
    omega_bc : float
        Frequency [rad/s] from which the controller has to roll off.
    M_u : float
        Largest |K S| at low frequency [unit of u per unit of y].
    A : float
        Largest |K S| at high frequency, below M_u.
    order : int
        The n of the formula: 1/|w_u| falls by n decades per decade around omega_bc.

    Returns
    -------
    control.StateSpace
        Weight of this order, biproper.

    Raises
    ------
    ValueError
        Numbers that are not positive, an A that is not below M_u.

    References
    ----------
    Zhou & Doyle, *Essentials of Robust Control*, 6.4.

    Examples
    --------
    >>> w_u = control_weight(100.0, M_u=5.0, A=0.1)
    >>> round(float(abs(w_u(0))), 6), round(float(abs(w_u(1e9j))), 6)
    (0.2, 10.0)
    """
    omega_bc = require_positive("omega_bc", omega_bc)
    M_u = require_positive("M_u", M_u)
    A = require_positive("A", A)
    order = require_integer("order", order, least=1)
    if M_u <= A:
        raise ValueError(f"A must be below M_u = {M_u:g}, got {A:g}")
    low, high = M_u ** (1 / order), A ** (1 / order)
    return from_roots(np.full(order, -omega_bc / low), np.full(order, -omega_bc / high), 1 / A, 0.0)


def makeweight(
    dc: float,
    crossover: float | tuple[float, float],
    high: float,
    *,
    order: int = 1,
    dt: float = 0.0,
) -> control.StateSpace:
    """Return a weight with given gains at zero, at one frequency and at infinity, as in MATLAB.

    W = ((h s + a d)/(s + a))^n with d = dc^(1/n), h = high^(1/n), and a from the gain m at omega.

    Parameters
    ----------
    dc, high : float
        |W| at zero frequency, and at infinity (sampled: at the Nyquist frequency).
    crossover : float or (float, float)
        Frequency [rad/s] at which |W| is one; or omega [rad/s] and |W| at omega, between dc and
        high.
    order : int
        Order of the weight; a higher order is steeper between dc and high.
    dt : float
        Sampling time [s]; 0 for a continuous weight.

    Returns
    -------
    control.StateSpace
        Stable, minimum phase and biproper.

    Raises
    ------
    ValueError
        Numbers that are not positive, a gain that is not between dc and high, a frequency beyond
        Nyquist.

    References
    ----------
    SP 2.8.2. A sampled weight comes from the bilinear map that is exact at omega.

    Examples
    --------
    >>> W = makeweight(100, (2.0, 1.5), 0.1, order=3)
    >>> [round(float(abs(W(s))), 6) for s in (0, 2j, 1e9j)]
    [100.0, 1.5, 0.1]
    >>> W = makeweight(0.01, 30.0, 2.0, dt=0.05)
    >>> [round(float(abs(W(np.exp(0.05j * w)))), 6) for w in (0.0, 30.0, np.pi / 0.05)]
    [0.01, 1.0, 2.0]
    """
    if isinstance(crossover, tuple | list) and len(crossover) == 2:
        omega, gain = crossover
    else:
        omega, gain = crossover, 1.0
    omega, gain = require_positive("crossover", omega), require_positive("crossover[1]", gain)
    dc = require_positive("dc", dc)
    high = require_positive("high", high)
    dt = require_nonnegative("dt", dt)
    order = require_integer("order", order, least=1)
    if not min(dc, high) < gain < max(dc, high):
        raise ValueError(
            f"the gain at crossover must be between dc = {dc:g} and high = {high:g}, got {gain:g}"
        )
    if omega * dt >= np.pi:
        raise ValueError(
            f"crossover must lie below the Nyquist frequency {np.pi / dt:g} rad/s, got {omega:g}"
            " rad/s"
        )
    d, m, h = (size ** (1 / order) for size in (dc, gain, high))
    a = omega * np.sqrt((m**2 - h**2) / (d**2 - m**2))
    W = from_roots(np.full(order, -a * d / h), np.full(order, -a), high, 0.0)
    if dt:
        return discretize(W, dt, prewarp=omega)
    return W


def delay_weight(delay: float, *, gain: float = 0.0) -> control.StateSpace:
    """Return a third-order multiplicative weight that covers an uncertain delay and gain.

    Use this for a delay that the nominal model does not contain.

    The weight covers |k exp(-s theta) - 1| for 0 <= theta <= delay and 1 - gain <= k <= 1 + gain.
    The rational weights of SP 7.4.5 do not cover the exact radius at all frequencies, so they are
    raised until they do.

    Parameters
    ----------
    delay : float
        Longest delay [s] that the nominal model does not contain.
    gain : float
        Relative gain error, below 1.

    Returns
    -------
    control.StateSpace
        A weight within a few tenths of a dB of the exact radius. Without gain error it is zero at
        zero frequency.

    Raises
    ------
    ValueError
        A delay that is not positive, a gain error out of [0, 1).

    References
    ----------
    SP 7.4.5 (the exact radius and its approximations).

    Examples
    --------
    >>> w_I = delay_weight(0.01)
    >>> all(abs(w_I(1j * w)) >= abs(np.exp(-0.01j * w) - 1) for w in (1.0, 100.0, 314.0, 1000.0))
    True
    """
    delay, gain = require_positive("delay", delay), require_nonnegative("gain", gain)
    if gain >= 1:
        raise ValueError(
            f"gain must be below 1: with 100 % error the plant may vanish, got {gain:g}"
        )
    top = 1 + gain / 2
    pairs = [2.363 / delay * (-zeta + 1j * np.sqrt(1 - zeta**2)) for zeta in (0.838, 0.685)]
    zeros, poles = (
        np.array([real, p, p.conjugate()])
        for real, p in zip((-gain / (top * delay), -2 / delay), pairs, strict=True)
    )
    W = from_roots(zeros, poles, 2 * top, 0.0)
    omega = (
        np.concatenate(
            [np.geomspace(1e-4, 1, 200), np.linspace(1, 20, 4000), np.geomspace(20, 1e4, 200)]
        )
        / delay
    )
    lift = float(np.max(_delay_radius(omega * delay, gain) / np.abs(response(W, omega)))) * (
        1 + 1e-6
    )
    return control.StateSpace(W.A, W.B, W.C * max(lift, 1.0), W.D * max(lift, 1.0), 0)


def _delay_radius(x: np.ndarray, gain: float) -> np.ndarray:
    """Return (W,) max |k exp(-j x t) - 1| over 0 <= t <= 1, |k - 1| <= gain, x = omega delay."""
    return np.where(
        x < np.pi, np.sqrt(gain**2 + 2 * (1 + gain) * (1 - np.cos(np.minimum(x, np.pi)))), 2 + gain
    )
