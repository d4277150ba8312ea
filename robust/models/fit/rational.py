"""Fits of rational functions to complex frequency data by vector fitting and least squares."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from robust.lti.realisation import order_roots

_FAR_RATIO = 1e12  # a zero beyond this multiple of the largest frequency is at infinity
_MIN_DAMPING = 1e-8  # a pole with a smaller damping is on the axis
Roots = tuple[
    np.ndarray, np.ndarray, float, float, float
]  # zeros, poles, gain, delay, cost, all in the s plane


def vector_fit(
    s: np.ndarray,
    data: np.ndarray,
    *,
    weight: np.ndarray,
    poles: np.ndarray,
    n_zeros: int | None = None,
    n_iterations: int = 12,
    stable: bool = True,
) -> np.ndarray:
    """Return poles of a rational function through the data, from starting poles.

    s : (W,) points on the imaginary axis; weight : (W,) multiplies the error; poles : conjugate
    pairs adjacent, upper one first; n_zeros : degree of the numerator, by default that of the
    poles. Among the poles of all iterations, those with the smallest residual are returned.
    Gustavsen & Semlyen, IEEE Trans. Power Delivery 14 (1999).
    """
    weight = weight / np.abs(weight).max()
    if n_zeros is None:
        n_zeros = poles.size
    b = stack_real_imaginary(data * weight)
    best, least = poles, np.inf
    for _ in range(n_iterations):
        with np.errstate(divide="ignore", invalid="ignore"):
            basis = partial_fractions(s, poles)
            if not np.isfinite(basis).all():  # a pole on a point of the data
                return best
            top = stack_real_imaginary(
                np.column_stack(_numerator_basis(s, weight, poles=poles, n_zeros=n_zeros)[0])
            )
        below = stack_real_imaginary(-data[:, None] * basis * weight[:, None])
        scale = np.linalg.norm(below, axis=0)
        scale[scale == 0] = 1.0
        # b is the residual that no numerator over the current poles explains; their relocation
        # explains the rest
        q = np.linalg.qr(top)[0]
        left = np.column_stack([below / scale, b])
        left = left - q @ (q.T @ left)
        # residual with these poles: on exact data of lower order the next ones may be anywhere
        cost = float(np.linalg.norm(left[:, -1]))
        if cost < least:
            best, least = poles, cost
        solution = np.linalg.lstsq(left[:, :-1], left[:, -1], rcond=None)[0] / scale
        moved = relocated_poles(poles, solution)
        if stable:
            moved = np.where(moved.real > 0, -moved.conj(), moved)
        # a pole on the axis would coincide with a data point and fit that point only
        moved = np.where(
            np.abs(moved.real) < _MIN_DAMPING * np.abs(moved),
            moved.imag * 1j - _MIN_DAMPING * np.abs(moved),
            moved,
        )
        moved = order_roots(moved)
        done = moved.size == poles.size and np.all(
            np.abs(moved - poles) < 1e-10 * np.abs(poles).max()
        )
        poles = moved
        if done:
            return poles
    return best


def partial_fractions(s: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """Return (W, n) basis 1/(s - p) for real poles, and its two real-coefficient combinations for a
    pair.
    """
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


def relocated_poles(poles: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Return zeros of 1 + sum residue/(s - pole): the poles of the next iteration."""
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


def starting_poles(n: int, low: float, high: float, *, spacing: str) -> np.ndarray:
    """Return n lightly damped poles over the band [rad/s], one of them real if n is odd."""
    spread = np.geomspace if spacing == "log" else np.linspace
    imag = spread(low, high, max(n // 2, 1))[: n // 2]
    pairs = np.column_stack([-0.01 * imag + 1j * imag, -0.01 * imag - 1j * imag]).ravel()
    return np.concatenate([[-np.sqrt(low * high) + 0j] * (n % 2), pairs])


def fit_numerator(
    s: np.ndarray, data: np.ndarray, *, weight: np.ndarray, poles: np.ndarray, n_zeros: int
) -> tuple[np.ndarray, float]:
    """Return zeros and gain of the best numerator of the given degree over given poles.

    The polynomial is written in a basis that is orthonormal on the weighted points (Forsythe), so
    that any degree keeps its digits; its roots are eigenvalues of the recurrence (a comrade
    matrix).
    """
    basis, up = _numerator_basis(s, weight, poles=poles, n_zeros=n_zeros)
    beta = np.linalg.lstsq(
        stack_real_imaginary(np.column_stack(basis)),
        stack_real_imaginary(weight * data),
        rcond=None,
    )[0]
    zeros = order_roots(_roots_of_recurrence(beta, up))
    shape = (
        weight / np.prod(s[:, None] - poles, axis=1) * np.prod(s[:, None] - zeros[None, :], axis=1)
    )
    return zeros, float(np.vdot(shape, weight * data).real / np.vdot(shape, shape).real)


def _numerator_basis(
    s: np.ndarray, weight: np.ndarray, *, poles: np.ndarray, n_zeros: int
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return polynomials of increasing degree over the poles, orthonormal on the weighted points;
    their recurrence.
    """
    over = weight / np.prod(s[:, None] - poles, axis=1)
    basis, up = [over / np.linalg.norm(over)], np.zeros(n_zeros + 1)
    for j in range(n_zeros):
        column = s * basis[j] + (up[j] * basis[j - 1] if j else 0.0)
        up[j + 1] = np.linalg.norm(column)
        basis.append(column / up[j + 1])
    return basis, up


def _roots_of_recurrence(beta: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return roots of sum beta_j p_j with s p_j = up_{j+1} p_{j+1} - up_j p_{j-1}.

    A pencil: if the last coefficients vanish (data of a lower degree), some roots go to infinity
    and the others keep their digits. Dividing the last row by that coefficient would lose them.
    """
    n = beta.size - 1
    if n == 0:
        return np.zeros(0, complex)
    M, B = np.diag(up[1:n], 1) - np.diag(up[1:n], -1), np.eye(n)
    size = np.abs(beta).max() or 1.0
    M[-1] = (beta[-1] * M[-1] - up[n] * beta[:-1]) / size
    B[-1, -1] = beta[-1] / size
    unit = up[1:].max()
    over, under = scipy.linalg.eig(M / unit, B, right=False, homogeneous_eigvals=True)
    far = np.abs(under) * _FAR_RATIO < np.abs(over)
    return np.where(far, -_FAR_RATIO, over / np.where(far, 1.0, under)) * unit


def stack_real_imaginary(a: np.ndarray) -> np.ndarray:
    """Return real over imaginary parts, for least squares over real unknowns."""
    return np.concatenate([a.real, a.imag])


def map_to_model_plane(
    zeros: np.ndarray, poles: np.ndarray, gain: float, dt: float, excess: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return zeros, poles and gain in the plane of the model: unchanged, or from s to z = (1 + s
    dt/2)/(1 - s dt/2).
    """
    if not dt:
        return zeros, poles, gain
    z = order_roots((1 + zeros * dt / 2) / (1 - zeros * dt / 2))
    p = order_roots((1 + poles * dt / 2) / (1 - poles * dt / 2))
    # s - a = (2/dt) (z - z_a) / ((z + 1)(1 + z_a)/2 ...): collected, each root contributes (1 - a
    # dt/2) / (dt/2)
    scale = np.prod((1 - zeros * dt / 2) / (dt / 2)) / np.prod((1 - poles * dt / 2) / (dt / 2))
    return z, p, float((gain * scale).real * 2.0**excess)


def s_plane_points(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return j omega, or its bilinear image j 2/dt tan(omega dt/2): all models are fitted in the s
    plane.
    """
    return 1j * (2 / dt * np.tan(omega * dt / 2) if dt else omega)


def known_factor(omega: np.ndarray, delay: float, *, dt: float, excess: int) -> np.ndarray:
    """Return the factor that the fit does not choose: the delay and, if discrete, zeros at z =
    infinity (s = 2/dt).
    """
    q = np.exp(-1j * omega * delay)
    if dt:
        return q * (1 - s_plane_points(omega, dt) * dt / 2) ** excess
    return q


def zpk_response(
    omega: np.ndarray,
    zeros: np.ndarray,
    *,
    poles: np.ndarray,
    gain: float,
    delay: float,
    dt: float,
    excess: int,
) -> np.ndarray:
    """Return (F,) response of the model at the lines."""
    s = s_plane_points(omega, dt)[:, None]
    out = gain * known_factor(omega, delay, dt=dt, excess=excess)
    # one pole and one zero at a time, so that high orders neither overflow nor underflow
    for k in range(poles.size):
        out = out / (s[:, 0] - poles[k]) * ((s[:, 0] - zeros[k]) if k < zeros.size else 1.0)
    return out
