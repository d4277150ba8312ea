"""Generalised plants whose D12, D21 or whole channels are deficient, with the norm that the best
controller leaves.
"""

import control
import numpy as np


def random_part(rng, n, dt=0.0):
    """(A, B) stable with poles of one size, and a matrix maker."""
    A = rng.standard_normal((n, n))
    return (
        A * 0.9 / np.abs(np.linalg.eigvals(A)).max()
        if dt
        else A - (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(n)
    )


def regular(rng, n, dt, stable=False):
    """(P, n_y, n_u) with D12 and D21 of full rank."""
    n_u, n_y = map(int, rng.integers(1, 3, 2))
    A = random_part(rng, n, dt) if stable else rng.standard_normal((n, n)) * (0.7 if dt else 1.0)
    B, C = rng.standard_normal((n, n_y + 1 + n_u)), rng.standard_normal((n_u + 1 + n_y, n))
    D = 0.5 * rng.standard_normal((n_u + 1 + n_y, n_y + 1 + n_u))
    return control.StateSpace(A, B, C, D, dt), n_y, n_u


def split(P, n_y, n_u):
    """B1, B2, C1, C2, D11, D12, D21, D22."""
    w, z = P.ninputs - n_u, P.noutputs - n_y
    return (
        P.B[:, :w],
        P.B[:, w:],
        P.C[:z],
        P.C[z:],
        P.D[:z, :w],
        P.D[:z, w:],
        P.D[z:, :w],
        P.D[z:, w:],
    )


def equal_actuators(rng, n, dt):
    """More actuators than act differently, in units of their own: the best norm is that of the
    plant itself.
    """
    P, n_y, n_u = regular(rng, n, dt)
    B1, B2, _, _, D11, D12, D21, D22 = split(P, n_y, n_u)
    mix = rng.standard_normal((n_u, n_u + 1 + int(rng.integers(2)))) * 10.0 ** rng.integers(-3, 4)
    D = np.block([[D11, D12 @ mix], [D21, D22 @ mix + rng.standard_normal((n_y, mix.shape[1]))]])
    return (
        control.StateSpace(P.A, np.hstack([B1, B2 @ mix]), P.C, D, dt),
        n_y,
        mix.shape[1],
        (P, n_y, n_u),
    )


def equal_measurements(rng, n, dt):
    """More measurements than tell something different."""
    P, n_y, n_u = regular(rng, n, dt)
    _, _, C1, C2, D11, D12, D21, D22 = split(P, n_y, n_u)
    mix = rng.standard_normal((n_y + 1 + int(rng.integers(2)), n_y))
    mix[0] *= int(rng.integers(2)) or 10.0 ** rng.integers(-3, 4)
    D = np.block([[D11, D12], [mix @ D21, mix @ D22]])
    return (
        control.StateSpace(P.A, P.B, np.vstack([C1, mix @ C2]), D, dt),
        mix.shape[0],
        n_u,
        (P, n_y, n_u),
    )


def unreached(rng, n, dt):
    """Outputs that u does not reach, while it may have to stabilise: the norm is that of the
    disturbances alone.
    """
    half = n // 2 + 1
    A1, A2 = random_part(rng, half, dt), rng.standard_normal((n, n)) * (0.7 if dt else 1.0)
    A = np.block([[A1, np.zeros((half, n))], [rng.standard_normal((n, half)), A2]])
    B1 = rng.standard_normal((half + n, 2))
    B2 = np.vstack([np.zeros((half, 1)), rng.standard_normal((n, 1))])
    C1 = np.hstack([rng.standard_normal((2, half)), np.zeros((2, n))])
    C2 = rng.standard_normal((1, half + n))
    D11, D21 = rng.standard_normal((2, 2)), rng.standard_normal((1, 2)) * int(rng.integers(2))
    D = np.block([[D11, np.zeros((2, 1))], [D21, np.zeros((1, 1))]])
    P = control.StateSpace(A, np.hstack([B1, B2]), np.vstack([C1, C2]), D, dt)
    return P, 1, 1, control.StateSpace(A1, B1[:half], C1[:, :half], D11, dt)


def unmeasured(rng, n, dt):
    """The transposed one: disturbances that y does not show."""
    P, _, _, open_loop = unreached(rng, n, dt)
    transposed = control.StateSpace(P.A.T, P.C.T, P.B.T, P.D.T, dt)
    return (
        transposed,
        1,
        1,
        control.StateSpace(open_loop.A.T, open_loop.C.T, open_loop.B.T, open_loop.D.T, dt),
    )


def dead(rng, n, dt):
    """A measurement of nothing, or an actuator of nothing, on a stable plant: K has no effect."""
    P, n_y, n_u = regular(rng, n, dt, stable=True)
    B, C, D = P.B.copy(), P.C.copy(), P.D.copy()
    if rng.integers(2):
        C[-n_y:], D[-n_y:, :-n_u] = 0, 0
    else:
        B[:, -n_u:], D[:-n_y, -n_u:] = 0, 0
    z, w = P.noutputs - n_y, P.ninputs - n_u
    return (
        control.StateSpace(P.A, B, C, D, dt),
        n_y,
        n_u,
        control.StateSpace(P.A, B[:, :w], C[:z], D[:z, :w], dt),
    )


def deficient(rng, n, dt):
    """Columns of D12 and rows of D21 that are zero or depend on one another: no closed form."""
    P, n_y, n_u = regular(rng, n, dt)
    D = P.D.copy()
    z, w = P.noutputs - n_y, P.ninputs - n_u
    for block in (D[:z, w:], D[z:, :w].T):
        kind = int(rng.integers(3))
        if kind == 0:
            block[:] = 0
        elif kind == 1:
            block[:, -1] = block[:, 0] if block.shape[1] > 1 else 0
    D[z:, w:] = 0
    return control.StateSpace(P.A, P.B, P.C, D, dt), n_y, n_u, None


def partly_unreached(rng, n, dt):
    """One more output that u does not reach beside those that it does: no closed form, the former
    is a lower bound.
    """
    P, n_y, n_u = regular(rng, n, dt)
    w, a = P.ninputs - n_u, random_part(rng, 1, dt)
    A = np.block([[P.A, np.zeros((n, 1))], [np.zeros((1, n)), a]])
    B = np.vstack([P.B, np.concatenate([rng.standard_normal(w), np.zeros(n_u)])[None]])
    extra = np.zeros((1, n + 1))
    extra[0, -1] = 1.0
    C = np.hstack([P.C, np.zeros((P.noutputs, 1))])
    C, D = np.vstack([extra, C]), np.vstack([np.zeros((1, P.ninputs)), P.D])
    return control.StateSpace(A, B, C, D, dt), n_y, n_u, None


FAMILIES = {
    made.__name__: made
    for made in (
        *(equal_actuators, equal_measurements, unreached, unmeasured),
        *(dead, deficient, partly_unreached),
    )
}


def closed_loop_gain(P, K, n_y, n_u):
    """Largest gain of F_l(P, K) on a grid and the largest real part (or modulus less one) of its
    poles, by numpy.
    """
    B1, B2, C1, C2, D11, D12, D21, D22 = split(P, n_y, n_u)
    inverse = np.linalg.inv(np.eye(n_u) - K.D @ D22)
    of_x, of_k, of_w = inverse @ K.D @ C2, inverse @ K.C, inverse @ K.D @ D21
    y_x, y_k, y_w = C2 + D22 @ of_x, D22 @ of_k, D21 + D22 @ of_w
    A = np.block([[P.A + B2 @ of_x, B2 @ of_k], [K.B @ y_x, K.A + K.B @ y_k]])
    B = np.vstack([B1 + B2 @ of_w, K.B @ y_w])
    C = np.hstack([C1 + D12 @ of_x, D12 @ of_k])
    D = D11 + D12 @ of_w
    poles = np.linalg.eigvals(A)
    return gain_on_a_grid(control.StateSpace(A, B, C, D, P.dt)), (
        np.abs(poles) - 1 if P.dt else poles.real
    ).max()


def gain_on_a_grid(system):
    """Largest singular value on a grid with the frequencies of the poles, by numpy."""
    poles = np.linalg.eigvals(system.A)
    omega = np.concatenate(
        [[0.0], np.geomspace(1e-3, 1e4, 1500), np.abs(poles), np.abs(poles.imag)]
    )
    points = np.exp(2j * np.arctan(omega)) if system.dt else 1j * omega
    if system.dt:
        points = np.concatenate([points, np.exp(1j * np.angle(poles))])
    eye = np.eye(len(system.A))
    return max(
        np.linalg.norm(system.D + system.C @ np.linalg.solve(p * eye - system.A, system.B), 2)
        for p in points
    )
