"""Transformation of a generalised plant to the form of the Riccati equations, and of K back.

The transformed plant is continuous and scaled to numbers near one, with D22 = 0, D12 = [0; I] and
D21 = [0 I].
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.values import ArrayField, value
from robust.lti.lti import Matrices, evaluate_transfer, scale_states, timebase
from robust.lti.norms import (
    EPS,
    from_half_plane,
    modal_coordinates,
    to_continuous,
    to_discrete,
    to_half_plane,
)
from robust.lti.stability import eigenvalues_with_rounding

#: Singular value over the largest one, below which a direction of the channels has no effect of its
#: own.
_RANK_TOLERANCE = 1e-10


@value
class Plant:
    """Continuous image of a generalised plant, D22 removed, with the data to undo this for its
    controller.
    """

    # A, B1, B2, C1, C2, D11, D12, D21: from (w, u) to (z, y)
    A: np.ndarray
    B1: np.ndarray
    B2: np.ndarray
    C1: np.ndarray
    C2: np.ndarray
    D11: np.ndarray
    D12: np.ndarray
    D21: np.ndarray
    speed: float  # factor of the time scaling [rad/s]
    first: (
        np.ndarray
    )  # (n_u, n_y) feedback closed before the bilinear map, to keep poles away from z = -1
    # D22, D22_image: (n_y, n_u) direct terms removed before and after the bilinear map
    D22: np.ndarray
    D22_image: np.ndarray
    # into_u, out_of_y: factors that take the controller for reduced or scaled u and y to the plant
    # itself: into_u K out_of_y
    into_u: np.ndarray
    out_of_y: np.ndarray
    dt: float  # sampling time [s], 0 for continuous
    region: tuple[
        float, ...
    ] = ()  # real ends of the circle that was mapped onto the axis, in scaled time; empty: none
    D22_region: ArrayField = None  # (n_y, n_u) direct term removed after that
    added: bool = False  # True if small outputs of u or disturbances of y were added


def prepare_plant(P: control.StateSpace, n_y: int, n_u: int) -> Plant:
    """Return P in continuous time with D22 = 0, with time and states scaled to numbers near one."""
    dt = timebase(P)
    w, z = P.ninputs - n_u, P.noutputs - n_y
    A, B, C, D = P.A, P.B, P.C, P.D.copy()
    D22 = D[z:, w:].copy()
    D[z:, w:] = 0
    first = np.zeros((n_u, n_y))
    if dt:
        if A.size and np.linalg.cond(A + np.eye(A.shape[0])) > 1e8:
            first = _shift_from_minus_one(A, B[:, w:], C[z:])
            left = np.vstack([B[:, w:] @ first, D[:z, w:] @ first])
            right = np.hstack([C[z:], D[z:, :w]])
            change, n = left @ right, A.shape[0]
            A, B[:, :w] = A + change[:n, :n], B[:, :w] + change[:n, n:]
            C[:z], D[:z, :w] = C[:z] + change[n:, :n], D[:z, :w] + change[n:, n:]
        A, B, C, D = to_continuous(A, B, C, D)
    A, B, C, speed = _scale_plant(A, B, C)
    return _compress_channels(
        Plant(
            A=A,
            B1=B[:, :w],
            B2=B[:, w:],
            C1=C[:z],
            C2=C[z:],
            D11=D[:z, :w],
            D12=D[:z, w:],
            D21=D[z:, :w],
            speed=speed,
            first=first,
            D22=D22,
            D22_image=D[z:, w:],
            into_u=np.eye(n_u),
            out_of_y=np.eye(n_y),
            dt=dt,
        )
    )


def _compress_channels(plant: Plant) -> Plant:
    """Return the plant with only those combinations of u and y that act and measure independently.

    Two equal actuators become one; a measurement without content is left out.
    """
    into_u = _independent_directions(np.vstack([plant.B2, plant.D12]))
    out_of_y = _independent_directions(np.hstack([plant.C2, plant.D21]).T).T
    return replace(
        plant, B2=plant.B2 @ into_u, D12=plant.D12 @ into_u, C2=out_of_y @ plant.C2, D21=out_of_y @ plant.D21,
        into_u=plant.into_u @ into_u, out_of_y=out_of_y @ plant.out_of_y,
    )  # fmt: skip


def _independent_directions(effects: np.ndarray) -> np.ndarray:
    """Return combinations (n, r) of n channels that span all r independent effects, in the unit of
    each channel.
    """
    sizes = np.linalg.norm(effects, axis=0)
    units = 1 / np.where(sizes > 0, sizes, 1.0)
    _, values, V = np.linalg.svd(effects * units)
    rank = int(np.count_nonzero(values > _RANK_TOLERANCE * values.max(initial=0.0)))
    if rank == len(V):
        return np.eye(rank)
    return units[:, None] * V[:rank].T


def _shift_from_minus_one(A: np.ndarray, B2: np.ndarray, C2: np.ndarray) -> np.ndarray:
    """Return a feedback u = F y that moves poles away from z = -1, which the bilinear map sends to
    infinity.
    """
    rng = np.random.default_rng(0)
    size = 0.3 / max(float(np.linalg.norm(B2)) * float(np.linalg.norm(C2)), 1e-300)
    tries = [size * rng.standard_normal((B2.shape[1], C2.shape[0])) for _ in range(8)]
    return min(tries, key=lambda F: np.linalg.cond(A + B2 @ F @ C2 + np.eye(A.shape[0])).item())


def _scale_plant(
    A: np.ndarray, B: np.ndarray, C: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Scale time by the geometric mean of the poles, and states to similar rows of [A B] and
    columns of [A; C].
    """
    if not A.size:
        return A, B, C, 1.0
    A, B, C = scale_states(A, B, C)
    size = np.abs(np.linalg.eigvals(A))
    size = size[size > 1e-12 * size.max(initial=0.0)]
    if size.size:
        speed = float(np.exp(np.mean(np.log(size))))
    else:
        speed = 1.0
    A, B, C = A / speed, B / np.sqrt(speed), C / np.sqrt(speed)
    for _ in range(10):
        for k in range(A.shape[0]):
            rest = np.arange(A.shape[0]) != k
            row = np.hypot(np.linalg.norm(A[k, rest]), np.linalg.norm(B[k]))
            column = np.hypot(np.linalg.norm(A[rest, k]), np.linalg.norm(C[:, k]))
            if row > 0 and column > 0:
                t = 2.0 ** np.round(np.log2(np.sqrt(column / row)))
                A[k], B[k] = A[k] * t, B[k] * t
                A[:, k], C[:, k] = A[:, k] / t, C[:, k] / t
    return A, B, C, speed


def hidden_mode(plant: Plant) -> str:
    """Return "" if u and y reach every mode that is not stable, otherwise a description of the
    hidden one.

    Ranks depend neither on the units of states and channels nor on the unit of time: rows and
    columns are scaled.
    """
    A, n = plant.A, plant.A.shape[0]
    for mode, moved in zip(*eigenvalues_with_rounding(A), strict=True):
        if mode.real < -1e-9 * max(1.0, abs(mode)) or mode.imag < 0:
            continue
        away = A - mode * np.eye(n)
        np.fill_diagonal(
            away, np.where(np.abs(np.diag(away)) > moved, np.diag(away), 0.0)
        )  # rounding is not a path
        for matrix, description in (
            (np.hstack([away, plant.B2]), "u does not reach"),
            (np.vstack([away, plant.C2]), "y misses"),
        ):
            if rank_margin(matrix) < _RANK_TOLERANCE:
                s = mode * plant.speed
                if plant.dt:
                    where = f"z = {(1 + s) / (1 - s):.4g}"
                else:
                    where = f"s = {s:.4g}"
                return f"{description} the mode at {where}"
    return ""


def rank_margin(matrix: np.ndarray) -> float:
    """Return the least singular value of a matrix whose rows and columns are scaled to norms near
    one.
    """
    for _ in range(20):
        for axis in (0, 1):
            size = np.linalg.norm(matrix, axis=axis, keepdims=True)
            matrix = matrix / np.where(size > 0, size, 1.0)
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])


def map_region(plant: Plant, a: float, b: float) -> Plant:
    """Return the plant with the circle through a and b in place of the axis: the norm is taken
    inside or outside it.

    A disc in the right half plane (0 < a < b) requires less than the half plane: its least norm is
    a lower bound. All but a disc in the left half plane (b < a < 0) requires more: its controllers
    are valid, and keep the poles in that disc. Zeros of the plant on the axis and at infinity lie
    on neither circle.
    """
    n_w, n_z = plant.B1.shape[1], plant.C1.shape[0]
    B, C = np.hstack([plant.B1, plant.B2]), np.vstack([plant.C1, plant.C2])
    D = np.block(
        [[plant.D11, plant.D12], [plant.D21, np.zeros((plant.C2.shape[0], plant.B2.shape[1]))]]
    )
    A, B, C, D = to_half_plane((plant.A, B, C, D), a, b)
    A, B, C = scale_states(A, B, C)
    return replace(
        plant,
        A=A,
        B1=B[:, :n_w],
        B2=B[:, n_w:],
        C1=C[:n_z],
        C2=C[n_z:],
        D11=D[:n_z, :n_w],
        D12=D[:n_z, n_w:],
        D21=D[n_z:, :n_w],
        region=(a, b),
        D22_region=np.linalg.pinv(plant.out_of_y) @ D[n_z:, n_w:] @ np.linalg.pinv(plant.into_u),
    )


def dual_plant(plant: Plant) -> Plant:
    """Return the transposed plant: its control problem is the filtering problem of this one."""
    return replace(
        plant, A=plant.A.T, B1=plant.C1.T, B2=plant.C2.T, C1=plant.B1.T, C2=plant.B2.T,
        D11=plant.D11.T, D12=plant.D21.T, D21=plant.D12.T, into_u=plant.out_of_y.T, out_of_y=plant.into_u.T,
    )  # fmt: skip


def has_zero_on_axis(plant: Plant) -> bool:
    """Return True if P12 (D12 of full rank) has a zero on the axis: then no Riccati solution is
    stabilising.
    """
    back = np.linalg.pinv(plant.D12)
    A = plant.A - plant.B2 @ back @ plant.C1
    C = plant.C1 - plant.D12 @ back @ plant.C1
    size = max(1e-300, float(np.linalg.norm(A)))
    for mode in np.linalg.eigvals(A) if A.size else ():
        if abs(mode.real) < 1e-6 * size and mode.imag >= 0:
            pencil = np.vstack([A - 1j * mode.imag * np.eye(A.shape[0]), C])
            if np.linalg.svd(pencil, compute_uv=False)[-1] < 1e-13 * size:
                return True
    return False


def regularise_plant(plant: Plant, size: float) -> Plant:
    """Return the plant with small outputs of u and disturbances of y added where D12, D21 lack
    rank.
    """
    n, n_u, n_y, n_w = plant.A.shape[0], plant.B2.shape[1], plant.C2.shape[0], plant.B1.shape[1]
    reaches, sees = has_full_ranks(plant)
    if not reaches:
        u_size = size * _typical_gain(plant.A, plant.B2, C=plant.C1, D=plant.D12)
        C1 = np.vstack([plant.C1, np.zeros((n_u, n))])
        D12 = np.vstack([plant.D12, u_size * np.eye(n_u)])
        plant = replace(
            plant, added=True, C1=C1, D12=D12, D11=np.vstack([plant.D11, np.zeros((n_u, n_w))])
        )
    if not sees:
        y_size = size * _typical_gain(plant.A, plant.B1, C=plant.C2, D=plant.D21)
        B1 = np.hstack([plant.B1, np.zeros((n, n_y))])
        D21 = np.hstack([plant.D21, y_size * np.eye(n_y)])
        plant = replace(
            plant,
            added=True,
            B1=B1,
            D21=D21,
            D11=np.hstack([plant.D11, np.zeros((plant.D11.shape[0], n_y))]),
        )
    return plant


def has_full_ranks(plant: Plant) -> tuple[bool, bool]:
    """Return True for each of D12 and D21 with full rank: u shows in z, w in y."""
    return _has_full_rank(plant.D12), _has_full_rank(plant.D21.T)


def _has_full_rank(D: np.ndarray) -> bool:
    """Return True if the columns are independent beyond rounding."""
    sizes = np.linalg.svd(D, compute_uv=False)
    return D.shape[0] >= D.shape[1] > 0 and bool(sizes[-1] > 1e-9 * max(1e-3, sizes[0]))


def _typical_gain(A: np.ndarray, B: np.ndarray, *, C: np.ndarray, D: np.ndarray) -> float:
    """Return the median gain around the poles; for a path of zero gain the size of the matrices, or
    one.
    """
    if A.size:
        speed = np.abs(np.linalg.eigvals(A))
    else:
        speed = np.ones(1)
    speed = speed[speed > 1e-9]
    low, high = min(speed.min(initial=1.0), 1.0), max(speed.max(initial=1.0), 1.0)
    gains = np.linalg.norm(
        evaluate_transfer(A, B, C, D, 1j * np.geomspace(low / 3, high * 3, 15)), axis=(1, 2)
    )
    typical = float(np.median(gains))
    size = float(np.linalg.norm(B) * np.linalg.norm(C) + np.linalg.norm(D))
    if typical > 1e-9 * size:
        return typical
    return size or 1.0


def normalise_plant(plant: Plant) -> Plant | None:
    """Return the plant with D12 = [0; I] and D21 = [0 I] by rotations of z and w and a change of u
    and y.

    Return None if one of them lacks rank.
    """
    n_u, n_y = plant.B2.shape[1], plant.C2.shape[0]
    n_z, n_w = plant.D11.shape
    if not all(has_full_ranks(plant)):
        return None
    Uz, su, Vu = np.linalg.svd(plant.D12)
    Uy, sy, Vw = np.linalg.svd(plant.D21)
    # the range of D12 last among the outputs, that of D21' last among the disturbances
    Z = np.hstack([Uz[:, n_u:], Uz[:, :n_u]])
    W = np.vstack([Vw[n_y:], Vw[:n_y]])
    into_u, out_of_y = Vu.T / su, Uy.T / sy[:, None]
    return replace(
        plant,
        B1=_drop_rounding(plant.B1 @ W.T, 1),
        B2=plant.B2 @ into_u,
        C1=_drop_rounding(Z.T @ plant.C1, 0),
        C2=out_of_y @ plant.C2,
        D11=Z.T @ plant.D11 @ W.T,
        D12=np.eye(n_z, n_u, k=-(n_z - n_u)),
        D21=np.eye(n_y, n_w, k=n_w - n_y),
        into_u=plant.into_u @ into_u,
        out_of_y=out_of_y @ plant.out_of_y,
    )


def _drop_rounding(rotated: np.ndarray, axis: int) -> np.ndarray:
    """Return a rotated matrix with zeros in place of rounding, which solvers of Riccati equations
    use for balancing.
    """
    sizes = np.linalg.norm(rotated, axis=axis, keepdims=True)
    return np.where(np.abs(rotated) < 4 * EPS * sizes, 0.0, rotated)


def restore_controller(plant: Plant, K: Matrices) -> control.StateSpace:
    """Return the controller for the original plant from that for the normalised one."""
    A, B, C, D = K
    B, C, D = B @ plant.out_of_y, plant.into_u @ C, plant.into_u @ D @ plant.out_of_y
    if plant.region:
        A, B, C, D = _to_modal_form(
            *from_half_plane(
                _restore_feedthrough(plant.D22_region, A, B=B, C=C, D=D), *plant.region
            )
        )
    A, B, C = A * plant.speed, B * np.sqrt(plant.speed), C * np.sqrt(plant.speed)
    A, B, C, D = _restore_feedthrough(plant.D22_image, A, B=B, C=C, D=D)
    if plant.dt:
        A, B, C, D = to_discrete(A, B, C, D)
    return control.StateSpace(
        *_restore_feedthrough(plant.D22, A, B=B, C=C, D=D + plant.first), plant.dt
    )


def _to_modal_form(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> Matrices:
    """Return modal coordinates if they exist: near the least level modes lie decades apart and hide
    one another.
    """
    if not A.size:
        return A, B, C, D
    A, B, C = scale_states(A, B, C)
    coordinates = modal_coordinates(A)
    if coordinates is None:
        return A, B, C, D
    forth, back = coordinates
    return forth @ A @ back, forth @ B, C @ back, D


def _restore_feedthrough(
    D22: np.ndarray, A: np.ndarray, *, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> Matrices:
    """Return the controller with u = K (y - D22 u) solved for u."""
    if not D22.any():
        return A, B, C, D
    inverse = np.linalg.inv(np.eye(D.shape[0]) + D @ D22)
    C, D = inverse @ C, inverse @ D
    return A - B @ D22 @ C, B - B @ D22 @ D, C, D
