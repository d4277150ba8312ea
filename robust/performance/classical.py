"""Crossover, phase and gain margin and bandwidth, read off the loop gain over frequency."""

from __future__ import annotations

import numpy as np

from nlfrf.shared.values import value
from nlfrf.shared.wording import hertz

__all__ = ["ClassicalMargins", "classical_margins"]


REAL = 1e-6  # |Im L| over |L| from which the last point, below the Nyquist frequency, counts as real


@value
class ClassicalMargins:
    """What a Bode picture of L is read for; they mean something for a loop that is stable.

    Fields
    ------
    crossover : float
        Highest frequency at which |L| is one [rad/s]; nan where it never is.
    phase_margin, omega_phase : float
        Smallest |180 deg + arg L| over all frequencies with |L| = 1 [rad], and where [rad/s].
    gain_margin, omega_gain : float
        Smallest factor above one on the loop gain that puts L on -1, inf where none does, and where [rad/s].
    gain_reduction, omega_reduction : float
        Largest factor below one that does, 0 where none does, and where [rad/s].
    bandwidth : float
        Lowest frequency at which |S| reaches 1/sqrt(2) from below [rad/s]; nan where it starts above or never does.

    References
    ----------
    SP 2.4.3 (margins), 2.4.5 (bandwidth).

    Examples
    --------
    L = 4/(s + 1)^3: phase crossover at sqrt(3) with |L| = 1/2.

    >>> omega = np.geomspace(1e-2, 1e2, 2000)
    >>> seen = classical_margins(omega, 4 / (1j * omega + 1) ** 3)
    >>> round(seen.gain_margin, 4), round(seen.omega_gain**2, 4)
    (2.0, 3.0)
    """

    crossover: float = float("nan")
    phase_margin: float = float("nan")
    omega_phase: float = float("nan")
    gain_margin: float = float("inf")
    omega_gain: float = float("nan")
    gain_reduction: float = 0.0
    omega_reduction: float = float("nan")
    bandwidth: float = float("nan")

    def __str__(self) -> str:
        if np.isnan(self.crossover):
            said = "|L| never crosses one"
        else:
            said = (
                f"crossover {hertz(self.crossover)}, phase margin {np.degrees(self.phase_margin):.1f} deg"
                f" at {hertz(self.omega_phase)}"
            )
        if np.isfinite(self.gain_margin):
            said += f", gain margin {20 * np.log10(self.gain_margin):.2f} dB at {hertz(self.omega_gain)}"
        else:
            said += ", no gain above this one makes it unstable"
        if self.gain_reduction:
            said += f", {20 * np.log10(self.gain_reduction):.2f} dB at {hertz(self.omega_reduction)}"
        return said + (f", bandwidth {hertz(self.bandwidth)}" if np.isfinite(self.bandwidth) else "")


def classical_margins(omega: np.ndarray, L: np.ndarray) -> ClassicalMargins:
    """The margins of a loop gain that is known at frequencies dense enough to interpolate between.

    Parameters
    ----------
    omega : (W,) ndarray
        Frequencies [rad/s], increasing.
    L : (W,) complex ndarray
        Loop gain there; points at which it is not finite are left out.

    Returns
    -------
    ClassicalMargins
        By straight lines in log |L| and phase over log frequency.
    """
    known = np.isfinite(L) & (L != 0)
    x, L = np.log(omega[known]), L[known]
    if x.size < 2:
        return ClassicalMargins()
    size, phase = np.log(np.abs(L)), np.unwrap(np.angle(L))
    found: dict[str, float] = {}
    at = crossings(x, size)
    if at.size:
        off = np.interp(at, x, phase)
        margin = np.abs((off + 2 * np.pi) % (2 * np.pi) - np.pi)
        k = int(np.argmin(margin))
        found |= {"crossover": np.exp(at[-1]), "phase_margin": margin[k], "omega_phase": np.exp(at[k])}
    turns = np.arange(np.ceil((phase.min() / np.pi - 1) / 2), np.floor((phase.max() / np.pi - 1) / 2) + 1)
    real = [crossings(x, phase - (2 * n + 1) * np.pi) for n in turns]
    if abs(L[-1].imag) < REAL * abs(L[-1]) and L[-1].real < 0:
        real.append(x[-1:])
    at = np.unique(np.concatenate([np.zeros(0), *real]))
    factor = np.exp(-np.interp(at, x, size))
    for name, side in (("gain", factor > 1), ("reduction", factor < 1)):
        if side.any():
            k = np.flatnonzero(side)[np.argmin(np.abs(np.log(factor[side])))]
            found |= {"gain_margin" if name == "gain" else "gain_reduction": factor[k], f"omega_{name}": np.exp(at[k])}
    S = np.log(np.abs(1 / (1 + L))) + np.log(2) / 2
    reached = crossings(x, S)
    if S[0] < 0 and reached.size:
        found["bandwidth"] = np.exp(reached[0])
    return ClassicalMargins(**{name: float(number) for name, number in found.items()})


def crossings(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Where a piecewise straight line crosses zero."""
    k = np.flatnonzero((y[:-1] < 0) != (y[1:] < 0))
    return np.asarray(x[k] + (x[k + 1] - x[k]) * y[k] / (y[k] - y[k + 1]))
