"""Summaries of the records behind a set: the FRF on its lines, and its variance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf import Bla
from nlfrf._base.values import value

#: Parts of the radius of a set.
PARTS = ("noise", "odd", "even", "misfit", "level", "systematic")
WINDOW = 13  # lines over which a level relative to |G| is averaged
LEVEL_DOF = 14.0  # complex degrees of freedom of the average
#: Divided by the number of lines: variance of the part of a realisation's log distortion power that
#: all lines share. Measured: 1 for a saturation, 7 for the rig with friction, 16 for a cube, 50 for
#: a fifth power.
FEW_LINES = 8.0
_MAX_DOF = 1e6  # stands for infinity, which a file cannot hold


@value
class RecordLevel:
    """Level at which the FRF of a record holds.

    Fields
    ------
    rms_u, rms_y : float
        Rms of the input and of the output on the excited lines [unit of u, unit of y].
    """

    rms_u: float
    rms_y: float


@value
class RecordSummary:
    """The FRF of one record and its likely scatter, for any number of channels. The first axis of
    every array is over the lines.

    Fields
    ------
    omega : (F,) ndarray
        Lines [rad/s].
    G : (F,) or (F, n_y, n_u) complex ndarray
        The FRF, which includes the hold of the model if the model has one.
    variance : (F,) ndarray, or (F, n_y, n_y) complex ndarray
        Variance of G around the BLA. For several channels the covariance C over outputs: an error
        of G is C^1/2 Z gamma^1/2 with Z white.
    gamma : (F, n_u, n_u) complex ndarray or None
        Covariance over inputs, for several channels.
    dof : (F,) ndarray or None
        Complex degrees of freedom behind the covariance, for several channels.
    scatter : (F,) ndarray or None
        Variance of the FRF of one realisation around the BLA by distortion, without noise; for one
        channel.
    confirmed : float
        Median ratio of `variance` to the variance behind `Bla.bound`. It is below one if G scatters
        less between neighbouring lines than the distortion level predicts; one for several channels.
    level : RecordLevel or None
        Rms of input and output; None if they are unknown, as for several channels.

    Notes
    -----
    For one channel the distortion level is averaged over thirteen lines. If G scatters less between
    neighbouring lines than this level predicts, the variance is taken from the scatter between
    lines. A bound uses the larger of two estimates of the level, which is too large for a
    prediction.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> summary = summarize_record(nlfrf.identify(record))
    >>> summary.confirmed <= 1, bool(np.all(summary.variance > 0))
    (True, True)
    """

    omega: np.ndarray
    G: np.ndarray
    variance: np.ndarray
    confirmed: float
    gamma: np.ndarray | None = None
    dof: np.ndarray | None = None
    scatter: np.ndarray | None = None
    level: RecordLevel | None = None

    @property
    def is_single(self) -> bool:
        """Return whether the record has one input and one output."""
        return self.G.ndim == 1

    def on_lines(self, omega: np.ndarray) -> RecordSummary:
        """Return the record on other lines, interpolated in log magnitude and phase."""
        if omega.size == self.omega.size and np.allclose(omega, self.omega, rtol=1e-9, atol=0):
            return self

        def between(x: np.ndarray) -> np.ndarray:
            rows = np.reshape(x, (self.omega.size, -1)).T
            return np.array([np.interp(omega, self.omega, row) for row in rows]).T.reshape(
                -1, *x.shape[1:]
            )

        log = np.log(np.maximum(np.abs(self.G), 1e-300)) + 1j * np.unwrap(np.angle(self.G), axis=0)
        gamma, dof, scatter = (
            None if x is None else between(x) for x in (self.gamma, self.dof, self.scatter)
        )
        G, variance = np.exp(between(log)), between(self.variance)
        return replace(
            self, omega=omega, G=G, variance=variance, gamma=gamma, dof=dof, scatter=scatter
        )


@value
class RecordHold:
    """Course of the inputs of a record between two samples.

    Fields
    ------
    kind : str
        As `Bla.hold`: "zoh" (a hold of 1/fs, which the FRF contains), "band-limited" (no hold), or
        "unknown".
    fs : float
        Sampling frequency of the record [Hz], as `Bla.fs`; nan for an FRF that came without one.
    """

    kind: str
    fs: float


@value
class Origin:
    """Source of an uncertainty set: its records, and its assumption outside the measured band.

    Fields
    ------
    source : str
        Description of the measurement.
    extrapolation : str
        Description of the assumption outside the measured band.
    delay : float
        Delay that the nominal contains [s], for information.
    omega_c : float
        Crossover [rad/s] of the loop for which the nominal was fitted; nan if none was given.
    hold : RecordHold or None
        Hold of the inputs of the record, with its sampling frequency; None without a record.
    unit : str
        Unit of y over u, for one channel.

    Examples
    --------
    >>> Origin(source="a drawing", unit="m/N").extrapolation
    'not stated'
    """

    source: str = "not stated"
    extrapolation: str = "not stated"
    delay: float = 0.0
    omega_c: float = float("nan")
    hold: RecordHold | None = None
    unit: str = ""


@value
class JointProbability:
    """Estimated probability that a whole FRF lies in a set, all its lines together.

    Fields
    ------
    frf : float
        For the FRF of another realisation (for several channels: of another set of experiments).
    bla : float
        For the best linear approximation.
    """

    frf: float
    bla: float


def summarize_record(bla: Bla, recorded: Bla | None = None) -> RecordSummary:
    """Return the summary of a record that a set keeps.

    recorded : the record before a hold was put into G, which gives the level of the input; bla when
    not given.
    """
    if not bla.is_single:
        G, C, gamma = (np.moveaxis(x, 2, 0) for x in (bla.G, bla.cov.bound, bla.cov.gamma))
        return RecordSummary(
            omega=bla.omega,
            G=G,
            variance=C,
            confirmed=1.0,
            gamma=gamma,
            dof=np.minimum(bla.dof, _MAX_DOF),
        )
    # relative to |G|, which a level follows across a resonance, except where G itself is below its
    # scatter
    size = np.maximum(np.abs(bla.G) ** 2 + bla.var_bound, np.finfo(float).tiny ** 0.5)
    level, rough = _window_mean(bla.var_bound / size), _window_mean(bla.roughness() / size)
    ratio = np.divide(rough, level, out=np.ones(level.size), where=level > 0)
    share = np.minimum(np.where(np.isfinite(ratio), ratio, 1.0), 1.0)
    variance = level * share * size
    return RecordSummary(
        omega=bla.omega,
        G=bla.G,
        variance=variance,
        scatter=bla.experiment.n_realizations * bla.distorted_share() * variance,
        confirmed=float(np.median(share)),
        level=level_of_record(bla if recorded is None else recorded),
    )


def level_of_record(bla: Bla) -> RecordLevel | None:
    """Return the rms of input and output on the excited lines, from the mean power over
    realisations; None if unknown.

    A Bla contains Y but not U. Realisations have one amplitude |U|, so the mean of |Y / U|^2 is
    |G|^2 + (M - 1) times the variance of their mean. For noise, the coherence is the share of G U
    in |Y|^2.
    """
    Y = bla.levels.excited
    if Y.shape[-1] != bla.f.size or np.isnan(Y).any():
        return None
    power_y = np.mean(np.abs(Y) ** 2, axis=0) / 2
    linear = np.where(np.isfinite(bla.coherence), bla.coherence, 1.0)
    gain = np.abs(bla.G) ** 2 + (bla.experiment.n_realizations - 1) * bla.var_total
    # the input of a line without response is unknown
    power_u = np.divide(power_y * linear, gain, out=np.zeros(gain.size), where=gain > 0)
    return RecordLevel(rms_u=float(np.sqrt(power_u.sum())), rms_y=float(np.sqrt(power_y.sum())))


def _window_mean(x: np.ndarray) -> np.ndarray:
    """Return the (F,) mean over the window around each line, one-sided at the ends."""
    half = WINDOW // 2
    weights = np.convolve(np.ones(x.size), np.ones(2 * half + 1))[half:-half]
    return np.asarray(np.convolve(x, np.ones(2 * half + 1))[half:-half] / weights)


def format_probability(p: float) -> str:
    """Format an estimated probability with as many digits as the estimate supports."""
    if p > 0.99:
        return "over 99 %"
    if p < 0.01:
        return "under 1 %"
    return f"about {100 * p:.0f} %"
