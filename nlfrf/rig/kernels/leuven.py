"""Compiled time stepping of the Leuven family of friction laws, and of hysteresis.

    dz/dt = v (1 - sgn(Fh/s(v)) |Fh/s(v)|^n),  F = Fh(z) + sigma1 dz/dt + sigma2 v        (see `nlfrf.rig.laws.laws`)

Compiled functions do not call other files, because the cache of compiled code on disk checks only
the file of a function: a kernel that calls into another file would run old code after an update.
This module is never imported at the head of another, so that numba is loaded by the first
simulation and not by ``import nlfrf``. Arrays are passed one by one: each array taken from a tuple
would be reference-counted, which costs more than the arithmetic. For the same reason kernels are
compiled without reference counts (`_nrt=False`): they make no arrays, and the first caller keeps
its arguments alive. That saves an eighth of a loop around the rig, and more than half for two
masses with elements.

Fixed-step fourth-order Runge-Kutta. The trial stages use the committed memory of the hysteresis,
which is committed once at the end of a step: a trial leaves no trace. The stiffness jumps where z
turns and where a loop closes, so a step is divided there. Every formula is odd in (position,
velocity, force), so the point symmetry of friction survives to rounding.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import math

import numpy as np

from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.kernels.compiled import njit
from nlfrf.rig.kernels.data import DEPTH, DIRECTION, ERROR, LOST, Body, Curve, F, Law, Step, V, X, Z

#: Branches of the hysteresis: found in the memory at every stage; the virgin curve; a later branch.
_FROM_MEMORY, _VIRGIN, _LATER = range(3)
#: Events that divide a step: v = 0, dz/dt = 0, z where a loop closes.
_VELOCITY, _RATE_OF_Z, _PLACE = range(3)
Branch = tuple[int, float, float]
Array = np.ndarray
compiled = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
# the innermost functions: inlining saves a sixth of the time
inlined = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, _nrt=False)


@inlined
def _virgin_curve(curve: Curve, grid: Array, z: float) -> float:
    """Return the virgin curve y(z), odd."""
    if curve.kind == kernel_data.SPRING:
        return curve.K0 * z
    if curve.kind == kernel_data.TANH:
        return curve.Fy * math.tanh(curve.K0 * z / curve.Fy)
    a = abs(z)
    if curve.kind == kernel_data.EXPONENTIAL:
        y = -curve.Fy * math.expm1(-curve.K0 * a / curve.Fy)
    elif curve.kind == kernel_data.PARABOLA:
        rest = max(1.0 - 0.5 * curve.K0 * a / curve.Fy, 0.0)
        y = curve.Fy * (1.0 - rest * rest)
    elif curve.kind == kernel_data.ELASTIC_PLASTIC:
        y = min(curve.K0 * a, curve.Fy)
    else:
        i = _find_segment(grid, a)
        y = grid[1, i] + grid[2, i] * (a - grid[0, i])
    return y if z >= 0.0 else -y


@compiled
def _virgin_stiffness(curve: Curve, grid: Array, z: float, y: float) -> float:
    """Return the stiffness y'(z) of the virgin curve, where y = y(z)."""
    if curve.kind == kernel_data.SPRING:
        return curve.K0
    if curve.kind == kernel_data.TANH:
        return curve.K0 * (1.0 - (y / curve.Fy) ** 2)
    if curve.kind == kernel_data.EXPONENTIAL:
        return curve.K0 * (1.0 - abs(y) / curve.Fy)
    a = abs(z)
    if curve.kind == kernel_data.PARABOLA:
        return curve.K0 * max(1.0 - 0.5 * curve.K0 * a / curve.Fy, 0.0)
    if curve.kind == kernel_data.ELASTIC_PLASTIC:
        return curve.K0 if curve.K0 * a < curve.Fy else 0.0
    return grid[2, _find_segment(grid, a)]


@compiled
def _find_segment(grid: Array, a: float) -> int:
    """Return the index of the last point of the table at or before a."""
    low, high = 0, grid.shape[1]
    while high - low > 1:
        middle = (low + high) // 2
        if grid[0, middle] <= a:
            low = middle
        else:
            high = middle
    return low


@compiled
def _depth_after_move(z: float, z0: float, direction: float, depth: int, stack: Array) -> int:
    """Return the depth of the memory after a monotone move from z0 to z; depth + 1 if z0 becomes a
    turning point.

    Passing the turning point before last closes an inner loop and removes two points. The outermost
    branch meets the virgin curve again at the mirror image of its turning point.
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
def hysteresis_on_trial(curve: Curve, grid: Array, state: Array, stack: Array, z: float) -> float:
    """Return the hysteresis force after a monotone move from the committed state to z."""
    z0 = state[Z]
    if curve.kind == kernel_data.SPRING:
        return curve.K0 * z
    if curve.kind == kernel_data.ELEMENTS:
        total = 0.0
        for i in range(grid.shape[1]):
            w = grid[1, i]
            total += min(max(stack[0, i] + grid[0, i] * (z - z0), -w), w)
        return total
    if z == z0:
        return state[F]
    depth = int(state[DEPTH])
    n = _depth_after_move(z, z0, state[DIRECTION], depth, stack)
    if n == 0:
        return _virgin_curve(curve, grid, z)
    zm, fm = z0, state[F]
    if n <= depth:
        zm, fm = stack[0, n - 1], stack[1, n - 1]
    return fm + 2.0 * _virgin_curve(curve, grid, 0.5 * (z - zm))


@compiled
def commit_hysteresis(curve: Curve, grid: Array, state: Array, stack: Array, z: float) -> float:
    """Move the memory to z; return the stiffness dFh/dz there."""
    z0 = state[Z]
    if curve.kind == kernel_data.SPRING:
        state[Z], state[F] = z, curve.K0 * z
        return curve.K0
    if curve.kind == kernel_data.ELEMENTS:
        total, stiffness = 0.0, 0.0
        for i in range(grid.shape[1]):
            w = grid[1, i]
            force = stack[0, i] + grid[0, i] * (z - z0)
            if abs(force) < w:
                stiffness += grid[0, i]
            stack[0, i] = min(max(force, -w), w)
            total += stack[0, i]
        state[Z], state[F] = z, total
        return stiffness
    depth = int(state[DEPTH])
    if z != z0:
        force = hysteresis_on_trial(curve, grid, state, stack, z)
        n = _depth_after_move(z, z0, state[DIRECTION], depth, stack)
        if n == depth + 1:
            if depth == stack.shape[1]:  # full: the innermost loop is forgotten and counted
                depth -= 2
                n = depth + 1
                state[LOST] += 1.0
            stack[0, depth], stack[1, depth] = z0, state[F]
        depth = n
        state[DIRECTION] = 1.0 if z > z0 else -1.0
        state[DEPTH], state[Z], state[F] = depth, z, force
    if depth == 0:
        return _virgin_stiffness(curve, grid, z, state[F])
    return _virgin_stiffness(
        curve, grid, 0.5 * (z - stack[0, depth - 1]), 0.5 * (state[F] - stack[1, depth - 1])
    )


@compiled
def follow_path(
    curve: Curve, grid: Array, state: Array, stack: Array, path: Array, out: Array
) -> None:
    """Write the hysteresis force along a path of z, monotone between its points, into `out`."""
    for j in range(path.size):
        commit_hysteresis(curve, grid, state, stack, path[j])
        out[j] = state[F]


@inlined
def _stribeck_force(law: Law, v: float) -> float:
    """Return the Stribeck curve |s(v)|."""
    if law.Fs == law.Fc:
        return law.Fc
    q = abs(v) / law.vs
    e = q * q if law.delta == 2.0 else q**law.delta
    return law.Fc + (law.Fs - law.Fc) * math.exp(-e)


@inlined
def friction_rates(law: Law, v: float, fh: float) -> tuple[float, float]:
    """Return dz/dt and the friction force of the Leuven family, which includes LuGre and Dahl."""
    g = _stribeck_force(law, v)
    if law.form == kernel_data.LEUVEN:
        r = abs(fh) / g
        if law.n != 1.0:
            r = r**law.n
        dz = v - abs(v) * r if fh >= 0.0 else v + abs(v) * r
    else:
        d = 1.0 if v >= 0.0 else -1.0
        r = 1.0 - d * fh / g
        dz = v * math.copysign(abs(r) ** law.n, r)
    return dz, fh + law.sigma1 * dz + law.sigma2 * v


@compiled
def error_growth(law: Law, v: float, fh: float, stiffness: float, h: float) -> float:
    """Return the factor of a step on an error of z in sliding; the step must resolve the relaxation
    rate of z.
    """
    q = h * law.n * law.curve.K0 * abs(v) / law.Fc
    if q > 30.0:  # z would jump to the flat part of the curve, without a restoring force
        return np.inf
    q *= stiffness / law.curve.K0
    if law.form != kernel_data.DAHL and law.n > 1.0:
        q *= (min(abs(fh) / law.Fc, 1.0)) ** (law.n - 1.0)
    return abs(1.0 - q * (1.0 - q * (0.5 - q * (1.0 / 6.0 - q / 24.0))))


@compiled
def _next_branch(law: Law, state: Array, stack: Array, v: float, has_turned: bool) -> Branch:
    """Return the branch until z turns or a loop closes, and its turning point."""
    if not (kernel_data.TANH <= law.curve.kind <= kernel_data.PARABOLA):
        return _FROM_MEMORY, 0.0, 0.0
    if not has_turned and state[DIRECTION] != 0.0:
        dz, _ = friction_rates(law, v, state[F])
        has_turned = dz * state[DIRECTION] < 0.0
    if has_turned:
        return _LATER, state[Z], state[F]
    depth = int(state[DEPTH])
    if depth == 0:
        return _VIRGIN, 0.0, 0.0
    return _LATER, stack[0, depth - 1], stack[1, depth - 1]


@inlined
def _branch_force(
    curve: Curve, grid: Array, state: Array, stack: Array, branch: Branch, z: float
) -> float:
    """Return the hysteresis force at z on a branch."""
    if branch[0] == _LATER:
        return branch[2] + 2.0 * _virgin_curve(curve, grid, 0.5 * (z - branch[1]))
    if branch[0] == _VIRGIN:
        return _virgin_curve(curve, grid, z)
    return hysteresis_on_trial(curve, grid, state, stack, z)


@compiled
def _trial_step(
    body: Body,
    law: Law,
    grid: Array,
    state: Array,
    stack: Array,
    branch: Branch,
    step: Step,
    a: float,
    b: float,
) -> tuple[float, float, float, float, float]:
    """Try the part a..b of a Runge-Kutta step with the committed memory; return x, v, z at its end,
    dz/dt at both.
    """
    curve, z, h = law.curve, state[Z], (b - a) * step.h
    w, k, c, driven = 1.0 / body.mass, body.stiffness, body.damping, body.driven
    u1, u2, u3 = _drive_at(step.u, a), _drive_at(step.u, 0.5 * (a + b)), _drive_at(step.u, b)
    x, v = step.x, step.v
    z1, f1 = friction_rates(law, v, state[F])
    a1 = w * (u1 - k * x - c * v - f1)
    v2 = u2 if driven else v + 0.5 * h * a1
    z2, f2 = friction_rates(
        law, v2, _branch_force(curve, grid, state, stack, branch, z + 0.5 * h * z1)
    )
    a2 = w * (u2 - k * (x + 0.5 * h * v) - c * v2 - f2)
    v3 = u2 if driven else v + 0.5 * h * a2
    z3, f3 = friction_rates(
        law, v3, _branch_force(curve, grid, state, stack, branch, z + 0.5 * h * z2)
    )
    a3 = w * (u2 - k * (x + 0.5 * h * v2) - c * v3 - f3)
    v4 = u3 if driven else v + h * a3
    z4, f4 = friction_rates(law, v4, _branch_force(curve, grid, state, stack, branch, z + h * z3))
    a4 = w * (u3 - k * (x + h * v3) - c * v4 - f4)
    x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    v = u3 if driven else v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    z += h / 6.0 * (z1 + 2.0 * z2 + 2.0 * z3 + z4)
    return x, v, z, z1, z4


@compiled
def _drive_at(u: tuple[float, float, float], s: float) -> float:
    """Return the drive at s in 0..1 of a step: the parabola through its start, middle and end."""
    return u[0] + s * ((4.0 * u[1] - 3.0 * u[0] - u[2]) + s * 2.0 * (u[0] - 2.0 * u[1] + u[2]))


@compiled
def _locate_event(
    body: Body,
    law: Law,
    grid: Array,
    state: Array,
    stack: Array,
    branch: Branch,
    step: Step,
    a: float,
    b: float,
    event: int,
    z: float,
) -> float:
    """Find the place between a and b of a step where velocity or dz/dt is zero, or z is reached, by
    false position.
    """
    low, high, e0, e1, enough = a, b, 0.0, 0.0, 0.0
    for i in range(12):
        if i > 0:
            b = low + (high - low) * e0 / (e0 - e1)
        _, v1, z1, d0, d1 = _trial_step(body, law, grid, state, stack, branch, step, a, b)
        e = v1 if event == _VELOCITY else (d1 if event == _RATE_OF_Z else z1 - z)
        if i == 0:
            e0 = step.v if event == _VELOCITY else (d0 if event == _RATE_OF_Z else state[Z] - z)
            e1 = e
            enough = 1e-12 * max(abs(e0), abs(e1))
        elif abs(e) <= enough:
            break
        elif e * e0 > 0.0:
            low, e0, e1 = b, e, 0.5 * e1
        else:
            high, e1, e0 = b, e, 0.5 * e0
    return b


@compiled
def _find_loop_closure(state: Array, stack: Array, z: float) -> tuple[bool, float]:
    """Return whether a monotone move to z closes a loop, and z at which the first one closes."""
    z0, depth = state[Z], int(state[DEPTH])
    turned = (z - z0) * state[DIRECTION] < 0.0
    if _depth_after_move(z, z0, state[DIRECTION], depth, stack) >= depth + turned:
        return False, z
    if turned:
        return True, (stack[0, depth - 1] if depth > 0 else -z0)
    return True, (stack[0, depth - 2] if depth > 1 else -stack[0, 0])


@compiled
def _step_to_event(
    body: Body,
    law: Law,
    grid: Array,
    state: Array,
    stack: Array,
    branch: Branch,
    step: Step,
    a: float,
    has_turned: bool,
) -> tuple[float, float, float, float, bool]:
    """Step from a until z turns or a loop closes, else to 1; return the end, x, v, z there, and
    whether z turned.
    """
    b = 1.0
    x1, v1, z1, d0, d1 = _trial_step(body, law, grid, state, stack, branch, step, a, b)
    if not has_turned and d0 * d1 < 0.0:
        what = _VELOCITY if step.v * v1 < 0.0 else _RATE_OF_Z
        b = _locate_event(body, law, grid, state, stack, branch, step, a, b, what, 0.0)
        has_turned = True
        x1, v1, z1, _, _ = _trial_step(body, law, grid, state, stack, branch, step, a, b)
    if branch[0] != _FROM_MEMORY:
        closes, z = _find_loop_closure(state, stack, z1)
        # a loop that closes where z turns needs no second division
        if closes and not (has_turned and abs(z1 - z) < 1e-4 * abs(z1 - state[Z])):
            b = _locate_event(body, law, grid, state, stack, branch, step, a, b, _PLACE, z)
            has_turned = False
            x1, v1, _, _, _ = _trial_step(body, law, grid, state, stack, branch, step, a, b)
            z1 = z
    return b, x1, v1, z1, has_turned


@compiled
def advance_hysteretic(
    body: Body,
    law: Law,
    grid: Array,
    state: Array,
    stack: Array,
    drive: Array,
    h: float,
    substeps: int,
    out: Array,
) -> bool:
    """Advance the Leuven family over the steps of `drive` (start, middle, end of each); False if it
    is not stable.

    `drive` is the force on the mass, or the velocity of a driven body. `out` gets position,
    velocity, z and friction force at the start of every step that is a multiple of `substeps`.
    Steps are divided at turning points, and at closing loops if the curve itself is smooth.
    """
    x, v = state[X], state[V]
    for j in range(drive.shape[0]):
        u = (drive[j, 0], drive[j, 1], drive[j, 2])
        if body.driven:
            v = u[0]
        if j % substeps == 0:
            i = j // substeps
            out[i, 0], out[i, 1], out[i, 2] = x, v, state[Z]
            _, out[i, 3] = friction_rates(law, v, state[F])
            # the squares of larger numbers overflow; nan fails both comparisons
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                break
        way = _next_branch(law, state, stack, v, False)
        step = Step(x, v, u, h)
        x1, v1, z1, d0, d1 = _trial_step(body, law, grid, state, stack, way, step, 0.0, 1.0)
        # z turned, or a loop closed: the trial is repeated in parts that end at these events
        if d0 * d1 < 0.0 or (way[0] != _FROM_MEMORY and _find_loop_closure(state, stack, z1)[0]):
            # the limit on parts also ends a loop whose event lies at the start of its part
            a, turned, parts = 0.0, False, 0
            while a < 1.0 and parts < 6:
                a, x1, v1, z1, turned = _step_to_event(
                    body, law, grid, state, stack, way, step, a, turned
                )
                parts += 1
                if a < 1.0:
                    step = Step(x1, v1, u, h)
                    commit_hysteresis(law.curve, grid, state, stack, z1)
                    way = _next_branch(law, state, stack, v1, turned)
            if a < 1.0:  # too many events in this step: the rest is one undivided step
                x1, v1, z1, _, _ = _trial_step(body, law, grid, state, stack, way, step, a, 1.0)
        x, v = x1, v1
        stiffness = commit_hysteresis(law.curve, grid, state, stack, z1)
        # at least one: a step also adds an error, which earlier decay does not reduce
        state[ERROR] = max(state[ERROR], 1.0) * error_growth(law, v, state[F], stiffness, h)
        if state[ERROR] > kernel_data.MAX_ERROR_GROWTH:
            return False
    state[X], state[V] = x, v
    return abs(x) < 1e150 and abs(v) < 1e150
