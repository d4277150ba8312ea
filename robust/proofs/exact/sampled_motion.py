r"""A continuous plant x' = A(theta) x + B(theta) v over one sample T: v is held, theta moves.

With xi = [x; v], M = [A B; 0 0], a >= |M(theta)| and theta(t) = theta_k + delta(t), |delta(t)| <=
nu t:

    x(T) = F(theta_k) xi + L w + e,    |w| <= |R xi|,  |e| <= eps |xi|

F is the exponential of M T as a Taylor series with scaling and squaring, cut in the Chebyshev basis
(Lanczos): what is cut off is in eps. The motion is M(theta(t)) - M(theta_k) = b Q(t) c plus a
remainder that is added to eps, |Q(t)| <= nu kappa t. With p = (T/t) Q c xi, and zeta_0 = c exp(M t)
xi:

    |p| <= f |zeta_0| in L2,   f = nu kappa T/(1 - g),   g = nu kappa T |c| |b| exp(a T) T/sqrt(12)
    R'R + delta_R^2 >= f^2 int exp(M't) c'c exp(M t) dt
    L L' + delta_L^2 >= int exp(A(T-t)) b b' exp(A'(T-t)) (t/T)^2 dt

Both integrals are polynomials of theta, from Taylor series with their remainder, so R and L are
verified at every theta in [-1, 1]. b, c, R and L are proposed in floating point. The states are
scaled by powers of two that balance A.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from math import factorial
from operator import mul

import numpy as np
from flint import arb, arb_mat
from numpy.polynomial import chebyshev

from nlfrf._base.values import value
from robust.lti.lti import balance_matrix
from robust.proofs.exact.polynomial_matrices import PolynomialMatrix, stacked

# of a Chebyshev coefficient that is cut off, relative: at the end, and before
_CUT = 1e-11
_FINE = 1e-14
_TERMS = 16  # of a Taylor series at a norm of at most one half
_RANK = 1e-12  # relative singular value that counts as zero
_SMALL = (1e-7, 1e-6, 1e-5)  # relative singular value of R and L that goes into eps, tried in turn
_COVER = 1.001  # factor on R and L above the largest of the nodes
_NODES = 7


@value(copy=False)
class _SampledMotion:
    """One sample of a plant in balanced units: x+ = F xi + L w + e.

    Fields
    ------
    F : PolynomialMatrix
        (n, n + m), with coefficients that are doubles.
    L, R : (n, q), (q, n + m) ndarray
        Without columns and rows if theta is held within a sample.
    eps : float
        |e| <= eps |xi|.
    units : (n + m,) ndarray
        Powers of two: the xi of the plant is `units` times the xi of this value.
    """

    F: PolynomialMatrix
    L: np.ndarray
    R: np.ndarray
    eps: float
    units: np.ndarray


def sample_plant(A: np.ndarray, B: np.ndarray, *, dt: float, rate: float) -> _SampledMotion | None:
    """Return one sample of a plant; rate: of theta [1/s], 0 if theta is held within a sample.

    None: moves too fast.

    A, B : (d + 1, n, n), (d + 1, n, m) coefficients.
    """
    n, m = B.shape[1:]
    both, units = augmented_plant(A, B)
    M = PolynomialMatrix.of(both)
    F, eps = _exponential(M.scaled(dt))
    F, rounded = _round(PolynomialMatrix.of(np.eye(n, n + m)[None]) * F)
    eps = eps + rounded
    L, R = np.zeros((n, 0)), np.zeros((0, n + m))
    if rate and np.any(both[1:]):
        found = _motion(M, both, n, T=arb(dt), nu=arb(rate))
        if found is None:
            return None
        L, R, more = found
        eps = eps + more
    return _SampledMotion(F=F, L=L, R=R, eps=float(eps.upper()) * (1 + 1e-15), units=units)


def augmented_plant(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of [A B; 0 0] in balanced units, and the units: exact, as powers of
    two.
    """
    n, m = B.shape[1:]
    units = _balanced_units(A, B)
    both = np.concatenate([np.concatenate([A, B], axis=2), np.zeros((len(A), m, n + m))], axis=1)
    return both * (units / units[:, None]), units


def _balanced_units(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return powers of two in which the entries of A are balanced and B is about as large as A."""
    size = np.abs(A).sum(axis=0)
    _, states = balance_matrix(size)
    scaled = size * states / states[:, None]
    pushed = np.linalg.norm(np.abs(B).sum(axis=0) / states[:, None], axis=0)
    inputs = max(np.linalg.norm(scaled), 1e-300) / np.where(pushed > 0, pushed, 1.0)
    return np.concatenate([states, 2.0 ** np.round(np.log2(inputs))])


def norm_bound(matrix: arb_mat) -> arb:
    """Return an upper bound of the largest singular value: sqrt(|.|_1 |.|_inf)."""
    rows = [[abs(x) for x in row] for row in matrix.tolist()]
    if not rows or not rows[0]:
        return arb(0)
    sums = (
        [sum(row, arb(0)).upper() for row in rows],
        [sum(col, arb(0)).upper() for col in zip(*rows, strict=True)],
    )
    return (max(sums[0]) * max(sums[1])).sqrt().upper()


def sup_bound(polynomial: PolynomialMatrix) -> arb:
    """Return an upper bound of the largest singular value at every theta in [-1, 1]."""
    return sum((norm_bound(p) for p in polynomial.parts), arb(0)).upper()


def _round(polynomial: PolynomialMatrix) -> tuple[PolynomialMatrix, arb]:
    """Return the polynomial with coefficients that are doubles, and the bound of the error."""
    rounded = PolynomialMatrix.of(polynomial.to_array())
    return rounded, sup_bound(polynomial - rounded)


# ---- The exponential.


def _cut(
    polynomial: PolynomialMatrix, smallest: float = _FINE
) -> tuple[PolynomialMatrix, arb, arb]:
    """Return the polynomial without small Chebyshev coefficients, bounds of what is cut off and of
    the whole.
    """
    n = len(polynomial.parts)
    to, back = (_basis_change(change, n) for change in (chebyshev.poly2cheb, chebyshev.cheb2poly))
    terms = _combine(to, polynomial.parts)
    sizes = [norm_bound(t) for t in terms]
    whole = sum(sizes, arb(0)).upper()
    keep, lost = n, arb(0)
    while keep > 1 and (lost + sizes[keep - 1]) < whole * smallest:
        keep -= 1
        lost = (lost + sizes[keep]).upper()
    return PolynomialMatrix(_combine(back[:keep, :keep], terms[:keep])), lost, whole


def _basis_change(change: object, n: int) -> np.ndarray:
    """Return the (n, n) matrix of a change of basis; its entries are dyadic."""
    made = np.zeros((n, n))
    for k, unit in enumerate(np.eye(n)):
        column = change(unit)  # type: ignore[operator]
        made[: len(column), k] = column
    return made


def _combine(weights: np.ndarray, parts: Sequence[arb_mat]) -> list[arb_mat]:
    zero = parts[0] * arb(0)
    return [
        sum((p * arb(w) for w, p in zip(row, parts, strict=True) if w), zero)
        for row in weights.tolist()
    ]


def _powers(M: PolynomialMatrix, first: PolynomialMatrix, count: int) -> list[PolynomialMatrix]:
    """Return first, first M, first M^2, ..."""
    return list(accumulate([M] * (count - 1), mul, initial=first))


def _exponential(M: PolynomialMatrix) -> tuple[PolynomialMatrix, arb]:
    """Return a polynomial and the bound of its distance to exp(M(theta)) on [-1, 1]."""
    size = sup_bound(M)
    halvings = max(0, int(np.ceil(np.log2(max(float(size), 1e-300)))) + 1)
    small = M.scaled(arb(2) ** -halvings)
    x = size * arb(2) ** -halvings
    one = PolynomialMatrix.of(np.eye(M.shape[0])[None])
    made, error, power, dropped = one, x**_TERMS / factorial(_TERMS) * x.exp(), one, arb(0)
    for k in range(
        1, _TERMS
    ):  # powers are cut, too: the error of M^k is that of M^(k-1) times |M|, and what is cut
        power, lost, _ = _cut(power * small)
        dropped = (dropped * x + lost).upper()
        made = made + power.scaled(arb(1) / factorial(k))
        error = (error + dropped / factorial(k)).upper()
    for _ in range(halvings):
        made, lost, whole = _cut(made)
        error = (error + lost).upper()
        made, error = made * made, (error * (2 * whole + error)).upper()
    made, lost, _ = _cut(made, _CUT)
    return made, (error + lost).upper()


# ---- The motion of theta within a sample.


def _motion(
    M: PolynomialMatrix, both: np.ndarray, n: int, *, T: arb, nu: arb
) -> tuple[np.ndarray, np.ndarray, arb] | None:
    """Return L, R and what they add to eps."""
    b, c, Q = _factor(both[1:], n)
    exact_b, exact_c = (PolynomialMatrix.of(x[None]) for x in (b, c))
    padded = PolynomialMatrix.of(np.vstack([b, np.zeros((both.shape[1] - n, b.shape[1]))])[None])
    kappa, rest = arb(0), arb(0)
    for j, (part, middle) in enumerate(zip(M.parts[1:], Q, strict=True), 1):
        made = padded * PolynomialMatrix.of(middle[None]) * exact_c
        kappa += j * norm_bound(PolynomialMatrix.of(middle[None]).parts[0])
        rest += j * norm_bound(part - made.parts[0])
    a, size_b, size_c = sup_bound(M), sup_bound(exact_b), sup_bound(exact_c)
    grown = ((a + nu * T * rest) * T).exp()
    g = nu * kappa * T**2 * size_b * size_c * (a * T).exp() / arb(12).sqrt()
    if not g < 1:
        return None
    f = nu * kappa * T / (1 - g)
    terms = 2
    while not (a * T) ** terms / factorial(terms) * grown < 1e-9:
        terms += 1
    tail = ((a * T) ** terms / factorial(terms) * grown).upper()
    A = PolynomialMatrix.of(both[:, :n, :n])
    seen = _gramian(_powers(M, exact_c, terms), T, late=False).scaled(f**2)
    driven = _gramian(_powers(A.transpose(), exact_b.transpose(), terms), T, late=True)
    R, delta_R = _cover(seen)
    L, delta_L = _cover(driven)
    if R is None or L is None:
        return None
    size_R, size_L = (norm_bound(PolynomialMatrix.of(x[None]).parts[0]) for x in (R, L))
    off = delta_R + f * size_c * tail * T.sqrt()
    left = delta_L + size_b * tail * (T / 3).sqrt()
    return L.T.copy(), R, size_L * off + left * (size_R + off) + nu * T**2 / 2 * rest * grown**2


def _factor(moving: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return b (n, r), c (r', n + m) and Q_j with M_j = b Q_j c to rounding, from coefficients (d,
    n + m, n + m).
    """
    top = moving[:, :n]
    U, s, _ = np.linalg.svd(np.hstack(list(top)), full_matrices=False)
    _, q, V = np.linalg.svd(np.vstack(list(top)), full_matrices=False)
    U, s = U[:, s > _RANK * s[0]], s[s > _RANK * s[0]]
    V, q = V[q > _RANK * q[0]], q[q > _RANK * q[0]]
    b, c = U * np.sqrt(s), np.sqrt(q)[:, None] * V
    return b, c, [(U.T @ part @ V.T) / np.sqrt(s)[:, None] / np.sqrt(q) for part in top]


def _gramian(terms: list[PolynomialMatrix], T: arb, *, late: bool) -> PolynomialMatrix:
    """Return int (sum_k G_k s^k/k!)' (sum_k G_k s^k/k!) ds over [0, T]; late: with weight (1 -
    s/T)^2.
    """
    K, rows = len(terms), terms[0].shape[0]
    G = stacked(terms)

    def moment(p: int) -> arb:
        whole = arb(1) / (p + 1)
        return (whole - arb(2) / (p + 2) + arb(1) / (p + 3) if late else whole) * T ** (p + 1)

    entries = [[moment(k + l) / (factorial(k) * factorial(l)) for l in range(K)] for k in range(K)]
    zero = arb(0)
    wide = [
        [entries[k // rows][l // rows] if k % rows == l % rows else zero for l in range(K * rows)]
        for k in range(K * rows)
    ]
    return G.transpose() * PolynomialMatrix([arb_mat(wide)]) * G


def _cover(gramian: PolynomialMatrix) -> tuple[np.ndarray | None, arb]:
    """Return rows R and delta with R'R + delta^2 >= gramian at every theta in [-1, 1], verified;
    None if it fails.
    """
    parts = gramian.to_array()
    nodes = np.cos(np.pi * np.arange(_NODES) / (_NODES - 1))
    values = np.array([np.tensordot(x ** np.arange(len(parts)), parts, 1) for x in nodes])
    mean = values.mean(axis=0)
    eigenvalues, vectors = np.linalg.eigh((mean + mean.T) / 2)
    eye = PolynomialMatrix.of(np.eye(len(mean))[None])
    for small in _SMALL:
        delta2 = small**2 * eigenvalues[-1]
        kept = eigenvalues > delta2
        root = vectors / np.sqrt(np.where(kept, eigenvalues, 0) + delta2 / 2)
        factor = (
            _COVER
            * np.linalg.eigvalsh(root.T @ (values - delta2 / 4 * np.eye(len(mean))) @ root).max()
        )
        R = np.sqrt(factor * eigenvalues[kept])[:, None] * vectors[:, kept].T
        delta, exact = arb(float(np.sqrt(max(factor, 1.0) * delta2))), PolynomialMatrix.of(R[None])
        if (exact.transpose() * exact + eye.scaled(delta**2) - gramian).is_positive_definite():
            return R, delta
    return None, arb(0)
