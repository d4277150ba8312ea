"""Rational functions through complex frequency data: vector fitting, numerators, Levenberg-Marquardt."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robust.lti import paired

UNDAMPED = 1e-8  # damping under which a pole counts as one on the axis

Roots = tuple[np.ndarray, np.ndarray, float, float, float]  # zeros, poles, gain, delay, cost, all in the s plane


def vector_fit(
    s: np.ndarray,
    data: np.ndarray,
    weight: np.ndarray,
    poles: np.ndarray,
    *,
    n_iterations: int = 12,
    stable: bool = True,
) -> np.ndarray:
    """Poles of a strictly proper (plus constant) rational function through the data, from starting poles.

    s : (W,) points on the imaginary axis; weight : (W,) multiplies the error; poles : conjugate pairs adjacent,
    upper one first. Gustavsen & Semlyen, IEEE Trans. Power Delivery 14 (1999).
    """
    weight = weight / np.abs(weight).max()
    best, least = poles, np.inf
    for _ in range(n_iterations):
        with np.errstate(divide="ignore", invalid="ignore"):
            basis = partial_fractions(s, poles)
        ones = np.ones((s.size, 1))
        if not np.isfinite(basis).all():  # a pole on a point of the data
            return best
        A = np.hstack([basis, ones, -data[:, None] * basis]) * weight[:, None]
        A, b = stacked(A), stacked(data * weight)
        scale = np.linalg.norm(A, axis=0)
        scale[scale == 0] = 1.0
        A = A / scale
        # how well these poles do by themselves: on exact data of lower order the next ones may be anywhere
        linear = A[:, : poles.size + 1]
        cost = float(np.linalg.norm(b - linear @ np.linalg.lstsq(linear, b, rcond=None)[0]))
        if cost < least:
            best, least = poles, cost
        solution = np.linalg.lstsq(A, b, rcond=None)[0] / scale
        moved = relocated(poles, solution[poles.size + 1 :])
        if stable:
            moved = np.where(moved.real > 0, -moved.conj(), moved)
        # a pole on the axis would stand on a point of the data, fit that one and no other
        moved = np.where(
            np.abs(moved.real) < UNDAMPED * np.abs(moved), moved.imag * 1j - UNDAMPED * np.abs(moved), moved
        )
        moved = in_order(moved)
        done = moved.size == poles.size and np.all(np.abs(moved - poles) < 1e-10 * np.abs(poles).max())
        poles = moved
        if done:
            return poles
    return best


def partial_fractions(s: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """(W, n) basis 1/(s - p) for real poles, and its two real-coefficient combinations for a pair."""
    basis = np.empty((s.size, poles.size), dtype=complex)
    k = 0
    while k < poles.size:
        p = poles[k]
        if p.imag == 0:
            basis[:, k] = 1 / (s - p)
            k += 1
        else:
            first, second = 1 / (s - p), 1 / (s - p.conjugate())
            basis[:, k], basis[:, k + 1] = first + second, 1j * (first - second)
            k += 2
    return basis


def relocated(poles: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Zeros of 1 + sum residue/(s - pole): the poles of the next iteration."""
    n = poles.size
    A, b = np.zeros((n, n)), np.zeros(n)
    k = 0
    while k < n:
        p = poles[k]
        if p.imag == 0:
            A[k, k], b[k] = p.real, 1.0
            k += 1
        else:
            A[k : k + 2, k : k + 2] = [[p.real, p.imag], [-p.imag, p.real]]
            b[k] = 2.0
            k += 2
    return np.linalg.eigvals(A - np.outer(b, residues))


def in_order(roots: np.ndarray) -> np.ndarray:
    """Real roots, then pairs with the upper one first, exactly conjugate."""
    roots = np.asarray(roots, dtype=complex)
    real = np.abs(roots.imag) <= 1e-14 * np.abs(roots)
    upper = roots[~real & (roots.imag > 0)]
    return np.concatenate([np.sort(roots[real].real) + 0j, np.column_stack([upper, upper.conj()]).ravel()])


def starting_poles(n: int, low: float, high: float, *, spacing: str) -> np.ndarray:
    """n lightly damped poles over the band [rad/s], one of them real where n is odd."""
    spread = np.geomspace if spacing == "log" else np.linspace
    imag = spread(low, high, max(n // 2, 1))[: n // 2]
    pairs = np.column_stack([-0.01 * imag + 1j * imag, -0.01 * imag - 1j * imag]).ravel()
    return np.concatenate([[-np.sqrt(low * high) + 0j] * (n % 2), pairs])


def numerator(
    s: np.ndarray, data: np.ndarray, weight: np.ndarray, poles: np.ndarray, n_zeros: int
) -> tuple[np.ndarray, float]:
    """Zeros and gain of the best numerator of that degree over given poles.

    The polynomial is written in a basis that is orthonormal on the weighted points (Forsythe), so that any
    degree keeps its digits; its roots are eigenvalues of the recurrence (a comrade matrix).
    """
    over = weight / np.prod(s[:, None] - poles[None, :], axis=1)
    basis, up = [over / np.linalg.norm(over)], np.zeros(n_zeros + 1)
    for j in range(n_zeros):
        column = s * basis[j] + (up[j] * basis[j - 1] if j else 0.0)
        up[j + 1] = np.linalg.norm(column)
        basis.append(column / up[j + 1])
    beta = np.linalg.lstsq(stacked(np.column_stack(basis)), stacked(weight * data), rcond=None)[0]
    zeros = in_order(roots_of(beta, up))
    shape = over * np.prod(s[:, None] - zeros[None, :], axis=1)
    return zeros, float(np.vdot(shape, weight * data).real / np.vdot(shape, shape).real)


def roots_of(beta: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Roots of sum beta_j p_j with s p_j = up_{j+1} p_{j+1} - up_j p_{j-1}."""
    n = beta.size - 1
    if n == 0:
        return np.zeros(0, complex)
    M = np.diag(up[1:n], 1) - np.diag(up[1:n], -1)
    last = beta[-1] if beta[-1] != 0 else np.finfo(float).eps * np.abs(beta).max()
    M[-1] -= up[n] * beta[:-1] / last
    return np.linalg.eigvals(M)


def stacked(a: np.ndarray) -> np.ndarray:
    """Real over imaginary parts: least squares over real unknowns."""
    return np.concatenate([a.real, a.imag])


def refine(
    s: np.ndarray,
    data: np.ndarray,
    weight: np.ndarray,
    start: Roots,
    factor: Callable[[float], np.ndarray],
    *,
    omega: np.ndarray | None = None,
    stable: bool = True,
) -> Roots:
    """Levenberg-Marquardt on the weighted error, over coefficients of second-order sections in scaled frequency.

    factor(delay) is what multiplies the rational function; the delay itself is refined where omega is given.
    """
    zeros, poles, gain, delay, _ = start
    free_delay = omega is not None
    unit = float(np.exp(np.mean(np.log(np.abs(s)))))
    x = s / unit
    theta = np.concatenate(
        [[1.0], coefficients(zeros / unit), coefficients(poles / unit, log=stable), [0.0] * free_delay]
    )
    n_zero, n_pole = zeros.size, poles.size
    base = gain * unit ** float(n_zero - n_pole)
    slope = -1j * omega / omega.max() if omega is not None else x
    delay_unit = 1 / omega.max() if omega is not None else 0.0

    def model(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        tau = delay + (theta[-1] * delay_unit if free_delay else 0.0)
        out = base * theta[0] * factor(tau)
        top, d_top = sections(x, theta[1 : 1 + n_zero], n_zero)
        bottom, d_bottom = sections(x, theta[1 + n_zero : 1 + n_zero + n_pole], n_pole, log=stable)
        for k in range(max(len(top), len(bottom))):
            out = out * (top[k] if k < len(top) else 1.0) / (bottom[k] if k < len(bottom) else 1.0)
        relative = [np.full(x.size, 1 / theta[0] if theta[0] else 1.0, dtype=complex), *d_top, *(-d for d in d_bottom)]
        if free_delay:
            relative.append(slope)
        return out, np.column_stack(relative) * out[:, None]

    def error(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        with np.errstate(all="ignore"):
            out, jacobian = model(theta)
            e = stacked((data - out) * weight)
            cost = float(e @ e)
        return e, stacked(jacobian * weight[:, None]), cost if np.isfinite(cost) else np.inf

    e, J, cost = error(theta)
    damping = 1e-3
    for _ in range(80):
        scale = np.linalg.norm(J, axis=0)
        scale[~(scale > 0)] = 1.0
        left, sv, right = np.linalg.svd(J / scale, full_matrices=False)
        if sv[0] == 0:  # a gain of zero, which no step of roots changes
            break
        before = cost
        for _ in range(12):
            step = right.T @ (sv / (sv**2 + damping * sv[0] ** 2) * (left.T @ e)) / scale
            trial = theta + step
            if free_delay and delay + trial[-1] * delay_unit < 0:
                trial[-1] = -delay / delay_unit
            e_new, J_new, cost_new = error(trial)
            if cost_new < cost and np.isfinite(J_new).all():
                theta, e, J, cost, damping = trial, e_new, J_new, cost_new, max(damping / 10, 1e-15)
                break
            damping *= 6
        if not cost < before * (1 - 1e-8):
            break
    zeros = in_order(roots_from(theta[1 : 1 + n_zero], n_zero) * unit)
    poles = in_order(roots_from(theta[1 + n_zero : 1 + n_zero + n_pole], n_pole, log=stable) * unit)
    tau = delay + (theta[-1] * delay_unit if free_delay else 0.0)
    return zeros, poles, base * theta[0] * unit ** float(n_pole - n_zero), tau, cost


def coefficients(roots: np.ndarray, *, log: bool = False) -> np.ndarray:
    """Section coefficients (c1, c0) of s^2 + c1 s + c0 for each pair, then c0 of a single s + c0.

    With log, the logarithms of natural frequency and damping instead: stable whatever their values.
    """
    pairs, rest = paired(roots)
    out: list[float] = []
    for a, b in pairs:
        c1, c0 = -(a + b).real, (a * b).real
        if log:
            w = np.sqrt(max(c0, 1e-24))
            out += [np.log(w), np.log(max(c1 / (2 * w), 1e-9))]
        else:
            out += [c1, c0]
    return np.array(out + [np.log(max(-r.real, 1e-12)) if log else -r.real for r in rest])


def sections(
    x: np.ndarray, theta: np.ndarray, n: int, *, log: bool = False
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Value of each section at x, and the relative derivative by each parameter."""
    out, slopes = [], []
    for k in range(0, n - n % 2, 2):
        c1, c0 = (2 * np.exp(theta[k] + theta[k + 1]), np.exp(2 * theta[k])) if log else (theta[k], theta[k + 1])
        out.append(x * x + c1 * x + c0)
        if log:
            slopes += [(c1 * x + 2 * c0) / out[-1], c1 * x / out[-1]]
        else:
            slopes += [x / out[-1], 1 / out[-1]]
    if n % 2:
        c0 = np.exp(theta[-1]) if log else theta[-1]
        out.append(x + c0)
        slopes.append((c0 if log else 1.0) / out[-1])
    return out, slopes


def roots_from(theta: np.ndarray, n: int, *, log: bool = False) -> np.ndarray:
    """The roots of all sections."""
    found: list[complex] = []
    for k in range(0, n - n % 2, 2):
        c1, c0 = (2 * np.exp(theta[k] + theta[k + 1]), np.exp(2 * theta[k])) if log else (theta[k], theta[k + 1])
        inner = complex(c1 * c1 / 4 - c0)
        if inner.real < 0:
            half = np.sqrt(inner)
            found += [-c1 / 2 + half, -c1 / 2 - half]
        else:
            # the larger root first, the other from their product: no cancellation
            far = -c1 / 2 - np.copysign(np.sqrt(inner.real), c1)
            found += [complex(far), complex(c0 / far if far else 0.0)]
    if n % 2:
        found.append(complex(-np.exp(theta[-1]) if log else -theta[-1]))
    roots = np.array(found, dtype=complex)
    # an exponential underflows to zero, and what is stable has to be strictly so
    return np.minimum(roots.real, -1e-12) + 1j * roots.imag if log else roots


def to_plane(
    zeros: np.ndarray, poles: np.ndarray, gain: float, dt: float, excess: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Zeros, poles and gain in the plane of the model: unchanged, or from s to z = (1 + s dt/2)/(1 - s dt/2)."""
    if not dt:
        return zeros, poles, gain
    z = in_order((1 + zeros * dt / 2) / (1 - zeros * dt / 2))
    p = in_order((1 + poles * dt / 2) / (1 - poles * dt / 2))
    # s - a = (2/dt) (z - z_a) / ((z + 1)(1 + z_a)/2 ...): collected, each root contributes (1 - a dt/2) / (dt/2)
    scale = np.prod((1 - zeros * dt / 2) / (dt / 2)) / np.prod((1 - poles * dt / 2) / (dt / 2))
    return z, p, float((gain * scale).real * 2.0**excess)
