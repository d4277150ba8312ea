"""`Bla`: the best linear approximation of a nonlinear system, its variances, and the bound on its
distortion.

The class serves any number of inputs and outputs. For a matrix G, Cov(vec G) = conj(gamma) kron C,
with the covariance C of the outputs (Pintelon & Schoukens, 2nd ed., 2.7). For one input and one
output G has one variance per line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf._base.arguments import (
    as_list,
    as_names,
    format_count,
    ratio_unit,
    require_choice,
    require_integer,
    require_one_channel,
    require_probability,
    require_real,
)
from nlfrf._base.numbers import TINY, roy_quantile
from nlfrf._base.values import ArrayField, freeze_array, value
from nlfrf.bla.calibration import FEW_LINES
from nlfrf.bla.covariance import diagonal, hermitian_sqrt
from nlfrf.bla.line_index import SMOOTHING_LINES, index_lines
from nlfrf.bla.local_models import MIN_FIT_LINES, fit_locally
from nlfrf.records.record import Channels
from nlfrf.signals.lines import LineGrid, local_mean

#: Fraction of the distortion of a new realisation that the roughness of the FRF does not show,
#: because it bends the FRF smoothly: none for a saturation, up to a half for a fifth power. A half
#: costs 7 % more of the loss than a quarter. With fewer than 27 lines the peaks of the input show
#: it (`crest_correction`), and `var_bound` contains it.
_SMOOTH_SHARE = {"roughness": 0.25}
_COVARIANCES = ("noise", "total", "distortion", "even", "bound")
#: Printed form of `Bla.level_source`.
_SOURCES = {
    "detection": "detection lines",
    "realizations": "scatter over realisations",
    "realizations and detection": "scatter over realisations and detection lines",
}
_PER_LINE = ("f", "dof", "grid_factor", "coherence")


@value
class Experiment:
    """Description of the experiment behind a `Bla`.

    Fields
    ------
    grid : str
        Kind of the harmonic grid, recognised from the excited lines: "special-odd", "full", ...
    design : str
        For several inputs: "orthogonal" if every experiment excites all inputs on all lines,
        "zippered" if each line excites one input.
    n_samples : int
        Samples N in one period.
    n_realizations, n_periods : int
        Number of realisations M and of periods P. For several inputs M is the number of sets of n_u
        experiments.
    n_experiments : int
        Number of experiments: M for one input, n_u M for several inputs.
    transient : str
        Treatment of the transient: "none", "discard" or "local", as in `identify`.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.7 and
    4.3.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_realizations=2, rng=2)
    >>> record = nlfrf.Record(u=ms.u[:, None], y=2 * ms.u[:, None], fs=256, lines=ms.lines)
    >>> made = nlfrf.identify(record).experiment
    >>> made.n_realizations, made.n_periods, made.grid
    (2, 1, 'special-odd')
    """

    grid: str
    design: str = "orthogonal"
    n_samples: int
    n_realizations: int = 1
    n_periods: int = 1
    n_experiments: int = 0
    transient: str = "none"

    def __post_init__(self) -> None:
        self.__dict__["n_experiments"] = self.n_experiments or self.n_realizations


@value(copy=False)
class Covariances:
    """Covariances of the residual Y - G U of one experiment, on each excited line.

    Each of them, C, gives a covariance of the estimate: Cov(vec G) = conj(gamma) kron C, where vec
    stacks the columns of G.

    Fields
    ------
    gamma : (n_u, n_u, F) complex ndarray
        Factor from the covariance of the residual to Cov(vec G). In open loop it is diagonal with
        1/(M A_i^2), A_i the amplitude of input i. In closed loop it is full. For one input and one
        output it is 1, and the other fields are variances of G itself.
    noise, total, distortion, even, bound : (n_y, n_y, F) complex ndarray
        Covariance due to: noise; noise and distortion; distortion alone, with negative eigenvalues
        set to zero; everything on the even detection lines, noise included. `bound` is the
        covariance that `Bla.bound` and `Bla.block` use.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.7.

    Examples
    --------
    >>> one = np.ones((1, 1, 3))
    >>> cov = Covariances(gamma=one, noise=one, total=2 * one, distortion=one, even=one, bound=2 * one)
    >>> cov.map(np.sqrt).noise.shape
    (1, 1, 3)
    """

    gamma: np.ndarray
    noise: np.ndarray
    total: np.ndarray
    distortion: np.ndarray
    even: np.ndarray
    bound: np.ndarray

    def map(self, change: Callable[[np.ndarray], np.ndarray]) -> Covariances:
        """Return a copy with `change` applied to each covariance; `gamma` is unchanged."""
        return replace(self, **{name: change(getattr(self, name)) for name in _COVARIANCES})


@value
class Bla(Channels):
    """Best linear approximation (BLA) of a nonlinear system on the excited lines, with its
    variances.

    `identify` returns it. Every variance is E|.|^2 of a complex error, one number per excited line.
    For one input and one output the fields are (F,) arrays. For several channels G is a matrix on
    each line. The covariance of its entries is Cov(vec G) = conj(gamma) kron C, where vec stacks
    the columns of G. The field `cov` contains gamma (n_u, n_u) and the covariances C (n_y, n_y) of
    the outputs.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    G : (F,) or (n_y, n_u, F) complex ndarray
        The best linear approximation [unit of y over unit of u].
    lines : LineGrid
        Excited lines, and detection lines (lines left without excitation to show the distortion).
    fs : float
        Sampling frequency [Hz].
    experiment : Experiment
        Grid, number of periods and of realisations (draws of the random phases) of the measurement.
    level_source : str
        Source of the distortion variance: "detection" (output on the detection lines), "roughness"
        (scatter of the FRF between neighbouring lines), "realizations" (scatter over M >= 2
        realisations), or "realizations and detection". A `Bla` from an FRF has "std" or
        "coherence".
    dof : (F,) ndarray
        Complex degrees of freedom of the variance in the bound.
    grid_factor : (F,) ndarray
        Factor from the mean variance on the detection lines near an excited line to the variance on
        that line. Ones if no detection lines were used.
    levels : DistortionLevels, or a tuple of them, one per output
        Output amplitudes on the excited and the detection lines.
    cov : Covariances
        Covariances due to noise and due to distortion, and the covariance that the bound uses.
    typical : float
        Distortion power expected for random phases, divided by that expected for the phases of the
        record. An input with low peaks excites less distortion. The ratio is computed for a cubic
        nonlinearity and lies between 1 and 3. Its square, which fits a fifth power, is used in two
        cases: if the peaks are lower than those of 19 in 20 realisations, and if the record has
        fewer than 27 lines. With fewer than 27 lines the number lies between 0.6 and 6. For several
        inputs it is the mean over the inputs.
    coherence : (F,) ndarray
        Fraction of the output power that is linear in the input, for noise excitation
        (`identify_noise`). nan for periodic records.
    hold : str
        Inputs between their samples, as in `Record`. With "zoh" G includes the zero-order hold over
        1/fs.
    inputs, outputs, input_units, output_units : tuple of str
        Names and units of the channels, as in `Record`.
    warnings : tuple of str
        Text of each `DataWarning` issued for the record and during its identification.

    Raises
    ------
    ValueError
        The shapes of the fields do not fit each other.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.7, 3.4,
    3.7 and 4.3; C. G. Khatri, *Distribution of the largest or the smallest characteristic root
    under null hypothesis concerning complex multivariate normal populations*, Ann. Math. Statist.
    35, 1964.

    Examples
    --------
    y = 2 u + 0.1 u^3, with u near Gaussian of variance 1: its BLA is nearly 2 + 3 * 0.1.

    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=2)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> bla = nlfrf.identify(record)
    >>> bool(np.all(np.abs(bla.G - 2.3) < bla.bound(simultaneous=True)))
    True

    Two inputs and two outputs, with 0.1 u_1^3 in the first output.

    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)                       # two periods
    >>> y = np.stack([2 * u[0] + 0.1 * u[0] ** 3 + u[1], u[1]])
    >>> bla = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines))
    >>> bla.G.shape, bool(np.all(np.abs(bla.G[0, 0] - 2.3) < bla.bound(simultaneous=True)[0, 0]))
    ((2, 2, 26), True)
    """

    f: np.ndarray
    G: np.ndarray
    lines: LineGrid
    fs: float
    experiment: Experiment
    cov: Covariances
    dof: np.ndarray
    level_source: str
    grid_factor: np.ndarray
    # one, or a tuple with one per output: a union would force every reader of the field to cast
    levels: Any
    typical: float = 1.0
    coherence: ArrayField = None
    hold: str = "unknown"
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        channels = self.G.shape[:-1] if self.G.ndim == 3 else ()
        n_y, n_u = channels or (1, 1)
        F, held, levels = self.f.size, self.__dict__, as_list(self.levels)
        if len(levels) != n_y:
            raise ValueError(f"levels must be one per output, {n_y} of them, got {len(levels)}")
        if channels == (1, 1):
            held["G"], channels = self.G[0, 0], ()
        if not channels:
            held["levels"] = levels[0]
        if self.coherence is None:
            held["coherence"] = freeze_array(np.full(F, np.nan))
        self._name_channels(
            (n_u, n_y), (self.inputs, self.outputs), (self.input_units, self.output_units)
        )
        shapes: dict[str, tuple[int, ...]] = {"G": (*channels, F)}
        shapes |= (
            dict.fromkeys(_PER_LINE, (F,))
            | dict.fromkeys(_COVARIANCES, (n_y, n_y, F))
            | {"gamma": (n_u, n_u, F)}
        )
        for name, shape in shapes.items():
            array = getattr(self if name in held else self.cov, name)
            if array.shape != shape or array.dtype.kind not in "fiuc":
                raise ValueError(
                    f"{name} must be numbers of shape {shape}, for {n_y} outputs, {n_u} inputs and"
                    f" {F} lines, got shape {array.shape}"
                )

    @property
    def matrix(self) -> np.ndarray:
        """(n_y, n_u, F) complex ndarray: G with axes of channels, also for one input and one
        output.
        """
        return self.G.reshape(self.n_outputs, self.n_inputs, self.f.size)

    @property
    def var_noise(self) -> np.ndarray:
        """(F,) or (n_y, n_u, F) variance of G due to noise; nan for one period."""
        return self.entries(self.cov.noise)

    @property
    def var_total(self) -> np.ndarray:
        """(F,) or (n_y, n_u, F) variance of G due to noise and distortion; always finite."""
        return self.entries(self.cov.total)

    @property
    def var_distortion(self) -> np.ndarray:
        """(F,) or (n_y, n_u, F) variance, due to distortion, of the FRF of one realisation (draw of
        the random phases) about the BLA.

        It does not decrease with the number of realisations. For one period it contains the noise.
        """
        return self.experiment.n_realizations * self.entries(self.cov.distortion)

    @property
    def var_even(self) -> np.ndarray:
        """(F,) or (n_y, n_u, F) variance of the FRF of one realisation (draw of the random phases)
        due to even distortion and noise.

        It is estimated on even lines without excitation, and is nan if there are none.
        """
        return self.experiment.n_realizations * self.entries(self.cov.even)

    @property
    def var_bound(self) -> np.ndarray:
        """(F,) or (n_y, n_u, F) variance in the bound: |G - G_BLA|^2 / var_bound ~ F(2, 2 dof).

        A statistical model estimates it from lines without excitation, from the scatter of G
        between lines, and from the scatter over realisations (docs/guide/distortion.md). This
        variance and `dof` are chosen so that the F distribution has the 95 % and 99.9 % quantiles
        of that model.
        """
        return self.entries(self.cov.bound)

    def entries(self, cov: np.ndarray) -> np.ndarray:
        """Return (F,) or (n_y, n_u, F) variances of the entries of G, from a covariance of the
        outputs (n_y, n_y, F).
        """
        every = np.einsum("jjk->jk", cov).real[:, None] * np.einsum("iik->ik", self.cov.gamma).real
        return np.asarray(every.reshape(self.G.shape))

    @property
    def omega(self) -> np.ndarray:
        """(F,) excited frequencies [rad/s]."""
        return 2 * np.pi * self.f

    @property
    def unit(self) -> str:
        """Unit of G for one input and one output, that of y over that of u; empty if neither is
        known.
        """
        return ratio_unit(self.y_unit, self.u_unit)

    @property
    def upper_limit(self) -> np.ndarray:
        """(F,) or (n_y, n_u, F) bool: True where the distortion is below the noise, so that its
        variance is an upper limit.
        """
        noise = np.apply_along_axis(local_mean, -1, np.nan_to_num(self.var_noise), 13)
        return np.asarray(self.var_total < 2 * noise)

    def covariance_of(self, of: str) -> np.ndarray:
        """Return the (n_y, n_y, F) covariance of the outputs in one experiment, as `bound` uses it.

        `of` is "bla" or "realization", as in `bound`.
        """
        require_choice("of", of, ("bla", "realization"))
        if of == "bla":
            return self.cov.bound
        if self.f.size >= FEW_LINES:
            missing = _SMOOTH_SHARE.get(self.level_source.split()[-1], 0.0)
        else:
            missing = 0.0
        new = (self.experiment.n_realizations + missing) * self.typical
        share = np.sqrt(new * np.atleast_2d(self.distorted_share()))
        return self.cov.bound * (1 + share[:, None] * share)

    def bound(
        self, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False
    ) -> np.ndarray:
        """Return the radius of the disc around G, or around each entry of G, that contains the true
        FRF.

        For a set that contains the whole matrix G, use `block`.

        Parameters
        ----------
        confidence : float
            Probability, strictly between 0 and 1.
        of : str
            "bla": the disc contains the best linear approximation. "realization": the disc contains
            the FRF for new random phases of the same excitation. Use "realization" for control,
            because signals in a loop have other phases.
        simultaneous : bool
            False: the probability holds on each line, so at 95 % the true FRF is outside on about
            one line in twenty. True: the probability holds for all lines and all entries together.

        Returns
        -------
        (F,) or (n_y, n_u, F) ndarray
            Radius, in the unit of G: sqrt(F_p var), with F_p the p-quantile of F(2, 2 dof).

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 2.4 and 4.3.
        """
        quantile = self.f_quantile(confidence, simultaneous=simultaneous)
        return np.sqrt(quantile * self.entries(self.covariance_of(of)))

    def block(
        self, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return `left` and `right` of the set {G + left Delta right, sigma_max(Delta) <= 1}, which
        contains the true matrix.

        C is the covariance that `covariance_of` returns, gamma the field `cov.gamma`, and dG the
        error of G. The largest singular value of C^-1/2 dG gamma^-1/2 has a known distribution
        (Roy's largest root). Below, x_p is the quantile of the square of this singular value at
        probability `confidence`.

        Parameters
        ----------
        confidence, of, simultaneous
            As in `bound`.

        Returns
        -------
        left, right : (n_y, n_y, F), (n_u, n_u, F) complex ndarray
            Factors with left left^H = x_p C and right^H right = gamma.
        """
        p = require_probability("confidence", confidence)
        if simultaneous:
            p = p ** (1 / self.f.size)
        x = np.array([roy_quantile(p, self.n_outputs, self.n_inputs, float(L)) for L in self.dof])
        return (
            np.sqrt(x) * hermitian_sqrt(self.covariance_of(of)),
            np.swapaxes(hermitian_sqrt(self.cov.gamma), 0, 1).conj(),
        )

    def f_quantile(self, confidence: float = 0.95, *, simultaneous: bool = False) -> np.ndarray:
        """Return the quantile of |G - G_BLA|^2 / var_bound, which has the distribution F(2, 2 dof).

        Parameters
        ----------
        confidence : float
            Probability, strictly between 0 and 1.
        simultaneous : bool
            True: the quantile holds for all lines (and all entries) together.

        Returns
        -------
        (F,) ndarray
            Quantile on each line. At 95 % it is 3.00 for a known variance and 3.89 for six complex
            degrees of freedom.

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 2.4 and 4.3.
        """
        p = require_probability("confidence", confidence)
        if simultaneous:
            p = p ** (1 / self.G.size)
        # L ((1 - p)^(-1/L) - 1), by expm1 so that large L do not cancel
        return np.asarray(self.dof * np.expm1(-np.log1p(-p) / self.dof))

    def distorted_share(self) -> np.ndarray:
        """Return the (F,) or (n_y, F) fraction of `var_bound` that is due to distortion.

        The fraction comes from the total variance minus the noise variance. Where noise dominates,
        this difference is negative on about half of the lines. So it is averaged over nine lines,
        and increased by an allowance for its scatter. A single line with a larger fraction keeps
        its own value.
        """
        noise = diagonal(np.nan_to_num(self.cov.noise))
        if not noise.any():
            return self._by_output(np.ones_like(noise))
        total = diagonal(self.cov.total if self.experiment.n_realizations == 1 else self.cov.bound)
        dof_noise = self.experiment.n_experiments * max(self.experiment.n_periods - 1, 1)
        weight = 1 / np.maximum(total + noise, TINY)
        n = SMOOTHING_LINES
        smoothed = local_mean(noise * weight, n) / np.maximum(local_mean(total * weight, n), 1e-300)
        smoothed = 1 - smoothed * (1 - np.sqrt(1 / self.dof + 1 / (n * dof_noise)) / 3)
        by_line = noise / np.maximum(total, TINY)
        by_line = 1 - by_line - 2 * np.sqrt(1 / self.dof + by_line**2 / dof_noise)
        return self._by_output(np.clip(np.maximum(smoothed, by_line), 0.0, 1.0))

    def _by_output(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (n_y, F) with the axes of G except that of the inputs."""
        return rows.reshape(*self.G.shape[:-2], self.f.size)

    def systematic(self, decibels: float = 8.0) -> np.ndarray:
        """Estimate the order of magnitude of |G_BLA - G_0|, G_0 being the FRF without the
        nonlinearity.

        This is a rule of thumb and not a bound.

        Parameters
        ----------
        decibels : float
            Assumed ratio of |G_BLA - G_0| |U| to the output amplitude on odd lines without
            excitation [dB]. For a static cubic and the default grid of `nlfrf.multisine` it is 7.7
            dB. For friction near a resonance it is larger.

        Returns
        -------
        (F,) or (n_y, n_u, F) ndarray
            Estimate of |G_BLA - G_0|, in the unit of G.

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 3.4.
        """
        return np.asarray(
            10 ** (require_real("decibels", decibels) / 20)
            * np.sqrt(self.var_distortion / self.grid_factor)
        )

    def entry(self, output: int, input: int) -> Bla:
        """Return one entry of the matrix as a `Bla` with one input and one output."""
        j, i = require_integer("output", output, least=0), require_integer("input", input, least=0)
        if j >= self.n_outputs or i >= self.n_inputs:
            raise ValueError(
                f"output and input must be below {self.n_outputs} and {self.n_inputs}, got {output}"
                f" and {input}"
            )
        if self.is_single:
            return self
        cov = self.cov.map(lambda part: part[j : j + 1, j : j + 1].real)
        left = np.maximum(cov.total - np.nan_to_num(cov.noise), 0.0)
        cov = replace(cov, gamma=self.cov.gamma[i : i + 1, i : i + 1].real, distortion=left)
        return replace(
            self,
            G=self.G[j, i],
            cov=cov,
            levels=self.levels[j],
            inputs=self.inputs[i : i + 1],
            outputs=self.outputs[j : j + 1],
            input_units=self.input_units[i : i + 1],
            output_units=self.output_units[j : j + 1],
        )

    def every(self, step: int) -> Bla:
        """Return the `Bla` on every `step`-th excited line."""
        some = slice(None, None, require_integer("step", step, least=1))
        cov = replace(self.cov.map(lambda part: part[..., some]), gamma=self.cov.gamma[..., some])
        levels = [
            replace(
                one,
                **{
                    name: getattr(one, name)[..., some]
                    for name in ("f_excited", "excited", "noise_excited")
                },
            )
            for one in as_list(self.levels)
        ]
        lines = replace(self.lines, excited=self.lines.excited[some])
        kept = {name: getattr(self, name)[..., some] for name in ("G", *_PER_LINE)}
        return replace(
            self,
            lines=lines,
            cov=cov,
            levels=tuple(levels),
            **kept,
        )

    def times(self, factor: np.ndarray, *, output_unit: str | Sequence[str] | None = None) -> Bla:
        """Return the `Bla` with G multiplied by a factor (F,), and its variances by the squared
        modulus of the factor.

        The output amplitudes in `levels` stay as measured.

        Parameters
        ----------
        factor : (F,) ndarray
            One number per line: -1/omega**2 turns acceleration into position.
        output_unit : str, or one per output, optional
            Unit of the output after multiplication. For a factor without a unit, give the present
            `output_units`. It may be left out if no unit is known, or if the factor has modulus 1.

        Raises
        ------
        ValueError
            `output_unit` is missing, although the unit of the output is known and the factor may
            change it.

        Examples
        --------
        >>> import nlfrf
        >>> f = np.arange(1.0, 21.0)
        >>> units = {"input_units": ["N"], "output_units": ["m/s2"]}
        >>> acceleration = nlfrf.bla_from_frf(f, 2.0 + 0j * f, std=0.1, **units)
        >>> position = acceleration.times(-1 / acceleration.omega**2, output_unit="m")
        >>> acceleration.unit, position.unit
        ('m/s2/N', 'm/N')
        """
        square = np.abs(factor) ** 2
        if output_unit is None and any(self.output_units) and not np.allclose(square, 1.0):
            raise ValueError(
                "output_unit must be given, as the factor may change the unit of"
                f' {", ".join(self.output_units)}: output_unit="m" if it makes metres of an'
                " acceleration, output_unit=bla.output_units for a ratio"
            )
        units = self.output_units if output_unit is None else as_names(output_unit)
        return replace(
            self,
            G=self.G * factor,
            output_units=units,
            cov=self.cov.map(lambda part: part * square),
        )

    def roughness(self) -> np.ndarray:
        """Estimate the variance of G from its scatter between neighbouring lines, to compare with
        `var_total`.

        This estimate uses the excited lines only. It is too high where G itself varies within a few
        lines, as at a sharp resonance. It does not contain distortion that is smooth over
        frequency.

        Returns
        -------
        (F,) ndarray
            Variance, in the unit of G squared. It is nan for fewer than five lines, and for noise
            excitation, because there neighbouring estimates share data.

        Raises
        ------
        ValueError
            The `Bla` has several inputs or outputs.

        References
        ----------
        Pintelon & Schoukens, 2nd ed., 7.2.2 (local polynomials).
        """
        require_one_channel("bla", self, "; take entry(output, input)")
        if self.f.size < MIN_FIT_LINES or np.isfinite(self.coherence).any():
            return np.full(self.f.size, np.nan)
        return fit_locally(
            self.G[None], np.ones((1, self.f.size)), index=index_lines(self.lines)
        ).variance[0]

    def __str__(self) -> str:
        """Describe the result in a few lines."""
        if not self.is_single:
            return _describe_matrix(self)
        about = (
            f"BLA on {self.f.size} lines from {self.f[0]:g} to {self.f[-1]:g} Hz,"
            f" {self.experiment.grid} grid, {format_count(self.experiment.n_realizations, 'realisation')},"
            f" {format_count(self.experiment.n_periods, 'period')}\n"
        )
        gain = np.abs(self.G)
        peak, there = int(np.argmax(gain)), gain > 0
        if not there.any():
            return about + "  G is zero on every line: no part of the output is linear in the input"
        relative, power = np.median(self.bound()[there] / gain[there]), np.median(gain[there]) ** 2
        noise = np.nan_to_num(self.experiment.n_realizations * self.var_noise)
        found = "distortion" if np.isfinite(self.var_noise).any() else "distortion and noise"
        levels = {
            "noise": np.median(noise),
            f"{found} of one realisation": np.median(self.var_distortion),
            f"even {found}": np.median(np.maximum(np.nan_to_num(self.var_even) - noise, 0.0)),
        }
        hidden = int(self.upper_limit.sum())
        source = _SOURCES.get(self.level_source, self.level_source)
        if np.isfinite(self.coherence).any():
            source += f", {np.nanmedian(self.coherence):.2g} in the median"
        parts = [f"{name} {10 * np.log10(v / power):.0f} dB" for name, v in levels.items() if v > 0]
        return (
            f"{about}  largest |G| {gain[peak]:.4g}{f' {self.unit}' * bool(self.unit)} at"
            f" {self.f[peak]:g} Hz; 95 % bound {100 * relative:.2g} % of |G| in the median\n"
            f"  relative to the median |G|: {', '.join(parts) or 'nothing above rounding'}\n  transient:"
            f" {self.experiment.transient}; distortion estimated from {source}"
            + (
                f"; on {hidden} lines distortion is below the noise, and its value is an upper"
                " limit"
                if hidden
                else ""
            )
            + (f"; {format_count(len(self.warnings), 'warning')}" if self.warnings else "")
        )


@value(copy=False)
class DistortionLevels:
    """Output amplitudes on the excited lines and on the odd and even detection lines.

    Fields
    ------
    f_excited, f_odd, f_even : (F,), (O,), (E,) ndarray
        Frequencies of the excited lines, of the odd and of the even detection lines [Hz].
    excited, odd, even : (M, F), (M, O), (M, E) complex ndarray
        Complex output amplitudes of each realisation, averaged over periods [unit of y]. If the
        input is not zero on a detection line, the linear response is subtracted there: Y - G U.
    noise_excited, noise_odd, noise_even : (F,), (O,), (E,) ndarray
        Standard deviation of these amplitudes due to noise [unit of y]; nan for one period.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3.

    Examples
    --------
    A cubic nonlinearity distorts odd lines only; even lines contain rounding errors.

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


def levels_without_detection(f: np.ndarray, excited: np.ndarray) -> DistortionLevels:
    """Return the levels of amplitudes (F,) of one realisation on excited lines, without detection
    lines.
    """
    none = np.zeros(0)
    return DistortionLevels(
        f_excited=f,
        f_odd=none,
        f_even=none,
        excited=excited[None].astype(complex),
        odd=none[None].astype(complex),
        even=none[None].astype(complex),
        noise_excited=np.full(f.size, np.nan),
        noise_odd=none,
        noise_even=none,
    )


def _describe_matrix(bla: Bla) -> str:
    """Describe each entry of the matrix in one line."""
    gain, made = np.abs(bla.G), bla.experiment
    rows = [
        f"FRF matrix of {bla.n_outputs} outputs by {bla.n_inputs} inputs on {bla.f.size} lines from"
        f" {bla.f[0]:g} to {bla.f[-1]:g} Hz, {made.design} {made.grid},"
        f" {format_count(made.n_realizations, 'set')} of experiments,"
        f" {format_count(made.n_experiments, 'experiment')}, {format_count(made.n_periods, 'period')}"
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = _median_over_lines(bla.bound() / gain)
        distortion = 10 * np.log10(_median_over_lines(bla.var_distortion / gain**2))
        noise = 10 * np.log10(_median_over_lines(made.n_realizations * bla.var_noise / gain**2))
    has_noise = np.isfinite(bla.var_noise).any()  # a single period does not show noise
    for j, out in enumerate(bla.outputs):
        for i, name in enumerate(bla.inputs):
            k = int(gain[j, i].argmax())
            rows.append(
                f"  {out} by {name}: largest |G| {gain[j, i, k]:.4g} at {bla.f[k]:g} Hz; 95 % "
                f"bound {100 * relative[j, i]:.2g} % of |G|; relative to |G|: "
                + (
                    f"noise {noise[j, i]:.0f} dB, distortion"
                    if has_noise
                    else "distortion and noise"
                )
                + f" {distortion[j, i]:.0f} dB"
            )
    if bla.warnings:
        warned = f"; {format_count(len(bla.warnings), 'warning')}"
    else:
        warned = ""
    rows.append(
        f"  medians over lines, for one set of experiments; transient: {made.transient}; distortion"
        f" estimated from {_SOURCES.get(bla.level_source, bla.level_source)}{warned}"
    )
    return "\n".join(rows)


def _median_over_lines(share: np.ndarray) -> np.ndarray:
    """Return the (n_y, n_u) median over lines of shares of |G|, 0 / 0 counted as 0."""
    return np.asarray(np.median(np.nan_to_num(share, nan=0.0, posinf=np.inf), axis=2))
