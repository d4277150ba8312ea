"""The best linear approximation at several rms values of the excitation, and the growth of the
distortion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_real_array
from nlfrf._base.values import value
from nlfrf.bla.bla import Bla
from nlfrf.bla.identify import identify
from nlfrf.rig.bench.rig import Rig
from nlfrf.rig.bench.simulate import simulate
from nlfrf.signals.multisine import Multisine


@value
class _LevelStudy:
    """Best linear approximations of a machine at several levels (rms values of the excitation).

    Fields
    ------
    rms : (L,) ndarray
        Rms of the excitation at each level [N].
    blas : tuple of L Bla
        BLA at each level. ``list(study.blas)`` is a family of plants for `robust.uncertainty`.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=2048, n_samples=2048, f_min=2, f_max=140, rng=1)
    >>> study = nlfrf.level_study(nlfrf.paper_rig(), ms, [0.01, 0.1], n_discard=4)
    >>> study.distortion.shape == (2, ms.f.size), study.growth.shape == (1, ms.f.size)
    (True, True)
    """

    rms: np.ndarray
    blas: Sequence[Bla]

    @property
    def f(self) -> np.ndarray:
        """(F,) excited frequencies [Hz]."""
        return self.blas[0].f

    @property
    def distortion(self) -> np.ndarray:
        """(L, F) ndarray: variance of the FRF of one realisation due to distortion, over |G|^2."""
        return np.stack([bla.var_distortion / np.abs(bla.G) ** 2 for bla in self.blas])

    @property
    def growth(self) -> np.ndarray:
        """(L - 1, F) ndarray: growth of `distortion` [dB] for each increase of the rms by 20 dB.

        It is 40 for a cubic and 20 for a quadratic nonlinearity.
        """
        step = np.diff(20 * np.log10(self.rms))[:, np.newaxis]
        return 20 * np.diff(10 * np.log10(self.distortion), axis=0) / step


def level_study(
    rig: Rig,
    ms: Multisine,
    rms: ArrayLike,
    *,
    n_periods: int = 1,
    n_discard: int = 2,
    oversampling: int = 1,
    executor: Executor | None = None,
    progress: Callable[[int, int], object] | None = None,
    resume: str | PathLike[str] | None = None,
) -> _LevelStudy:
    """Simulate the same multisine on a machine at several levels (rms values), and identify the
    best linear approximation (BLA) at each.

    Parameters
    ----------
    rig : Rig
        The machine.
    ms : Multisine
        The excitation; it is scaled to each level.
    rms : (L,) ndarray
        Rms at each level [N]; at least two, increasing.
    n_periods, n_discard, oversampling, executor, resume
        As in `nlfrf.simulate`.
    progress : callable, optional
        Function called with the number of finished realisations and their total, over all levels.

    Returns
    -------
    _LevelStudy

    Raises
    ------
    ValueError
        The levels are not positive and increasing; also as in `simulate` and `identify`.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4.

    Examples
    --------
    In small motions the Leuven friction of the rig acts nearly like a quadratic nonlinearity. So
    the distortion relative to G grows by about 20 dB if the rms grows by 20 dB:

    >>> from nlfrf.signals.multisine import multisine
    >>> from nlfrf.rig.bench.rig import paper_rig
    >>> ms = multisine(fs=2048, n_samples=8192, f_min=2, f_max=140, n_realizations=4, rng=1)
    >>> study = level_study(paper_rig(), ms, [0.005, 0.01], n_discard=4)
    >>> bool(17 < np.median(study.growth) < 22)
    True
    """
    levels = require_real_array("rms", rms, ndim=1)
    if levels.size < 2 or levels[0] <= 0 or np.any(np.diff(levels) <= 0):
        raise ValueError(
            f"rms must hold at least two positive, increasing levels, got {levels.tolist()}"
        )
    blas = []
    for i, level in enumerate(levels):

        def count(done: int, total: int, before: int = i * ms.n_realizations) -> None:
            if progress is not None:
                progress(before + done, ms.n_realizations * levels.size)

        record = simulate(
            rig,
            replace(ms, amplitude=ms.amplitude * (level / ms.rms)),
            n_periods=n_periods,
            n_discard=n_discard,
            oversampling=oversampling,
            executor=executor,
            progress=count,
            resume=resume,
        )
        blas.append(identify(record))
    return _LevelStudy(rms=levels, blas=tuple(blas))
