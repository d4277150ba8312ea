"""Disk margins: how much gain and phase, at once and in all channels at once, a loop can bear."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import integer, real
from nlfrf.shared.values import value
from robust.certificates.stability import instability
from robust.mu.upper import mu_upper, refined
from robust.systems.grids import structure_grid
from robust.systems.lft import lower
from robust.systems.nyquist import winding
from robust.systems.realisation import multivariable

__all__ = ["DiskMargin", "disk_margin"]


@value
class DiskMargin:
    """The largest disk of gains and phases around one that leaves a loop stable.

    Fields
    ------
    alpha : float
        Size of the disk; nan where the loop is not stable, then `reason` says why.
    omega : float
        Frequency where it is limited [rad/s].
    skew : float
        Which disk: 0 as much gain up as down, 1 the distance of L from -1 (1/max |S|), -1 1/max |T|.
    gain_margin : tuple of float
        Every channel may be multiplied by any gain between these two.
    phase_margin : float
        Every channel may be turned by any phase up to this [rad]; inf where none matters.
    reason : str
        Why there is no margin; empty otherwise.

    References
    ----------
    Seiler, Packard & Gahinet, *An Introduction to Disk Margins*, IEEE Control Systems Magazine 40(5), 2020.

    Examples
    --------
    >>> disk_margin(control.tf([250], [1, 10, 10, 10])).reason
    'the loop is unstable: a pole at 0.5922+4.785j'
    """

    alpha: float
    omega: float
    skew: float
    gain_margin: tuple[float, float]
    phase_margin: float
    reason: str

    def __str__(self) -> str:
        """One line."""
        if self.reason:
            return f"no disk margin: {self.reason}"
        low, high = (20 * np.log10(g) if g > 0 else -np.inf for g in self.gain_margin)
        return (
            f"disk margin {self.alpha:.4g} at {self.omega / 2 / np.pi:.4g} Hz: gain {low:.2f} to {high:+.2f} dB, "
            f"phase {np.degrees(self.phase_margin):.1f} deg, in all channels at once"
        )


def disk_margin(L: Any, *, skew: float = 0.0, n_unstable: int = 0) -> DiskMargin:
    """Disk margin of a loop transfer function, closed by negative feedback of one; of several channels by mu.

    Parameters
    ----------
    L : control.StateSpace, TransferFunction or FrequencyResponseData
        Loop broken at the plant's input (K G) or output (G K), as many inputs as outputs. Of an FRF the margin holds
        on its lines only, and stability is read from how often det(I + L) winds about zero.
    skew : float
        Which disk, see `DiskMargin`.
    n_unstable : int
        Unstable poles of L, for an FRF.

    Returns
    -------
    DiskMargin
        alpha = 1/max mu(S + (skew - 1)/2 I) over frequency, one complex block per channel. Never larger than the true
        one at the frequencies looked at, and equal to it for up to three channels.

    Raises
    ------
    ValueError
        L that is not square, a loop without a solution, an FRF that is not finite.

    References
    ----------
    Seiler, Packard & Gahinet, *An Introduction to Disk Margins*, IEEE Control Systems Magazine 40(5), 2020.

    Examples
    --------
    Seiler, Packard & Gahinet, the loop of their first example.

    >>> margin = disk_margin(control.tf([25], [1, 10, 10, 10]))
    >>> print(margin)
    disk margin 0.4581 at 0.3112 Hz: gain -4.05 to +4.05 dB, phase 25.8 deg, in all channels at once
    """
    skew, n_unstable = real("skew", skew), integer("n_unstable", n_unstable, least=0)
    if isinstance(L, control.FrequencyResponseData):
        omega, alpha, reason = on_lines(L, skew, n_unstable)
    else:
        omega, alpha, reason = of_system(L, skew)
    if reason:
        return DiskMargin(
            alpha=np.nan, omega=np.nan, skew=skew, gain_margin=(np.nan, np.nan), phase_margin=np.nan, reason=reason
        )
    low, high = (2 - (1 - skew) * alpha) / (2 + (1 + skew) * alpha), 2 - (1 + skew) * alpha
    # the disk meets the unit circle where its rim, which runs through the two gains, does
    up = (2 + (1 - skew) * alpha) / high if high else np.inf
    cosine = (1 + low * up) / (low + up) if np.isfinite(up) else low
    return DiskMargin(
        alpha=alpha,
        omega=omega,
        skew=skew,
        gain_margin=(low, up if high > 0 else np.inf),
        phase_margin=float(np.arccos(cosine)) if abs(cosine) <= 1 else np.inf,
        reason="",
    )


def of_system(L: Any, skew: float) -> tuple[float, float, str]:
    """Where the margin of a system is limited, the margin, and why there is none."""
    L = multivariable("L", L)
    square(L.noutputs, L.ninputs)
    n = L.ninputs
    one = np.eye(n)
    # e = r - L e, closed through one: the sensitivity with all states of L
    P = control.StateSpace(L.A, np.hstack([0 * L.B, L.B]), np.vstack([-L.C] * 2), np.block([[one, -L.D]] * 2), L.dt)
    S = lower(P, control.StateSpace([], [], [], one, L.dt))
    unstable = instability(S)
    if unstable:
        return np.nan, np.nan, f"the loop is {unstable}"

    M = control.StateSpace(S.A, S.B, S.C, S.D + (skew - 1) / 2 * one, S.dt)
    omega, found = refined(M, [(1, 1)] * n, structure_grid(M))
    return limit(omega, found)


def limit(omega: np.ndarray, mu: np.ndarray) -> tuple[float, float, str]:
    """Where mu is largest, and the margin there."""
    k = int(mu.argmax())
    return float(omega[k]), float(1 / mu[k]) if mu[k] > 0 else np.inf, ""


def on_lines(L: control.FrequencyResponseData, skew: float, n_unstable: int) -> tuple[float, float, str]:
    """The same on the lines of an FRF."""
    square(L.noutputs, L.ninputs)
    n, omega, response = L.ninputs, np.asarray(L.omega, dtype=float), np.moveaxis(np.asarray(L.frdata), 2, 0)
    if not np.isfinite(response).all():
        raise ValueError("L must have a finite FRF on every line, got nan or infinite numbers")
    difference = np.eye(n) + response
    static = control.StateSpace([], [], [], 1.0, 0)
    turns, clear = winding(omega, np.linalg.det(difference) - 1, static, 0.0)
    if not clear:
        return np.nan, np.nan, "the lines are too far apart, or end too early, to tell whether the loop is stable"
    if turns != n_unstable:
        return np.nan, np.nan, f"unstable: det(I + L) winds {turns} times about zero, stability needs {n_unstable}"
    M = np.linalg.inv(difference) + (skew - 1) / 2 * np.eye(n)
    return limit(omega, mu_upper(np.moveaxis(M, 0, 2), [(1, 1)] * n).value)


def square(n_out: int, n_in: int) -> None:
    """Refuse a loop that cannot be closed."""
    if n_out != n_in:
        raise ValueError(f"L must have as many inputs as outputs, got {n_in} inputs and {n_out} outputs")
