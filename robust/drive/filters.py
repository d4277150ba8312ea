"""Filter slots of a drive: second-order filters between the velocity loop and the current loop."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_nonnegative, require_positive, require_real_array
from nlfrf._base.values import value


@value
class FilterSlot:
    """A filter of a drive, (b2 s^2 + b1 s + b0)/(a2 s^2 + a1 s + a0), sampled by the bilinear map (Tustin).

    Fields
    ------
    kind : str
        "notch", "low-pass" or "biquad".
    numerator, denominator : (3,) ndarray
        b2, b1, b0 and a2, a1, a0, highest power of s [rad/s] first.
    frequency : float
        Where the sampled filter has exactly the response of the continuous one [Hz].

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 8.2: the bilinear map with prewarping.

    Examples
    --------
    >>> low_pass(800.0).section(4000.0).shape
    (6,)
    """

    kind: str
    numerator: np.ndarray
    denominator: np.ndarray
    frequency: float

    def __post_init__(self) -> None:
        require_positive("frequency", self.frequency)
        for name in ("numerator", "denominator"):
            if require_real_array(name, getattr(self, name), ndim=1).shape != (3,):
                raise ValueError(f"{name} must hold three coefficients, got {getattr(self, name).size}")
        if not np.all(np.roots(self.denominator).real < 0):
            raise ValueError(f"denominator must be that of a stable filter, got {self.denominator.tolist()}")

    def section(self, fs: float) -> np.ndarray:
        """Return (6,) b0 b1 b2 1 a1 a2 of the filter sampled at fs [Hz]."""
        return bilinear_section(self.numerator, self.denominator, frequency=self.frequency, fs=fs)

    def __str__(self) -> str:
        return f"{self.kind} at {self.frequency:g} Hz"


def bilinear_section(numerator: np.ndarray, denominator: np.ndarray, *, frequency: float, fs: float) -> np.ndarray:
    """Return (6,) second-order section of a filter of s, exact at a frequency [Hz]; in powers of z^-1."""
    if not frequency < fs / 2:
        raise ValueError(
            f"filters must lie below half the sampling frequency, {fs / 2:g} Hz, got one at {frequency:g} Hz"
        )
    scale = 2 * np.pi * frequency / np.tan(np.pi * frequency / fs)  # s = scale (z - 1)/(z + 1)
    squares = np.array([[1.0, -2.0, 1.0], [1.0, 0.0, -1.0], [1.0, 2.0, 1.0]]) * [[scale**2], [scale], [1.0]]
    b, a = numerator @ squares, denominator @ squares
    return np.concatenate([b, a]) / a[0]


def notch(frequency: float, *, bandwidth: float, depth: float = 0.0) -> FilterSlot:
    """Return a notch: it takes a band around a resonance out of the current.

    Parameters
    ----------
    frequency : float
        Where the gain is least [Hz].
    bandwidth : float
        Distance of the two frequencies at which a notch of depth zero has a gain of 1/sqrt(2) [Hz].
    depth : float
        Gain at `frequency`, from 0 to 1.

    Returns
    -------
    FilterSlot

    Raises
    ------
    ValueError
        A frequency or a bandwidth that is not positive, a depth that is not between 0 and 1.

    References
    ----------
    Siemens, *SINAMICS S120 Function Manual Drive Functions*: current set point filters, bandstop with its blocking
    frequency, bandwidth and numerator bandwidth (here `depth` times the bandwidth).

    Examples
    --------
    >>> slot = notch(83.0, bandwidth=20.0, depth=0.1)
    >>> b, a = slot.section(4000.0).reshape(2, 3)
    >>> q = np.exp(-2j * np.pi * 83.0 / 4000.0)
    >>> round(float(abs(np.polyval(b[::-1], q) / np.polyval(a[::-1], q))), 9)
    0.1
    """
    frequency, bandwidth = require_positive("frequency", frequency), require_positive("bandwidth", bandwidth)
    if not require_nonnegative("depth", depth) < 1:
        raise ValueError(f"depth must lie between 0 and 1, got {depth:g}")
    omega, wide = 2 * np.pi * frequency, 2 * np.pi * bandwidth
    return FilterSlot(
        kind="notch",
        numerator=np.array([1.0, depth * wide, omega**2]),
        denominator=np.array([1.0, wide, omega**2]),
        frequency=frequency,
    )


def low_pass(frequency: float, *, zeta: float = np.sqrt(0.5)) -> FilterSlot:
    """Return a low-pass of second order, omega^2/(s^2 + 2 zeta omega s + omega^2).

    Parameters
    ----------
    frequency : float
        Natural frequency [Hz].
    zeta : float
        Damping ratio; 1/sqrt(2) for the flattest gain (Butterworth).

    Returns
    -------
    FilterSlot

    Raises
    ------
    ValueError
        A frequency or a zeta that is not positive.

    References
    ----------
    G. Ellis, *Control System Design Guide*, 4th ed., Butterworth-Heinemann, 2012, 9.2.

    Examples
    --------
    >>> b, a = low_pass(800.0).section(4000.0).reshape(2, 3)
    >>> round(float(b.sum() / a.sum()), 9)                            # gain one at zero frequency
    1.0
    """
    omega = 2 * np.pi * require_positive("frequency", frequency)
    return FilterSlot(
        kind="low-pass",
        numerator=np.array([0.0, 0.0, omega**2]),
        denominator=np.array([1.0, 2 * require_positive("zeta", zeta) * omega, omega**2]),
        frequency=frequency,
    )


def biquad(frequency: float, *, zeta: float, numerator_frequency: float, numerator_zeta: float) -> FilterSlot:
    """Return the general filter of second order, of gain one at zero frequency.

    (s^2/omega_n^2 + 2 zeta_n s/omega_n + 1)/(s^2/omega^2 + 2 zeta s/omega + 1)

    Parameters
    ----------
    frequency, numerator_frequency : float
        Natural frequencies of denominator and numerator [Hz].
    zeta, numerator_zeta : float
        Their damping ratios.

    Returns
    -------
    FilterSlot

    Raises
    ------
    ValueError
        A frequency or the damping of the denominator that is not positive, a negative damping of the numerator.

    References
    ----------
    Siemens, *SINAMICS S120 Function Manual Drive Functions*: general filter of second order.

    Examples
    --------
    >>> b, a = biquad(80, zeta=0.5, numerator_frequency=47, numerator_zeta=0.02).section(4000.0).reshape(2, 3)
    >>> round(float(b.sum() / a.sum()), 9)
    1.0
    """
    poles, zeros = (
        2 * np.pi * require_positive(name, number)
        for name, number in (("frequency", frequency), ("numerator_frequency", numerator_frequency))
    )
    zeta = require_positive("zeta", zeta)
    numerator_zeta = require_nonnegative("numerator_zeta", numerator_zeta)
    return FilterSlot(
        kind="biquad",
        numerator=np.array([1 / zeros**2, 2 * numerator_zeta / zeros, 1.0]),
        denominator=np.array([1 / poles**2, 2 * zeta / poles, 1.0]),
        frequency=frequency,
    )
