"""Linear systems as this package takes them in: one single-loop state space, its response, its roots."""

from __future__ import annotations

import numbers
from typing import Any

import control
import numpy as np
from scipy.linalg import eig, matrix_balance, schur

from nlfrf.checks import shown

MANY_STATES = 40


def state_space(name: str, system: Any) -> control.StateSpace:
    """The system as a single-input single-output state space with its own states kept, or a refusal.

    Transfer functions are realised without cancelling anything: a mode that hides in G K must stay visible to
    the stability check. A number becomes a constant gain.
    """
    if isinstance(system, (numbers.Real, np.ndarray)) and not isinstance(system, bool):
        gain = np.asarray(system, dtype=float)
        if gain.size != 1:
            raise ValueError(f"{name} must have one input and one output, got {shown(system)}")
        system = control.StateSpace([], [], [], gain.reshape(1, 1), None)
    if isinstance(system, control.TransferFunction):
        if (system.ninputs, system.noutputs) != (1, 1):
            raise ValueError(f"{name} must have one input and one output, got {system.ninputs} and {system.noutputs}")
        system = from_polynomials(name, system.num[0][0], system.den[0][0], system.dt)
    if not isinstance(system, control.StateSpace):
        raise ValueError(f"{name} must be a control.StateSpace, a TransferFunction or a number, got {shown(system)}")
    if (system.ninputs, system.noutputs) != (1, 1):
        raise ValueError(f"{name} must have one input and one output, got {system.ninputs} and {system.noutputs}")
    return complete(name, system)


def complete(name: str, system: control.StateSpace) -> control.StateSpace:
    """A state space that states its sampling time and has finite matrices, or a refusal."""
    if system.dt is True:
        raise ValueError(f"{name} must state its sampling time, got dt=True")
    for matrix in (system.A, system.B, system.C, system.D):
        if not np.isfinite(matrix).all():
            raise ValueError(f"{name} must have finite coefficients, got nan or infinite ones")
    return system


def from_polynomials(name: str, num: np.ndarray, den: np.ndarray, dt: Any) -> control.StateSpace:
    """Controllable canonical form in scaled time, balanced, so that coefficients over many decades survive."""
    num, den = np.trim_zeros(np.asarray(num, float), "f"), np.trim_zeros(np.asarray(den, float), "f")
    if den.size == 0 or not (np.isfinite(num).all() and np.isfinite(den).all()):
        raise ValueError(f"{name} must have finite coefficients and a denominator, got {num} over {den}")
    if num.size > den.size:
        raise ValueError(f"{name} must be proper, got degree {num.size - 1} over degree {den.size - 1}")
    n = den.size - 1
    num = np.concatenate([np.zeros(n + 1 - num.size), num]) / den[0]
    den = den / den[0]
    D = np.array([[num[0]]])
    if n == 0:
        return control.StateSpace([], [], [], D, dt)
    # scale = geometric mean of the roots that are not zero: the polynomial in s / scale has coefficients near one
    last = np.flatnonzero(den)[-1]
    scale = abs(den[last]) ** (1 / last) if last else 1.0
    powers = scale ** -np.arange(1.0, n + 1)
    tail, head = den[1:] * powers, (num[1:] - num[0] * den[1:]) * powers
    A = np.zeros((n, n))
    A[0], A[1:, :-1] = -tail, np.eye(n - 1)
    B = np.zeros((n, 1))
    B[0, 0] = 1.0
    A, B, C = scaled_states(A, B, head[None, :])
    level = np.sqrt(np.linalg.norm(C) / np.linalg.norm(B)) if np.any(C) else 1.0
    return control.StateSpace(A * scale, B * level * scale, C / level, D, dt)


def from_roots(zeros: np.ndarray, poles: np.ndarray, gain: float, dt: float) -> control.StateSpace:
    """gain prod (s - zeros) / prod (s - poles), realised as a chain of sections without forming polynomials.

    Both sets are closed under conjugation, with at most as many zeros as poles. Slow poles of a discrete system
    crowd around z = 1, where polynomial coefficients lose them and sections do not.
    """
    zero_pairs, zero_rest = paired(zeros)
    pole_pairs, pole_rest = paired(poles)
    chain = [control.StateSpace([], [], [], [[gain]], dt)]
    for pair in pole_pairs:
        mine: tuple[complex, ...] = ()
        if zero_pairs:
            mine = zero_pairs.pop(0)
        elif zero_rest and not pole_rest:
            mine = (zero_rest.pop(),)
        chain.append(section(mine, pair, dt))
    if pole_rest:
        chain.append(section(tuple(zero_rest), (pole_rest[0],), dt))
    return in_series(*chain)


def paired(roots: np.ndarray) -> tuple[list[tuple[complex, ...]], list[complex]]:
    """Conjugate pairs, then pairs of real roots in order of size; and the real root that is left, if any."""
    roots = np.asarray(roots, dtype=complex)
    real = np.abs(roots.imag) <= 1e-12 * np.abs(roots)
    upper = roots[~real & (roots.imag > 0)]
    alone = list(np.sort(roots[real].real))
    pairs: list[tuple[complex, ...]] = [(complex(r), complex(np.conj(r))) for r in upper]
    rest = [complex(alone.pop(0))] if len(alone) % 2 else []
    return pairs + [(complex(a), complex(b)) for a, b in zip(alone[::2], alone[1::2], strict=True)], rest


def section(zeros: tuple[complex, ...], poles: tuple[complex, ...], dt: float) -> control.StateSpace:
    """One section with one or two poles and at most as many zeros, leading coefficients one."""
    if len(poles) == 1:
        p = poles[0].real
        if not zeros:
            return control.StateSpace([[p]], [[1.0]], [[1.0]], [[0.0]], dt)
        return control.StateSpace([[p]], [[1.0]], [[p - zeros[0].real]], [[1.0]], dt)
    p1, p2 = poles
    direct = 1.0 if len(zeros) == 2 else 0.0
    # numerator = direct (s - p1)(s - p2) + slope (s - p2) + value, value being the numerator at p2
    slope = {2: lambda: (p1 + p2 - sum(zeros)).real, 1: lambda: 1.0, 0: lambda: 0.0}[len(zeros)]()
    if p1.imag == 0:
        value = np.prod([p2 - z for z in zeros]).real if zeros else 1.0
        A = [[p1.real, 0.0], [1.0, p2.real]]
        return control.StateSpace(A, [[1.0], [0.0]], [[slope, value]], [[direct]], dt)
    sigma, w = p1.real, abs(p1.imag)
    # states (s - sigma)/den and w/den; numerator = direct den + slope (s - sigma) + value
    if len(zeros) == 2:
        middle, product = sum(zeros).real / 2, np.prod(zeros).real
        value = (middle - sigma) ** 2 + (product - middle**2) - w**2
    else:
        value = (sigma - zeros[0]).real if zeros else 1.0
    A = [[sigma, -w], [w, sigma]]
    return control.StateSpace(A, [[1.0], [0.0]], [[slope, value / w]], [[direct]], dt)


def timebase(system: control.StateSpace) -> float:
    """Sampling time [s], zero for continuous time; a system without a stated one counts as continuous."""
    return 0.0 if system.dt is None else float(system.dt)


def constant(system: control.StateSpace) -> bool:
    """Whether the system is a gain that fits any sampling time."""
    return system.nstates == 0


def response(system: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """(W,) complex response at omega [rad/s] (inf at a pole on the axis)."""
    return evaluate(system.A, system.B, system.C, system.D, on_axis(omega, timebase(system)))[:, 0, 0]


def on_axis(omega: np.ndarray, dt: float) -> np.ndarray:
    """s = j omega, or z on the unit circle where sampled."""
    return np.exp(1j * omega * dt) if dt else 1j * omega


def scaled_states(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same dynamics with each state in a unit of its own, by powers of two: rows and columns of A alike in size."""
    A, (weights, _) = matrix_balance(A, permute=False, separate=True)
    return A, B / weights[:, None], C * weights


def evaluate(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(W, n_out, n_in) transfer matrix C (s I - A)^-1 B + D at the complex points."""
    points = np.atleast_1d(np.asarray(points, dtype=complex))
    out = np.empty((points.size, *D.shape), dtype=complex)
    out[:] = D
    n = A.shape[0]
    if n == 0:
        return out
    A, B, C = scaled_states(A, B, C)
    finite = np.isfinite(points)
    if n > MANY_STATES and points.size > 4:
        out[finite] += by_schur(A, B, C, points[finite])
        return out
    for part in np.array_split(np.flatnonzero(finite), max(1, points.size * n * n // 400_000)):
        pencil = points[part, None, None] * np.eye(n) - A
        try:
            out[part] += C @ np.linalg.solve(pencil, np.broadcast_to(B, (part.size, *B.shape)))
        except np.linalg.LinAlgError:
            for i, k in enumerate(part):
                try:
                    out[k] += C @ np.linalg.solve(pencil[i], B)
                except np.linalg.LinAlgError:
                    out[k] = np.inf
    return out


def by_schur(A: np.ndarray, B: np.ndarray, C: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(W, n_out, n_in) C (s I - A)^-1 B by one Schur form and back substitution at all points at once.

    For long delay lines; solving point by point keeps more digits where modes lie decades apart.
    """
    T, Q = schur(A.astype(complex), output="complex")
    right, left = Q.conj().T @ B, C @ Q
    x = np.zeros((A.shape[0], right.shape[1], points.size), dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(A.shape[0] - 1, -1, -1):
            x[k] = (right[k, :, None] + np.tensordot(T[k, k + 1 :], x[k + 1 :], 1)) / (points - T[k, k])
    return np.moveaxis(np.tensordot(left, x, 1), 2, 0)


def poles(system: control.StateSpace) -> np.ndarray:
    """Eigenvalues of A."""
    return np.linalg.eigvals(system.A) if system.nstates else np.zeros(0, complex)


def zeros(system: control.StateSpace) -> np.ndarray:
    """Finite invariant zeros of a single-loop system."""
    n = system.nstates
    if n == 0:
        return np.zeros(0, complex)
    d = system.D[0, 0]
    A, B, C = scaled_states(system.A, system.B, system.C)
    if abs(d) * (1 + np.linalg.norm(A)) > 1e-8 * np.linalg.norm(C) * np.linalg.norm(B):
        return np.linalg.eigvals(A - B @ C / d)
    top = np.block([[A, B], [C, np.atleast_2d(d)]])
    bottom = np.zeros((n + 1, n + 1))
    bottom[:n, :n] = np.eye(n)
    found = eig(top, bottom, right=False, homogeneous_eigvals=True)
    finite = np.abs(found[1]) > 1e-12 * (np.abs(found[0]) / max(1.0, np.linalg.norm(A)) + np.abs(found[1]))
    return found[0][finite] / found[1][finite]


def in_s(roots: np.ndarray, dt: float) -> np.ndarray:
    """Roots in the s plane: by the logarithm where they are discrete."""
    if not dt:
        return roots
    with np.errstate(divide="ignore"):
        return np.log(np.where(roots == 0, 1e-300, roots).astype(complex)) / dt


def stable(system: control.StateSpace) -> bool:
    """Whether every pole lies strictly inside the stability region."""
    p = poles(system)
    return bool(np.all(np.abs(p) < 1)) if timebase(system) else bool(np.all(p.real < 0))


def stable_weight(name: str, system: Any, dt: float) -> control.StateSpace:
    """A stable weight, continuous or sampled as the loop is, or a refusal."""
    w = state_space(name, system)
    step = timebase(w)
    if step and not constant(w) and abs(step - dt) > 1e-9 * step:
        loop = f"{dt:g} s" if dt else "which is continuous"
        raise ValueError(f"{name} must be continuous or have the sampling time of the loop, {loop}, got {step:g} s")
    if not stable(w):
        raise ValueError(f"{name} must be stable, got poles {poles(w)}. Use a slow pole in place of an integrator.")
    return w


def least_stable(system: control.StateSpace) -> complex:
    """The pole farthest out."""
    p = poles(system)
    return complex(p[np.argmax(np.abs(p) if timebase(system) else p.real)])


def in_series(*systems: control.StateSpace, dt: float | None = None) -> control.StateSpace:
    """First system first: the output of each drives the next; all states are kept."""
    total = systems[0]
    for system in systems[1:]:
        nt, ns = total.nstates, system.nstates
        A = np.block([[total.A, np.zeros((nt, ns))], [system.B @ total.C, system.A]])
        B = np.vstack([total.B, system.B @ total.D])
        C = np.hstack([system.D @ total.C, system.C])
        step = total.dt if constant(system) or total.dt is not None else system.dt
        total = control.StateSpace(A, B, C, system.D @ total.D, system.dt if constant(total) else step)
    return total if dt is None else control.StateSpace(total.A, total.B, total.C, total.D, dt)


def to_continuous(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear image z = (1 + s)/(1 - s): keeps stability and norms; omega maps to tan(omega dt / 2)."""
    n = A.shape[0]
    inverse = inverted(A + np.eye(n), "z = -1 (the Nyquist frequency)")
    return inverse @ (A - np.eye(n)), np.sqrt(2) * inverse @ B, np.sqrt(2) * C @ inverse, D - C @ inverse @ B


def to_discrete(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The way back from `to_continuous`: s = (z - 1)/(z + 1)."""
    n = A.shape[0]
    inverse = inverted(np.eye(n) - A, "s = 2/dt (or where prewarping puts that)")
    return inverse @ (np.eye(n) + A), np.sqrt(2) * inverse @ B, np.sqrt(2) * C @ inverse, D + C @ inverse @ B


def inverted(A: np.ndarray, place: str) -> np.ndarray:
    """The inverse a bilinear map needs, or a refusal that names the pole in its way."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError(
            f"system must have no pole at {place}, got one: the bilinear map would send it to infinity"
        ) from None


def frequency_response(name: str, plant: Any, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and complex response of an FRF, or of a system on omega."""
    if isinstance(plant, control.FrequencyResponseData):
        if (plant.ninputs, plant.noutputs) != (1, 1):
            raise ValueError(f"{name} must have one input and one output, got {plant.ninputs} and {plant.noutputs}")
        return np.asarray(plant.omega, dtype=float), np.asarray(plant.frdata[0, 0], dtype=complex)
    return omega, response(state_space(name, plant), omega)
