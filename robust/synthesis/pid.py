"""The PID controller kp + ki/s + kd s/(filter_time s + 1) as a tunable block."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_nonnegative, require_positive
from nlfrf._base.values import value
from robust.lti.lti import Matrices
from robust.synthesis.blocks import Numbers, TunableBlock, second_order_section


@value
class Pid(TunableBlock):
    """PID controller kp + ki/s + kd s/(filter_time s + 1), or a part of it, as a tunable block.

    Use it as the start of `tune` or `design_frf`, or for an existing PID controller.

    Fields
    ------
    kp, ki, kd : float
        Gains at the start of the search, in the unit of `drives` over `reads`; ki per second, kd
        times seconds. A part with zero gain is left out. Each gain keeps its sign.
    filter_time : float
        Time constant of the derivative filter [s]; positive if kd is not zero.
    reads, drives : str
        Names of the input signal (`reads`) and of the output signal (`drives`) of the block.
    fixed : tuple of str
        Parameters that keep their start values.
    lower, upper : dict of str to float, optional
        Bounds by name of the parameter; by default a thousandth of the start value, and a thousand
        times the start value. In a sampled loop filter_time stays above dt/10.
    scheduled : dict of str to int, optional
        Degree d of each number that is a polynomial of the operating point, by name. The field of
        such a number contains its Bernstein coefficients (d + 1,). The first and the last
        coefficient are the values at the ends of the range, and all values are between the smallest
        and the largest coefficient. If a single number is given, all coefficients start with it.

    Raises
    ------
    ValueError
        A derivative without filter, names that are no parameters.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.

    Examples
    --------
    >>> Pid(kp=2.0, ki=10.0, reads="e", drives="u").order
    1
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    filter_time: float = 0.0

    NUMBERS = ("kp", "ki", "kd", "filter_time")

    @classmethod
    def from_gains(cls, gains: object, *, reads: str, drives: str) -> Pid:
        """Return the block for a `PidGains`, for example from `robust.io.pid_gains`.

        >>> from robust.io import PidGains
        >>> Pid.from_gains(PidGains(kp=2.0, ki=10.0), reads="e", drives="u").ki
        10.0
        """
        return cls(
            reads=reads, drives=drives, **{name: getattr(gains, name) for name in cls.NUMBERS}
        )

    def check_numbers(self) -> None:
        """Check the gains, and the filter of a derivative."""
        super().check_numbers()
        require_nonnegative("filter_time", float(np.min(self.filter_time)))
        if np.any(self.kd) and not np.any(self.filter_time):
            raise ValueError(
                "filter_time must be positive [s] if kd is not zero: a derivative needs a filter,"
                " got 0"
            )

    def present(self) -> list[str]:
        """Return the names of the nonzero gains, and the filter of a derivative."""
        gains = [name for name in ("kp", "ki", "kd") if np.any(getattr(self, name))]
        if np.any(self.kd):
            return [*gains, "filter_time"]
        return gains

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return the PID as a system with its parts in parallel.

        The factor ki is before the integrator, so that the integral does not jump if ki is
        scheduled.
        """
        rows: list[tuple[float | np.ndarray, ...]] = []
        D = numbers.get("kp", 0.0)
        if "ki" in numbers:
            rows.append((0.0, numbers["ki"], 1.0))
        if "kd" in numbers:
            kd, tau = numbers["kd"], numbers["filter_time"]
            rows.append((-1 / tau, 1 / tau, -kd / tau))
            D = D + kd / tau
        if rows:
            A = np.diag(np.array([row[0] for row in rows]))
        else:
            A = np.zeros((0, 0))
        B = np.array([[row[1]] for row in rows]).reshape(len(rows), 1)
        C = np.array([[row[2] for row in rows]]).reshape(1, len(rows))
        return A, B, C, np.array([[D]])

    def section(self, fs: float) -> np.ndarray:
        """Return (6,) b0 b1 b2 1 a1 a2, in powers of z^-1, of the PID sampled at fs [Hz]."""
        self.require_system(0.0)
        kp, ki, kd, tau = self.kp, self.ki, self.kd, self.filter_time if self.kd else 0.0
        numerator, denominator = [kp * tau + kd, kp + ki * tau, ki], [tau, 1.0, 0.0]
        first, last = 0 if self.kd else 1, 3 if self.ki else 2
        return second_order_section(
            numerator[first:last], denominator[first:last], 2 * require_positive("fs", fs)
        )
