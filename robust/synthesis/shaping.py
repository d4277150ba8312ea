"""Elements for manual loop shaping as systems: lead, lag, notch, low-pass, PID."""

from __future__ import annotations

import control

from robust.synthesis.filters import Lag, Lead, LowPass, Notch
from robust.synthesis.pid import Pid


def lead(omega: float, phase: float, *, dt: float = 0.0) -> control.StateSpace:
    """Return a lead element: phase lead at omega, where its gain is one.

    Parameters
    ----------
    omega, phase : float
        Frequency of the largest lead [rad/s], and largest lead [rad], as for `robust.tuning.Lead`.
    dt : float
        Sampling time [s]; 0 for a continuous element. A discrete element comes from the bilinear
        map that is exact at omega.

    Returns
    -------
    control.StateSpace

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> import numpy as np
    >>> K = lead(10.0, np.radians(50))
    >>> round(float(abs(K(10j))), 9), round(float(np.degrees(np.angle(K(10j)))), 9)
    (1.0, 50.0)
    """
    return Lead(omega=omega, phase=phase).system(dt)


def lag(omega: float, gain: float, *, dt: float = 0.0) -> control.StateSpace:
    """Return a lag element: higher gain below omega, gain one above it; PI for an infinite gain.

    Parameters
    ----------
    omega, gain : float
        Frequency below which the gain is raised [rad/s], and gain at zero frequency, as for
        `robust.tuning.Lag`.
    dt : float
        Sampling time [s], as in `lead`.

    Returns
    -------
    control.StateSpace

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> round(float(abs(lag(1.0, 20.0)(0))), 9), round(float(abs(lag(1.0, 20.0)(1e6j))), 6)
    (20.0, 1.0)
    """
    return Lag(omega=omega, gain=gain).system(dt)


def notch(
    omega: float, *, depth: float = Notch.depth, width: float = Notch.width, dt: float = 0.0
) -> control.StateSpace:
    """Return a notch filter for a resonance, with gain one far from it.

    Parameters
    ----------
    omega, depth, width : float
        Frequency of the notch [rad/s], gain at this frequency, and relative width, as for
        `robust.tuning.Notch`.
    dt : float
        Sampling time [s], as in `lead`.

    Returns
    -------
    control.StateSpace

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of
    Control 4 (1998).

    Examples
    --------
    >>> import numpy as np
    >>> K = notch(100.0, depth=0.05, dt=1e-3)
    >>> round(float(abs(K(np.exp(0.1j)))), 9)
    0.05
    """
    return Notch(omega=omega, depth=depth, width=width).system(dt)


def low_pass(
    omega: float, *, order: int = LowPass.order, zeta: float = LowPass.zeta, dt: float = 0.0
) -> control.StateSpace:
    """Return a low-pass filter of first or second order.

    Parameters
    ----------
    omega, order, zeta : float, int, float
        Corner frequency [rad/s], order and damping ratio, as for `robust.tuning.LowPass`.
    dt : float
        Sampling time [s], as in `lead`.

    Returns
    -------
    control.StateSpace
        Gain one at zero frequency.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of
    Control 4 (1998).

    Examples
    --------
    >>> round(float(abs(low_pass(10.0, zeta=0.5)(10j))), 9)
    1.0
    """
    return LowPass(omega=omega, order=order, zeta=zeta).system(dt)


def pid(
    kp: float, ki: float = 0.0, kd: float = 0.0, *, filter_time: float = 0.0, dt: float = 0.0
) -> control.StateSpace:
    """Return the PID controller kp + ki/s + kd s/(filter_time s + 1).

    Parameters
    ----------
    kp, ki, kd, filter_time : float
        Gains, and time constant of the derivative filter [s], as for `robust.tuning.Pid`.
    dt : float
        Sampling time [s] of a discrete controller, by the Tustin method; 0 for a continuous one.

    Returns
    -------
    control.StateSpace

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.

    Examples
    --------
    >>> import numpy as np
    >>> K = pid(2.0, 3.0, 0.1, filter_time=0.01)
    >>> complex(np.round(K(1j), 6))
    (2.001-2.90001j)
    """
    return Pid(kp=kp, ki=ki, kd=kd, filter_time=filter_time).system(dt)
