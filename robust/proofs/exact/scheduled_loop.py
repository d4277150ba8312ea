"""The loop u = -K(theta) y of a plant that depends on theta, in polynomials of theta, with every
perturbation as an external block.

plant       x' = A x + B v, y = C x; continuous under a sampled controller: one sample of it (`sampled_motion`)
set         v = u + w or y = C x + w, with w = Delta W u or Delta W y, as the form says; |Delta| <= 1
motion      the motion of theta within a sample is one more block
performance "S": from n in y = ... + n to y; "GS": from d in v = u + d to y
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value
from robust.proofs.exact.claim import LpvMatrices, Matrices
from robust.proofs.exact.polynomial_matrices import PolynomialMatrix, stacked
from robust.proofs.exact.sampled_motion import sample_plant

GAINS = ("S", "GS")


@value(copy=False)
class ScheduledLoop:
    """x' (or x+) = A x + B w, z = C x + D w, with blocks w_k = Delta_k z_k of gain one. The last
    block is the performance channel.

    Fields
    ------
    A, B, C, D : PolynomialMatrix
    blocks : list of (rows, cols)
        Sizes of z_k and w_k.
    dt : float
    plant_states : int
        The first states are those of the plant.
    xi, eps : PolynomialMatrix, float
        The next state of the plant is that of A and B plus e, |e| <= eps |xi|, from states and w.
    """

    A: PolynomialMatrix
    B: PolynomialMatrix
    C: PolynomialMatrix
    D: PolynomialMatrix
    blocks: list[tuple[int, int]]
    dt: float
    plant_states: int
    xi: PolynomialMatrix
    eps: float


def assemble_schedule(
    plant: LpvMatrices,
    controller: LpvMatrices,
    *,
    weight: Matrices | None,
    reads: tuple[str, ...],
    delay: int,
    rate: float,
    gain: str,
) -> ScheduledLoop | None:
    """Return the loop; None if theta moves too fast within a sample for a bound.

    weight : W, on u or y. reads : "K" in it: W reads u, else y; "G" in it: w enters at v, else at
    y. delay : samples between u and v. rate : of theta [1/s] for a plant that is sampled here, 0 if
    theta is held within a sample.
    """
    n, m, p = plant.order, plant.B.shape[2], plant.C.shape[1]
    sampled = None
    if controller.dt and not plant.dt:
        sampled = sample_plant(plant.A, plant.B, dt=controller.dt, rate=rate)
        if sampled is None:
            return None
    if sampled is None:
        units = np.ones(n + m)
    else:
        units = sampled.units
    n_K = controller.order
    n_W = 0 if weight is None else weight.order
    if sampled is None:
        moving = 0
    else:
        moving = sampled.L.shape[1]
    into_plant = "G" in reads
    if weight is None:
        wide = 0
    elif into_plant:
        wide = m
    else:
        wide = p
    d = {"": 0, "S": p, "GS": m}[gain]
    sizes = [n, n_K, n_W, delay * m, wide, moving, d]
    total, ends = sum(sizes), np.cumsum(sizes)
    x, x_K, x_W, held, w, moved, disturbed = (
        constant(np.eye(total)[end - size : end]) for end, size in zip(ends, sizes, strict=True)
    )
    y = PolynomialMatrix.of(plant.C * units[:n]) * x
    if wide and not into_plant:
        y = y + w
    if gain == "S":
        measured = y + disturbed
    else:
        measured = y
    A_K, B_K, C_K, D_K = (PolynomialMatrix.of(getattr(controller, name)) for name in "ABCD")
    u = -(C_K * x_K + D_K * measured)
    if delay:
        arriving = constant(np.eye(m, delay * m)) * held
    else:
        arriving = u
    v = arriving
    if wide and into_plant:
        v = v + w
    if gain == "GS":
        v = v + disturbed
    xi = stacked([x, constant(np.diag(1 / units[n:])) * v])
    if sampled is None:
        next_x = PolynomialMatrix.of(plant.A) * x + PolynomialMatrix.of(plant.B) * v
    else:
        next_x = sampled.F * xi + constant(sampled.L) * moved
    following = [next_x, A_K * x_K + B_K * measured]
    seen, blocks = [], []
    if weight is not None:
        read = arriving if "K" in reads else y
        following.append(constant(weight.A) * x_W + constant(weight.B) * read)
        seen.append(constant(weight.C) * x_W + constant(weight.D) * read)
        blocks.append((weight.C.shape[0], wide))
    if delay:
        following += [constant(np.eye((delay - 1) * m, delay * m, m)) * held, u]
    if moving and sampled is not None:
        seen.append(constant(sampled.R) * xi)
        blocks.append((sampled.R.shape[0], moving))
    if gain:
        seen.append(measured)
        blocks.append((p, d))
    order = n + n_K + n_W + delay * m
    f, z = stacked(following), stacked([*seen, constant(np.zeros((0, total)))])
    states, inputs = constant(np.eye(total, order)), constant(np.eye(total, total - order, -order))
    return ScheduledLoop(
        A=f * states, B=f * inputs, C=z * states, D=z * inputs,
        blocks=blocks, dt=controller.dt, plant_states=n, xi=xi, eps=0.0 if sampled is None else sampled.eps,
    )  # fmt: skip


def constant(matrix: np.ndarray) -> PolynomialMatrix:
    """Return a polynomial of degree zero."""
    return PolynomialMatrix.of(matrix[None])
