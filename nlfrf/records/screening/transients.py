"""Transients between periods: they are smooth over frequency; noise and faults are not."""

from __future__ import annotations

from functools import cache

import numpy as np

from nlfrf._base.numbers import TINY, power

N_POLYNOMIAL = 3
_MAX_WINDOWS = 1000  # windows that suffice to detect a transient
# neighbouring lines of a window over which a difference between periods is tested for smoothness
WINDOW_LINES = 12


def is_transient(first: np.ndarray, last: np.ndarray) -> bool:
    """Return whether two periods differ by more than noise: noise is rough over frequency, a
    transient is smooth.

    Parameters
    ----------
    first, last : (M, K) complex ndarray
        Spectra of two periods on neighbouring lines.
    """
    n_windows = first.shape[1] // WINDOW_LINES
    step = max(1, first.shape[0] * n_windows // _MAX_WINDOWS)
    difference = first[:, : n_windows * WINDOW_LINES] - last[:, : n_windows * WINDOW_LINES]
    windows = difference.reshape(len(difference), -1, WINDOW_LINES)[:, ::step].reshape(
        -1, WINDOW_LINES
    )
    total = power(windows)
    if np.add.reduce(total) <= 1e-20 * np.add.reduce(power(last)):
        return False
    explained = power(windows @ smooth_basis())
    rest = np.maximum(total - explained, 1e-12 * total)
    # in noise the ratio is F(6, 18): mean 1.125, standard deviation 0.75
    ratio = explained / np.maximum(rest, TINY) * (WINDOW_LINES - N_POLYNOMIAL) / N_POLYNOMIAL
    return bool(ratio.sum() > ratio.size * (1.5 + 5 * 0.75 / ratio.size**0.5))


@cache
def smooth_basis() -> np.ndarray:
    """Return (WINDOW, N_POLYNOMIAL) orthonormal polynomials on the lines of a window."""
    return np.linalg.qr(np.linspace(-1, 1, WINDOW_LINES)[:, None] ** np.arange(N_POLYNOMIAL))[
        0
    ].astype(complex)
