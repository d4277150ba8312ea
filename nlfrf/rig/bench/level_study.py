"""The best linear approximation over levels of excitation, and the growth of the distortion."""

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
class LevelStudy:
    """A family of best linear approximations, one for each level.

    Fields
    ------
    rms : (L,) ndarray
        Levels of the excitation [N].
    blas : tuple of L Bla
        Result at each level; as a list, a plant family for `robust.uncertainty`.

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
        """(L, F) variance by distortion of the FRF of one realisation, over |G|^2."""
        return np.stack([bla.var_distortion / np.abs(bla.G) ** 2 for bla in self.blas])

    @property
    def growth(self) -> np.ndarray:
        """(L - 1, F) growth of the distortion [dB] per 20 dB of level:

        40 for a cube, 20 for a square.
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
) -> LevelStudy:
    """Run the same multisine through a rig at several levels, and identify the BLA at each.

    Parameters
    ----------
    rig : Rig
        The machine.
    ms : Multisine
        The excitation, scaled to each level.
    rms : (L,) ndarray
        Levels [N], at least two, increasing.
    n_periods, n_discard, oversampling, executor, resume
        As in `nlfrf.simulate`.
    progress : callable, optional
        Called with the realisations done and the total, over all levels.

    Returns
    -------
    LevelStudy

    Raises
    ------
    ValueError
        Levels that are not positive and increasing; also as in `simulate` and `identify`.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4.

    Examples
    --------
    In small motions the friction of the paper distorts by its creep, |v| Fh/s, of second degree
    (and odd):

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
    return LevelStudy(rms=levels, blas=tuple(blas))
