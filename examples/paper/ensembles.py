"""The paper's experiments on its rig, its equations as functions of an ensemble, and its findings
in numbers.

"The impact of nonlinear friction on FRF measurements": a mass on a spring with Leuven friction,
excited by random-phase multisines on odd, odd-odd and special-odd grids, at a level that stays in
presliding (1), one ten times smaller (2) and one ten times larger (3), 100 realisations each.
`reproduce.py` runs and draws them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import nlfrf
from nlfrf.rig import Rig
from nlfrf.signals import LineGrid

#: Rms of the force [N] at the paper's levels: 1 covers presliding without sliding.
LEVELS = {1: 0.25, 2: 0.025, 3: 2.5}
#: The paper's grids, and the one it recommends looking at.
GRIDS = ("odd", "odd-odd", "special-odd", "random-odd")
F0, FS = 0.25, 4096.0
#: First and last line of the band: 5, 7, ..., 573 for the odd grid, from 9 on for the two that
#: leave lines out.
_BAND_LINES = {
    "odd": (5, 573),
    "odd-odd": (9, 573),
    "special-odd": (9, 573),
    "random-odd": (5, 573),
}
#: Half width [Hz] of what is called "at the resonance".
_RESONANCE_HALF_WIDTH = 3.0


@dataclass(frozen=True)
class Ensemble:
    """Spectra of the realisations of one experiment.

    Fields
    ------
    lines : LineGrid
        Excited and detection lines.
    f0 : float
        Resolution [Hz].
    U, Y : (M, L) complex ndarray
        Amplitudes of the cosines of input [N] and output [m] on lines 0 to L - 1, averaged over
        periods.
    """

    lines: LineGrid
    f0: float
    U: np.ndarray
    Y: np.ndarray

    @property
    def n_realizations(self) -> int:
        """Realisations M."""
        return self.U.shape[0]


Ensembles = dict[tuple[int, str], Ensemble]


def ensemble_spectra(record: nlfrf.Record) -> Ensemble:
    """Return the spectra of a record, up to its last excited line."""
    last = record.lines.excited[-1] + 1
    U, Y = (
        np.fft.rfft(s.mean(axis=1), axis=1)[:, :last] * (2 / record.n_samples)
        for s in (record.u, record.y)
    )
    return Ensemble(lines=record.lines, f0=record.f0, U=U, Y=Y)


def paper_multisine(
    kind: str, level: int, *, n_realizations: int, rng: np.random.Generator | int | None = None
) -> nlfrf.Multisine:
    """Return the paper's excitation:

    4 s periods, lines up to 573 at 0.25 Hz, the same rms on every grid.
    """
    first, last = _BAND_LINES[kind]
    return nlfrf.multisine(
        kind,
        fs=FS,
        n_samples=round(FS / F0),
        f_min=first * F0,
        f_max=last * F0,
        rms=LEVELS[level],
        n_realizations=n_realizations,
        rng=rng,
    )


def output_linear(e: Ensemble) -> np.ndarray:
    """Return the (F,) output that is linear in the input, equation (7):

    E[Y U*] / |U| on the excited lines.
    """
    u, y = e.U[:, e.lines.excited], e.Y[:, e.lines.excited]
    return np.asarray(np.mean(y * u.conj(), axis=0) / np.sqrt(np.mean(np.abs(u) ** 2, axis=0)))


def output_stochastic(e: Ensemble) -> np.ndarray:
    """Return the (F,) stochastic distortion on the excited lines, equation (8): std(Y U*) / |U|."""
    u, y = e.U[:, e.lines.excited], e.Y[:, e.lines.excited]
    return np.asarray(
        np.std(y * u.conj(), axis=0, ddof=1) / np.sqrt(np.mean(np.abs(u) ** 2, axis=0))
    )


def output_rms(e: Ensemble, lines: np.ndarray) -> np.ndarray:
    """Return the (D,) output on detection lines, equation (9): its rms over the realisations."""
    return np.sqrt(np.mean(np.abs(e.Y[:, lines]) ** 2, axis=0))


def frf(e: Ensemble) -> tuple[np.ndarray, np.ndarray]:
    """Return the (F,) best linear approximation E[Y U*] / E|U|^2, and the variance of this mean."""
    u, y = e.U[:, e.lines.excited], e.Y[:, e.lines.excited]
    power = np.mean(np.abs(u) ** 2, axis=0)
    G = np.mean(y * u.conj(), axis=0) / power
    rest = (y - G * u) * u.conj()
    m = e.n_realizations
    return G, np.sum(np.abs(rest) ** 2, axis=0) / (m - 1) / m / power**2


def find_resonance(e: Ensemble) -> float:
    """Find where |G| is largest [Hz]: the vertex of a parabola through the lines within 3 Hz of the
    largest one.
    """
    G, _ = frf(e)
    f = e.lines.excited * e.f0
    peak = f[np.argmax(np.abs(G))]
    near = np.abs(f - peak) <= _RESONANCE_HALF_WIDTH
    a, b, _ = np.polyfit(f[near] - peak, np.abs(G[near]) / np.abs(G).max(), 2)
    return (
        float(peak - np.clip(b / (2 * a), -_RESONANCE_HALF_WIDTH, _RESONANCE_HALF_WIDTH))
        if a < 0
        else float(peak)
    )


def is_near_resonance(e: Ensemble, lines: np.ndarray) -> np.ndarray:
    """Return a mask of the lines within 3 Hz of the resonance."""
    return np.abs(lines * e.f0 - find_resonance(e)) <= _RESONANCE_HALF_WIDTH


def underestimation_db(e: Ensemble) -> float:
    """Return the stochastic distortion on excited lines over the rms of odd detection lines, at the
    resonance [dB].
    """
    excited = output_stochastic(e)[is_near_resonance(e, e.lines.excited)]
    odd = output_rms(e, e.lines.odd)[is_near_resonance(e, e.lines.odd)]
    return float(power_db(np.mean(excited**2) / np.mean(odd**2)))


def bootstrap_sigma(
    e: Ensemble, quantity: Callable[[Ensemble], float], *, n_draws: int = 200
) -> float:
    """Return the standard deviation of a quantity of the ensemble, over draws of realisations with
    replacement.
    """
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(n_draws):
        m = rng.integers(0, e.n_realizations, e.n_realizations)
        drawn.append(quantity(replace(e, U=e.U[m], Y=e.Y[m])))
    return float(np.std(drawn, ddof=1))


def normalised_difference(a: Ensemble, b: Ensemble) -> float:
    """Return the mean over common lines of |G_a - G_b|^2 over its variance: one where the two are
    the same BLA.
    """
    common, i, j = np.intersect1d(
        a.lines.excited, b.lines.excited, assume_unique=True, return_indices=True
    )
    (Ga, va), (Gb, vb) = frf(a), frf(b)
    if common.size == 0:
        raise ValueError("a and b must share excited lines, got none in common")
    dof = a.n_realizations + b.n_realizations - 2
    # the variances are estimates too: with few realisations their inverse is large on average
    return float(np.mean(np.abs(Ga[i] - Gb[j]) ** 2 / (va[i] + vb[j])) * (dof - 1) / dof)


def systematic_over_detection(e: Ensemble, rig: Rig) -> np.ndarray:
    """Return (F,) systematic distortion |G_R - G_0| |U| over the odd detection level [dB]; G_0:
    before it slips.
    """
    G, _ = frf(e)
    f = e.lines.excited * e.f0
    s = 2j * np.pi * f
    law = rig.friction
    damping = rig.damping + law.sigma1 + law.sigma2
    G0 = 1 / (rig.mass * s**2 + damping * s + rig.stiffness + law.curve.K0)
    u = e.U[:, e.lines.excited]
    odd = np.interp(e.lines.excited, e.lines.odd, np.log(output_rms(e, e.lines.odd)))
    return np.asarray(
        2 * power_db(np.abs(G - G0) * np.sqrt(np.mean(np.abs(u) ** 2, axis=0)) / np.exp(odd))
    )


def single_experiment_coverage(
    e: Ensemble, *, factor: float, n_detection: int = 6
) -> tuple[float, float]:
    """Return the level of one experiment over the true one [dB, median], and how often its 95 %
    disc holds G.

    The level is the rms over the nearest odd detection lines, its square times `factor`.
    """
    u, y, detected = e.U[:, e.lines.excited], e.Y[:, e.lines.excited], e.Y[:, e.lines.odd]
    nearest = np.argsort(np.abs(e.lines.excited[:, np.newaxis] - e.lines.odd), axis=1)[
        :, :n_detection
    ]
    level = np.sqrt(factor * np.mean(np.abs(detected[:, nearest]) ** 2, axis=2))
    G, _ = frf(e)
    quantile = n_detection * (0.05 ** (-1 / n_detection) - 1)  # F(2, 2 L) at 95 %
    inside = np.abs(y - G * u) <= np.sqrt(quantile) * level
    return float(np.median(2 * power_db(level / output_stochastic(e)))), float(np.mean(inside))


def power_db(ratio: np.ndarray | float) -> np.ndarray:
    """Return a power ratio in dB."""
    return 10 * np.log10(ratio)
