"""Elements for manual loop shaping: lead, lag, notch, low-pass, PID as systems, to be
multiplied.
"""

from __future__ import annotations

import control

from robust.synthesis.blocks import Lag, Lead, LowPass, Notch, Pid


def lead(omega: float, phase: float, *, dt: float = 0.0) -> control.StateSpace:
    """Return phase lead at a frequency with gain one there, for phase margin at the crossover.

    Parameters
    ----------
    omega, phase : float
        Frequency of the largest lead [rad/s], and the lead there [rad], as for `Lead`.
    dt : float
        Sampling time [s] of a sampled element, by the bilinear map that is exact at omega; 0 for
        continuous.

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
    """Return higher gain below a frequency and gain one above it; PI action for an infinite gain.

    Parameters
    ----------
    omega, gain : float
        Frequency below which the gain is raised [rad/s], and the gain at zero frequency, as for
        `Lag`.
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
    """Return a notch over a resonance, with gain one away from it.

    Parameters
    ----------
    omega, depth, width : float
        Its frequency [rad/s], the gain there, its relative width, as for `Notch`.
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
    """Return a low-pass filter of first or second order: less gain for noise and unknown modes
    above its corner.

    Parameters
    ----------
    omega, order, zeta : float, int, float
        Corner [rad/s], order and damping ratio, as for `LowPass`.
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
        Gains and time constant of the derivative filter [s], as for `Pid`.
    dt : float
        Sampling time [s], by Tustin; 0 for continuous.

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
