"""Find a channel whose gain or delay in one experiment differs from the other experiments.

If a channel is wrong by a factor 1 + a in one experiment, the residual there is V = Y - G U = a X,
with X the contribution of the channel to G U. So a is found by weighted regression of V on X over
all lines. X has the random phases of the experiment, and G is smooth, so a small a is found. An
error that all experiments have in common looks like the plant, and is not found.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, squared_modulus
from nlfrf.bla.line_index import SMOOTHING_LINES
from nlfrf.bla.residual import NonlinearResidual
from nlfrf.bla.spectra import Spectra
from nlfrf.records.record import Record
from nlfrf.signals.lines import local_mean

#: Least significance in standard deviations. It is divided by 1 + _FEW_LINES_WIDENING over the
#: number of lines that weigh, because a few lines scatter by chance.
_MIN_SIGNIFICANCE, _FEW_LINES_WIDENING = 4.0, 10.0
#: Squared error by the mismatch over the variance of G above which it is warned of: the bound then
#: holds for 91 % instead of 95 %.
_MIN_RELATIVE_ERROR = 0.25
_MAX_LINE_WEIGHT = 3.0  # largest weight of a line, over the usual weight

#: Usual weight of a line over that in the strongest experiment, below which a channel was not
#: played.
_MIN_EXPERIMENT_WEIGHT = 1e-9
_RIVAL_SHARE = 0.8  # least significance of a rival channel, over that of the most significant one

Mismatch = tuple[float, int, str, str]  # significance, experiment, name of the channel, description


def warn_of_mismatch(
    record: Record,
    excited: Spectra,
    *,
    residual: NonlinearResidual,
    level: np.ndarray,
    retained: float,
) -> bool:
    """Warn of the channel and the experiment that differ most, if the bound of G would not hold.

    `retained` is the share of the mismatch left in the residual: the subtracted G contains the
    rest.
    """
    if excited.U.shape[1] < 2:
        return False
    found = sorted(
        _estimate_mismatches(record, excited, residual=residual, level=level, retained=retained)
    )[::-1]
    significance, experiment, name, text = found[0]
    if significance <= _MIN_SIGNIFICANCE:
        return False
    least = max(_MIN_SIGNIFICANCE, _RIVAL_SHARE * significance)
    others = " or ".join(
        sorted({rival for s, at, rival, _ in found if s > least and at == experiment} - {name})
    )
    data_warning(
        f"{text} in experiment {experiment} of {excited.U.shape[1]} than in the"
        f" others{f' ({others} would explain it nearly as well)' if others else ''}, according to"
        " all lines together. So G is not that of one machine, and its bound does not hold. Was a"
        " measuring range changed, or is the channel from another run? Measure that experiment"
        " again, or correct the channel if the change is known"
    )
    return True


def _estimate_mismatches(
    record: Record,
    excited: Spectra,
    *,
    residual: NonlinearResidual,
    level: np.ndarray,
    retained: float,
) -> Iterator[Mismatch]:
    """Yield the worst experiment of every channel, and of all outputs together, with its gain and
    its delay.
    """
    at = excited.index.excited
    V, G = (one.take(at, axis=-1) for one in (residual.Y, residual.G))
    known = [residual.smoothed_noise(j) for j in range(len(V))]
    noise = np.stack([np.zeros(at.size) if one is None else one.take(at) for one in known])
    size = np.mean(squared_modulus(excited.Y), axis=1)
    weight = 1 / (
        local_mean(np.mean(squared_modulus(V), axis=1), SMOOTHING_LINES) + 1e-24 * size + TINY
    )
    C = level + TINY
    samples = record.n_samples / (2 * np.pi * excited.lines)  # delay of a line by one radian
    X = G[:, :, None] * excited.U  # (n_y, n_u, M, F)
    outputs = X.sum(axis=1)
    n_y = len(outputs)
    channels = [
        (name, slice(j, j + 1), outputs[j : j + 1]) for j, name in enumerate(record.outputs)
    ]
    if not excited.is_zippered:  # an input recorded too large makes the output too small
        channels += [(name, slice(n_y), -X[:, i]) for i, name in enumerate(record.inputs)]
    channels += [(f"all of {', '.join(record.outputs)}", slice(n_y), outputs)] * (n_y > 1)
    # one nonlinearity sends a product of four lines to each of them: its effect on the gain over
    # all lines is twice that of single lines (a delay has each product with either sign, so it
    # cancels)
    curvature_factor = 1 + np.clip(1 - np.median(noise / C, axis=1), 0.0, 1.0)
    for kind, slope in (("gain", np.ones(at.size)), ("delay", -1j / samples)):
        for name, rows, x in channels:
            if kind == "gain":
                chance = curvature_factor[rows].max()
            else:
                chance = 1.0
            size, significance, experiment = _estimate_mismatch(
                V[rows],
                x * slope,
                weight=weight[rows],
                level=C[rows],
                retained=retained,
                common_scatter=float(chance),
            )
            if kind == "gain":
                text = (
                    f"{name} is about {100 * abs(size):.2g} % {'higher' if size > 0 else 'lower'}"
                )
            else:
                text = (
                    f"{name} is about {abs(size):.2g} samples {'later' if size > 0 else 'earlier'}"
                )
            yield significance, experiment, name, text


def _estimate_mismatch(
    V: np.ndarray,
    X: np.ndarray,
    *,
    weight: np.ndarray,
    level: np.ndarray,
    retained: float,
    common_scatter: float,
) -> tuple[float, float, int]:
    """Regress the residual V (n, M, F) on X (n, M, F) in each experiment and return the one that
    differs most.

    Returns its mismatch, relative or in samples, positive for a channel that is too large or late;
    its significance in standard deviations; and the number of the experiment, from 1 on. `weight`
    and `level` (n, F) are the weight of each line and the variance of V. The standard deviation of
    the factor comes from its scatter over the lines, times `common_scatter` for the part of the
    distortion that all lines have in common.
    """
    along = np.sum((V.real * X.real + V.imag * X.imag) * weight[:, None], axis=0)  # (M, F)
    power = squared_modulus(X)
    whole = np.sum(power * weight[:, None], axis=0)
    usual = np.median(whole, axis=1)
    on = np.flatnonzero(usual > _MIN_EXPERIMENT_WEIGHT * usual.max())
    M = on.size
    if M < 2:  # a channel that was played once cannot be compared
        return 0.0, 0.0, 1
    along, power, whole = along[on], power[:, on], whole[on]
    # a peak that the fit follows leaves V near zero, and would weigh most
    most = _MAX_LINE_WEIGHT * usual[on, None]
    trust = most / np.maximum(whole, most)
    along, whole = along * trust, whole * trust
    total = whole.sum(axis=1)
    factor = along.sum(axis=1) / total
    variance = np.sum((along - factor[:, None] * whole) ** 2, axis=1) / total**2
    deviation = (factor - factor.mean()) * M / (M - 1)  # from the mean of the others
    scatter = np.sqrt(variance + (variance.sum() - variance) / (M - 1) ** 2)
    n = float(np.min(total**2 / np.sum(whole**2, axis=1)))
    sigmas = np.abs(deviation) / np.maximum(
        scatter * common_scatter * (1 + _FEW_LINES_WIDENING / n), TINY
    )
    worst = int(sigmas.argmax())
    size = float(deviation[worst] / retained)
    significance = float(sigmas[worst])
    error_over_variance = size**2 / M * np.median(power[:, worst] / level, axis=1).max()
    if significance > _MIN_SIGNIFICANCE and error_over_variance < _MIN_RELATIVE_ERROR:
        significance = 0.0
    return size, significance, int(on[worst]) + 1
