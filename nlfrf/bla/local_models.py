"""Local polynomial and rational models of an FRF over its excited lines (LPM, LRM), and their
residual.

    (1 + a1 r + a2 r^2) G(r) = b0 + b1 r + b2 r^2,  r: distance in the window (a1 = a2 = 0: polynomial)

Pintelon & Schoukens, 2nd ed., 7.2 and 7.3. The value at r = 0 is an FRF with less scatter. The
residual is an estimate of the distortion variance without detection lines: with random phases the
distortion varies at random from line to line, while the FRF is smooth. The rational model is used
if it explains the FRF much better, as at a resonance a few lines wide. What neither model explains
counts as distortion, so the variance may be too high, but not too low.

On a grid with few lines a resonance is narrower than a window. Then one rational function of low
order, with real coefficients and stable poles, is fitted to all lines, and used if it halves the
residual.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from nlfrf._base.numbers import EPS, SMALL_NORM, TINY, power, squared_modulus, two_unknowns
from nlfrf.bla.calibration import FEW_LINES
from nlfrf.bla.line_index import N_CACHED_GRIDS, LineIndex
from nlfrf.signals.lines import local_mean

POLYNOMIAL_ORDER = 2  # of both polynomials; the code is written for this order
_N_POWERS = POLYNOMIAL_ORDER + 1  # number of columns r^k G
_N_RATIONAL_UNKNOWNS = 2 * POLYNOMIAL_ORDER + 1
#: Residual variance of the rational over the polynomial model below which it is used: with 0.5 it
#: fitted noise alone in one window of five.
RATIONAL_VARIANCE_RATIO = 0.25
N_POOLED_WINDOWS = 9  # neighbouring lines over which this ratio is averaged
_MIN_NOISE_SHARE = 0.5  # least roughness over the known noise
NOISE_SMOOTHING_LINES = 13  # neighbouring lines over which the noise of a few periods is averaged
#: Least denominator over that at the line itself: a pole of the fit near the window is no
#: distortion.
_MIN_DENOMINATOR = 0.1
MIN_FIT_LINES = POLYNOMIAL_ORDER + 3  # lines that leave two degrees of freedom
_GLOBAL_ORDERS = (
    2,
    4,
)  # orders of the rational function over all lines of a small grid: one mode, or two
_MIN_RESIDUAL_DOF = 7.0  # least complex degrees of freedom of its residual
_N_REWEIGHTED_STEPS = (
    6  # steps towards its output error, each weighted by the denominator of the one before
)
_MIN_FLATNESS = 1 - 1e-9  # smallest over largest weight of a flat spectrum
_N_CACHED_FITS = 4  # number of grids with cached fits: two kilobytes per line
#: Variance about the global over that about the local fits, above which the local fits stay: chance
#: gives as much.
_MAX_GLOBAL_VARIANCE_RATIO = 0.5


class LocalFit(NamedTuple):
    """FRFs fitted over their neighbouring lines; of the shape of the FRFs, (M, F) or (M, n_y, n_u,
    F).
    """

    G: np.ndarray  # complex fitted value at each line
    variance: np.ndarray  # variance of the FRF about the fit
    dof: np.ndarray  # complex degrees of freedom of `variance`
    # (M, n_y, n_u, F, n) complex residual of the fit on the lines of each window, times the weight
    # there. None for one output: only the correlation of outputs needs it, and it is large for long
    # records.
    residual: np.ndarray | None


def fit_locally(
    G: np.ndarray, weight: np.ndarray, *, index: LineIndex, noise: np.ndarray | None = None
) -> LocalFit:
    """Fit each FRF at each line over the nine lines around it.

    All entries of a machine have the same poles, so the entries of a row share their denominators
    (Voorhoeve and others, MSSP 2018). Rows do not share them, because a disturbance of one output
    does not act on the others.

    Parameters
    ----------
    G : (M, F) or (M, n_y, n_u, F) complex ndarray
        FRF, or matrix, of each realisation.
    weight : ndarray, of the shape of G or (M, 1, n_u, F)
        |U|: the variance of G is modelled as a smooth variance at the output over |U|^2.
    index : LineIndex
        Index of the grid of G.
    noise : ndarray of the shape of G, optional
        Variance of each G by noise, if known: noise need not follow |G| as distortion does.

    Raises
    ------
    ValueError
        Fewer than five excited lines.
    """
    if index.excited.size < MIN_FIT_LINES:
        raise ValueError(
            f"lines must hold at least {MIN_FIT_LINES} excited lines for the roughness, got"
            f" {index.excited.size}"
        )
    shape, n = G.shape, index.excited_windows.shape[1]
    n_u, several = 1 if G.ndim == 2 else shape[-2], G.ndim == 4 and shape[1] > 1
    if weight.shape != shape:
        weight = np.broadcast_to(weight, shape)
    G, weight = (x.reshape(-1, n_u, shape[-1]) for x in (G, weight))
    value, a, (rest, rational_rest), (variance, rational_variance), used = (
        _fit_polynomial_and_rational(G, weight, index)
    )
    better = used[:, None]
    dof = np.full(variance.shape, float(n - POLYNOMIAL_ORDER - 1))
    denominator: np.ndarray | float = 1.0
    least = np.zeros(variance.shape)
    if better.any():
        _, powers, _ = _local_powers(index)
        inverse = np.where(
            better[..., None], np.abs(1 - np.vecmat(a.conj(), powers[:, 1:]))[:, None], 1.0
        )
        dof_r = n - POLYNOMIAL_ORDER - 1 - 2 / n_u
        # the residual under the denominator follows |G|; without it, it is flat: which of them the
        # distortion does is unknown, so the larger variance is used
        flat = power(rational_rest / np.maximum(inverse, _MIN_DENOMINATOR)) / dof_r
        variance = np.where(better, np.maximum(rational_variance, flat), variance)
        dof = np.where(better, dof_r, dof)
        if several:
            rest = np.where(better[..., None], rational_rest, rest)
        if noise is not None:
            denominator = np.where(flat[..., None] > rational_variance[..., None], 1.0, inverse)
    if noise is not None:
        smooth = local_mean(noise.reshape(G.shape) * weight**2, NOISE_SMOOTHING_LINES)
        # the variance is not far below the known noise
        share = _noise_correction(
            variance, denominator, smooth=smooth, window=index.excited_windows
        )
        least = _MIN_NOISE_SHARE * smooth
        variance = np.maximum(variance * share, least)
    square = weight**2
    variance, least = variance / square, least / square
    if index.excited.size < FEW_LINES:
        value, variance = _apply_global_model(
            value,
            variance,
            G=G,
            weight=weight,
            lines=index.lines[index.excited].astype(float),
            noise_variance=least,
        )
    return LocalFit(
        G=value.reshape(shape),
        variance=variance.reshape(shape),
        dof=dof.reshape(shape),
        residual=rest.reshape(*shape, n) if several else None,
    )


def _apply_global_model(
    value: np.ndarray,
    variance: np.ndarray,
    *,
    G: np.ndarray,
    weight: np.ndarray,
    lines: np.ndarray,
    noise_variance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Replace value and variance if one rational function over the band explains an FRF (M, E, F)
    much better.

    Its residual may be flat at the output or follow |G|. Each hypothesis is weighted by its
    likelihood; the root mean square of both is the variance for a bound. The degrees of freedom
    stay those of a window. `noise_variance` is the lower limit of the variance, by noise alone.
    """
    value, variance = value.copy(), variance.copy()
    for m in np.ndindex(G.shape[:-1]):
        whole, dof = _fit_global_rational(G[m], weight[m], lines)
        if not dof:
            continue
        shape = np.array([np.ones(lines.size), np.maximum(squared_modulus(whole), TINY)]) / (
            weight[m] * weight[m]
        )
        residual = np.add.reduce(squared_modulus(G[m] - whole) / shape, axis=1)
        variances = np.maximum(residual[:, None] / dof * shape, TINY)  # one row per hypothesis
        log_likelihood = -np.add.reduce(np.log(variances), axis=1) * (dof / lines.size)
        likelihood = np.exp(log_likelihood - log_likelihood.max())
        highest = variances.max()
        pooled = highest * np.sqrt(likelihood @ (variances / highest) ** 2 / likelihood.sum())
        pooled = np.maximum(pooled, noise_variance[m])
        if np.mean(np.log(pooled) - np.log(np.maximum(variance[m], TINY))) < np.log(
            _MAX_GLOBAL_VARIANCE_RATIO
        ):
            less = pooled < variance[m]
            value[m][less], variance[m][less] = whole[less], pooled[less]
    return value, variance


def _fit_global_rational(
    G: np.ndarray, weight: np.ndarray, lines: np.ndarray
) -> tuple[np.ndarray, float]:
    """Fit a rational function to an FRF over all its lines; return its values (F,) and its complex
    degrees of freedom.

    Real coefficients in s, stable poles, relative errors; each step weights by the denominator of
    the step before (Sanathanan & Koerner, IEEE Trans. Autom. Control 8, 1963). Returns G itself and
    0 without a stable fit.
    """
    size = np.abs(G)
    relative = weight / np.maximum(size, EPS * size.max() + SMALL_NORM)
    s = 1j * lines / np.sqrt(lines[0] * lines[-1])
    best, lowest, degrees = G, np.inf, 0.0
    for order in _GLOBAL_ORDERS:
        left = lines.size - order - 0.5  # half of 2 n + 1 real coefficients
        if left < _MIN_RESIDUAL_DOF:
            break
        powers = s[:, None] ** np.arange(order + 1)
        columns = np.concatenate([powers, -G[:, None] * powers[:, 1:]], axis=1)
        scale = relative
        for _ in range(_N_REWEIGHTED_STEPS):
            x = _solve_real_least_squares(columns * scale[:, None], G * scale)
            denominator = 1 + powers[:, 1:] @ x[order + 1 :]
            if not denominator.all():
                break
            scale = relative / np.abs(denominator)
            whole = powers @ x[: order + 1] / denominator
            cost = float(power((G - whole) * relative)) / left
            if cost < lowest and _is_stable(x[order + 1 :]):
                best, lowest, degrees = whole, cost, left
    return best, degrees


def _solve_real_least_squares(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Solve A x = b for real x (p,) by least squares, for complex A (n, p) and b; columns are
    scaled to one norm.
    """
    stacked = np.concatenate([A.real, A.imag])
    scale = np.sqrt(np.vecdot(stacked.T, stacked.T))
    scale[scale == 0] = 1.0
    return np.asarray(
        np.linalg.lstsq(stacked / scale, np.concatenate([b.real, b.imag]), rcond=1e-12)[0] / scale
    )


def _is_stable(a: np.ndarray) -> bool:
    """Return whether 1 + a1 s + a2 s^2 (+ a3 s^3 + a4 s^4) has all roots in the left half-plane
    (Routh, Hurwitz).

    >>> [_is_stable(np.array(a)) for a in ([0.1, 1.0], [-0.1, 1.0], [0.1, -1.0])]
    [True, False, False]
    >>> _is_stable(np.array([1.0, 3.0, 1.0, 1.0])), _is_stable(np.array([1.0, 1, 1, 1]))
    (True, False)
    """
    if (a <= 0).any():
        return False
    return bool(a.size == 2 or a[0] * a[1] * a[2] > a[0] * a[0] * a[3] + a[2] * a[2])


def is_flat(amplitude: np.ndarray) -> bool:
    """Return whether each of the spectra (..., F) is the same on all lines."""
    return bool((amplitude.min(axis=-1) >= _MIN_FLATNESS * amplitude.max(axis=-1)).all())


def _fit_polynomial_and_rational(
    G: np.ndarray, weight: np.ndarray, index: LineIndex
) -> tuple[
    np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], np.ndarray
]:
    """Fit FRFs (M, E, F) over the windows of `index`, weighted by `weight` (M, E, F): polynomials,
    a rational model.

    Returns
    -------
    value : (M, E, F) complex ndarray
        Value at the line itself, by the model in use.
    a : (M, F, 2) complex ndarray
        Coefficients of the denominator 1 + a1 r + a2 r^2, common to all E entries.
    residuals : two (M, E, F, n) complex ndarray
        Residual of each model on the lines of the window.
    variances : two (M, E, F) ndarray
        Variance of each.
    use_rational : (M, F) bool ndarray
        Lines for which the rational model is used.
    """
    window, (r, powers, centred) = index.excited_windows, _local_powers(index)
    (M, E, F), n = G.shape, window.shape[1]
    row = (weight * G).take(window, axis=-1)
    if is_flat(weight):  # as designed: the fits then depend on the grid alone
        fitted = (_unweighted_fits(index) @ row.view(float).reshape(*row.shape, 2)).view(complex)[
            ..., 0
        ]
        rest = fitted[..., :-_N_POWERS].reshape(M, E, F, _N_POWERS, n)
        at_zero = fitted[..., -_N_POWERS:]
        at_zero = at_zero / weight[..., None]
    else:
        basis, basis_at_zero = _orthonormal_polynomials(r, weight.take(window, axis=-1))
        spanned, rest = _project_onto_rows(basis, row, powers)
        at_zero = np.matvec(spanned, basis_at_zero)
    left = rest[..., 0, :]
    variance = variance_r = power(left) / (n - POLYNOMIAL_ORDER - 1)
    a, remainder, better = at_zero[:, 0, :, 1:], left, np.zeros((M, F), dtype=bool)
    if n >= _N_RATIONAL_UNKNOWNS + 3:
        a, remainder = two_unknowns(rest.transpose(0, 2, 3, 1, 4).reshape(M, F, _N_POWERS, E * n))
        remainder = remainder.reshape(M, F, E, n).swapaxes(1, 2)
        variance_r = power(remainder) / (n - POLYNOMIAL_ORDER - 1 - 2 / E)
        # at the ends of the band windows are equal and one-sided: the nearest centred window
        # decides
        first, last = centred[0], centred[-1] + 1
        gained = np.add.reduce(RATIONAL_VARIANCE_RATIO * variance - variance_r, axis=1)
        if (gained > 0).any():
            better = (local_mean(gained[:, first:last], N_POOLED_WINDOWS) > 0).take(
                centred - first, axis=1
            )
    value = at_zero[..., 0]
    if better.any():
        value = np.where(
            better[:, None], value - np.vecdot(a[:, None].conj(), at_zero[..., 1:]), value
        )
    return value, a, (left, remainder), (variance, variance_r), better


@lru_cache(maxsize=N_CACHED_GRIDS)
def _local_powers(index: LineIndex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the distances r (F, n) in each window, from -1 to 1, and the columns 1, -r, -r^2 of
    the fit (F, 3, n).

    The third value (F,) is for each line the nearest one with a centred window.
    """
    window, lines = index.excited_windows, index.lines[index.excited]
    r = (lines[window] - lines[:, None]).astype(float)
    r /= np.abs(r).max(axis=1, keepdims=True)
    # b0 + b1 r + b2 r^2 = G, and (1 + a1 r + a2 r^2) G = b0 + b1 r + b2 r^2: the residual of the
    # second is weighted by the denominator, that is by 1/|G| across a resonance, where the
    # distortion follows |G|
    powers = np.stack([np.ones(r.shape), -r, -r * r], axis=1)
    last = lines.size - 1
    end = min(window.shape[1] // 2, last // 2)
    centred = np.clip(np.arange(last + 1), end, last - end)
    for array in (r, powers, centred):
        array.flags.writeable = False
    return r, powers, centred


def _noise_correction(
    variance: np.ndarray, denominator: np.ndarray | float, *, smooth: np.ndarray, window: np.ndarray
) -> np.ndarray:
    """Return the factor (M, F) on a variance for smoothed noise that varies in a window, weighted
    as the residual.
    """
    there = np.add.reduce(denominator**2 * smooth.take(window, axis=-1), axis=-1) / window.shape[1]
    distortion = np.maximum(variance - there, 0.0)
    total = np.maximum(distortion + there, TINY)
    return np.asarray((distortion + smooth) / total)


def _orthonormal_polynomials(r: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the polynomials p of order 0, 1 and 2 that are orthonormal on the points r (F, n)
    under weights w^2.

    Returns w p (..., F, 3, n) and p(0) (..., F, 3), by their three-term recurrence (Forsythe,
    1957).
    """
    basis = np.empty((*w.shape[:-1], POLYNOMIAL_ORDER + 1, r.shape[1]))
    at_zero = np.empty((*w.shape[:-1], POLYNOMIAL_ORDER + 1))
    p, p_0 = w, np.ones(w.shape[:-1])
    for k in range(POLYNOMIAL_ORDER + 1):
        if k:
            known = basis[..., max(k - 2, 0) : k, :]
            p = r * known[..., -1, :]
            along = np.vecdot(known, p[..., None, :])
            p -= np.vecmat(along, known)
            p_0 = -np.vecdot(along, at_zero[..., max(k - 2, 0) : k])
        scale = 1 / np.sqrt(np.vecdot(p, p))
        np.multiply(p, scale[..., None], out=basis[..., k, :])
        np.multiply(p_0, scale, out=at_zero[..., k])
    return basis, at_zero


def leave_one_out_residual(
    G: np.ndarray, index: LineIndex
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the difference of each line of FRFs (..., F) from the parabola through its neighbours.

    Returns
    -------
    residual : (..., F) complex ndarray
        G less the parabola through its neighbours.
    scatter : (..., F) ndarray
        Variance of the neighbours about this parabola.
    spread : (F,) ndarray
        Variance of `residual` over that of a single line.
    """
    around = G.take(index.excited_windows[:, 1:], axis=-1)
    (basis,), (at_zero,) = _unweighted_polynomials(index, with_center=False)
    spanned = np.vecdot(basis, around[..., None, :])
    scatter = np.maximum(power(around) - power(spanned), 0.0) / (
        around.shape[-1] - POLYNOMIAL_ORDER - 1
    )
    return G - np.vecdot(at_zero, spanned), scatter, 1 + power(at_zero)


@lru_cache(maxsize=N_CACHED_GRIDS)
def _unweighted_polynomials(
    index: LineIndex, *, with_center: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return `_orthonormal_polynomials` under a unit weight, with or without the line itself."""
    r = _local_powers(index)[0][:, 0 if with_center else 1 :]
    both = _orthonormal_polynomials(r, np.ones((1, *r.shape)))
    for array in both:
        array.flags.writeable = False
    return both


@lru_cache(maxsize=_N_CACHED_FITS)
def _unweighted_fits(index: LineIndex) -> np.ndarray:
    """Return (F, 3 n + 3, n) maps of an unweighted window to the residual of each column r^k G and
    to its value.

    They depend on the grid alone.
    """
    _, powers, _ = _local_powers(index)
    (basis,), (at_zero,) = _unweighted_polynomials(index, with_center=True)
    n_lines, n = index.excited_windows.shape
    fits = np.empty((n_lines, _N_POWERS * (n + 1), n))
    rest, value = fits[:, :-_N_POWERS].reshape(n_lines, _N_POWERS, n, n), fits[:, -_N_POWERS:]
    np.multiply(
        (np.eye(n) - np.swapaxes(basis, -1, -2) @ basis)[:, None], powers[:, :, None], out=rest
    )
    np.multiply(np.vecmat(at_zero, basis)[:, None], powers, out=value)
    fits.flags.writeable = False
    return fits


def _project_onto_rows(
    basis: np.ndarray, row: np.ndarray, powers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Project a complex row (..., n) times `powers` (c, n) onto the real orthonormal rows of
    `basis` (..., p, n).

    Returns the coefficients (..., c, p) and the residual (..., c, n).
    """
    c = powers.shape[-2]
    parts = np.empty(
        (*row.shape[:-1], 2 * c, row.shape[-1])
    )  # real and imaginary parts: real products
    np.multiply(row.real[..., None, :], powers, out=parts[..., :c, :])
    np.multiply(row.imag[..., None, :], powers, out=parts[..., c:, :])
    spanned = parts @ np.swapaxes(basis, -1, -2)
    parts -= spanned @ basis
    return _join_real_and_imaginary(spanned, c), _join_real_and_imaginary(parts, c)


def _join_real_and_imaginary(parts: np.ndarray, c: int) -> np.ndarray:
    """Return (..., c, n) complex rows from c real parts and c imaginary parts."""
    joined = np.empty((*parts.shape[:-2], c, parts.shape[-1]), dtype=complex)
    joined.real, joined.imag = parts[..., :c, :], parts[..., c:, :]
    return joined
