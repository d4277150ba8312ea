"""Elements to shape a loop with by hand: lead, lag, notch, roll-off, PID; python-control objects, to be multiplied."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import require_integer, require_nonnegative, require_positive, require_real
from robust.lti.realisation import from_roots
from robust.lti.sampling import discretize


def lead(omega: float, phase: float, *, dt: float = 0.0) -> control.StateSpace:
    """Phase lead at a frequency, gain one there: what a crossover near the stability limit needs.

    r (s + omega/r)/(s + omega r) with r^2 = (1 + sin phase)/(1 - sin phase): the gain falls by r below omega and rises
    by r above it.

    Parameters
    ----------
    omega : float
        Where the lead is largest [rad/s].
    phase : float
        Lead there [rad], under pi/2.
    dt : float
        Sampling time [s] of a sampled element, by the bilinear map that is exact at omega; 0 for continuous.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        A frequency that is not positive, a phase that is not between zero and pi/2.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> K = lead(10.0, np.radians(50))
    >>> round(float(abs(K(10j))), 9), round(float(np.degrees(np.angle(K(10j)))), 9)
    (1.0, 50.0)
    """
    omega, phase = require_positive("omega", omega), require_positive("phase", phase)
    if phase >= np.pi / 2:
        raise ValueError(f"phase must be below pi/2 rad for one lead, got {phase:g}. Take two")
    ratio = np.sqrt((1 + np.sin(phase)) / (1 - np.sin(phase)))
    return on_time_base(from_roots(np.array([-omega / ratio]), np.array([-omega * ratio]), ratio, 0.0), omega, dt)


def lag(omega: float, gain: float, *, dt: float = 0.0) -> control.StateSpace:
    """More gain below a frequency, one above it: (s + omega)/(s + omega/gain); gain inf is PI action.

    Parameters
    ----------
    omega : float
        Up to where the gain is raised [rad/s]; a tenth of the crossover costs it 6 degrees.
    gain : float
        Gain at zero frequency, above one; inf for an integrator.
    dt : float
        Sampling time [s], as in `lead`.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        A frequency that is not positive, a gain of one or less.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> round(float(abs(lag(1.0, 20.0)(0))), 9), round(float(abs(lag(1.0, 20.0)(1e6j))), 6)
    (20.0, 1.0)
    """
    omega = require_positive("omega", omega)
    if not (isinstance(gain, float) and np.isposinf(gain)):
        gain = require_real("gain", gain)
    if gain <= 1:
        raise ValueError(f"gain must be above 1, got {gain:g}")
    return on_time_base(from_roots(np.array([-omega]), np.array([-omega / gain]), 1.0, 0.0), omega, dt)


def notch(omega: float, *, depth: float = 0.1, width: float = 0.5, dt: float = 0.0) -> control.StateSpace:
    """Return a notch over a resonance, gain one away from it.

    (s^2 + depth width omega s + omega^2)/(s^2 + width omega s + omega^2).

    Parameters
    ----------
    omega : float
        Its frequency [rad/s].
    depth : float
        Gain there; above one it is a peak.
    width : float
        Relative width of the dip, 2 zeta of the poles; wide where the resonance moves with the level.
    dt : float
        Sampling time [s], as in `lead`.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        A frequency or width that is not positive, a negative depth.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of Control 4 (1998).

    Examples
    --------
    >>> K = notch(100.0, depth=0.05, dt=1e-3)
    >>> round(float(abs(K(np.exp(0.1j)))), 9)
    0.05
    """
    omega, depth, width = (
        require_positive("omega", omega),
        require_nonnegative("depth", depth),
        require_positive("width", width),
    )
    top, bottom = (np.roots([1.0, d * width * omega, omega**2]) for d in (depth, 1.0))
    return on_time_base(from_roots(top, bottom, 1.0, 0.0), omega, dt)


def roll_off(omega: float, *, order: int = 1, zeta: float = 0.7, dt: float = 0.0) -> control.StateSpace:
    """Return a low-pass filter of first or second order: above it noise and unknown modes are left alone.

    Parameters
    ----------
    omega : float
        Corner [rad/s].
    order : int
        1 or 2.
    zeta : float
        Damping of the second order.
    dt : float
        Sampling time [s], as in `lead`.

    Returns
    -------
    control.StateSpace
        Gain one at zero frequency.

    Raises
    ------
    ValueError
        A frequency or damping that is not positive, an order other than one or two.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of Control 4 (1998).

    Examples
    --------
    >>> round(float(abs(roll_off(10.0, order=2, zeta=0.5)(10j))), 9)
    1.0
    """
    omega, zeta, order = (
        require_positive("omega", omega),
        require_positive("zeta", zeta),
        require_integer("order", order, least=1),
    )
    if order > 2:
        raise ValueError(f"order must be 1 or 2, got {order}")
    poles = np.array([-omega]) if order == 1 else np.roots([1.0, 2 * zeta * omega, omega**2])
    return on_time_base(from_roots(np.zeros(0), poles, omega**order, 0.0), omega, dt)


def pid(
    kp: float, ki: float = 0.0, kd: float = 0.0, *, filter_time: float = 0.0, dt: float = 0.0
) -> control.StateSpace:
    """PID control kp + ki/s + kd s/(filter_time s + 1).

    Parameters
    ----------
    kp, ki, kd : float
        Gains: unit of u per unit of y; the same per second; the same times seconds.
    filter_time : float
        Time constant of the derivative filter [s]; positive where kd is not zero.
    dt : float
        Sampling time [s], by Tustin; 0 for continuous.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        A derivative without a filter.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.

    Examples
    --------
    >>> K = pid(2.0, 3.0, 0.1, filter_time=0.01)
    >>> complex(np.round(K(1j), 6))
    (2.001-2.90001j)
    """
    kp, ki, kd, tau = (
        require_real("kp", kp),
        require_real("ki", ki),
        require_real("kd", kd),
        require_nonnegative("filter_time", filter_time),
    )
    if kd and not tau:
        raise ValueError("filter_time must be positive [s] where kd is not zero: a derivative needs a filter, got 0")
    dt = require_nonnegative("dt", dt)
    A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), kp
    if ki:
        A, B, C = np.zeros((1, 1)), np.ones((1, 1)), np.array([[ki]])
    if kd:
        # kd s/(tau s + 1) = kd/tau - (kd/tau) / (tau s + 1)
        A, B = np.pad(A, ((0, 1), (0, 1))), np.vstack([B, [[1 / tau]]])
        A[-1, -1], D = -1 / tau, D + kd / tau
        C = np.hstack([C, [[-kd / tau]]])
    K = control.StateSpace(A, B, C, [[D]], 0)
    return discretize(K, dt) if dt else K


def on_time_base(K: control.StateSpace, omega: float, dt: float) -> control.StateSpace:
    """Return the element on its time base, exact at its frequency."""
    dt = require_nonnegative("dt", dt)
    return discretize(K, dt, prewarp=omega) if dt else K
