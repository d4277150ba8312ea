"""A `Bla` from an FRF that an analyser, a stepped sine or another program measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    data_warning,
    keep_warnings,
    require_choice,
    require_positive,
    require_real,
    require_real_array,
)
from nlfrf.bla.bla import Bla, Covariances, Experiment, levels_without_detection
from nlfrf.signals.lines import LineGrid

#: Complex degrees of freedom of a known variance: its F quantile equals that of a chi-square to
#: 1e-6.
_KNOWN_DOF = 1e6
# largest relative variation of a real gain: one that varies more has a phase
_MAX_GAIN_VARIATION = 0.01
# difference of a coherence from 1 up to which digits were lost in its computation, not in its file
_ROUNDING = 1e-6
_MAX_RAISED_STD = 2.0  # factor on a standard deviation of an entry up to which no warning is given


@keep_warnings
def bla_from_frf(
    f: np.ndarray,
    G: np.ndarray,
    *,
    std: ArrayLike | None = None,
    coherence: ArrayLike | None = None,
    n_averages: float | None = None,
    fs: float | None = None,
    hold: str = "unknown",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    input_units: Sequence[str] = (),
    output_units: Sequence[str] = (),
) -> Bla:
    """Make a `Bla` (FRF with a bound) from an FRF and its standard deviation or coherence.

    Use this if you have an FRF of an analyser instead of a record. The variance contains whatever
    differs between the averages, noise and distortion together, which cannot be separated.

    - `bound()` contains the FRF that the same measurement would give after infinite averaging.
    - `bound(of="realization")`, which `robust.uncertainty` uses, contains another FRF measured in the
      same way.

    Neither contains an error that repeats in every average. Examples are the distortion of a
    stepped sine or of one multisine, and a wrong sensor calibration.

    Parameters
    ----------
    f : (F,) ndarray
        Frequencies [Hz], positive and increasing, equally spaced or not.
    G : (F,) or (n_y, n_u, F) complex ndarray
        The FRF, for one channel or for several. It must be complex: a magnitude alone has no phase.
    std : float, or (F,) or (n_y, n_u, F) ndarray, optional
        Standard deviation of the complex number G, sqrt(E|G - E G|^2), in the unit of G. It is
        sqrt(2) times the standard deviation of the real part. For averaged measurements, give the
        standard deviation of the average. Without `n_averages` it is taken as exactly known, with
        `n_averages` as estimated from so many averages.
    coherence : float, or (F,) or (n_y, n_u, F) ndarray, optional
        Ordinary coherence, above 0 and up to 1, for G = S_yu / S_uu over `n_averages` averages.
        Several inputs must have been excited one after the other. The variance is (1 - coherence) /
        coherence |G|^2 / (n_averages - 1), with n_averages - 1 complex degrees of freedom.
    n_averages : float, optional
        Number of independent averages. Count each of half-overlapping Hann segments as 0.95. At
        least 2 with `coherence`.
    fs : float, optional
        Sampling frequency [Hz]; needed if `hold` is "zoh".
    hold : str
        Input between its samples, as in `Record`: "zoh", "band-limited" or "unknown".
    inputs, outputs, input_units, output_units : sequence of str
        Names and units of the channels, as in `Record`.

    Returns
    -------
    Bla
        Its `level_source` is "std" or "coherence", and its grid "given". Unknown values are nan:
        `var_noise`, `var_even`, the amplitudes in `levels`, and `fs` if it was not given.
        `n_samples` is 0. For several channels the variance of each entry must be a product of a
        factor of its output and a factor of its input. If the given variances are not, they are
        increased until they are, and the errors of the entries are taken as independent.

    Raises
    ------
    ValueError
        G is real; `std` and `coherence` are both given or both missing; shapes do not fit;
        frequencies do not increase; `coherence` is given without `n_averages`, or is 1 on every
        line.

    Warns
    -----
    DataWarning
        The imaginary part of G is zero on every line, as if the phase were missing. The coherence
        is rounded to 1 on some lines. For several channels, a standard deviation was more than
        doubled to make the variances products of factors.

    References
    ----------
    Bendat & Piersol, *Random Data*, 4th ed., 9.2; Pintelon & Schoukens, 2nd ed., 2.5.

    Examples
    --------
    >>> f = np.geomspace(1, 100, 30)
    >>> G = 1 / (1 + 0.1j * f)
    >>> bla = bla_from_frf(f, G, std=0.01 * np.abs(G))
    >>> round(float(bla.bound()[0] / np.abs(G[0])), 4)                  # sqrt(3) times 1 %
    0.0173
    >>> bla = bla_from_frf(f, G, coherence=0.99, n_averages=20)
    >>> round(float(bla.bound()[0] / np.abs(G[0])), 4)
    0.0415
    """
    f, G = _checked_frf(f, G)
    variance, dof = _entry_variances(G, std=std, coherence=coherence, n_averages=n_averages)
    rate = _checked_rate(fs, hold)
    several = G.ndim == 3
    n_y, n_u = G.shape[:-1] or (1, 1)
    # noise and distortion cannot be separated: the scatter counts as the total
    levels = levels_without_detection(f, np.full(f.size, np.nan))
    if coherence is None or several:
        measured_coherence = None
    else:
        measured_coherence = np.broadcast_to(coherence, f.shape).astype(float)
    return Bla(
        f=f,
        G=G,
        lines=LineGrid(excited=np.arange(1, f.size + 1), odd=[], even=[]),
        experiment=Experiment(
            grid="given", design="FRF", n_samples=0, n_experiments=n_u, transient="unknown"
        ),
        cov=_covariances(variance.reshape(n_y, n_u, f.size)),
        dof=np.full(f.size, dof),
        level_source="std" if coherence is None else "coherence",
        fs=rate,
        hold=hold,
        grid_factor=np.ones(f.size),
        levels=(levels,) * n_y if several else levels,
        coherence=measured_coherence,
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        input_units=tuple(input_units),
        output_units=tuple(output_units),
    )


def _checked_frf(f: np.ndarray, G: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and a complex FRF of fitting shapes; refuse others, and warn of an FRF
    without a phase.
    """
    f, G = require_real_array("f", f, ndim=1), np.asarray(G)
    if G.dtype.kind not in "fiuc" or not np.isfinite(G).all():
        raise ValueError(
            "G must hold finite complex numbers; leave out the lines where nothing was measured"
        )
    if f.size == 0 or f[0] <= 0 or np.any(np.diff(f) <= 0):
        raise ValueError(
            "f must be positive and increasing frequencies [Hz]; sort the lines by frequency"
        )
    if G.ndim not in (1, 3) or G.shape[-1] != f.size:
        raise ValueError(
            f"G must have the shape ({f.size},) or (n_y, n_u, {f.size}) to match f, got {G.shape}"
        )
    if G.dtype.kind != "c":
        raise ValueError(
            f"G must be complex, got real numbers from {G.min():.4g} to {G.max():.4g}, which have"
            " no phase: use 10**(dB/20) * np.exp(1j*np.radians(degrees)) for decibels and degrees,"
            " magnitude * np.exp(1j*phase) for a magnitude, G + 0j for a gain without phase"
        )
    if (
        not G.imag.any()
        and np.ptp(G.real, axis=-1).max() > _MAX_GAIN_VARIATION * np.abs(G.real).max()
    ):
        data_warning(
            "G is real on every line and varies, as if its phase were missing, or as if it were in"
            " decibels: every model of it is then wrong; give G with its phase"
        )
    return f, G.astype(complex)


def _checked_rate(fs: float | None, hold: str) -> float:
    """Return the sampling frequency [Hz], nan for none; refuse a hold without one."""
    require_choice("hold", hold, ("zoh", "band-limited", "unknown"))
    if hold == "zoh" and fs is None:
        raise ValueError('fs must be given if hold is "zoh": G includes the hold of 1/fs')
    if fs is None:
        return np.nan
    return require_positive("fs", fs)


def _covariances(variance: np.ndarray) -> Covariances:
    """Return the covariances for variances (n_y, n_u, F) of the entries.

    A Bla has Cov(vec G) = gamma (x) cov, so the variances need to be a product.
    """
    n_y, n_u = variance.shape[:2]
    of_output, of_input = _bound_by_product(variance)
    cov = np.einsum("jf,jk->jkf", of_output, np.eye(n_y)).astype(complex)
    nan = np.full(cov.shape, np.nan, dtype=complex)
    return Covariances(
        gamma=np.einsum("if,ij->ijf", of_input, np.eye(n_u)).astype(complex),
        noise=nan,
        total=cov,
        distortion=cov,
        even=nan,
        bound=cov,
    )


def _entry_variances(
    G: np.ndarray, *, std: ArrayLike | None, coherence: ArrayLike | None, n_averages: float | None
) -> tuple[np.ndarray, float]:
    """Return the variance of each entry, of the shape of G, and its complex degrees of freedom."""
    if (std is None) == (coherence is None):
        got = "neither" if std is None else "both"
        raise ValueError(
            f"std or coherence must be given, got {got}: without a variance the bound has no"
            " probability"
        )
    if n_averages is None:
        n = None
    else:
        n = require_real("n_averages", n_averages)
    if n is not None and n < 2:
        raise ValueError(f"n_averages must be at least 2, got {n:g}: one average has no scatter")
    if coherence is None:
        name, given = "std", np.asarray(std)
    else:
        name, given = "coherence", np.asarray(coherence)
    numbers = require_real_array(name, given, ndim=given.ndim)
    try:
        numbers = np.broadcast_to(numbers, G.shape)
    except ValueError:
        raise ValueError(
            f"{name} must be one number or have the shape of G, {G.shape}, got {numbers.shape}"
        ) from None
    if coherence is None:
        if np.any(numbers <= 0):
            raise ValueError(f"std must be positive on every line, got {numbers.min():g}")
        return numbers**2, _KNOWN_DOF if n is None else n - 1
    if n is None:
        raise ValueError("n_averages must be given with coherence: the variance of G depends on it")
    if np.any((numbers <= 0) | (numbers > 1)):
        bad = numbers[(numbers <= 0) | (numbers > 1)].flat[0]
        raise ValueError(
            f"coherence must be above 0 and at most 1, got {bad:g}; leave out lines without"
            " coherence"
        )
    if np.all(numbers == 1):
        raise ValueError(
            "coherence must be below 1 on some lines, got 1 on all, as from a single average:"
            " give std"
        )
    below = np.minimum(numbers, numbers[numbers < 1].max())
    if np.max(numbers - below) > _ROUNDING:
        data_warning(
            "coherence of 1 on some lines is rounded, and would leave G without variance:"
            f" {below.max():g} is used"
        )
    return (1 - below) / below * np.abs(G) ** 2 / (n - 1), n - 1


def _bound_by_product(variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (n_y, F) and (n_u, F) whose product equals the variances (n_y, n_u, F), or is the
    least bound above.
    """
    # rank one in the logarithm: exact if the residual of an output is the same for every input
    of_output = np.exp(np.mean(np.log(np.maximum(variance, np.finfo(float).tiny)), axis=1))
    of_input = np.max(variance / of_output[:, None], axis=0)
    raised = np.sqrt(
        np.max(of_output[:, None] * of_input / np.maximum(variance, np.finfo(float).tiny), axis=2)
    )
    if raised.max() > _MAX_RAISED_STD:
        j, i = np.unravel_index(int(np.argmax(raised)), raised.shape)
        data_warning(
            f"std of output {j + 1} by input {i + 1} was increased up to {raised.max():.3g}"
            " times: for several channels the variances must be products of an output and an"
            " input factor. To avoid this, use one Bla per entry"
        )
    return of_output, of_input
