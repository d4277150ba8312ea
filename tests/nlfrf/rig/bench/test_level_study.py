"""The best linear approximation over levels: how fast its distortion grows."""

from dataclasses import replace

import numpy as np
import pytest

from nlfrf import level_study, multisine, paper_rig


def test_level_study_grows_as_the_degree_of_the_distortion():
    ms = multisine(fs=2048, n_samples=8192, f_min=2, f_max=140, n_realizations=4, rng=1)
    seen = []
    study = level_study(
        paper_rig(),
        ms,
        [0.005, 0.01, 2.5],
        n_discard=4,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert study.growth.shape == (2, ms.f.size)
    assert 17 < np.median(study.growth[0]) < 22  # creep is of second degree
    assert np.median(study.growth[1]) < 15  # and saturates in sliding
    assert seen[-1] == (12, 12)
    peaks = [bla.f[np.argmax(np.abs(bla.G))] for bla in study.blas]
    assert peaks[0] == pytest.approx(60.3, abs=1)
    assert peaks[2] == pytest.approx(45.5, abs=1.5)
    first = study.blas[0]
    cube = [
        replace(first, cov=replace(first.cov, distortion=first.cov.distortion * g**4))
        for g in (1, 10)
    ]
    assert np.allclose(replace(study, rms=np.array([1.0, 10.0]), blas=cube).growth, 40)


@pytest.mark.parametrize("rms", [[1.0], [1.0, 0.5], [0.0, 1.0]])
def test_levels_that_make_no_study_are_refused(rms):
    ms = multisine(fs=2048, n_samples=2048, f_min=2, f_max=140, rng=1)
    with pytest.raises(
        ValueError, match="rms must hold at least two positive, increasing levels, got"
    ):
        level_study(paper_rig(), ms, rms)
