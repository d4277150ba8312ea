"""Compiled time stepping of Coulomb friction and of the generalised Maxwell-slip model.

The file stands alone for the reason given in `leuven`. Both laws switch between sticking and
slipping where the velocity turns: steps are divided there.
"""

from __future__ import annotations

import math

import numpy as np

from nlfrf.rig.kernels.compiled import njit
from nlfrf.rig.kernels.data import DIRECTION, Body, F, Law, Step, V, X

# mypy: disable-error-code="untyped-decorator"


Array = np.ndarray
# `_nrt=False`: without reference counts, see `leuven`
compiled = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)


@compiled
def stribeck_force(law: Law, v: float) -> float:
    """Return the Stribeck curve |s(v)|."""
    if law.Fs == law.Fc:
        return law.Fc
    q = abs(v) / law.vs
    e = q * q if law.delta == 2.0 else q**law.delta
    return law.Fc + (law.Fs - law.Fc) * math.exp(-e)


@compiled
def _drive_at(u: tuple[float, float, float], s: float) -> float:
    """Return the drive at s in 0..1 of a step: the parabola through its start, middle and end."""
    return u[0] + s * ((4.0 * u[1] - 3.0 * u[0] - u[2]) + s * 2.0 * (u[0] - 2.0 * u[1] + u[2]))


@compiled
def _sliding_step(
    body: Body, law: Law, d: float, step: Step, a: float, b: float
) -> tuple[float, float]:
    """Return position and velocity after the part a..b of a step that slides in the direction d."""
    h, w, k, c = (b - a) * step.h, 1.0 / body.mass, body.stiffness, body.damping + law.sigma2
    u1, u2, u3 = _drive_at(step.u, a), _drive_at(step.u, 0.5 * (a + b)), _drive_at(step.u, b)
    x, v = step.x, step.v
    a1 = w * (u1 - k * x - c * v - d * stribeck_force(law, v))
    v2 = v + 0.5 * h * a1
    a2 = w * (u2 - k * (x + 0.5 * h * v) - c * v2 - d * stribeck_force(law, v2))
    v3 = v + 0.5 * h * a2
    a3 = w * (u2 - k * (x + 0.5 * h * v2) - c * v3 - d * stribeck_force(law, v3))
    v4 = v + h * a3
    a4 = w * (u3 - k * (x + h * v3) - c * v4 - d * stribeck_force(law, v4))
    return x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (
        a1 + 2.0 * a2 + 2.0 * a3 + a4
    )


@compiled
def _locate_break_away(body: Body, law: Law, step: Step, a: float) -> tuple[float, float]:
    """Find where after a the force on a stuck mass passes the static friction, and its direction;
    else (1, 0).
    """
    spring = body.stiffness * step.x
    end = _drive_at(step.u, 1.0) - spring
    if abs(end) <= law.Fs:
        return 1.0, 0.0
    d = 1.0 if end > 0.0 else -1.0
    low, high = a, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        if d * (_drive_at(step.u, middle) - spring) > law.Fs:
            high = middle
        else:
            low = middle
    return high, d


@compiled
def _locate_stop(body: Body, law: Law, d: float, step: Step, a: float, v1: float) -> float:
    """Find the place behind a where the velocity passes zero, by false position."""
    low, high, e0, e1 = a, 1.0, step.v, v1
    b = low + (high - low) * e0 / (e0 - e1)
    for _ in range(12):
        _, e = _sliding_step(body, law, d, step, a, b)
        if abs(e) <= 1e-12 * max(abs(step.v), abs(v1)):
            break
        if e * e0 > 0.0:
            low, e0, e1 = b, e, 0.5 * e1
        else:
            high, e1, e0 = b, e, 0.5 * e0
        b = low + (high - low) * e0 / (e0 - e1)
    return b


@compiled
def advance_coulomb(
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
    """Advance Coulomb friction over the steps of `drive`: the mass sticks until the force passes
    Fs, then slides.
    """
    x, v = state[X], state[V]
    for j in range(drive.shape[0]):
        u = (drive[j, 0], drive[j, 1], drive[j, 2])
        if body.driven:
            v = u[0]
            state[DIRECTION] = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
        if j % substeps == 0:
            i = j // substeps
            out[i, 0], out[i, 1], out[i, 2] = x, v, 0.0
            d = state[DIRECTION]
            stuck = 0.0 if body.driven else u[0] - body.stiffness * x
            out[i, 3] = stuck if d == 0.0 else d * stribeck_force(law, v) + law.sigma2 * v
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                break
        if body.driven:
            x, v = x + h / 6.0 * (u[0] + 4.0 * u[1] + u[2]), u[2]
            continue
        a = 0.0
        for _ in range(6):
            d = state[DIRECTION]
            step = Step(x, v, u, h)
            if d == 0.0:
                a, state[DIRECTION] = _locate_break_away(body, law, step, a)
            else:
                x1, v1 = _sliding_step(body, law, d, step, a, 1.0)
                if d * v1 > 0.0:
                    x, v, a = x1, v1, 1.0
                else:
                    b = _locate_stop(body, law, d, step, a, v1) if v != 0.0 else a
                    x, _ = _sliding_step(body, law, d, step, a, b)
                    v, a = 0.0, b
                    force = _drive_at(u, b) - body.stiffness * x
                    state[DIRECTION] = (
                        0.0 if abs(force) <= law.Fs else (1.0 if force > 0.0 else -1.0)
                    )
            if a >= 1.0:
                break
        if a < 1.0:  # it starts and stops within the step: it rests
            v, state[DIRECTION] = 0.0, 0.0
    state[X], state[V] = x, v
    return abs(x) < 1e150 and abs(v) < 1e150


@compiled
def elements_force(
    law: Law, grid: Array, stack: Array, d: float, move: float, v: float, keep: float, gain: float
) -> float:
    """Return the force of the elements after a move: stuck ones follow it up to their limit,
    slipping ones relax.

    The limit holds in the direction d of the motion: a force beyond the other limit may return
    freely. A slipping element is keep times its force at the start of the step plus gain times its
    share of the strength.
    """
    g, total = stribeck_force(law, v), law.sigma2 * v
    for i in range(grid.shape[1]):
        if stack[1, i] == 0.0:
            w, force = grid[1, i] * g, stack[0, i] + grid[0, i] * move
            if d >= 0.0:
                force = min(force, w)
            if d <= 0.0:
                force = max(force, -w)
            total += force
        else:
            total += keep * stack[0, i] + gain * stack[1, i] * grid[1, i]
    return total


@compiled
def _trial_step(
    body: Body, law: Law, grid: Array, stack: Array, d: float, step: Step, a: float, b: float
) -> tuple[float, float, float, float]:
    """Try the part a..b of a Runge-Kutta step: return x, v, and keep and gain of slipping elements.

    In slipping, dF/dt = d C (alpha - F / s(v)) is linear in F: keep' = -C/|s| keep and gain' = C (1
    - gain/|s|) hold for all elements at once.
    """
    h, w, k, c, n = (b - a) * step.h, 1.0 / body.mass, body.stiffness, body.damping, law.n
    u1, u2, u3 = _drive_at(step.u, a), _drive_at(step.u, 0.5 * (a + b)), _drive_at(step.u, b)
    x, v, driven = step.x, step.v, body.driven
    r = n / stribeck_force(law, v)
    k1, g1 = -r, n
    a1 = w * (u1 - k * x - c * v - elements_force(law, grid, stack, d, 0.0, v, 1.0, 0.0))
    v2 = u2 if driven else v + 0.5 * h * a1
    keep, gain, r = 1.0 + 0.5 * h * k1, 0.5 * h * g1, n / stribeck_force(law, v2)
    k2, g2 = -r * keep, n - r * gain
    a2 = w * (
        u2
        - k * (x + 0.5 * h * v)
        - c * v2
        - elements_force(law, grid, stack, d, 0.5 * h * v, v2, keep, gain)
    )
    v3 = u2 if driven else v + 0.5 * h * a2
    keep, gain, r = 1.0 + 0.5 * h * k2, 0.5 * h * g2, n / stribeck_force(law, v3)
    k3, g3 = -r * keep, n - r * gain
    a3 = w * (
        u2
        - k * (x + 0.5 * h * v2)
        - c * v3
        - elements_force(law, grid, stack, d, 0.5 * h * v2, v3, keep, gain)
    )
    v4 = u3 if driven else v + h * a3
    keep, gain, r = 1.0 + h * k3, h * g3, n / stribeck_force(law, v4)
    k4, g4 = -r * keep, n - r * gain
    a4 = w * (
        u3 - k * (x + h * v3) - c * v4 - elements_force(law, grid, stack, d, h * v3, v4, keep, gain)
    )
    x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    v = u3 if driven else v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    keep = 1.0 + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x, v, keep, h / 6.0 * (g1 + 2.0 * g2 + 2.0 * g3 + g4)


@compiled
def _locate_reversal(
    body: Body, law: Law, grid: Array, stack: Array, d: float, step: Step, a: float, v1: float
) -> float:
    """Find the place behind a where the velocity passes zero, by false position."""
    low, high, e0, e1 = a, 1.0, step.v, v1
    b = low + (high - low) * e0 / (e0 - e1)
    for _ in range(12):
        _, e, _, _ = _trial_step(body, law, grid, stack, d, step, a, b)
        if abs(e) <= 1e-12 * max(abs(step.v), abs(v1)):
            break
        if e * e0 > 0.0:
            low, e0, e1 = b, e, 0.5 * e1
        else:
            high, e1, e0 = b, e, 0.5 * e0
        b = low + (high - low) * e0 / (e0 - e1)
    return b


@compiled
def commit_elements(
    law: Law,
    grid: Array,
    stack: Array,
    d: float,
    step: Step,
    x1: float,
    v1: float,
    keep: float,
    gain: float,
) -> None:
    """Commit the elements at the end of a step: those beyond their limit have begun to slip.

    The place in the step where an element passed its limit counts: behind it the element lags the
    Stribeck curve.
    """
    g0, g1 = stribeck_force(law, step.v), stribeck_force(law, v1)
    for i in range(grid.shape[1]):
        share = grid[1, i]
        if stack[1, i] == 0.0:
            begin, end = d * stack[0, i], d * (stack[0, i] + grid[0, i] * (x1 - step.x))
            if end >= share * g1:
                s = 0.0
                if begin < share * g0:
                    s = (share * g0 - begin) / (share * g0 - begin + end - share * g1)
                # its relaxation in the rest of this step is of second order
                end = min(
                    begin + s * (end - begin),
                    share * stribeck_force(law, step.v + s * (v1 - step.v)),
                )
                stack[1, i] = d
            stack[0, i] = d * end
        else:
            stack[0, i] = keep * stack[0, i] + gain * stack[1, i] * share


@compiled
def advance_gms(
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
    """Advance generalised Maxwell slip; grid: stiffness and share of strength; stack: force and
    slip direction.
    """
    x, v = state[X], state[V]
    for j in range(drive.shape[0]):
        u = (drive[j, 0], drive[j, 1], drive[j, 2])
        if body.driven:
            v = u[0]
        d = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
        if j % substeps == 0:
            i = j // substeps
            state[F] = elements_force(law, grid, stack, d, 0.0, v, 1.0, 0.0)
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, v, 0.0, state[F]
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                break
        step = Step(x, v, u, h)
        x1, v1, keep, gain = _trial_step(body, law, grid, stack, d, step, 0.0, 1.0)
        # The force is not smooth where the velocity changes its sign: the step ends there, every
        # element sticks again, and the rest of the step follows in the other direction.
        if v * v1 < 0.0:
            b = _locate_reversal(body, law, grid, stack, d, step, 0.0, v1)
            x1, v1, keep, gain = _trial_step(body, law, grid, stack, d, step, 0.0, b)
            commit_elements(law, grid, stack, d, step, x1, v1, keep, gain)
            stack[1, :] = 0.0
            d, step = -d, Step(x1, v1, u, h)
            x1, v1, keep, gain = _trial_step(body, law, grid, stack, d, step, b, 1.0)
        elif d == 0.0:
            d = 1.0 if v1 > 0.0 else -1.0
        commit_elements(law, grid, stack, d, step, x1, v1, keep, gain)
        x, v = x1, v1
    state[X], state[V] = x, v
    return abs(x) < 1e150 and abs(v) < 1e150


# ---- Compiled time stepping of Maxwell slip with varying sliders.
#
# Fourth-order Runge-Kutta steps of the mass. An element follows the motion until its slider gives
# way, and then has the force that the slider holds. The trial stages leave no trace.


#: Rows of the memory of the elements: force, direction of slip, time of rest, number drawn.
_ELEMENT_FORCE, _SLIP, _REST, _DRAWN = range(4)


@compiled
def _slider_force(
    law: Law, grid: Array, stack: Array, i: int, d: float, x: float, v: float
) -> float:
    """Return the force at which the slider of an element holds, or slips, in the direction d."""
    m = 1.0
    if stack[_SLIP, i] == d:
        q = v / law.vs
        m *= math.exp(-q * q)
    elif grid[4, i] > 0.0:
        m *= 1.0 - math.exp(-stack[_REST, i] / grid[4, i])
    if grid[3, i] > 0.0:
        m *= 0.5 * (1.0 + math.cos(grid[3, i] * x + grid[2, i]))
    if d < 0.0:
        m *= 1.0 - grid[5, i]
    if grid[6, i] > 0.0:
        m *= stack[_DRAWN, i]
    least = 1.0 / law.n
    return grid[1, i] * (least + (1.0 - least) * m)


@compiled
def _element_force_on_trial(
    law: Law, grid: Array, stack: Array, i: int, move: float, x: float, v: float
) -> float:
    """Return the force of an element after a move, without committing it."""
    force = stack[_ELEMENT_FORCE, i] + grid[0, i] * move
    if abs(force) * law.n <= grid[1, i]:  # below the slip force of any slider
        return force
    d = 1.0 if force > 0.0 else -1.0
    most = _slider_force(law, grid, stack, i, d, x, v)
    return d * most if abs(force) > most else force


@compiled
def sliders_force(law: Law, grid: Array, stack: Array, move: float, x: float, v: float) -> float:
    """Return the force of all elements after a move, without committing it."""
    force = 0.0
    for i in range(grid.shape[1]):
        force += _element_force_on_trial(law, grid, stack, i, move, x, v)
    return force


@compiled
def _give_way(
    law: Law, grid: Array, stack: Array, i: int, move: float, x: float, v0: float, v: float
) -> float:
    """Return the force of an element that gives way within a step, while the velocity goes from v0
    to v.

    The force drops at the velocity at which it gives way. An element that sticks again, as in a
    motion that slows down, keeps this drop. With the velocity at the end of the step the force
    would jump when a strength moves over a step.
    """
    d = 1.0 if stack[_ELEMENT_FORCE, i] + grid[0, i] * move > 0.0 else -1.0
    held, stretch = d * stack[_ELEMENT_FORCE, i], d * grid[0, i] * move
    most = _slider_force(law, grid, stack, i, d, x, v)
    part = min(max(0.0, (most - held) / stretch), 1.0) if stretch > 0.0 else 1.0
    stack[_SLIP, i] = d
    after = (
        min(most, _slider_force(law, grid, stack, i, d, x, v0 + part * (v - v0)))
        + (1.0 - part) * stretch
    )
    least = _slider_force(law, grid, stack, i, d, x, v)
    if after < least:
        stack[_SLIP, i], stack[_REST, i] = 0.0, 0.0
    return d * min(after, least)


@compiled
def commit_sliders(
    law: Law, grid: Array, stack: Array, move: float, x: float, v0: float, v: float, h: float
) -> None:
    """Commit the elements at the end of a step: mark slipping ones, and count the time of rest of
    the others.
    """
    for i in range(grid.shape[1]):
        stuck = stack[_ELEMENT_FORCE, i] + grid[0, i] * move
        force = _element_force_on_trial(law, grid, stack, i, move, x, v)
        if force == stuck:
            if stack[_SLIP, i] != 0.0:
                drawn = stack[_DRAWN, i] * 9301.0 + 0.49297 + 0.618 * grid[6, i] + 0.31 * i
                stack[_DRAWN, i] = drawn - math.floor(drawn)
                stack[_REST, i] = 0.0
            stack[_SLIP, i] = 0.0
            stack[_REST, i] += h
        elif stack[_SLIP, i] * stuck > 0.0:
            # its slip force is at most the force that it held
            most = _slider_force(law, grid, stack, i, stack[_SLIP, i], x, v)
            force = stack[_SLIP, i] * min(abs(force), most)
        else:
            force = _give_way(law, grid, stack, i, move, x, v0, v)
        stack[_ELEMENT_FORCE, i] = force


@compiled
def follow_sliders(
    law: Law, grid: Array, stack: Array, x: Array, v: Array, h: float, out: Array
) -> None:
    """Write the force of each element along a motion x (n,), v (n,), from rest at x[0], into `out`
    (E, n).
    """
    for j in range(x.size):
        last = max(0, j - 1)
        commit_sliders(law, grid, stack, x[j] - x[last], x[j], v[last], v[j], h)
        for i in range(grid.shape[1]):
            out[i, j] = stack[_ELEMENT_FORCE, i]


@compiled
def advance_sliders(
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
    """Advance elements with varying sliders over the steps of `drive`; arguments as in the other
    kernels.
    """
    x, v, w, k, c = state[X], state[V], 1.0 / body.mass, body.stiffness, body.damping
    for j in range(drive.shape[0]):
        u1, u2, u3 = drive[j, 0], drive[j, 1], drive[j, 2]
        if body.driven:
            v = u1
        f1 = sliders_force(law, grid, stack, 0.0, x, v)
        if j % substeps == 0:
            i = j // substeps
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, v, 0.0, f1
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                break
        if body.driven:
            x1, v1 = x + h / 6.0 * (u1 + 4.0 * u2 + u3), u3
        else:
            a1 = w * (u1 - k * x - c * v - f1)
            v2, x2 = v + 0.5 * h * a1, x + 0.5 * h * v
            a2 = w * (u2 - k * x2 - c * v2 - sliders_force(law, grid, stack, x2 - x, x2, v2))
            v3, x3 = v + 0.5 * h * a2, x + 0.5 * h * v2
            a3 = w * (u2 - k * x3 - c * v3 - sliders_force(law, grid, stack, x3 - x, x3, v3))
            v4, x4 = v + h * a3, x + h * v3
            a4 = w * (u3 - k * x4 - c * v4 - sliders_force(law, grid, stack, x4 - x, x4, v4))
            x1 = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v1 = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        commit_sliders(law, grid, stack, x1 - x, x1, v, v1, h)
        x, v = x1, v1
    state[X], state[V] = x, v
    state[F] = sliders_force(law, grid, stack, 0.0, x, v)
    return abs(x) < 1e150 and abs(v) < 1e150


# ---- A load on a spring and a damper behind a periodic motion, with derivatives.
#
# With all elements stuck the load is linear, and a step of it is exact; the slip of the sliders
# acts as a force that changes linearly within a step. Along the motion every element sticks or
# slips, so all derivatives solve one linear equation, each with its own force.

#: Largest share of the response to a step that friction falling with speed may take away; more is
#: not resolved.
_MOST_FALL = 0.5
#: Rows of the memory of an element: deflection, direction of slip; then after a step: deflection;
#: by direction, 1 if it slips and 2 if it slipped and stuck again; jump of its slider when it gives
#: way; place of this in the step; and weakening of the slider with speed.
_HELD, _SLIPS, _AFTER, _MOVED, _JUMP, _PART, _WEAKER = range(7)


@compiled
def _move_element(
    D: float, rho: float, vs: float, before: tuple[float, float], trial: float, v0: float, v: float
) -> tuple[float, float, float, float]:
    """Return AFTER, MOVED, JUMP and PART of an element that goes to `trial` if it sticks; before:

    HELD and SLIPS.

    It gives way as in `_give_way`.
    """
    d, least, q = 1.0 if trial > 0.0 else -1.0, D / rho, v / vs
    if abs(trial) <= least:
        return trial, 0.0, 0.0, 1.0
    slips = least + (D - least) * math.exp(-q * q)
    if before[1] == d:
        return (d * slips, d, 0.0, 1.0) if abs(trial) > slips else (trial, 0.0, 0.0, 1.0)
    if abs(trial) <= D:
        return trial, 0.0, 0.0, 1.0
    stretch = d * (trial - before[0])
    part = min(max(0.0, (D - d * before[0]) / stretch), 1.0) if stretch > 0.0 else 1.0
    q = (v0 + part * (v - v0)) / vs
    jump = (D - least) * (1.0 - math.exp(-q * q))
    after = d * trial - jump
    return (
        (d * slips, d, d * jump, part) if slips <= after else (d * after, 2.0 * d, d * jump, part)
    )


@compiled
def follow_load(
    numbers: Array,
    elements: Array,
    step: Array,
    motor: Array,
    h: float,
    memory: Array,
    tangents: Array,
    out: Array,
) -> None:
    """Write the force with which a load reacts on the motion of a motor, from rest; the second of
    two periods counts.

    numbers : (6,) mass, spring, damper, viscous friction, stiction, Stribeck velocity. elements :
    (2, E) stiffness and break-away displacement. step : (2, 4) position and velocity after a step h
    with all elements stuck: factors of position and velocity before
        it, and of the force at its start and end.
    motor : (3, n) position, velocity, and force of spring and damper on a load at rest. memory :
    (7, E) zeros, the rows above. tangents : (P, 3 + E) zeros, P = 6 + 2 E or 0: position, velocity,
    force, and slip of each slider. out : (1 + P, n) force and its derivatives by the logarithms of
    all numbers, then of the elements; by the viscous
        friction itself, and by the logarithm of stiction minus one.
    """
    k, c, rho, vs = numbers[1], numbers[2], numbers[4], numbers[5]
    n, E, P = motor.shape[1], elements.shape[1], tangents.shape[0]
    damping, total, end_x, end_v = c + numbers[3], k, step[0, 3], step[1, 3]
    all_x, all_v = step[0, 2] + end_x, step[1, 2] + end_v
    for i in range(E):
        total += elements[0, i]
    x = v = pushed = 0.0  # pushed: force from the slip of all sliders so far
    for j in range(2 * n):
        now, then = j % n, (j + 1) % n
        if j >= n:
            spring, damper = k * (motor[0, now] - x), c * (motor[1, now] - v)
            out[0, now] = spring + damper
            for p in range(P):
                out[1 + p, now] = -k * tangents[p, 0] - c * tangents[p, 1]
            if P > 0:
                out[2, now] += spring
                out[3, now] += damper
        begin, end = motor[2, now] + pushed, motor[2, then] + pushed
        x1 = step[0, 0] * x + step[0, 1] * v + step[0, 2] * begin + end_x * end
        v1 = step[1, 0] * x + step[1, 1] * v + step[1, 2] * begin + end_v * end
        stuck_x, stuck_v, slipping = x1, v1, 0.0
        for trial in range(2):  # first find the moving sliders, then their slip
            slipping = moved = early = 0.0
            for i in range(E):
                at, before = memory[_HELD, i] + x1 - x, (memory[_HELD, i], memory[_SLIPS, i])
                after = _move_element(elements[1, i], rho, vs, before, at, v, v1)
                memory[_AFTER, i], memory[_MOVED, i], memory[_JUMP, i], memory[_PART, i] = after
                early += elements[0, i] * memory[_JUMP, i] * (0.5 - memory[_PART, i])
                if abs(memory[_MOVED, i]) == 1.0:
                    slipping += elements[0, i]
                    moved += elements[0, i] * (memory[_HELD, i] - x - memory[_AFTER, i])
                elif memory[_MOVED, i] != 0.0:
                    moved += elements[0, i] * (at - memory[_AFTER, i])
            if trial == 1 or (slipping == 0.0 and moved == 0.0):
                break
            force = (slipping * stuck_x + moved) / (1.0 - end_x * slipping)
            # the slip is not linear: it bends with the motion, and jumps within the step
            bend = early - slipping * h * (stuck_v + end_v * force - v) / 12.0
            x1, v1 = stuck_x + end_x * force + all_x * bend, stuck_v + end_v * force + all_v * bend
        pushed = 0.0
        for i in range(E):
            pushed += elements[0, i] * (x1 - memory[_AFTER, i])
        if P > 0:
            rate, q = 0.0, v1 / vs
            near = math.exp(-q * q) * (1.0 - 1.0 / rho)
            for i in range(E):
                d = memory[_MOVED, i]
                memory[_WEAKER, i] = d / max(abs(d), 1.0) * 2.0 * q / vs * near * elements[1, i]
                rate += elements[0, i] * memory[_WEAKER, i]
            left = 1.0 - end_x * slipping
            left -= min(end_v * rate, _MOST_FALL * left)
            for p in range(P):
                force = 0.0
                if p == 0:
                    force = damping * v1 + total * x1 - motor[2, then] - pushed
                elif p == 1:
                    force = k * (motor[0, then] - x1)
                elif p == 2:
                    force = c * (motor[1, then] - v1)
                elif p == 3:
                    force = -v1
                elif 6 <= p < 6 + E:
                    force = -elements[0, p - 6] * memory[_AFTER, p - 6]
                for i in range(E):
                    force += elements[0, i] * tangents[p, 3 + i]
                a, b, was = tangents[p, 0], tangents[p, 1], tangents[p, 2]
                a1 = step[0, 0] * a + step[0, 1] * b + step[0, 2] * was + end_x * force
                b1 = step[1, 0] * a + step[1, 1] * b + step[1, 2] * was + end_v * force
                way = early = 0.0
                for i in range(E):
                    d = memory[_MOVED, i]
                    if d == 0.0:
                        continue
                    wider = 0.0  # increase of the limit of its slider, over its stiffness
                    if p == 4:
                        wider = elements[1, i] * (near - (1.0 - 1.0 / rho)) / rho
                    elif p == 5:
                        wider = elements[1, i] * near * 2.0 * q * q
                    elif p == 6 + E + i:
                        wider = elements[1, i] * (1.0 / rho + near)
                    if abs(d) == 1.0:
                        gone = -d * wider - tangents[p, 3 + i]
                    else:
                        gone = -d / 2.0 * wider
                        if p == 6 + E + i:
                            gone += d / 2.0 * elements[1, i]
                    if memory[_JUMP, i] != 0.0:  # it gives way earlier in the step
                        later = a + memory[_PART, i] * (a1 - a) - tangents[p, 3 + i]
                        if p == 6 + E + i:
                            later -= math.copysign(elements[1, i], d)
                        early += elements[0, i] * memory[_JUMP, i] * later / (x1 - x)
                    way += elements[0, i] * gone
                    tangents[p, 3 + i] += gone
                if slipping != 0.0 or rate != 0.0 or way != 0.0:
                    more = (slipping * a1 + rate * b1 + way) / left
                    bend = early - slipping * h * (b1 + end_v * more - b) / 12.0
                    a1, b1 = a1 + end_x * more + all_x * bend, b1 + end_v * more + all_v * bend
                    force += more
                    for i in range(E):
                        if memory[_MOVED, i] != 0.0:
                            tangents[p, 3 + i] += memory[_WEAKER, i] * b1
                            if abs(memory[_MOVED, i]) == 1.0:
                                tangents[p, 3 + i] += a1
                tangents[p, 0], tangents[p, 1], tangents[p, 2] = a1, b1, force
        x, v = x1, v1
        for i in range(E):
            memory[_HELD, i] = memory[_AFTER, i]
            memory[_SLIPS, i] = memory[_MOVED, i] if abs(memory[_MOVED, i]) == 1.0 else 0.0
