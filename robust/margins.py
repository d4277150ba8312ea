"""How far the uncertainty may grow before a demand fails."""

from __future__ import annotations

import numpy as np

from robust.assembly import Assembly
from robust.lti import response


def performance_margin(loop: Assembly, omega: np.ndarray, band: tuple[float, float]) -> tuple[float, float]:
    """Largest factor on the uncertainty with |w_P| max |S_p| <= 1, and where it is limited."""
    if loop.w_P is None:
        return np.nan, np.nan
    peak, where = loop.peak(loop.nominal, omega, band)
    if peak >= 1:
        return 0.0, where

    def inverse(points: np.ndarray) -> np.ndarray:
        S, a, b = loop.terms(points)
        return 1 / factor_allowed(np.abs(response(loop.w_P, points)) * np.abs(S), a, b)

    largest, where = loop.peak(inverse, omega, band)
    return 1 / largest if largest > 0 else np.inf, where


def factor_allowed(nominal: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(W,) largest x with nominal (|1 - x^2 a b*| + x |a - b|)/(1 - x^2 |b|^2) <= 1, by bisection (increasing in x)."""
    low, high = np.zeros(nominal.size), 1 / np.maximum(np.abs(b), 1e-12)
    for _ in range(60):
        x = (low + high) / 2
        with np.errstate(all="ignore"):
            value = nominal * (np.abs(1 - x**2 * a * b.conj()) + x * np.abs(a - b)) / (1 - x**2 * np.abs(b) ** 2)
        good = (value <= 1) & (x * np.abs(b) < 1)
        low, high = np.where(good, x, low), np.where(good, high, x)
    return np.maximum(low, 1e-12)
