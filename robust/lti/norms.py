"""The H-infinity norm and the Hamiltonian test behind it, with an honest account of rounding."""

from __future__ import annotations

import warnings

import control
import numpy as np
from scipy.linalg import eig, schur, solve_continuous_are, solve_continuous_lyapunov

from robust.lti.lti import Matrices, balance_matrix, evaluate_transfer, timebase

# ---- Bilinear maps: between the circle and the axis, z = (1 + s T/2)/(1 - s T/2), and between discs and half planes.


def to_continuous(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear image z = (1 + s)/(1 - s): keeps stability and norms; omega maps to tan(omega dt / 2)."""
    n = A.shape[0]
    inverse = _invert_for_bilinear(A + np.eye(n), "z = -1 (the Nyquist frequency)")
    return inverse @ (A - np.eye(n)), np.sqrt(2) * inverse @ B, np.sqrt(2) * C @ inverse, D - C @ inverse @ B


def to_discrete(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear image s = (z - 1)/(z + 1) of a continuous system, the inverse of `to_continuous`."""
    n = A.shape[0]
    inverse = _invert_for_bilinear(np.eye(n) - A, "s = 2/dt (or where prewarping puts that)")
    return inverse @ (np.eye(n) + A), np.sqrt(2) * inverse @ B, np.sqrt(2) * C @ inverse, D + C @ inverse @ B


def _invert_for_bilinear(A: np.ndarray, place: str) -> np.ndarray:
    """Return the inverse a bilinear map needs, or a refusal that names the pole in its way."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError(
            f"system must have no pole at {place}, got one: the bilinear map would send it to infinity"
        ) from None


def continuous_image(system: control.StateSpace) -> Matrices:
    """Return the matrices in continuous time; discrete systems through the bilinear map, which keeps the norm."""
    matrices = (system.A, system.B, system.C, system.D)
    return to_continuous(*matrices) if timebase(system) else matrices


def to_half_plane(matrices: Matrices, a: float, b: float) -> Matrices:
    """Return the image under p = (s - a)/(1 - s/b), which takes the circle through a and b, both real, onto the axis.

    With 0 < a < b the disc between them becomes the right half plane of p, with b < a < 0 all that lies outside of it.

    >>> A, B, C, D = to_half_plane((np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))), 1.0, 3.0)
    >>> float(A[0, 0]), round(float((D - C @ np.linalg.solve(A - 1, B))[0, 0]), 12)   # p = 1 is s = 1.5: 1/(1.5 - 1)
    (0.0, 2.0)
    """
    A, B, C, D = matrices
    inverse = np.linalg.inv(np.eye(A.shape[0]) - A / b)
    across, root = inverse @ B, np.sqrt(1 - a / b)
    return inverse @ (A - a * np.eye(A.shape[0])), root * across, root * C @ inverse, D + C @ across / b


def from_half_plane(matrices: Matrices, a: float, b: float) -> Matrices:
    """Return the image under s = (p + a)/(1 + p/b), the inverse of `to_half_plane`."""
    return to_half_plane(matrices, -a, -b)


EPS = np.finfo(float).eps
_LEVEL_OFFSETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # relative, above a singular value of D


def well_conditioned(matrices: Matrices) -> Matrices:
    """Return a stable system in coordinates where numbers say what the dynamics are, hidden modes kept."""
    return well_conditioned_with(matrices)[0]


def well_conditioned_with(matrices: Matrices) -> tuple[Matrices, np.ndarray]:
    """Return `well_conditioned` and the T of its coordinates T x.

    The two Gramians are balanced (Moore 1981) after a small multiple of the identity was added to what drives them,
    so that a mode that hardly shows at input or output stays where it is; modal coordinates where that fails, those
    of the model where neither reproduces the response.
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
    scale = size + 1e-6 * size.max() + 1e-300  # where nearly nothing comes through, nothing need be kept
    for forth, back in filter(None, candidates):
        moved = forth @ A @ back, forth @ B, C @ back, D
        if all(np.isfinite(m).all() for m in moved):
            after = evaluate_transfer(*moved, 1j * omega)
            if np.all(np.abs(before - after) < 1e-6 * scale):
                return moved, forth / weights
    return (A, B, C, D), np.diag(1 / weights)


def _balancing_coordinates(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Coordinates that balance the Gramians, and back; None where they are not to be trusted."""
    speed = float(np.exp(np.mean(np.log(np.maximum(np.abs(np.linalg.eigvals(A)), 1e-300)))))
    drive, sense = B @ B.T, C.T @ C
    floor = 1e-7 * np.eye(A.shape[0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # scipy warns of a Gramian that is not to be trusted
            Wc = solve_continuous_lyapunov(A / speed, -drive / max(np.trace(drive), 1e-300) - floor)
            Wo = solve_continuous_lyapunov(A.T / speed, -sense / max(np.trace(sense), 1e-300) - floor)
        Lc, Lo = np.linalg.cholesky((Wc + Wc.T) / 2), np.linalg.cholesky((Wo + Wo.T) / 2)
    except (np.linalg.LinAlgError, RuntimeWarning):
        return None
    U, sizes, V = np.linalg.svd(Lo.T @ Lc)
    return (U / np.sqrt(sizes)).T @ Lo.T, Lc @ V.T / np.sqrt(sizes)


def modal_coordinates(A: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Coordinates in which every mode has its own one or two states, and back; None where modes nearly coincide."""
    found, vectors = np.linalg.eig(A)
    columns = []
    for value, vector in zip(found, vectors.T, strict=True):
        if value.imag == 0:
            columns.append(vector.real)
        elif value.imag > 0:
            columns += [vector.real, vector.imag]
    back = np.column_stack(columns)
    return None if np.linalg.cond(back) > 1e10 else (np.linalg.inv(back), back)


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
    """Frequencies [rad/s] where a singular value may equal `level`, with the uncertainty of each by rounding.

    They are the eigenvalues of the Hamiltonian that may lie on the imaginary axis: an eigenvalue counts as
    soon as its distance from the axis is within what rounding can move it (100 eps |H| over its condition, and at
    most what it moves a sixfold eigenvalue), so that no true crossing is lost. None where the test cannot be made:
    level is a singular value of D.

    References
    ----------
    Boyd, Balakrishnan & Kabamba 1989; Bruinsma & Steinbuch 1990.
    """
    A, B, C, D = matrices
    n = A.shape[0]
    if n == 0:
        return np.zeros(0), np.zeros(0)
    B, C, D = B / np.sqrt(level), C / np.sqrt(level), D / level
    Bh, Ch, Dh = B.conj().T, C.conj().T, D.conj().T  # a scaling may have made them complex
    inner, outer = np.eye(D.shape[1]) - Dh @ D, np.eye(D.shape[0]) - D @ Dh
    smallest = min(np.abs(np.linalg.eigvalsh(M)).min() for M in (inner, outer))
    if smallest < 1e-9:
        return None
    rounding = EPS / min(smallest, 1.0)  # of what the Hamiltonian is made from, relative to it
    F = A + B @ np.linalg.solve(inner, Dh @ C)
    H = np.block([[F, B @ np.linalg.solve(inner, Bh)], [-Ch @ np.linalg.solve(outer, C), -F.conj().T]])
    return _eigenvalues_near_axis(H, rounding)


def _eigenvalues_near_axis(H: np.ndarray, rounding: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Eigenvalues of a Hamiltonian that may lie on the upper imaginary axis, with what rounding may have moved them."""
    if not np.isfinite(H).all():
        return None
    H = balance_matrix(H)[0]
    found, left, right = eig(H, left=True, right=True)
    cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    # to first order; where eigenvalues coincide (the states of a delay do) they move by a root of that instead
    moved = np.minimum(100 * rounding / np.maximum(cosine, EPS), 10 * rounding ** (1 / 6)) * np.linalg.norm(H)
    near = (np.abs(found.real) <= moved) & (found.imag >= -moved)
    return np.maximum(found.imag[near], 0.0), moved[near]


def hinf_norm(system: control.StateSpace, *, tolerance: float = 1e-9) -> tuple[float, float]:
    """H-infinity norm of a stable system and the frequency [rad/s] of its peak (inf where unstable).

    A lower bound by evaluation, raised from one pair of crossings to the next (Bruinsma & Steinbuch 1990).

    >>> norm, omega = hinf_norm(control.ss(control.tf([1], [1, 0.1, 1])))
    >>> round(norm, 6), round(omega, 4)
    (10.012523, 0.9975)
    """
    dt = timebase(system)
    p = np.linalg.eigvals(system.A) if system.nstates else np.zeros(0)
    if np.any(np.abs(p) >= 1) if dt else np.any(p.real >= 0):
        return np.inf, np.nan
    matrices = well_conditioned(continuous_image(system))
    p = np.linalg.eigvals(matrices[0]) if system.nstates else p
    starts = np.concatenate([[0.0, np.inf], np.abs(p.imag), np.abs(p)])
    gains = largest_gain(matrices, starts)
    peak, norm = float(starts[gains.argmax()]), float(gains.max())
    for _ in range(30):
        higher = _find_gain_above(matrices, norm, tolerance) if norm else None
        if higher is None:
            break
        norm, peak = higher
    return norm, 2 / dt * float(np.arctan(peak)) if dt else peak


def _find_gain_above(matrices: Matrices, norm: float, tolerance: float) -> tuple[float, float] | None:
    """Return a gain above a norm by more than a tolerance, and where [rad/s]; None where there is none.

    Beside a singular value of D (a norm that is reached at infinity, or at the Nyquist frequency) the Hamiltonian says
    nothing for rounding: peaks that are well above it are looked for first.
    """
    sizes = np.linalg.svd(matrices[3], compute_uv=False)
    near_direct = np.any(np.abs(sizes - norm) < _LEVEL_OFFSETS[0] * norm)
    for step in (*_LEVEL_OFFSETS, tolerance) if near_direct else (tolerance,):
        found = crossings(matrices, norm * (1 + step))
        if found is None or not found[0].size:
            continue
        omega = np.unique(found[0])
        middle = np.concatenate([omega, (omega[1:] + omega[:-1]) / 2, np.sqrt(omega[1:] * omega[:-1])])
        gains = largest_gain(matrices, middle)
        if gains.max() > norm * (1 + tolerance):
            return float(gains.max()), float(middle[gains.argmax()])
    return None


# ---- Stabilising solutions of Riccati equations.

_WELL_CONDITIONED = 1e6  # R of up to this: the Hamiltonian, at a third of the time
_RICCATI_RESIDUAL = 1e-11  # of its largest terms may be left of the equation where another solver can be asked
#: The same at all: without a solution the pencil gives a matrix that leaves a tenth. Of 54 published problems 1e-6
#: worsens one by 17 %, as slow poles leave more of a solution, and 1e-8 refutes a level that is reached.
_MAX_RESIDUAL = 1e-3


def stabilising_riccati(
    A: np.ndarray, B: np.ndarray, *, Q: np.ndarray, R: np.ndarray, S: np.ndarray, quick: bool = False
) -> np.ndarray | None:
    """X >= 0 with A'X + XA - (XB + S) R^-1 (B'X + S') + Q = 0 and A + B F stable; None where there is none.

    quick: from the Hamiltonian where that is exact enough, for when only the existence is asked for.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros((0, 0))
    if not Q.any() and not S.any() and np.linalg.eigvals(A).real.max() < 0:
        return np.zeros((n, n))  # which rounding would give a sign
    quick = quick and np.linalg.cond(R) < _WELL_CONDITIONED
    solvers = (_riccati_by_hamiltonian, _riccati_by_pencil) if quick else (_riccati_by_pencil, _riccati_by_hamiltonian)
    for solve in solvers:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the solution is judged below
                X = solve(A, B, Q, R, S)
            gain = np.linalg.solve(R, B.T @ X + S.T)
            poles = np.linalg.eigvals(A - B @ gain)
        except (np.linalg.LinAlgError, ValueError):
            continue
        # a slow pole may come out on either side and is judged later; an undamped one means no solution
        slack = np.where(np.abs(poles) > 1e-9 * np.linalg.norm(A), -1e-9 * np.abs(poles), 1e-9 * np.linalg.norm(A))
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


def _riccati_by_pencil(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray) -> np.ndarray:
    """SciPy's solver, on the extended pencil: R need not be well conditioned."""
    return np.asarray(solve_continuous_are(A, B, Q, R, s=S))


def _riccati_by_hamiltonian(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray) -> np.ndarray:
    """From the stable subspace of the Hamiltonian, whose slow eigenvalues are the more exact ones."""
    n = A.shape[0]
    F = A - B @ np.linalg.solve(R, S.T)
    G, H = B @ np.linalg.solve(R, B.T), Q - S @ np.linalg.solve(R, S.T)
    size = np.sqrt(np.linalg.norm(H) / np.linalg.norm(G)) if H.any() and G.any() else 1.0
    _, Z, n_stable = schur(np.block([[F, -G * size], [-H / size, -F.T]]), sort="lhp")
    if n_stable != n:
        raise ValueError("eigenvalues on the imaginary axis")
    return np.asarray(np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * size)


def continuous_matrices(system: control.StateSpace, dt: float) -> Matrices:
    """Return the system in s, or under a clock in w = 2/dt (z - 1)/(z + 1) [rad/s]: the bilinear map keeps norms."""
    matrices = (system.A, system.B, system.C, system.D)
    if not dt or not system.nstates:
        return matrices
    A, B, C, D = to_continuous(*matrices)
    root = np.sqrt(2 / dt)
    return A * 2 / dt, B * root, C * root, D


def discrete_matrices(matrices: Matrices, dt: float) -> Matrices:
    """Return under a clock dt [s] the image of a system in 2/dt (z - 1)/(z + 1): `continuous_matrices` undone."""
    if not dt:
        return matrices
    A, B, C, D = matrices
    root = np.sqrt(dt / 2)
    return to_discrete(A * dt / 2, B * root, C * root, D)
