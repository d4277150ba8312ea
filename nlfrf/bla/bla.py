"""``Bla``: the best linear approximation of a nonlinear system, and the bound on its distortion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf._base.arguments import one_of, probability, ratio_unit, real
from nlfrf._base.numbers import TINY
from nlfrf._base.values import Sketch, value
from nlfrf.bla.calibration import FEW
from nlfrf.bla.localfit import LEAST, fit_locally
from nlfrf.bla.neighbours import place_lines
from nlfrf.signals.lines import LineGrid, local_mean

__all__ = ["Bla", "DistortionLevels"]


#: Fraction of the distortion of a new realisation that the roughness of the FRF does not show, as it bends the FRF
#: smoothly: none of a saturation, up to a half of a fifth power. A half costs 7 % more of the loss than a quarter.
#: With fewer than 27 lines the peaks of the input show it (`read_peaks`), and it is in `var_bound`.
UNSEEN = {"roughness": 0.25}
VARIANCES = ("var_noise", "var_total", "var_distortion", "var_even", "var_bound")
AROUND = 9  # lines over which noise and distortion are told apart


@value
class Bla:
    """Best linear approximation of a nonlinear system on the excited lines, with its variances.

    Every variance is E|.|^2 of a complex number, per excited line, in the unit of G squared.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    G : (F,) complex ndarray
        The best linear approximation, unit of y over unit of u.
    lines : LineGrid
        Excited and detection lines.
    grid : str
        The kind of grid that was recognised.
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        Samples N in one period.
    n_realizations, n_periods : int
        Realisations M and periods P behind it.
    transient : str
        What was done about the transient: "none", "discard" or "local".
    level_source : str
        Where the distortion level comes from: "detection" (lines that were not excited), "roughness" (of the
        FRF over the excited lines), "realizations" (scatter over M >= 2 experiments), or
        "realizations and detection".
    var_noise : (F,) ndarray
        Variance of G by noise; nan for P = 1.
    var_total : (F,) ndarray
        Variance of G by noise and distortion; always finite.
    var_distortion : (F,) ndarray
        Variance of one realisation's FRF about the BLA by distortion; it does not shrink with M. For P = 1 it
        contains the noise.
    var_even : (F,) ndarray
        What the even lines say, as a variance of one realisation's FRF at the excited lines; nan without them.
    dof : (F,) ndarray
        Complex degrees of freedom behind the bound.
    grid_factor : (F,) ndarray
        Variance at an excited line over the mean on its window of detection lines, as applied; ones where
        no detection lines were used.
    levels : DistortionLevels
        Output amplitudes on excited and detection lines.
    var_bound : (F,) ndarray
        Scale of |G - G_BLA|^2 / var_bound ~ F(2, 2 dof): detection lines, roughness and scatter over realisations,
        pooled by one statistical model (docs/guide/distortion.md). Its quantiles at 95 and
        99.9 % are those of the model.
    typical : float
        Expected over observed distortion power: how much more a realisation of random phases distorts than those at
        hand, by the cube of their input, from 1 to 3. Low peaks distort less, whether they are chance or were chosen.
        The square of that, as a fifth power asks for it, where they are lower than one realisation in twenty has them;
        of fewer than 27 lines always, from 0.6 to 6.
    coherence : (F,) ndarray
        Share of the output power that is linear in the input, for noise excitation (`identify_noise`); nan for periodic
        records, where distortion and noise are told apart instead.
    hold : str
        How the input ran between its samples, as the `Record` says: with "zoh" the hold of 1/fs is in G.
    u_name, y_name, u_unit, y_unit : str
        Names and units of the channels; empty where they are not known.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4 and 4.3.

    Examples
    --------
    A weak cube: by Bussgang the BLA is 2 + 0.3, but for what the line itself takes out of the sum.

    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> bla = nlfrf.identify(record)
    >>> bool(np.all(np.abs(bla.G - 2.3) < bla.bound(simultaneous=True)))
    True
    """

    f: np.ndarray
    G: np.ndarray
    lines: LineGrid
    grid: str
    fs: float
    n_samples: int
    n_realizations: int
    n_periods: int
    transient: str
    level_source: str
    var_noise: np.ndarray
    var_total: np.ndarray
    var_distortion: np.ndarray
    var_even: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray
    levels: DistortionLevels
    var_bound: np.ndarray
    typical: float = 1.0
    coherence: Any = None
    hold: str = "unknown"
    u_name: str = ""
    y_name: str = ""
    u_unit: str = ""
    y_unit: str = ""

    def __post_init__(self) -> None:
        if self.coherence is None:
            unknown = np.full(self.f.size, np.nan)
            unknown.flags.writeable = False
            object.__setattr__(self, "coherence", unknown)

    @property
    def omega(self) -> np.ndarray:
        """(F,) excited frequencies [rad/s]."""
        return 2 * np.pi * self.f

    @property
    def unit(self) -> str:
        """Unit of G, that of y over that of u; empty where neither is known."""
        return ratio_unit(self.y_unit, self.u_unit)

    @property
    def upper_limit(self) -> np.ndarray:
        """(F,) bool: distortion does not stand out of the noise here; its level is an upper limit, not a zero."""
        return np.asarray(self.var_total < 2 * local_mean(np.nan_to_num(self.var_noise), 13))

    def bound(self, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False) -> np.ndarray:
        """Radius of the disc around G that holds the truth with the stated probability.

        Parameters
        ----------
        confidence : float
            Probability, strictly between 0 and 1.
        of : str
            "bla": the disc holds the best linear approximation itself. "realization": it holds the FRF of a new
            realisation of the same excitation; this is what a controller has to live with.
        simultaneous : bool
            False: the probability holds line by line, so at 95 % about one line in twenty lies outside.
            True: it holds for all lines together.

        Returns
        -------
        (F,) ndarray
            Radius, in the unit of G: sqrt(F_p var), with F_p the p-quantile of F(2, 2 dof).

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 2.4 and 4.3.
        """
        quantile = self.f_quantile(confidence, simultaneous=simultaneous)
        one_of("of", of, ("bla", "realization"))
        variance = self.var_bound
        if of == "realization":
            missing = UNSEEN.get(self.level_source.split()[-1], 0.0) if self.f.size >= FEW else 0.0
            scatter = (self.n_realizations + missing) * self.typical * self.distorted_share()
            variance = variance * (1 + scatter)
        return np.sqrt(quantile * variance)

    def f_quantile(self, confidence: float = 0.95, *, simultaneous: bool = False) -> np.ndarray:
        """Quantile of F(2, 2 dof): the squared modulus of a complex normal over its estimated variance.

        Parameters
        ----------
        confidence : float
            Probability, strictly between 0 and 1.
        simultaneous : bool
            Whether it holds for all lines together.

        Returns
        -------
        (F,) ndarray
            From 3.00 for a known variance to 3.89 for six complex degrees of freedom, at 95 %.

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 2.4 and 4.3.
        """
        p = probability("confidence", confidence)
        if simultaneous:
            p = p ** (1 / self.f.size)
        # L ((1 - p)^(-1/L) - 1), by expm1 so that large L do not cancel
        return np.asarray(self.dof * np.expm1(-np.log1p(-p) / self.dof))

    def distorted_share(self) -> np.ndarray:
        """(F,) the share of `var_bound` that is distortion: a new realisation scatters by it, not by the noise.

        Line by line the difference of two estimates is nothing half of the time where noise prevails, so it is taken
        over nine lines, with an allowance for chance; where one line by itself shows more, it counts by itself.
        """
        noise, total = np.nan_to_num(self.var_noise), self.var_total if self.n_realizations == 1 else self.var_bound
        if not noise.any():
            return np.ones(self.f.size)
        dof_noise = self.n_realizations * max(self.n_periods - 1, 1)
        weight = 1 / np.maximum(total + noise, TINY)
        around = local_mean(noise * weight, AROUND) / np.maximum(local_mean(total * weight, AROUND), 1e-300)
        around = 1 - around * (1 - np.sqrt(1 / self.dof + 1 / (AROUND * dof_noise)) / 3)
        alone = noise / np.maximum(total, TINY)
        alone = 1 - alone - 2 * np.sqrt(1 / self.dof + alone**2 / dof_noise)
        return np.clip(np.maximum(around, alone), 0.0, 1.0)

    def systematic(self, decibels: float = 8.0) -> np.ndarray:
        """Order of magnitude of how far the BLA lies from the FRF of the linear part alone: not a bound.

        Parameters
        ----------
        decibels : float
            How far the systematic part stands over the odd detection level [dB]. A pure cubic on a special-odd grid has
            7.7, friction near its resonance more.

        Returns
        -------
        (F,) ndarray
            |G_BLA - G_0|, roughly, in the unit of G.

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 3.4.
        """
        return np.asarray(10 ** (real("decibels", decibels) / 20) * np.sqrt(self.var_distortion / self.grid_factor))

    def times(self, factor: np.ndarray) -> Bla:
        """The same with G times a factor (F,) on each line, and its variances times the square of that.

        What the output holds, `levels`, stays as it was measured.
        """
        square = np.abs(factor) ** 2
        scaled = {name: getattr(self, name) * square for name in VARIANCES}
        return replace(self, G=self.G * factor, **scaled)

    def _sketch_(self) -> Sketch:
        """|G| and its bound, for a notebook."""
        gain, bound = np.abs(self.G), self.bound()
        with np.errstate(divide="ignore"):
            curves = [("|G|", self.f, 20 * np.log10(gain)), ("bound", self.f, 20 * np.log10(bound))]
        return Sketch("Hz", "dB", curves, log=True)

    def roughness(self) -> np.ndarray:
        """Variance of G read from how rough it is over its lines: a second reading beside `var_total`.

        A level from detection lines errs on the wide side where it can be read in two ways; the scatter that is in G
        itself does not, but it reads too high where G bends within a few lines, and misses what is smooth.

        Returns
        -------
        (F,) ndarray
            In the unit of G squared; nan on fewer than five lines and for noise excitation, whose lines share a window.

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 7.2.2 (local polynomials).
        """
        if self.f.size < LEAST or np.isfinite(self.coherence).any():
            return np.full(self.f.size, np.nan)
        return fit_locally(self.G[None], np.ones((1, self.f.size)), place_lines(self.lines)).variance[0]

    def __str__(self) -> str:
        """What was found, in a few lines."""
        about = (
            f"BLA on {self.f.size} lines from {self.f[0]:g} to {self.f[-1]:g} Hz, {self.grid} grid, "
            f"M = {self.n_realizations}, P = {self.n_periods}\n"
        )
        gain = np.abs(self.G)
        peak, there = int(np.argmax(gain)), gain > 0
        if not there.any():
            return about + "  G is zero on every line: no part of the output is linear in the input"
        relative, power = np.median(self.bound()[there] / gain[there]), np.median(gain[there]) ** 2
        noise = np.nan_to_num(self.n_realizations * self.var_noise)
        found = "distortion" if np.isfinite(self.var_noise).any() else "distortion and noise"
        levels = {
            "noise": np.median(noise),
            f"{found} of one realisation": np.median(self.var_distortion),
            f"even {found}": np.median(np.maximum(np.nan_to_num(self.var_even) - noise, 0.0)),
        }
        hidden = int(self.upper_limit.sum())
        source = self.level_source
        if np.isfinite(self.coherence).any():
            source += f", {np.nanmedian(self.coherence):.2g} in the median"
        said = [f"{name} {10 * np.log10(v / power):.0f} dB" for name, v in levels.items() if v > 0]
        return (
            f"{about}  largest |G| {gain[peak]:.4g}{f' {self.unit}' * bool(self.unit)} at {self.f[peak]:g} Hz; "
            f"95 % bound {100 * relative:.2g} % of |G| in the median\n"
            f"  under the median |G|: {', '.join(said) or 'nothing above rounding'}\n"
            f"  transient: {self.transient}; level from {source}"
            + (f"; distortion is under the noise on {hidden} lines: an upper limit there" if hidden else "")
        )


@value
class DistortionLevels:
    """What the output holds on each kind of line.

    Fields
    ------
    f_excited, f_odd, f_even : (F,), (O,), (E,) ndarray
        Frequencies of the excited and of the odd and even detection lines [Hz].
    excited, odd, even : (M, F), (M, O), (M, E) complex ndarray
        Output amplitudes of each realisation, averaged over periods [unit of y]. On detection lines the linear
        answer to whatever input energy stood there was taken off, Y - G U. The level is the rms over M.
    noise_excited, noise_odd, noise_even : (F,), (O,), (E,) ndarray
        Standard deviation of those amplitudes by noise [unit of y]; nan where there was one period only.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3.

    Examples
    --------
    A cube drives odd lines only; the even ones stay at rounding.

    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> levels = nlfrf.identify(record).levels
    >>> bool(np.abs(levels.odd).max() > 1e-3), bool(np.abs(levels.even).max() < 1e-12)
    (True, True)
    """

    f_excited: np.ndarray
    f_odd: np.ndarray
    f_even: np.ndarray
    excited: np.ndarray
    odd: np.ndarray
    even: np.ndarray
    noise_excited: np.ndarray
    noise_odd: np.ndarray
    noise_even: np.ndarray
