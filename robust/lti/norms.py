"""The H-infinity norm and its Hamiltonian test, with a bound on rounding."""

from __future__ import annotations

import warnings

import control
import numpy as np
from scipy.linalg import eig, schur, solve_continuous_are, solve_continuous_lyapunov

from robust.lti.lti import Matrices, balance_matrix, evaluate_transfer, timebase

# ---- Bilinear maps: between the circle and the axis, z = (1 + s T/2)/(1 - s T/2), and between
# discs and half planes.


def to_continuous(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the bilinear image z = (1 + s)/(1 - s), with equal stability and norms; omega maps to
    tan(omega dt/2).
    """
    n = A.shape[0]
    inverse = _invert_for_bilinear(A + np.eye(n), "z = -1 (the Nyquist frequency)")
    return (
        inverse @ (A - np.eye(n)),
        np.sqrt(2) * inverse @ B,
        np.sqrt(2) * C @ inverse,
        D - C @ inverse @ B,
    )


def to_discrete(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the bilinear image s = (z - 1)/(z + 1), the inverse of `to_continuous`."""
    n = A.shape[0]
    inverse = _invert_for_bilinear(np.eye(n) - A, "s = 2/dt (or where prewarping puts that)")
    return (
        inverse @ (np.eye(n) + A),
        np.sqrt(2) * inverse @ B,
        np.sqrt(2) * C @ inverse,
        D + C @ inverse @ B,
    )


def _invert_for_bilinear(A: np.ndarray, place: str) -> np.ndarray:
    """Return the inverse for a bilinear map, or refuse the pole that makes it singular."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError(
            f"system must have no pole at {place}, because the bilinear map moves it to"
            " infinity, got one"
        ) from None


def continuous_image(system: control.StateSpace) -> Matrices:
    """Return the matrices in continuous time; discrete systems through the bilinear map, which
    keeps the norm.
    """
    matrices = (system.A, system.B, system.C, system.D)
    if timebase(system):
        return to_continuous(*matrices)
    return matrices


def to_half_plane(matrices: Matrices, a: float, b: float) -> Matrices:
    """Return the image under p = (s - a)/(1 - s/b), which maps the circle through the real a and b
    onto the axis.

    For 0 < a < b the disc between them becomes the right half plane of p; for b < a < 0 the outside
    of the disc does.

    >>> A, B, C, D = to_half_plane((np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))), 1.0, 3.0)
    >>> float(A[0, 0]), round(float((D - C @ np.linalg.solve(A - 1, B))[0, 0]), 12)   # p = 1 is s = 1.5: 1/(1.5 - 1)
    (0.0, 2.0)
    """
    A, B, C, D = matrices
    inverse = np.linalg.inv(np.eye(A.shape[0]) - A / b)
    across, root = inverse @ B, np.sqrt(1 - a / b)
    return (
        inverse @ (A - a * np.eye(A.shape[0])),
        root * across,
        root * C @ inverse,
        D + C @ across / b,
    )


def from_half_plane(matrices: Matrices, a: float, b: float) -> Matrices:
    """Return the image under s = (p + a)/(1 + p/b), the inverse of `to_half_plane`."""
    return to_half_plane(matrices, -a, -b)


EPS = np.finfo(float).eps
_LEVEL_OFFSETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # relative, above a singular value of D


def well_conditioned(matrices: Matrices) -> Matrices:
    """Return a stable system in well-conditioned coordinates, with its hidden modes."""
    return well_conditioned_with(matrices)[0]


def well_conditioned_with(matrices: Matrices) -> tuple[Matrices, np.ndarray]:
    """Return `well_conditioned`, and the T of its coordinates T x.

    The two Gramians are balanced (Moore 1981) after a small multiple of the identity is added to
    their right-hand sides, so that a mode that hardly shows at input or output stays in place. If
    that fails, modal coordinates are used; if neither reproduces the response, those of the model.
    """
    A, B, C, D = matrices
    n = A.shape[0]
    if n < 2:
        return matrices, np.eye(n)
    A, weights = balance_matrix(A)
    B, C = B / weights[:, None], C * weights
    candidates = [_balancing_coordinates(A, B, C), modal_coordinates(A)]
    omega = np.unique(np.abs(np.linalg.eigvals(A)))
    before = evaluate_transfer(*matrices, 1j * omega)
    size = np.abs(before).max(axis=(1, 2), keepdims=True)
    # a response that is nearly zero need not be reproduced
    scale = size + 1e-6 * size.max() + 1e-300
    for forth, back in filter(None, candidates):
        moved = forth @ A @ back, forth @ B, C @ back, D
        if all(np.isfinite(m).all() for m in moved):
            after = evaluate_transfer(*moved, 1j * omega)
            if np.all(np.abs(before - after) < 1e-6 * scale):
                return moved, forth / weights
    return (A, B, C, D), np.diag(1 / weights)


def _balancing_coordinates(
    A: np.ndarray, B: np.ndarray, C: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return coordinates that balance the Gramians, and back; None if they are inaccurate."""
    speed = float(np.exp(np.mean(np.log(np.maximum(np.abs(np.linalg.eigvals(A)), 1e-300)))))
    drive, sense = B @ B.T, C.T @ C
    floor = 1e-7 * np.eye(A.shape[0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # scipy warns of an inaccurate Gramian
            Wc = solve_continuous_lyapunov(A / speed, -drive / max(np.trace(drive), 1e-300) - floor)
            Wo = solve_continuous_lyapunov(
                A.T / speed, -sense / max(np.trace(sense), 1e-300) - floor
            )
        Lc, Lo = np.linalg.cholesky((Wc + Wc.T) / 2), np.linalg.cholesky((Wo + Wo.T) / 2)
    except (np.linalg.LinAlgError, RuntimeWarning):
        return None
    U, sizes, V = np.linalg.svd(Lo.T @ Lc)
    return (U / np.sqrt(sizes)).T @ Lo.T, Lc @ V.T / np.sqrt(sizes)


def modal_coordinates(A: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return modal coordinates and back; None if modes nearly coincide."""
    found, vectors = np.linalg.eig(A)
    columns = []
    for value, vector in zip(found, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
        elif value.imag > 0:
            columns += [vector.real, vector.imag]
    back = np.column_stack(columns)
    if np.linalg.cond(back) > 1e10:
        return None
    return np.linalg.inv(back), back


def largest_gain(matrices: Matrices, omega: np.ndarray) -> np.ndarray:
    """Return (W,) largest singular value at s = j omega; omega may be infinite."""
    omega = np.atleast_1d(np.asarray(omega, dtype=float))
    points = 1j * np.where(np.isinf(omega), 0.0, omega)
    points[np.isinf(omega)] = np.inf
    values = evaluate_transfer(*matrices, points)
    if values.shape[1:] == (1, 1):
        return np.abs(values[:, 0, 0])
    out = np.full(omega.size, np.inf)
    fine = np.isfinite(values).all(axis=(1, 2))
    out[fine] = np.linalg.svd(values[fine], compute_uv=False)[:, 0]
    return out


def crossings(matrices: Matrices, level: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return frequencies [rad/s] where a singular value may equal `level`, with the uncertainty of
    each by rounding.

    They are the eigenvalues of the Hamiltonian that may lie on the imaginary axis. An eigenvalue
    counts if rounding may have moved it by its distance from the axis (100 eps |H| over its
    condition, at most the shift of a sixfold eigenvalue), so no true crossing is lost. None if the
    test is impossible, because level is a singular value of D.

    References
    ----------
    Boyd, Balakrishnan & Kabamba 1989; Bruinsma & Steinbuch 1990.
    """
    A, B, C, D = matrices
    n = A.shape[0]
    if n == 0:
        return np.zeros(0), np.zeros(0)
    B, C, D = B / np.sqrt(level), C / np.sqrt(level), D / level
    Bh, Ch, Dh = B.conj().T, C.conj().T, D.conj().T  # complex after a complex scaling
    inner, outer = np.eye(D.shape[1]) - Dh @ D, np.eye(D.shape[0]) - D @ Dh
    smallest = min(np.abs(np.linalg.eigvalsh(M)).min() for M in (inner, outer))
    if smallest < 1e-9:
        return None
    rounding = EPS / min(smallest, 1.0)  # relative rounding of the parts of the Hamiltonian
    F = A + B @ np.linalg.solve(inner, Dh @ C)
    H = np.block(
        [[F, B @ np.linalg.solve(inner, Bh)], [-Ch @ np.linalg.solve(outer, C), -F.conj().T]]
    )
    return _eigenvalues_near_axis(H, rounding)


def _eigenvalues_near_axis(H: np.ndarray, rounding: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return eigenvalues of a Hamiltonian that may lie on the upper imaginary axis, and their
    possible shifts.
    """
    if not np.isfinite(H).all():
        return None
    H = balance_matrix(H)[0]
    found, left, right = eig(H, left=True, right=True)
    cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    # to first order; coinciding eigenvalues (such as the states of a delay) move by a root of that
    # instead
    moved = np.minimum(
        100 * rounding / np.maximum(cosine, EPS), 10 * rounding ** (1 / 6)
    ) * np.linalg.norm(H)
    near = (np.abs(found.real) <= moved) & (found.imag >= -moved)
    return np.maximum(found.imag[near], 0.0), moved[near]


def hinf_norm(system: control.StateSpace, *, tolerance: float = 1e-9) -> tuple[float, float]:
    """Return the H-infinity norm of a stable system and the frequency [rad/s] of its peak (inf if
    it is unstable).

    A lower bound by evaluation is raised from one pair of crossings to the next (Bruinsma &
    Steinbuch 1990).

    >>> norm, omega = hinf_norm(control.ss(control.tf([1], [1, 0.1, 1])))
    >>> round(norm, 6), round(omega, 4)
    (10.012523, 0.9975)
    """
    dt = timebase(system)
    if system.nstates:
        p = np.linalg.eigvals(system.A)
    else:
        p = np.zeros(0)
    if np.any(np.abs(p) >= 1) if dt else np.any(p.real >= 0):
        return np.inf, np.nan
    matrices = well_conditioned(continuous_image(system))
    if system.nstates:
        p = np.linalg.eigvals(matrices[0])
    starts = np.concatenate([[0.0, np.inf], np.abs(p.imag), np.abs(p)])
    gains = largest_gain(matrices, starts)
    peak, norm = float(starts[gains.argmax()]), float(gains.max())
    for _ in range(30):
        if norm:
            higher = _find_gain_above(matrices, norm, tolerance)
        else:
            higher = None
        if higher is None:
            break
        norm, peak = higher
    return norm, 2 / dt * float(np.arctan(peak)) if dt else peak


def _find_gain_above(
    matrices: Matrices, norm: float, tolerance: float
) -> tuple[float, float] | None:
    """Return a gain above a norm by more than a tolerance, and its frequency [rad/s]; None if there
    is none.

    Close to a singular value of D (a norm that is reached at infinity, or at the Nyquist frequency)
    rounding makes the Hamiltonian useless, so peaks well above it are searched first.
    """
    sizes = np.linalg.svd(matrices[3], compute_uv=False)
    near_direct = np.any(np.abs(sizes - norm) < _LEVEL_OFFSETS[0] * norm)
    for step in (*_LEVEL_OFFSETS, tolerance) if near_direct else (tolerance,):
        found = crossings(matrices, norm * (1 + step))
        if found is None or not found[0].size:
            continue
        omega = np.unique(found[0])
        middle = np.concatenate(
            [omega, (omega[1:] + omega[:-1]) / 2, np.sqrt(omega[1:] * omega[:-1])]
        )
        gains = largest_gain(matrices, middle)
        if gains.max() > norm * (1 + tolerance):
            return float(gains.max()), float(middle[gains.argmax()])
    return None


# ---- Stabilising solutions of Riccati equations.

# largest condition of R for the Hamiltonian, which takes a third of the time
_WELL_CONDITIONED = 1e6
# largest residual, relative to the largest terms, if another solver can be tried
_RICCATI_RESIDUAL = 1e-11
#: The same for the last solver: without a solution the pencil gives a matrix with a residual of a
#: tenth. Of 54 published problems 1e-6 worsens one by 17 %, because slow poles leave a larger
#: residual, and 1e-8 refutes a level that is reached.
_MAX_RESIDUAL = 1e-3


def stabilising_riccati(
    A: np.ndarray,
    B: np.ndarray,
    *,
    Q: np.ndarray,
    R: np.ndarray,
    S: np.ndarray,
    quick: bool = False,
) -> np.ndarray | None:
    """Return X >= 0 with A'X + XA - (XB + S) R^-1 (B'X + S') + Q = 0 and A + B F stable; None if
    there is none.

    quick : use the Hamiltonian if it is exact enough, for tests of existence only.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros((0, 0))
    if not Q.any() and not S.any() and np.linalg.eigvals(A).real.max() < 0:
        return np.zeros((n, n))  # rounding would give it a sign
    quick = quick and np.linalg.cond(R) < _WELL_CONDITIONED
    if quick:
        solvers = _riccati_by_hamiltonian, _riccati_by_pencil
    else:
        solvers = _riccati_by_pencil, _riccati_by_hamiltonian
    for solve in solvers:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the solution is judged below
                X = solve(A, B, Q, R, S)
            gain = np.linalg.solve(R, B.T @ X + S.T)
            poles = np.linalg.eigvals(A - B @ gain)
        except (np.linalg.LinAlgError, ValueError):
            continue
        # a slow pole may come out on either side and is judged later; an undamped one means no
        # solution
        slack = np.where(
            np.abs(poles) > 1e-9 * np.linalg.norm(A),
            -1e-9 * np.abs(poles),
            1e-9 * np.linalg.norm(A),
        )
        if np.any(poles.real > slack):
            continue
        X = (X + X.T) / 2
        left = A.T @ X + X @ A - (X @ B + S) @ gain + Q
        terms = 2 * np.linalg.norm(A.T @ X) + np.linalg.norm((X @ B + S) @ gain) + np.linalg.norm(Q)
        another = quick and solve is _riccati_by_hamiltonian
        if not np.linalg.norm(left) <= (_RICCATI_RESIDUAL if another else _MAX_RESIDUAL) * terms:
            continue
        # X = 0 is a solution too, and a slow pole magnifies its rounding
        slowest = max(float(np.abs(poles).min()), 1e-12)
        rounding = 1e-7 * np.linalg.norm(X) + (1e-9 + 1000 * EPS / slowest) * np.linalg.norm(Q)
        if np.linalg.eigvalsh(X)[0] >= -rounding:
            return X
    return None


def _riccati_by_pencil(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray
) -> np.ndarray:
    """Solve by SciPy, on the extended pencil: R need not be well conditioned."""
    return np.asarray(solve_continuous_are(A, B, Q, R, s=S))


def _riccati_by_hamiltonian(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray
) -> np.ndarray:
    """Solve from the stable subspace of the Hamiltonian, whose slow eigenvalues are more exact."""
    n = A.shape[0]
    F = A - B @ np.linalg.solve(R, S.T)
    G, H = B @ np.linalg.solve(R, B.T), Q - S @ np.linalg.solve(R, S.T)
    if H.any() and G.any():
        size = np.sqrt(np.linalg.norm(H) / np.linalg.norm(G))
    else:
        size = 1.0
    _, Z, n_stable = schur(np.block([[F, -G * size], [-H / size, -F.T]]), sort="lhp")
    if n_stable != n:
        raise ValueError("eigenvalues on the imaginary axis")
    return np.asarray(np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * size)


def continuous_matrices(system: control.StateSpace, dt: float) -> Matrices:
    """Return the system in s, or for dt in w = 2/dt (z - 1)/(z + 1) [rad/s]: the bilinear map keeps
    norms.
    """
    matrices = (system.A, system.B, system.C, system.D)
    if not dt or not system.nstates:
        return matrices
    A, B, C, D = to_continuous(*matrices)
    root = np.sqrt(2 / dt)
    return A * 2 / dt, B * root, C * root, D


def discrete_matrices(matrices: Matrices, dt: float) -> Matrices:
    """Return the system for dt [s] from its image in 2/dt (z - 1)/(z + 1), the inverse of
    `continuous_matrices`.
    """
    if not dt:
        return matrices
    A, B, C, D = matrices
    root = np.sqrt(dt / 2)
    return to_discrete(A * dt / 2, B * root, C * root, D)
