"""Filters of first and second order as tunable blocks.

    Notch    (p^2 + depth width p + 1)/(p^2 + width p + 1)
    Lead     (r p + 1)/(p + r), r^2 = (1 + sin phase)/(1 - sin phase)
    Lag      (p + 1)/(p + 1/gain)
    LowPass  1/(p^2 + 2 zeta p + 1), or 1/(p + 1)
    Biquad   (p^2/q^2 + 2 numerator_zeta p/q + 1)/(p^2 + 2 zeta p + 1), q = numerator_omega/omega

with p = s/omega. With a sampling time T a filter is exact at its own omega: p = (z - 1)/(z +
1)/tan(omega T/2).
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from nlfrf._base.arguments import require_integer, require_nonnegative, require_positive
from nlfrf._base.values import value
from robust.lti.lti import Matrices
from robust.synthesis.blocks import Coefficients, Numbers, TunableBlock, second_order_section


@value
class Filter(TunableBlock):
    """A filter of first or second order: a quotient of polynomials in p = s/omega.

    When sampled, it has exactly the response of the continuous filter at omega.
    """

    omega: float

    @abstractmethod
    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return coefficients of numerator and monic denominator in p, highest power first."""

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return states in units of omega (sampled: of its image), so that the rows of A have equal
        size.
        """
        omega = numbers["omega"]
        rate = 2 / dt * np.tan(omega * dt / 2) if dt else omega
        (direct, *top), (_, *bottom) = self.polynomials(numbers)
        C = np.array(
            [[b - direct * a for b, a in zip(reversed(top), reversed(bottom), strict=True)]]
        )
        if len(bottom) == 1:
            return np.array([[-rate * bottom[0]]]), np.array([[rate]]), C, np.array([[direct]])
        A = np.array([[0.0, rate], [-rate * bottom[1], -rate * bottom[0]]])
        return A, np.array([[0.0], [rate]]), C, np.array([[direct]])

    def section(self, fs: float) -> np.ndarray:
        """Return (6,) b0 b1 b2 1 a1 a2 of the filter sampled at fs [Hz], in powers of z^-1, as in a
        drive.
        """
        self.require_system(1 / require_positive("fs", fs))
        return second_order_section(*self.polynomials(vars(self)), 1 / np.tan(self.omega / fs / 2))

    def __str__(self) -> str:
        hertz = " to ".join(f"{one / (2 * np.pi):g}" for one in np.atleast_1d(self.omega))
        return f"{type(self).__name__.lower()} at {hertz} Hz"


@value
class Notch(Filter):
    """Notch filter for a resonance as a tunable block.

    Fields
    ------
    omega : float
        Frequency of the notch [rad/s].
    depth : float
        Gain at omega. With 0 the frequency omega is blocked completely; a depth above one makes a
        peak. The default range for tuning is 0.001 to 1.
    width : float
        Relative width, which is twice the damping ratio of the poles. A notch of depth zero has a
        gain of 1/sqrt(2) at two frequencies whose distance is width times omega. The default range
        for tuning is 0.01 to 4.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency or width that is not positive, a negative depth, names that are no parameters.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of
    Control 4 (1998). Siemens, *SINAMICS S120 Function Manual Drive Functions*: current set point
    filters, bandstop with its blocking frequency, bandwidth (here `width` times it) and numerator
    bandwidth (here `depth` times the bandwidth).

    Examples
    --------
    A notch at 83 Hz, 20 Hz wide, at a sampling frequency of 4 kHz.

    >>> slot = Notch(omega=2 * np.pi * 83.0, depth=0.1, width=20.0 / 83.0)
    >>> b, a = slot.section(4000.0).reshape(2, 3)
    >>> q = np.exp(-2j * np.pi * 83.0 / 4000.0)
    >>> round(float(abs(np.polyval(b[::-1], q) / np.polyval(a[::-1], q))), 9)
    0.1
    """

    omega: float
    depth: float = 0.3
    width: float = 0.6

    NUMBERS = ("omega", "depth", "width")
    LIMITS = {"omega": (0.0, np.inf), "depth": (1e-3, 1.0), "width": (1e-2, 4.0)}  # noqa: RUF012

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise. The depth may be zero."""
        if name == "depth":
            return require_nonnegative(name, number)
        return super().check_number(name, number)

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        depth, width = numbers["depth"], numbers["width"]
        return [1.0, depth * width, 1.0], [1.0, width, 1.0]


@value
class Lead(Filter):
    """Lead element as a tunable block: phase lead at omega, where its gain is one.

    The transfer function is (r p + 1)/(p + r), with p = s/omega and r^2 = (1 + sin phase)/(1 - sin
    phase). The gain is 1/r far below omega and r far above it.

    Fields
    ------
    omega : float
        Frequency of the largest lead [rad/s].
    phase : float
        Phase lead at omega [rad], below pi/2. The default range for tuning is 0.01 to 1.5.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency that is not positive, a phase that is not between zero and pi/2, names that are
        no parameters.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> K = Lead(omega=10.0, phase=np.radians(50)).system()
    >>> round(float(abs(K(10j))), 9), round(float(np.degrees(np.angle(K(10j)))), 9)
    (1.0, 50.0)
    """

    omega: float
    phase: float = 0.8

    NUMBERS = ("omega", "phase")
    LIMITS = {"omega": (0.0, np.inf), "phase": (1e-2, 1.5)}  # noqa: RUF012

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise."""
        if super().check_number(name, number) >= np.pi / 2 and name == "phase":
            raise ValueError(f"phase must be below pi/2 rad for one lead, got {number:g}. Take two")
        return float(number)

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        sine = np.sin(numbers["phase"])
        r = np.sqrt((1 + sine) / (1 - sine))
        return [r, 1.0], [1.0, r]


@value
class Lag(Filter):
    """Lag element as a tunable block: higher gain below omega, gain one above it.

    Fields
    ------
    omega : float
        Frequency below which the gain is raised [rad/s]. With omega at a tenth of the crossover,
        the lag costs 6 degrees of phase at the crossover.
    gain : float
        Gain at zero frequency, above one. inf: the block has PI action, and the gain is not tuned.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency that is not positive, a gain of one or less, names that are no parameters.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> K = Lag(omega=1.0, gain=20.0).system()
    >>> round(float(abs(K(0))), 9), round(float(abs(K(1e6j))), 6)
    (20.0, 1.0)
    """

    omega: float
    gain: float = np.inf

    NUMBERS = ("omega", "gain")
    LIMITS = {"omega": (0.0, np.inf), "gain": (1.0, np.inf)}  # noqa: RUF012

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise. The gain may be infinite."""
        if name == "gain" and isinstance(number, float) and np.isposinf(number):
            return number
        if super().check_number(name, number) <= 1 and name == "gain":
            raise ValueError(f"gain must be above 1, got {number:g}")
        return float(number)

    def present(self) -> list[str]:
        """Return the names of the numbers; an infinite gain is not one of them."""
        if np.all(np.isfinite(self.gain)):
            return ["omega", "gain"]
        return ["omega"]

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        return [1.0, 1.0], [1.0, 1 / numbers.get("gain", np.inf)]


@value
class LowPass(Filter):
    """Low-pass filter of first or second order as a tunable block.

    Fields
    ------
    omega : float
        Corner [rad/s].
    zeta : float
        Damping ratio of a filter of second order. Default: 1/sqrt(2), the Butterworth filter. The
        default range for tuning is 0.1 to 2.
    order : int
        1 or 2.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency or damping that is not positive, an order other than one or two, names that are
        no parameters.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of
    Control 4 (1998). G. Ellis, *Control System Design Guide*, 4th ed., Butterworth-Heinemann, 2012,
    9.2.

    Examples
    --------
    >>> round(float(abs(LowPass(omega=10.0, zeta=0.5).system()(10j))), 9)
    1.0
    >>> b, a = LowPass(omega=2 * np.pi * 800).section(4000.0).reshape(2, 3)
    >>> round(float(b.sum() / a.sum()), 9)                            # gain one at zero frequency
    1.0
    """

    omega: float
    zeta: float = np.sqrt(0.5)
    order: int = 2

    NUMBERS = ("omega", "zeta")
    LIMITS = {"omega": (0.0, np.inf), "zeta": (0.1, 2.0)}  # noqa: RUF012

    def check_numbers(self) -> None:
        """Check numbers and order."""
        super().check_numbers()
        if require_integer("order", self.order, least=1) > 2:
            raise ValueError(f"order must be 1 or 2, got {self.order}")

    def present(self) -> list[str]:
        """Return the names of the numbers; a filter of first order has no damping."""
        return ["omega", "zeta"][: self.order]

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        if self.order == 1:
            return [0.0, 1.0], [1.0, 1.0]
        return [0.0, 0.0, 1.0], [1.0, 2 * numbers["zeta"], 1.0]


@value
class Biquad(Filter):
    """Second-order filter with gain one at zero frequency, as a tunable block.

    The transfer function is (p^2/q^2 + 2 numerator_zeta p/q + 1)/(p^2 + 2 zeta p + 1), with p =
    s/omega and q = numerator_omega/omega.

    Fields
    ------
    omega, numerator_omega : float
        Natural frequencies of denominator and numerator [rad/s].
    zeta, numerator_zeta : float
        Damping ratios of denominator and numerator. The damping ratio of the numerator may be zero.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency or the damping of the denominator that is not positive, a negative damping of
        the numerator.

    References
    ----------
    Siemens, *SINAMICS S120 Function Manual Drive Functions*: general filter of second order.

    Examples
    --------
    >>> hz = 2 * np.pi
    >>> slot = Biquad(omega=80 * hz, zeta=0.5, numerator_omega=47 * hz, numerator_zeta=0.02)
    >>> b, a = slot.section(4000.0).reshape(2, 3)
    >>> round(float(b.sum() / a.sum()), 9)
    1.0
    """

    omega: float
    zeta: float
    numerator_omega: float
    numerator_zeta: float

    NUMBERS = ("omega", "zeta", "numerator_omega", "numerator_zeta")
    LIMITS = {  # noqa: RUF012
        "omega": (0.0, np.inf),
        "zeta": (1e-2, 2.0),
        "numerator_omega": (0.0, np.inf),
        "numerator_zeta": (0.0, 2.0),
    }

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise; the damping of the numerator may be zero."""
        if name == "numerator_zeta":
            return require_nonnegative(name, number)
        return super().check_number(name, number)

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        ratio = numbers["omega"] / numbers["numerator_omega"]
        return [ratio**2, 2 * numbers["numerator_zeta"] * ratio, 1.0], [
            1.0,
            2 * numbers["zeta"],
            1.0,
        ]
