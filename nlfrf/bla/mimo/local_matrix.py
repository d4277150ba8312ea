"""A matrix of FRFs fitted over its neighbouring lines, with one denominator for all its entries.

    (1 + a1 r + a2 r^2) G(r) = B0 + B1 r + B2 r^2,  r: distance in the window

The poles of a machine are those of all its entries, so the two numbers a1, a2 are found from n_y n_u rows at once; the
polynomials are projected off first. Where a denominator does not explain the matrix much better it is left out. (Local
rational method: Pintelon & Schoukens, 2nd ed., 7.2; shared denominator: Voorhoeve and others, MSSP 2018.)
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import EPS, SMALL_NORM, TINY, power, squared_modulus, two_unknowns
from nlfrf._base.values import value
from nlfrf.bla.mimo.channels import nearest_lines
from nlfrf.signals.lines import LineGrid, local_mean

__all__ = ["EARNED", "LEAST", "ORDER", "POOLED", "WIDTH", "LocalMatrix", "fit_matrix", "interpolate_matrix"]


ORDER = 2
WIDTH = 9
LEAST = ORDER + 3
# The denominator has to earn its place: over noise alone it goes to where 1 + a1 r + a2 r^2 is small away from r = 0,
# and leaves 0.435 of it on nine lines.
EARNED = 0.25
POOLED = 9  # neighbouring lines over which it is judged


@value(copy=False)
class LocalMatrix:
    """A matrix fitted over its neighbours.

    Fields
    ------
    G : (n_y, n_u, F) complex ndarray
        Fitted value on each line.
    residual : (F, n_y, n_u, n) complex ndarray
        What the fit left on the lines of each window.
    window : (F, n) int ndarray
        Those lines.
    dof : (F,) ndarray
        Complex degrees of freedom of one entry's residual.
    """

    G: np.ndarray
    residual: np.ndarray
    window: np.ndarray
    dof: np.ndarray


def fit_matrix(G: np.ndarray, grid: LineGrid, gamma: np.ndarray) -> LocalMatrix:
    """Fit (n_y, n_u, F) on each of the excited lines of a grid over the nine around it.

    Columns weigh by how well they were measured, gamma (n_u, n_u, F): whatever the units of the inputs.
    """
    lines = grid.excited
    n_y, n_u, F = G.shape
    if lines.size < LEAST:
        raise ValueError(f"lines must hold at least {LEAST} excited lines for a local fit, got {lines.size}")
    window = nearest_lines(lines, lines, WIDTH)
    n = window.shape[1]
    r = (lines[window] - lines[:, None]).astype(float)
    r /= np.abs(r).max(axis=1, keepdims=True)
    Q, T = np.linalg.qr(r[..., None] ** np.arange(ORDER + 1))  # (F, n, 3)
    at_zero = Q @ np.linalg.solve(np.swapaxes(T, 1, 2), np.eye(ORDER + 1)[0][:, None])  # row of the fit at r = 0
    near = np.moveaxis(G[..., window], 2, 0)  # (F, n_y, n_u, n)
    known = np.sqrt(np.einsum("iif->fi", gamma).real)[:, None, :, None]
    value_at_zero = (near.reshape(F, -1, n) @ at_zero)[..., 0]
    # rows of one size, so that an output in other units weighs the same
    size = known * (np.sqrt(np.mean(squared_modulus(near / known), axis=(2, 3), keepdims=True)) + TINY)
    powers = np.stack([np.ones(r.shape), -r, -(r**2)], axis=1)[:, :, None]  # (F, 3, 1, n)
    rows = (near / size).reshape(F, 1, -1, n) * powers[:, : 3 if n >= 2 * ORDER + 4 else 1]
    rows = (rows - (rows @ Q[:, None]) @ np.swapaxes(Q, 1, 2)[:, None]).reshape(F, rows.shape[1], -1)
    E, dof = rows[:, 0], np.full(F, float(n - ORDER - 1))
    if rows.shape[1] == 3:
        a, E_r = two_unknowns(rows)
        dof_r = n - ORDER - 1 - 2 / (n_y * n_u)
        better = local_mean(EARNED * power(E) / dof - power(E_r) / dof_r, POOLED) > 0
        weights = r * a[:, :1] + r**2 * a[:, 1:]
        bent = ((near * (1 + weights[:, None, None])).reshape(F, -1, n) @ at_zero)[..., 0]
        value_at_zero = np.where(better[:, None], bent, value_at_zero)
        E = np.where(better[:, None], E_r, E)
        dof = np.where(better, dof_r, dof)
    return LocalMatrix(
        G=np.moveaxis(value_at_zero.reshape(F, n_y, n_u), 0, 2),
        residual=E.reshape(near.shape) * size,
        window=window,
        dof=dof,
    )


def interpolate_matrix(G: np.ndarray, excited: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """(n_y, n_u, K) entries between their lines, linear in log magnitude and in phase; held at the ends."""
    size = np.abs(G)
    floor = np.maximum(EPS * size.max(axis=-1, keepdims=True), SMALL_NORM)
    logarithm = np.log(np.maximum(size, floor)) + 1j * np.unwrap(np.angle(G), axis=-1)
    flat = logarithm.reshape(-1, excited.size)
    return np.exp(np.array([np.interp(lines, excited, one) for one in flat])).reshape(*G.shape[:2], lines.size)
