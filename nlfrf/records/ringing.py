"""Whether periods differ by a transient: it is smooth over frequency, which neither noise nor a fault is."""

from __future__ import annotations

from functools import cache

import numpy as np

from nlfrf.shared.leastsquares import TINY, power

__all__ = ["N_POLYNOMIAL", "WINDOW", "is_transient"]


N_POLYNOMIAL = 3
ENOUGH = 1000  # windows that decide whether there is a transient; more would only take time
WINDOW = 12  # neighbouring lines over which a difference between periods is tested for smoothness


def is_transient(first: np.ndarray, last: np.ndarray) -> bool:
    """Whether two periods differ by more than noise: noise is rough over frequency, a transient is smooth.

    Parameters
    ----------
    first, last : (M, K) complex ndarray
        Spectra of two periods on neighbouring lines.
    """
    n_windows = first.shape[1] // WINDOW
    step = max(1, first.shape[0] * n_windows // ENOUGH)
    apart = first[:, : n_windows * WINDOW] - last[:, : n_windows * WINDOW]
    windows = apart.reshape(len(apart), -1, WINDOW)[:, ::step].reshape(-1, WINDOW)
    total = power(windows)
    if np.add.reduce(total) <= 1e-20 * np.add.reduce(power(last)):
        return False
    explained = power(windows @ smooth_part())
    rest = np.maximum(total - explained, 1e-12 * total)
    # in noise the ratio is F(6, 18): mean 1.125, standard deviation 0.75
    ratio = explained / np.maximum(rest, TINY)
    ratio *= (WINDOW - N_POLYNOMIAL) / N_POLYNOMIAL
    return bool(ratio.sum() > ratio.size * (1.5 + 5 * 0.75 / ratio.size**0.5))


@cache
def smooth_part() -> np.ndarray:
    """(WINDOW, N_POLYNOMIAL) orthonormal polynomials on the lines of a window."""
    return np.linalg.qr(np.linspace(-1, 1, WINDOW)[:, None] ** np.arange(N_POLYNOMIAL))[0].astype(complex)
