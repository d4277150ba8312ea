"""What one record says of its lines, as far as the set made of it has to remember: the FRF and how it scatters."""

from __future__ import annotations

import numpy as np

from nlfrf import Bla
from nlfrf._base.values import value

__all__ = [
    "FEW_LINES",
    "LEVEL_DOF",
    "WINDOW",
    "Evidence",
    "MatrixEvidence",
    "averaged",
    "evidence_of",
    "matrix_evidence_of",
    "rms_levels",
]


WINDOW = 13  # lines over which a level is averaged, relative to |G|
LEVEL_DOF = 14.0  # complex degrees of freedom behind a level averaged so
#: Lines: over the number of lines, the variance of the log power of one realisation's distortion that all lines share.
#: Measured: 1 for a saturation, 7 for the rig with friction, 16 for a cube, 50 for a fifth power.
FEW_LINES = 8.0


@value
class Evidence:
    """The FRF of one record and the likeliest size of its scatter, where bounds take the largest one.

    Fields
    ------
    omega : (F,) ndarray
        Lines [rad/s].
    G : (F,) complex ndarray
        The FRF, behind the hold of the model where that has one.
    variance : (F,) ndarray
        Variance of G about the BLA.
    scatter : (F,) ndarray
        Variance of the FRF of one realisation about the BLA by distortion, noise left out.
    confirmed : float
        How far the roughness of G confirms the level: variance over that behind `Bla.bound`, as a median.
    rms_u, rms_y : float
        Rms of the input and of the output on the excited lines [unit of u, unit of y]: the level at which G holds. nan
        where it is not known, as in files of 0.1.0.

    Notes
    -----
    A level is averaged over thirteen lines, and where G is less rough than it says, its roughness is taken: of a level
    that may be read in two ways a bound takes the larger, which is too large for a prediction.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> bla = nlfrf.identify(record)
    >>> evidence = evidence_of(bla)
    >>> evidence.confirmed <= 1, bool(np.all(evidence.variance > 0))
    (True, True)
    """

    omega: np.ndarray
    G: np.ndarray
    variance: np.ndarray
    scatter: np.ndarray
    confirmed: float
    rms_u: float = float("nan")
    rms_y: float = float("nan")


@value
class MatrixEvidence:
    """The same of a record of several inputs and outputs, lines in front: an error of G is C^1/2 Z gamma^1/2, Z white.

    Fields
    ------
    omega : (F,) ndarray
        Lines [rad/s].
    G : (F, n_y, n_u) complex ndarray
        The matrix.
    C, gamma : (F, n_y, n_y), (F, n_u, n_u) complex ndarray
        Its covariance over outputs, and over inputs.
    dof : (F,) ndarray
        Complex degrees of freedom behind C.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, n_inputs=2, n_realizations=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> frm = nlfrf.identify(nlfrf.Record(u=u, y=u + 0.1 * u**3, fs=128, lines=ms.lines))
    >>> matrix_evidence_of(frm).G.shape == (frm.f.size, 2, 2)
    True
    """

    omega: np.ndarray
    G: np.ndarray
    C: np.ndarray
    gamma: np.ndarray
    dof: np.ndarray


def matrix_evidence_of(frm: Bla) -> MatrixEvidence:
    """What a record of several inputs and outputs says of its lines."""
    G, C, gamma = (np.moveaxis(x, 2, 0) for x in (frm.G, frm.cov_bound, frm.gamma))
    return MatrixEvidence(omega=frm.omega, G=G, C=C, gamma=gamma, dof=np.minimum(frm.dof, 1e6))


def evidence_of(bla: Bla, recorded: Bla | None = None) -> Evidence:
    """What a record says of its lines.

    recorded : the same before a hold was put into G, from which the level of the input is computed; bla when not given.
    """
    # relative to |G|, as a level follows it across a resonance; but not where G itself is below its scatter
    size = np.maximum(np.abs(bla.G) ** 2 + bla.var_bound, np.finfo(float).tiny ** 0.5)
    level, rough = averaged(bla.var_bound / size), averaged(bla.roughness() / size)
    ratio = np.divide(rough, level, out=np.ones(level.size), where=level > 0)
    share = np.minimum(np.where(np.isfinite(ratio), ratio, 1.0), 1.0)
    variance = level * share * size
    rms_u, rms_y = rms_levels(bla if recorded is None else recorded)
    return Evidence(
        omega=bla.omega,
        G=bla.G,
        variance=variance,
        scatter=bla.n_realizations * bla.distorted_share() * variance,
        confirmed=float(np.median(share)),
        rms_u=rms_u,
        rms_y=rms_y,
    )


def rms_levels(bla: Bla) -> tuple[float, float]:
    """Rms of input and output on the excited lines, mean power over realisations; nan where the output is not known.

    A Bla keeps Y and not U. Realisations have one amplitude |U|, so that the mean of |Y / U|^2 is |G|^2 + (M - 1) times
    the variance of their mean. Of noise, the coherence is the share of |Y|^2 that G U makes.
    """
    Y = bla.levels.excited
    if Y.shape[-1] != bla.f.size:
        return float("nan"), float("nan")
    power_y = np.mean(np.abs(Y) ** 2, axis=0) / 2
    linear = np.where(np.isfinite(bla.coherence), bla.coherence, 1.0)
    gain = np.abs(bla.G) ** 2 + (bla.n_realizations - 1) * bla.var_total
    # a line without any response does not tell its input
    power_u = np.divide(power_y * linear, gain, out=np.zeros(gain.size), where=gain > 0)
    return float(np.sqrt(power_u.sum())), float(np.sqrt(power_y.sum()))


def averaged(x: np.ndarray) -> np.ndarray:
    """(F,) mean over the lines around each, one-sided at the ends."""
    half = WINDOW // 2
    weights = np.convolve(np.ones(x.size), np.ones(2 * half + 1))[half:-half]
    return np.asarray(np.convolve(x, np.ones(2 * half + 1))[half:-half] / weights)
