"""Compiled time stepping of friction: every ``@njit`` function of the package is in this one file.

One file, because the cache of compiled code on disk looks only at the file of the function it holds: a kernel
that calls into another file would go on running old code after an update. Nothing imports this module at its
head, so that numba is loaded by the first simulation and not by ``import nlfrf``.

Fixed-step fourth-order Runge-Kutta. The trial stages look at the memory of the hysteresis as it was committed
at the beginning of the step, and the step is committed once, at its end: a look ahead leaves no trace. Every
formula is odd in (position, velocity, force), so the point symmetry of friction survives to rounding.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import math

import numpy as np
from numba import njit

from nlfrf.packing import (
    DAHL,
    DEEPEST,
    DEPTH,
    DIRECTION,
    ELASTIC_PLASTIC,
    ELEMENTS,
    EXPONENTIAL,
    LEUVEN,
    LINEAR,
    LOST,
    ORIGINAL,
    PARABOLA,
    RATE,
    SPRING,
    TANH,
    Body,
    Curve,
    F,
    Law,
    Memory,
    V,
    X,
    Z,
)

compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def virgin(curve: Curve, z: float) -> float:
    """Virgin curve y(z), odd."""
    if curve.kind <= LINEAR:
        return curve.K0 * z
    if curve.kind == TANH:
        return curve.Fy * math.tanh(curve.K0 * z / curve.Fy)
    a = abs(z)
    if curve.kind == EXPONENTIAL:
        y = -curve.Fy * math.expm1(-curve.K0 * a / curve.Fy)
    elif curve.kind == PARABOLA:
        rest = max(1.0 - 0.5 * curve.K0 * a / curve.Fy, 0.0)
        y = curve.Fy * (1.0 - rest * rest)
    elif curve.kind == ELASTIC_PLASTIC:
        y = min(curve.K0 * a, curve.Fy)
    else:
        i = segment(curve.table, a)
        y = curve.table[1, i] + curve.table[2, i] * (a - curve.table[0, i])
    return y if z >= 0.0 else -y


@compiled
def slope(curve: Curve, z: float) -> float:
    """Stiffness y'(z) of the virgin curve."""
    if curve.kind <= LINEAR:
        return curve.K0
    a = abs(z)
    if curve.kind == TANH:
        t = math.tanh(curve.K0 * a / curve.Fy)
        return curve.K0 * (1.0 - t * t)
    if curve.kind == EXPONENTIAL:
        return curve.K0 * math.exp(-curve.K0 * a / curve.Fy)
    if curve.kind == PARABOLA:
        return curve.K0 * max(1.0 - 0.5 * curve.K0 * a / curve.Fy, 0.0)
    if curve.kind == ELASTIC_PLASTIC:
        return curve.K0 if curve.K0 * a < curve.Fy else 0.0
    return curve.table[2, segment(curve.table, a)]


@compiled
def segment(table: np.ndarray, a: float) -> int:
    """Index of the last point of the table at or before a."""
    low, high = 0, table.shape[1]
    while high - low > 1:
        middle = (low + high) // 2
        if table[0, middle] <= a:
            low = middle
        else:
            high = middle
    return low


@compiled
def branch(z: float, z0: float, direction: float, depth: int, stack: np.ndarray) -> int:
    """Depth of the memory after a monotone move from z0 to z; depth + 1 where z0 becomes a turning point.

    Passing the turning point before last closes an inner loop and wipes two points out; the outermost branch
    meets the virgin curve again at the mirror image of its turning point.
    """
    d = 1.0 if z > z0 else -1.0
    n = depth + 1 if d * direction < 0.0 else depth
    while n > 1:
        if d * (z - stack[0, n - 2]) < 0.0:
            return n
        n -= 2
    if n == 1:
        outermost = z0 if depth == 0 else stack[0, 0]
        if d * (z + outermost) >= 0.0:
            n = 0
    return n


@compiled
def hysteresis(curve: Curve, memory: Memory, z: float) -> tuple[float, float]:
    """Hysteresis force after a monotone move from the committed state to z, and the force its branch began with."""
    state, stack = memory.state, memory.stack
    z0 = state[Z]
    if curve.kind == SPRING:
        return curve.K0 * z, 0.0
    if curve.kind == ELEMENTS:
        total = 0.0
        for i in range(curve.elements.shape[1]):
            w = curve.elements[1, i]
            total += min(max(memory.slip[0, i] + curve.elements[0, i] * (z - z0), -w), w)
        return total, 0.0
    depth = int(state[DEPTH])
    if z == z0:
        return state[F], (stack[1, depth - 1] if depth > 0 else 0.0)
    n = branch(z, z0, state[DIRECTION], depth, stack)
    if n == 0:
        return virgin(curve, z), 0.0
    if n == depth + 1:
        zm, fm = z0, state[F]
    else:
        zm, fm = stack[0, n - 1], stack[1, n - 1]
    return fm + 2.0 * virgin(curve, 0.5 * (z - zm)), fm


@compiled
def commit(curve: Curve, memory: Memory, z: float) -> float:
    """Move the memory to z; returns the stiffness dFh/dz there."""
    state, stack, slip = memory.state, memory.stack, memory.slip
    z0 = state[Z]
    if curve.kind == SPRING:
        state[Z], state[F] = z, curve.K0 * z
        return curve.K0
    if curve.kind == ELEMENTS:
        total, stiffness = 0.0, 0.0
        for i in range(curve.elements.shape[1]):
            w = curve.elements[1, i]
            force = slip[0, i] + curve.elements[0, i] * (z - z0)
            if abs(force) < w:
                stiffness += curve.elements[0, i]
            slip[0, i] = min(max(force, -w), w)
            total += slip[0, i]
        state[Z], state[F] = z, total
        return stiffness
    depth = int(state[DEPTH])
    if z != z0:
        force, _ = hysteresis(curve, memory, z)
        n = branch(z, z0, state[DIRECTION], depth, stack)
        if n == depth + 1:
            if depth == stack.shape[1]:  # full: the innermost loop is forgotten, and counted
                depth -= 2
                n = depth + 1
                state[LOST] += 1.0
            stack[0, depth], stack[1, depth] = z0, state[F]
        depth = n
        state[DIRECTION] = 1.0 if z > z0 else -1.0
        state[DEPTH], state[DEEPEST] = depth, max(state[DEEPEST], depth)
        state[Z], state[F] = z, force
    if depth == 0:
        return slope(curve, z)
    return slope(curve, 0.5 * (z - stack[0, depth - 1]))


@compiled
def follow(curve: Curve, memory: Memory, path: np.ndarray, out: np.ndarray) -> None:
    """The hysteresis force along a path of z, monotone between its points."""
    for j in range(path.size):
        commit(curve, memory, path[j])
        out[j] = memory.state[F]


@compiled
def sliding_force(law: Law, v: float) -> float:
    """Stribeck curve |s(v)|."""
    if law.Fs == law.Fc:
        return law.Fc
    q = abs(v) / law.vs
    e = q * q if law.delta == 2.0 else q**law.delta
    return law.Fc + (law.Fs - law.Fc) * math.exp(-e)


@compiled
def rates(law: Law, v: float, fh: float, fb: float) -> tuple[float, float]:
    """dz/dt and the friction force of the Leuven family (LuGre and Dahl are in it)."""
    g = sliding_force(law, v)
    if law.form == LEUVEN:
        r = abs(fh) / g
        if law.n != 1.0:
            r = r**law.n
        dz = v - abs(v) * r if fh >= 0.0 else v + abs(v) * r
    else:
        d = 1.0 if v >= 0.0 else -1.0
        if law.form == ORIGINAL:
            # where the branch began beyond s(v) no way is left to go: it slides
            way, room = d * (fh - fb), g - d * fb
            r = 1.0 if room <= 0.0 or way >= room else way / room
            dz = v * (1.0 - math.copysign(abs(r) ** law.n, r))
        else:
            r = 1.0 - d * fh / g
            dz = v * math.copysign(abs(r) ** law.n, r)
    return dz, fh + law.sigma1 * dz + law.sigma2 * v


@compiled
def pull_back(law: Law, v: float, fh: float, stiffness: float) -> float:
    """How fast dz/dt pulls z back while sliding [1/s]: the eigenvalue that limits the step."""
    g = sliding_force(law, v)
    rate = law.n * stiffness * abs(v) / g
    if law.form != DAHL and law.n > 1.0:
        rate *= (abs(fh) / g) ** (law.n - 1.0)
    return rate


@compiled
def advance_hysteretic(
    body: Body, law: Law, memory: Memory, drive: np.ndarray, h: float, substeps: int, out: np.ndarray
) -> bool:
    """Leuven family over the steps of `drive` (begin, middle, end of each); False where the numbers ran away.

    `drive` is the force on the mass, or the velocity of a driven body. `out` takes position, velocity, z and
    friction force at the beginning of every step that is a multiple of `substeps`.
    """
    curve, state = law.curve, memory.state
    w, k, c, driven = 1.0 / body.mass, body.stiffness, body.damping, body.driven
    x, v = state[X], state[V]
    for j in range(drive.shape[0]):
        u1, u2, u3 = drive[j, 0], drive[j, 1], drive[j, 2]
        z = state[Z]
        if driven:
            v = u1
        depth = int(state[DEPTH])
        z1, f1 = rates(law, v, state[F], memory.stack[1, depth - 1] if depth > 0 else 0.0)
        a1 = w * (u1 - k * x - c * v - f1)
        if j % substeps == 0:
            i = j // substeps
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, v, z, f1
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                break
        v2 = u2 if driven else v + 0.5 * h * a1
        fh, fb = hysteresis(curve, memory, z + 0.5 * h * z1)
        z2, f2 = rates(law, v2, fh, fb)
        a2 = w * (u2 - k * (x + 0.5 * h * v) - c * v2 - f2)
        v3 = u2 if driven else v + 0.5 * h * a2
        fh, fb = hysteresis(curve, memory, z + 0.5 * h * z2)
        z3, f3 = rates(law, v3, fh, fb)
        a3 = w * (u2 - k * (x + 0.5 * h * v2) - c * v3 - f3)
        v4 = u3 if driven else v + h * a3
        fh, fb = hysteresis(curve, memory, z + h * z3)
        z4, f4 = rates(law, v4, fh, fb)
        a4 = w * (u3 - k * (x + h * v3) - c * v4 - f4)
        x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        v = u3 if driven else v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        stiffness = commit(curve, memory, z + h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4))
        state[RATE] = max(state[RATE], pull_back(law, v, state[F], stiffness))
    state[X], state[V] = x, v
    return abs(x) < 1e150 and abs(v) < 1e150
