"""Noise excitation: where the local polynomials read the FRF, and which lines a band holds."""

import numpy as np
import pytest

from nlfrf import identify_noise


@pytest.mark.parametrize("ratio", [2, 2.5, 8.7])
def test_local_polynomials_read_the_frf_at_the_line_they_name(ratio):
    """A delay of d samples turns the phase by 2 pi d / n a line: a frequency a little off is an FRF far off.

    The lines of the whole record lie elsewhere where its length is no multiple of n_samples, and at the ends of the
    band they lie on one side.
    """
    n, d = 400, 12
    u = np.random.default_rng(2).standard_normal(int(ratio * n) + d)
    options = dict(fs=1.0, n_samples=n, f_min=1 / n, f_max=0.4999)
    bla = identify_noise(u[d:], u[:-d], **options)
    turned = np.angle(bla.G * np.exp(2j * np.pi * d * bla.f))
    assert bla.f.size == n // 2 - 1
    assert np.max(np.abs(turned)) < 0.1  # half a line off would be 0.094 in the middle, three lines 0.57 at the ends
    assert np.sqrt(np.mean(turned**2)) < 0.02


@pytest.mark.parametrize(("f_min", "f_max"), [(0.07, 0.29), (0.14, 0.28)])
def test_the_ends_of_the_band_are_lines_whatever_the_rounding(f_min, f_max):
    u = np.random.default_rng(0).standard_normal(1000)
    f = identify_noise(u, u, fs=1.0, n_samples=100, f_min=f_min, f_max=f_max).f
    np.testing.assert_allclose(f[[0, -1]], [f_min, f_max])
