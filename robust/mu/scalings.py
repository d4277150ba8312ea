"""Upper bounds on the structured singular value: scalings found by Newton's method, the bound
recomputed from them.

For a perturbation u = Delta y of structure `blocks` and size below 1/beta, det(I - N Delta) = 0 is
impossible if

    N^H X_L N + j (G N - N^H G^H) < beta^2 X_R,       X > 0 commuting with Delta, G Hermitian on the real blocks.

For complex blocks, with X = D^H D, this is sigma(D_L N D_R^-1) < beta (Doyle 1982; with G: Fan,
Tits & Doyle 1991).
"""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import short_form
from nlfrf._base.values import value
from robust._base.types import Blocks
from robust.lti.lti import response_by_channel
from robust.lti.norms import EPS
from robust.mu.blocks import BlockStructure, block_structure, structure_for

_MAX_STEPS = 80
_MAX_STEPS_REAL = 200
#: Least number of steps; number of products in all steps above which fewer steps are taken, some
#: ten seconds.
_LEAST_STEPS, _MOST_WORK = 1, 2e9
_CENTRE_GAP = 1e-9
_CENTRE_REGULARISATION = 0.1
_MAX_ENTRIES = 500_000  # of the arrays of one Newton step, a fraction of a second


@value(copy=False)
class MuBound:
    """A bound on mu at every frequency, with the scaling or the perturbation that shows it.

    Fields
    ------
    value : (W,) ndarray
        The bound, recomputed from `scaling` (upper bound) or from `delta` (lower bound).
    scaling : (D_L, D_R, G) or None
        For an upper bound: D_L (n_out, n_out, W), D_R (n_in, n_in, W) and G (n_in, n_out, W). G is
        defined for the scaled matrix D_L N D_R^-1.
    delta : (n_in, n_out, W) ndarray or None
        For a lower bound: the perturbation Delta of size 1/value with det(I - N Delta) = 0; nan if
        none was found.

    References
    ----------
    SP 8.8 and 8.12.

    Examples
    --------
    SP Example 8.5: with one full block the structured singular value is the largest singular value.

    >>> M = np.array([[2.0, 2.0], [-1.0, -1.0]])[..., None]
    >>> round(float(upper(M, [(2, 2)]).value[0]), 3), round(float(upper(M, [(1, 1), (1, 1)]).value[0]), 3)
    (3.162, 3.0)
    """

    value: np.ndarray
    scaling: tuple[np.ndarray, ...] | None = None
    delta: np.ndarray | None = None


def upper(N: np.ndarray, blocks: Blocks) -> MuBound:
    """Return an upper bound of mu, the structured singular value, at each frequency.

    Use this for a response at given frequencies. `certify` proves an upper bound at all
    frequencies, and `bounds` computes both bounds.

    Parameters
    ----------
    N : (n_out, n_in, W) ndarray
        Complex response of the system to which the perturbation is connected; for a single matrix
        N[:, :, None].
    blocks : list
        Blocks of the perturbation, in the order of the outputs and inputs of N: (rows, cols) for a
        full complex block, (n, n, "repeated") for a complex number times the identity, (n, n,
        "real") for a real number times the identity. The input of a block is `rows` outputs of N,
        and its output is `cols` inputs of N.

    Returns
    -------
    MuBound
        `value` is the largest singular value of M = D_L N D_R^-1 with the scaling that was found.
        With real blocks it is the root of the largest eigenvalue of M^H M + j (G M - M^H G^H),
        with a bound on rounding added. Any scaling gives an upper bound. For up to three full
        blocks `value` is mu itself.

    Raises
    ------
    ValueError
        Blocks that do not add up to N, numbers that are not finite.

    References
    ----------
    SP 8.8.3, eq. 8.87 (with the definition 8.76); Young, Newlin & Doyle 1991 (real blocks); Boyd &
    El Ghaoui 1993 (the method of centres).

    Examples
    --------
    SP Example 8.5: mu is 3.162 for one full block, 3 for two scalar blocks, and 1 for a repeated
    scalar block.

    >>> M = np.array([[2, 2], [-1, -1]])[:, :, None]
    >>> [round(float(upper(M, b).value[0]), 3) for b in ([(2, 2)], [(1, 1), (1, 1)], [(2, 2, "repeated")])]
    [3.162, 3.0, 1.0]
    """
    return upper_bound(response_matrices("N", N), blocks)


def upper_bound(M: np.ndarray, blocks: Blocks, *, target: float = 0.0) -> MuBound:
    """Return the bound on (W, n_out, n_in) matrices; with a target from the scalings with most
    slack below it.
    """
    s = structure_for("blocks", blocks, M.shape[1:])
    size = np.abs(M).max(axis=(1, 2))  # the squares of the scaled numbers do not overflow
    scale = np.where(size > 0, size, 1.0)
    M = M / scale[:, None, None]
    D_L, D_R, G = optimal_scalings(M, s, target=target / scale)
    one_L, one_R = (np.broadcast_to(np.eye(n, dtype=complex), (M.shape[0], n, n)) for n in s.shape)
    best = bound_from_scalings(M, D_L, D_R, G)
    best = np.where(best * scale < target, 0.0, best)  # good enough: no other scaling is tried
    for others in ((D_L, D_R, 0 * G), (one_L, one_R, 0 * G)):
        other = bound_from_scalings(M, *others)
        D_L, D_R, G = (
            np.where((other < best)[:, None, None], new, old)
            for new, old in zip(others, (D_L, D_R, G), strict=True)
        )
        best = np.minimum(best, other)
    best = np.where(best == 0, bound_from_scalings(M, D_L, D_R, G), best)
    scaling = (np.moveaxis(m, 0, 2) for m in (D_L, D_R, G * scale[:, None, None]))
    return MuBound(value=best * scale, scaling=tuple(scaling))


def response_matrices(name: str, N: object) -> np.ndarray:
    """Return (W, n_out, n_in) from (n_out, n_in, W), or refuse the array."""
    if isinstance(N, control.lti.LTI):
        raise ValueError(
            f"{name} must be an array (outputs, inputs, frequencies), got a {type(N).__name__};"
            f" give its response, {name}(1j * omega), or use robust.mu.certify, which bounds mu of"
            " a state space at all frequencies"
        )
    M = np.asarray(N)
    if M.ndim != 3 or M.dtype.kind not in "fciu":
        raise ValueError(
            f"{name} must be an array (outputs, inputs, frequencies), got {short_form(M)}. One"
            " matrix: N[:, :, None]."
        )
    if not M.size:
        raise ValueError(
            f"{name} must have rows, columns and at least one frequency, got the shape {M.shape}"
        )
    if not np.isfinite(M).all():
        raise ValueError(
            f"{name} must be finite, got {np.count_nonzero(~np.isfinite(M))} nan or infinite"
            " numbers"
        )
    return np.ascontiguousarray(np.moveaxis(M, 2, 0), dtype=complex)


def bound_from_scalings(
    N: np.ndarray, D_L: np.ndarray, D_R: np.ndarray, G: np.ndarray
) -> np.ndarray:
    """Return (W,) the bound that these scalings prove; inf if they prove none."""
    with np.errstate(all="ignore"):
        scaled = D_L @ N @ np.linalg.inv(D_R)
        fine = np.isfinite(scaled).all(axis=(1, 2)) & np.isfinite(G).all(axis=(1, 2))
    scaled = np.where(fine[:, None, None], scaled, 0)
    if not G.any():
        bound = np.linalg.svd(scaled, compute_uv=False)[:, 0]
        return np.where(fine, bound, np.inf)
    G = np.where(fine[:, None, None], G, 0)
    skew = 1j * G @ scaled
    square = conjugate_transpose(scaled) @ scaled
    rounding = (
        20
        * N.shape[-1]
        * EPS
        * (np.linalg.norm(square, axis=(1, 2)) + np.linalg.norm(skew, axis=(1, 2)))
    )
    largest = np.linalg.eigvalsh(square + skew + conjugate_transpose(skew))[:, -1] + rounding
    return np.where(fine, np.sqrt(np.maximum(largest, 0.0)), np.inf)


def conjugate_transpose(M: np.ndarray) -> np.ndarray:
    return M.conj().swapaxes(-1, -2)


def _osborne_balance(N: np.ndarray, s: BlockStructure, n_steps: int = 12) -> np.ndarray:
    """Return (W, blocks) numbers d that balance the norms of the blocks d_i N_ik / d_k."""
    sizes = np.stack(
        [
            np.stack([np.linalg.norm(N[:, r, c], axis=(1, 2)) for c in s.cols], axis=1)
            for r in s.rows
        ],
        axis=1,
    )
    sizes = sizes**2 * (1 - np.eye(len(s.rows)))
    floor = 1e-40 * (sizes.sum(axis=(1, 2)) + 1e-200)  # for a block without coupling to the others
    d2 = np.ones((N.shape[0], len(s.rows)))
    for _ in range(n_steps):
        for i in range(len(s.rows)):
            row = (sizes[:, i] / d2).sum(axis=1) + floor  # over the columns k, without d_i
            column = (sizes[:, :, i] * d2).sum(axis=1) + floor
            d2[:, i] = np.sqrt(column / row)
        d2 /= d2[:, -1:]
    return np.sqrt(d2)


def optimal_scalings(
    N: np.ndarray, s: BlockStructure, *, target: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return D_L, D_R and G (W, ., .) with the least bound:

    Osborne's balance, then the method of centres.

    With a target that can be reached, the centre of the scalings that prove it: those with the
    largest slack. Many scalings on many frequencies are computed for a few frequencies at a time,
    and very many in fewer steps. Blocks without a loop through both have no common centre, and are
    scaled separately.
    """
    label, depth = _separate_loops(N, s)
    if label.max() > 0:
        return _scalings_of_loops(N, s, label=label, depth=depth, target=target)
    W, size = N.shape[0], len(s.left) + len(s.skew)
    target = np.broadcast_to(np.square(target), W)
    parts = np.array_split(np.arange(W), max(1, W * size * N.shape[2] ** 2 // _MAX_ENTRIES))
    most = int(
        np.clip(_MOST_WORK / (W * size**2 * N.shape[2] ** 2 + 1), _LEAST_STEPS, _MAX_STEPS_REAL)
    )
    n_steps = min(most, _MAX_STEPS_REAL if s.skew.size else _MAX_STEPS)
    found = [_method_of_centres(N[part], s, target=target[part], n_steps=n_steps) for part in parts]
    D_L, D_R, G = (np.concatenate(each) for each in zip(*found, strict=True))
    return D_L, D_R, G


#: Factor by which a one-way coupling of two blocks counts less than their own entries, and largest
#: ratio of the two.
_ONE_WAY, _MAX_COUPLING = 1e4, 1e16


def _separate_loops(N: np.ndarray, s: BlockStructure) -> tuple[np.ndarray, np.ndarray]:
    """Return (K,) the loop of each block, and the number of loops before it."""
    acts = np.array([[bool(N[:, row, col].any()) for col in s.cols] for row in s.rows]) | np.eye(
        len(s.rows), dtype=bool
    )
    for _ in s.rows:
        acts = acts @ acts  # row from column, over any path
    _, label = np.unique(acts & acts.T, axis=0, return_inverse=True)
    return np.ravel(label), (acts & ~acts.T).sum(axis=1)


def _scalings_of_loops(
    N: np.ndarray,
    s: BlockStructure,
    *,
    label: np.ndarray,
    depth: np.ndarray,
    target: np.ndarray | float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `optimal_scalings` for loops with at most one-way coupling."""
    W, (n_out, n_in) = len(N), s.shape
    D_L, D_R, G = (
        np.zeros((W, *shape), complex) for shape in ((n_out, n_out), (n_in, n_in), (n_in, n_out))
    )
    for k in range(label.max() + 1):
        own = np.flatnonzero(label == k)
        rows, cols = (np.concatenate([np.r_[cut[i]] for i in own]) for cut in (s.rows, s.cols))
        sizes = [
            (s.rows[i].stop - s.rows[i].start, s.cols[i].stop - s.cols[i].start, s.kinds[i])
            for i in own
        ]
        inside = N[:, rows[:, None], cols]
        found = optimal_scalings(inside, block_structure("blocks", sizes), target=target)
        # the coupling of the loops must vanish relative to their own entries, in any units
        least = np.min(
            np.abs(inside).max(axis=(1, 2)),
            initial=np.inf,
            where=np.abs(inside).max(axis=(1, 2)) > 0,
        )
        if np.isfinite(least):
            coupling = max(1.0, float(np.abs(N).max() / least))
        else:
            coupling = 1.0
        unit = (_ONE_WAY * min(coupling, _MAX_COUPLING)) ** -float(depth[own[0]])
        D_L[:, rows[:, None], rows], D_R[:, cols[:, None], cols] = unit * found[0], unit * found[1]
        G[:, cols[:, None], rows] = found[2]
    return D_L, D_R, G


def _method_of_centres(
    N: np.ndarray, s: BlockStructure, *, target: np.ndarray, n_steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return D_L, D_R, G with the least bound, for all frequencies; below `target` (W,), squared,
    with most slack.
    """
    W = N.shape[0]
    # Minimise alpha such that alpha I - (the bound's matrix) stays positive: Newton steps go to the
    # centre of the scalings that are possible for alpha, then alpha is lowered (Boyd and El Ghaoui
    # 1993). All frequencies are solved together; those that are done leave.
    d = _osborne_balance(N, s)
    D_L, D_R = (
        np.stack([np.diag(np.repeat(row, [p.stop - p.start for p in parts])) for row in d]).astype(
            complex
        )
        for parts in (s.rows, s.cols)
    )
    G = np.zeros((W, *s.skew.shape[1:]), complex)
    todo = np.arange(W)
    M, L, R, g = D_L @ N @ np.linalg.inv(D_R), D_L.copy(), D_R.copy(), G.copy()
    bound = _top_eigenvalue(M, g)
    best = bound.copy()
    alpha = np.where(
        bound < target, target, np.maximum(bound * 1.3, bound + 0.1 * np.abs(bound) + 1e-9)
    )
    for _ in range(n_steps):
        M, L, R, g, near, lost = _newton_step_to_centre(M, L, R=R, G=g, alpha=alpha, s=s)
        bound = _top_eigenvalue(M, g)
        goal = target[todo]
        better = (bound < best[todo]) | (alpha == goal)
        at = todo[better]
        D_L[at], D_R[at], G[at], best[at] = L[better], R[better], g[better], bound[better]
        # far from the centre alpha is constant; near it, it decreases towards the bound reached
        gap = alpha - bound
        done = (
            lost
            | (gap <= _CENTRE_GAP * np.abs(alpha))
            | (bound < 1e-14) & (goal == 0)
            | near & (alpha == goal)
        )
        alpha = np.where(near, np.where(bound < goal, goal, bound + 0.2 * gap), alpha)
        keep = ~done & np.isfinite(bound)
        todo, M, L, R, g, alpha = todo[keep], M[keep], L[keep], R[keep], g[keep], alpha[keep]
        if not todo.size:
            break
    return D_L, D_R, G


def _top_eigenvalue(M: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (W,) the largest eigenvalue of `scaled_square`."""
    return np.linalg.eigvalsh(scaled_square(M, G))[:, -1]


def scaled_square(M: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return M^H M + j (G M - M^H G^H) of every matrix, G on the first inputs and outputs."""
    square, (cols, rows) = conjugate_transpose(M) @ M, G.shape[1:]
    if G.any():
        skew = np.zeros_like(square)
        skew[:, :cols] = 1j * G @ M[:, :rows]
        square = square + skew + conjugate_transpose(skew)
    return square


def _newton_step_to_centre(
    M: np.ndarray,
    L: np.ndarray,
    *,
    R: np.ndarray,
    G: np.ndarray,
    alpha: np.ndarray,
    s: BlockStructure,
) -> tuple[np.ndarray, ...]:
    """Take one Newton step from X = I to the centre of the scalings that prove alpha; return if it
    was near, or lost.

    The centre minimises -log det(alpha X_R - A(X, G)) - log det X at constant trace, because X and
    G prove the same as any multiple of them. The barrier is self-concordant, so a step damped by
    its decrement stays inside (Nesterov & Nemirovskii 1994).
    """
    W, n = M.shape[0], M.shape[2]
    K = s.left.shape[0]
    F = alpha[:, None, None, None] * s.right - conjugate_transpose(M)[:, None] @ s.left @ M[:, None]
    if s.skew.size:
        skew = 1j * s.skew @ M[:, None]
        F = np.concatenate([F, -(skew + conjugate_transpose(skew))], axis=1)
    # F: derivatives of Y = alpha X_R - A by the coordinates of X, then of G; -log det Y has the
    # derivatives -tr(Y^-1 F_k) and tr(Y^-1 F_k Y^-1 F_l)
    A = scaled_square(M, G)
    inverse = np.linalg.inv(alpha[:, None, None] * np.eye(n) - A)
    P = inverse[:, None] @ F
    flat = P.reshape(W, -1, n * n)
    turned = P.swapaxes(-1, -2).reshape(W, -1, n * n)
    H = (flat @ turned.swapaxes(-1, -2)).real
    trace = np.einsum("kii->k", s.left).real
    rows, G_rows = s.left.reshape(K, M.shape[1] ** 2), s.skew.reshape(len(s.skew), n * M.shape[1])
    # the same of -log det X, at X = I
    gram = (rows @ s.left.swapaxes(1, 2).reshape(rows.shape).T).real
    H[:, :K, :K] += gram
    gradient = -np.einsum("wkii->wk", P).real
    gradient[:, :K] -= trace
    size = H.shape[1]
    # a penalty on G, which the barrier alone may let diverge; it is weaker closer to the bound
    spring = _CENTRE_REGULARISATION * np.clip(1 - np.linalg.eigvalsh(A)[:, -1] / alpha, 1e-9, 1.0)
    gradient[:, K:] += spring[:, None] * (G.reshape(W, n * M.shape[1]) @ G_rows.conj().T).real
    H[:, K:, K:] += spring[:, None, None] * (G_rows.conj() @ G_rows.T).real
    # the ridge keeps H regular along a flat direction
    H = H + 1e-13 * np.einsum("wkk->w", H)[:, None, None] * np.eye(size) / size
    # two right-hand sides: trace and gradient. Their combination with zero trace is the step.
    border = np.zeros((W, size, 2))
    border[:, :K, 0], border[:, :, 1] = trace, gradient
    try:
        solved = np.linalg.solve(H, border)
    except np.linalg.LinAlgError:  # one of them has a flat direction
        solved = np.linalg.pinv(H, hermitian=True) @ border
    multiplier = (trace @ solved[:, :K, 1:])[:, 0] / (trace @ solved[:, :K, :1])[:, 0]
    step = multiplier[:, None] * solved[:, :, 0] - solved[:, :, 1]
    decrement = np.sqrt(np.maximum(-(gradient * step).sum(axis=1), 0.0))
    near = decrement < 0.5  # a full step stays inside below one
    step = step * np.where(near, 1.0, 1 / (1 + decrement))[:, None]
    if s.scalar and not s.skew.size:
        # every X is diagonal: roots and quotients suffice
        left, right = (1 + step @ np.einsum("kii->ki", basis).real for basis in (s.left, s.right))
        lost = ~(np.minimum(left.min(axis=1), right.min(axis=1)) > 1e-9)
        left, right = (np.sqrt(np.where(lost[:, None], 1.0, x))[:, :, None] for x in (left, right))
        return left * M / right.swapaxes(1, 2), left * L, right * R, G, near, lost
    X_L = np.eye(M.shape[1]) + np.tensordot(step[:, :K], s.left, 1)
    X_R = np.eye(n) + np.tensordot(step[:, :K], s.right, 1)
    least = np.minimum(np.linalg.eigvalsh(X_L)[:, 0], np.linalg.eigvalsh(X_R)[:, 0])
    lost = ~(least > 1e-9)  # rounding dominates: do not move
    X_L[lost], X_R[lost] = np.eye(M.shape[1]), np.eye(n)
    if s.skew.size:
        G = G + np.where(lost[:, None, None], 0, np.tensordot(step[:, K:], s.skew, 1))
    # M, L and R take the step in, so that the next one starts from X = I again
    C_L, C_R = np.linalg.cholesky(X_L), np.linalg.cholesky(X_R)
    into = np.linalg.inv(conjugate_transpose(C_R))
    if s.skew.size:
        G = conjugate_transpose(into) @ G @ np.linalg.inv(conjugate_transpose(C_L))
    return (
        conjugate_transpose(C_L) @ M @ into,
        conjugate_transpose(C_L) @ L,
        conjugate_transpose(C_R) @ R,
        G,
        near,
        lost,
    )


_N_REFINEMENTS = 4


def mu_bound_at(N: control.StateSpace, blocks: Blocks, *, omega: np.ndarray) -> np.ndarray:
    """Return (W,) the upper bound at omega."""
    return upper_bound(response_matrices("N", response_by_channel(N, omega)), blocks).value


def refine_grid(
    N: control.StateSpace, blocks: Blocks, *, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies with additional ones around the peak, and the bound at them."""
    mu = mu_bound_at(N, blocks, omega=omega)
    for _ in range(_N_REFINEMENTS):  # around the largest value, five times closer each time
        k = int(mu.argmax())
        if k > 1:
            low = omega[k - 1]
        else:
            low = omega[1] / 10
        more = np.geomspace(low, omega[min(k + 1, omega.size - 1)], 11)[1:-1]
        more = np.setdiff1d(more, omega)
        both = np.concatenate([omega, more])
        order = np.argsort(both)
        omega, mu = both[order], np.concatenate([mu, mu_bound_at(N, blocks, omega=more)])[order]
    return omega, mu
