"""Weights by formula: what is asked of S and K S, and what a neglected delay and gain error may do."""

from __future__ import annotations

import control
import numpy as np

from nlfrf.shared.arguments import integer, nonnegative, positive
from robust.systems.connections import in_series
from robust.systems.lti import response
from robust.systems.realisation import from_roots

__all__ = ["control_weight", "delay_weight", "performance_weight"]


def performance_weight(omega_B: float, *, M_S: float = 2.0, A: float = 1e-3, order: int = 1) -> control.StateSpace:
    """What the sensitivity must stay under: |S| <= 1/|w_P|, bandwidth omega_B, peak M_S, error A at low frequency.

    w_P = ((s/M_S^(1/n) + omega_B)/(s + omega_B A^(1/n)))^n.

    Parameters
    ----------
    omega_B : float
        Bandwidth asked for [rad/s]: where the asymptote of 1/|w_P| crosses one.
    M_S : float
        Largest |S| allowed anywhere, above one (2 is usual).
    A : float
        |S| allowed at zero frequency, below M_S.
    order : int
        Slope of the demand: n decades per decade.

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
    omega_B, M_S, A = positive("omega_B", omega_B), positive("M_S", M_S), positive("A", A)
    order = integer("order", order, least=1)
    if M_S <= 1:
        raise ValueError(f"M_S must be above 1: |S| of a real loop exceeds one somewhere, got {M_S:g}")
    if A >= M_S:
        raise ValueError(f"A must be below M_S = {M_S:g}, got {A:g}")
    high, low = M_S ** (1 / order), A ** (1 / order)
    return from_roots(np.full(order, -omega_B * high), np.full(order, -omega_B * low), 1 / M_S, 0.0)


def control_weight(omega_bc: float, *, M_u: float = 1.0, A: float = 1e-2, order: int = 1) -> control.StateSpace:
    """What the actuator must not be asked for: |K S| <= 1/|w_u|, M_u at low frequency, A far above omega_bc.

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
        Slope of the roll-off: n decades per decade.

    Returns
    -------
    control.StateSpace
        Of that order, biproper.

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
    omega_bc, M_u, A = positive("omega_bc", omega_bc), positive("M_u", M_u), positive("A", A)
    order = integer("order", order, least=1)
    if M_u <= A:
        raise ValueError(f"A must be below M_u = {M_u:g}, got {A:g}")
    low, high = M_u ** (1 / order), A ** (1 / order)
    return from_roots(np.full(order, -omega_bc / low), np.full(order, -omega_bc / high), 1 / A, 0.0)


def delay_weight(delay: float, *, gain: float = 0.0, order: int = 3) -> control.StateSpace:
    """Multiplicative weight that covers any delay up to a maximum and any gain error up to a fraction.

    Covers |k exp(-s theta) - 1| for 0 <= theta <= delay, 1 - gain <= k <= 1 + gain. The book's rational weights touch
    the exact radius from below in places; here they are lifted until they cover it.

    Parameters
    ----------
    delay : float
        Longest delay [s] the nominal model leaves out.
    gain : float
        Relative gain error, below 1.
    order : int
        1 (simple, up to 1.5 dB above) or 3 (within a few tenths of a dB).

    Returns
    -------
    control.StateSpace
        Without gain error it vanishes at zero frequency.

    Raises
    ------
    ValueError
        A delay that is not positive, a gain error out of [0, 1), an order other than one or three.

    References
    ----------
    SP 7.4.5 (the exact radius and its approximations).

    Examples
    --------
    >>> w_I = delay_weight(0.01)
    >>> all(abs(w_I(1j * w)) >= abs(np.exp(-0.01j * w) - 1) for w in (1.0, 100.0, 314.0, 1000.0))
    True
    """
    delay, gain = positive("delay", delay), nonnegative("gain", gain)
    if gain >= 1:
        raise ValueError(f"gain must be below 1: with 100 % error the plant may vanish, got {gain:g}")
    if order not in (1, 3):
        raise ValueError(f"order must be 1 or 3, got {order!r}")
    top = 1 + gain / 2
    W = from_roots(np.array([-gain / (top * delay)]), np.array([-2 / delay]), 2 * top, 0.0)
    if order == 3:
        w0 = 2.363 / delay
        pairs = [w0 * (-zeta + 1j * np.sqrt(1 - zeta**2)) for zeta in (0.838, 0.685)]
        zeros, poles = (np.array([p, p.conjugate()]) for p in pairs)
        W = in_series(W, from_roots(zeros, poles, 1.0, 0.0))
    omega = np.concatenate([np.geomspace(1e-4, 1, 200), np.linspace(1, 20, 4000), np.geomspace(20, 1e4, 200)]) / delay
    lift = float(np.max(delay_radius(omega * delay, gain) / np.abs(response(W, omega)))) * (1 + 1e-6)
    return control.StateSpace(W.A, W.B, W.C * max(lift, 1.0), W.D * max(lift, 1.0), 0)


def delay_radius(x: np.ndarray, gain: float) -> np.ndarray:
    """(W,) largest |k exp(-j x t) - 1| over 0 <= t <= 1 and |k - 1| <= gain, at x = omega delay."""
    return np.where(x < np.pi, np.sqrt(gain**2 + 2 * (1 + gain) * (1 - np.cos(np.minimum(x, np.pi)))), 2 + gain)
