"""The matrix G from experiments in which each line excites one input (zippered): each column is
interpolated between the lines of its input.

    (1 + a1 r + a2 r^2) G_ji(r) = B_0 + B_1 r + B_2 r^2,  r: distance in the window

Column i is measured on the lines of input i. On other lines it is fitted over the nine nearest of
these lines. All entries have the same poles, so a1 and a2 are fitted to all columns at once. The
first iterations divide by the denominator of the iteration before (Sanathanan & Koerner 1963);
otherwise resonances would have too little weight. Gauss-Newton iterations follow, because noise in
the regressors biases the first ones. The errors of the lines in a window are propagated to the
fitted value to first order.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import TINY, squared_modulus, two_unknowns
from nlfrf._base.values import value
from nlfrf.bla.covariance import diagonal, sum_outer_products, to_correlation
from nlfrf.bla.frf import FrmEstimate
from nlfrf.bla.line_index import WINDOW_LINES, nearest_lines
from nlfrf.bla.local_models import N_POOLED_WINDOWS, POLYNOMIAL_ORDER, RATIONAL_VARIANCE_RATIO
from nlfrf.bla.spectra import Spectra, residual_scatter
from nlfrf.signals.lines import local_mean

_N_REWEIGHTED_ROUNDS, _N_GAUSS_NEWTON_ROUNDS = 3, 3  # rounds of either kind
#: Least |1 + a1 r + a2 r^2| on a line: below it a pole lies on the line, and the round before is
#: kept.
_MIN_ZIPPERED_DENOMINATOR = 0.02


@value(copy=False)
class _ColumnInterpolation:
    """Interpolation of the columns between their own lines."""

    owner: np.ndarray  # (F,) input that each line drives
    line_variance: (
        np.ndarray
    )  # (F,) variance of an entry of its column over that of one experiment's residual
    window: np.ndarray  # (F, n_u, n) indices of the lines from which column i was fitted at line k
    # (F, n_u, n_y, n_u, n, n_y) complex derivative of each fitted entry with respect to the error
    # of each entry of its window
    error_weights: np.ndarray


def estimate_zippered_frm(excited: Spectra) -> tuple[FrmEstimate, _ColumnInterpolation]:
    """Estimate the matrix in open loop; the scatter over experiments is that of the column driven
    by a line.
    """
    lines, U, Y = excited.lines, excited.U, excited.Y
    (n_u, M, F), n_y, k = U.shape, len(Y), np.arange(lines.size)
    size = np.sqrt(excited.mean_power_U)
    owner = (size / size.max(axis=1, keepdims=True)).argmax(axis=0)
    measured = Y / U[owner, :, k].T  # (n_y, M, F), the column that the line drives
    column = measured.mean(axis=1)
    G, between = _interpolate_columns(
        column, lines, owner=owner, line_variance=1 / (M * size[owner, k] ** 2)
    )
    each = np.broadcast_to(G, (M, *G.shape)).copy()
    each[:, :, owner, k] = np.moveaxis(measured, 1, 0)
    # a line shows the scatter of one column: as an error of the output it stands for all of them
    V = (measured - column[:, None]) * size[owner, k]
    gamma = np.zeros((n_u, n_u, F), dtype=complex)
    for i in range(n_u):
        gamma[i, i] = np.interp(lines, lines[owner == i], between.line_variance[owner == i])
    scatter = residual_scatter(G, excited)
    known = scatter.shape[2] > 0
    frm = FrmEstimate(
        G=G,
        G_each=each,
        gamma=gamma,
        gamma_each=np.broadcast_to(M * gamma, (M, *gamma.shape)),
        noise_each=np.sum(squared_modulus(scatter), axis=2).swapaxes(0, 1)
        if known
        else np.full((M, n_y, F), np.nan),
        cov_noise=sum_outer_products(scatter) / M if known else np.full((n_y, n_y, F), np.nan),
        gamma_of_set=M * diagonal(gamma),
        cov_scatter=sum_outer_products(V) / (M - 1) if M > 1 else np.full((n_y, n_y, F), np.nan),
    )
    return frm, between


def _interpolate_columns(
    column: np.ndarray, lines: np.ndarray, *, owner: np.ndarray, line_variance: np.ndarray
) -> tuple[np.ndarray, _ColumnInterpolation]:
    """Return (n_y, n_u, F) with every column on every line, from (n_y, F) the column that each line
    drives.
    """
    n_y, F = column.shape
    n_u = int(owner.max()) + 1
    places = [np.flatnonzero(owner == i) for i in range(n_u)]
    width = min(WINDOW_LINES, *(place.size for place in places))
    window = np.stack(
        [place[nearest_lines(lines, lines[place], width)] for place in places], axis=1
    )
    r = (lines[window] - lines[:, None, None]).astype(float)
    r /= np.abs(r).max(axis=(1, 2), keepdims=True)  # (F, n_u, n)
    g = np.moveaxis(column[:, window], 0, 2)  # (F, n_u, n_y, n)
    # for each column, in the units of its input
    known = np.sqrt(np.mean(line_variance[window], axis=2))[:, :, None, None]
    size = known * (np.sqrt(np.mean(np.abs(g / known) ** 2, axis=(1, 3), keepdims=True)) + TINY)
    D = _fit_denominator(r, g, size)
    plain, rational = (_residual_power(r, g, D=one, size=size) for one in (np.ones(D.shape), D))
    dof = n_y * n_u * (width - POLYNOMIAL_ORDER - 1)
    better = (
        local_mean(RATIONAL_VARIANCE_RATIO * plain / dof - rational / (dof - 2), N_POOLED_WINDOWS)
        > 0
    )
    D = np.where(better[:, None, None] & (width >= 2 * POLYNOMIAL_ORDER + 4), D, 1.0)
    at_zero, _, _, slopes, rest = _fit_numerator(r, g, D)
    value_at_zero = (g @ at_zero[..., None])[..., 0]  # (F, n_u, n_y)
    # step of (a1, a2) by the error of a window, and its effect on the fitted value
    rows = (rest / size[..., None]).reshape(F, -1, 2)
    step = np.linalg.pinv(rows, rcond=1e-10).reshape(F, 2, n_u, n_y, width) / size[:, None]
    step = np.where(better[:, None, None, None, None], step, 0.0)
    by_step = -np.einsum("fin,fijnm->fijm", at_zero, slopes)
    weights = np.einsum("fijm,fmaln->fijanl", by_step, step)
    for i in range(n_u):
        for j in range(n_y):
            weights[:, i, j, i, :, j] += at_zero[:, i]
    G = np.moveaxis(value_at_zero, 0, 2).swapaxes(0, 1).copy()
    G[:, owner, np.arange(F)] = column
    return G, _ColumnInterpolation(
        owner=owner, line_variance=line_variance, window=window, error_weights=weights
    )


def _fit_numerator(r: np.ndarray, g: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, ...]:
    """Fit the numerators to windows g (F, n_u, n_y, n) at distances r under a denominator D.

    Returns
    -------
    at_zero : (F, n_u, n) complex ndarray
        B_0 = at_zero @ g.
    basis : (F, n_u, n, 3) complex ndarray
        Orthonormal columns of the weighted numerator.
    fit : (F, n_u, n_y, n) complex ndarray
        Fitted values.
    slopes, slope_residuals : (F, n_u, n_y, n, 2) complex ndarray
        Derivatives of the fit by (a1, a2) for a fixed numerator, and their residuals after a new
        fit of the numerator.
    """
    w = 1 / D
    basis, T = np.linalg.qr(
        w[..., None] * r[..., None] ** np.arange(POLYNOMIAL_ORDER + 1)
    )  # (F, n_u, n, 3)
    first = np.linalg.solve(np.swapaxes(T, -1, -2), np.eye(POLYNOMIAL_ORDER + 1)[0][:, None])
    at_zero = (basis @ first)[..., 0].conj()
    fit = g - _numerator_residual(g, basis)
    slopes = [-fit * (w * r**m)[:, :, None] for m in (1, 2)]
    rest = [_numerator_residual(slope, basis) for slope in slopes]
    return at_zero, basis, fit, np.stack(slopes, axis=-1), np.stack(rest, axis=-1)


def _numerator_residual(x: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return x (F, n_u, n_y, n) minus its projection onto the columns of `basis`."""
    return np.asarray(x - (x @ basis.conj()) @ np.swapaxes(basis, -1, -2))


def _residual_power(r: np.ndarray, g: np.ndarray, *, D: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the (F,) power of the residual under a denominator D, each row over its size."""
    return np.asarray(np.sum(np.abs((g - _fit_numerator(r, g, D)[2]) / size) ** 2, axis=(1, 2, 3)))


def _fit_denominator(r: np.ndarray, g: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Fit the denominator of each window; return 1 + a1 r + a2 r^2 (F, n_u, n) on its lines."""
    D = np.ones(r.shape, dtype=complex)
    a = np.zeros((len(r), 2), dtype=complex)
    for turn in range(_N_REWEIGHTED_ROUNDS + _N_GAUSS_NEWTON_ROUNDS):
        _, basis, fit, _, rest = _fit_numerator(r, g, D)
        aim = g - fit
        if turn < _N_REWEIGHTED_ROUNDS:
            first, second = (
                _numerator_residual(-g * (r**m / D)[:, :, None], basis) for m in (1, 2)
            )
            aim = _numerator_residual(g / D[:, :, None], basis)
            rest = np.stack([first, second], axis=-1)
        found, _ = two_unknowns(
            np.stack([one / size for one in (aim, *np.moveaxis(rest, -1, 0))], 1).reshape(
                len(r), 3, -1
            )
        )
        if turn < _N_REWEIGHTED_ROUNDS:
            trial = found
        else:
            trial = a + found
        there = 1 + r * trial[:, 0, None, None] + r**2 * trial[:, 1, None, None]
        good = np.abs(there).min(axis=(1, 2)) > _MIN_ZIPPERED_DENOMINATOR
        if turn >= _N_REWEIGHTED_ROUNDS:
            good &= _residual_power(r, g, D=there, size=size) <= _residual_power(
                r, g, D=D, size=size
            )
        a = np.where(good[:, None], trial, a)
        D = np.where(good[:, None, None], there, D)
    return D


def bound_interpolated_columns(
    interpolation: _ColumnInterpolation, gamma: np.ndarray, *, cov: np.ndarray, n_sets: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return gamma and a covariance that bound those of every column, measured or interpolated.

    Parameters
    ----------
    interpolation : _ColumnInterpolation
        Interpolation of the columns.
    gamma : (n_u, n_u, F) ndarray
        Diagonal, as if every column had been measured on every line.
    cov : (n_y, n_y, F) complex ndarray
        Covariance of one experiment's residual.
    n_sets : int
        Number R of experiments behind it.

    Returns
    -------
    gamma, cov : (n_u, n_u, F), (n_y, n_y, F) ndarray
        Entry by entry exact or above; the covariance grows where a fitted column scatters in other
        directions.
    """
    n_y, F = len(cov), cov.shape[2]
    C = np.moveaxis(cov, 2, 0)
    lines = interpolation.line_variance[:, None, None] * C  # for the column that each line drives
    around = lines[interpolation.window]  # (F, n_u, n, n_y, n_y)
    columns = np.einsum(
        "fijanl,fanlm,fipanm->fijp",
        interpolation.error_weights,
        around,
        interpolation.error_weights.conj(),
        optimize=True,
    )
    correlation, scale = (np.moveaxis(part, -1, 0) for part in to_correlation(cov))
    values, vectors = np.linalg.eigh(correlation)
    values = np.maximum(values, 1e-8 * values[:, -1:] + TINY)
    root = scale[:, :, None] * (
        (vectors * np.sqrt(values)[:, None]) @ np.swapaxes(vectors, -1, -2).conj()
    )
    inverse = ((vectors / np.sqrt(values)[:, None]) @ np.swapaxes(vectors, -1, -2).conj()) / scale[
        :, None
    ]
    gamma, more = gamma.copy(), np.zeros((F, n_y, n_y), dtype=complex)
    for i in range(columns.shape[1]):
        fitted = interpolation.owner != i
        ratio = np.einsum("fjj->fj", columns[:, i]).real / np.einsum("fjj->fj", C).real
        own, smooth = gamma[i, i].real, ratio.max(axis=1)
        # a fit scatters less than a line, but a new set may have measured on this line what was
        # fitted here: its share in bound(of="realization") is n_sets times one
        gamma[i, i] = np.where(
            fitted,
            np.maximum(smooth, (smooth + n_sets * own) / (1 + n_sets)),
            interpolation.line_variance,
        )
        T = (
            inverse
            @ columns[:, i]
            @ np.swapaxes(inverse, -1, -2).conj()
            / gamma[i, i].real[:, None, None]
        )
        beyond, along = np.linalg.eigh(T)
        part = (along * np.maximum(beyond - 1, 0.0)[:, None]) @ np.swapaxes(along, -1, -2).conj()
        more = more + np.where(fitted[:, None, None], part, 0.0)
    return gamma, np.moveaxis(root @ (np.eye(n_y) + more) @ np.swapaxes(root, -1, -2).conj(), 0, 2)
