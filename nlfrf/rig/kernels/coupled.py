"""Compiled steps for several coupled masses, each with its own friction law or none.

    M x'' + C x' + K x + cubic springs + friction(x') = force

All axes are integrated together with the states of their laws, by fourth-order Runge-Kutta. The
memories of the laws are constant within a step, and are updated at its end. A step is divided where
a law changes: where the first of all axes stops, breaks away, or reverses its bristles.

This file calls kernels of other files, which the cache of compiled code on disk does not check. So
a cached function that calls `advance_axes` carries a digest of the files, as explained in `loops`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.kernels.compiled import njit
from nlfrf.rig.kernels.data import DIRECTION, ERROR, Axes, Curve, F, Law, Step, V, X, Z
from nlfrf.rig.kernels.leuven import (
    commit_hysteresis,
    error_growth,
    friction_rates,
    hysteresis_on_trial,
)
from nlfrf.rig.kernels.loops import CALLED_FILES, digest_files
from nlfrf.rig.kernels.slip import (
    commit_elements,
    commit_sliders,
    elements_force,
    sliders_force,
    stribeck_force,
)

# mypy: disable-error-code="untyped-decorator"


Array = np.ndarray
# `_nrt=False`: without reference counts, see `leuven`
compiled = njit(nogil=True, error_model="numpy", _nrt=False)  # cached with its caller
inlined = njit(nogil=True, error_model="numpy", forceinline=True, _nrt=False)
#: Matrices of a machine; the last one exists only with cubic springs.
_MASS, _INVERSE_MASS, _STIFFNESS, _DAMPING, _CUBIC = range(5)
#: Rows of the work space, one number per axis. Four rows make a state: position, velocity, two
#: states of the law.
_PLACE, _STAGE, _RATE, _END = 0, 4, 8, 12
#: Force; friction at start and end of a step; turning indicators at both; direction of motion; mark
#: of a turn.
_NET, _FRICTION_BEGIN, _FRICTION_END, _TURN_BEGIN, _TURN_END, _HEADING, _HAS_TURNED = range(16, 23)
N_ROWS = 23
_MAX_PARTS = 12


@inlined
def _unpack_law(laws: Array, i: int) -> Law:
    """Return the law of an axis from its row of numbers."""
    curve = Curve(int(laws[i, 8]), laws[i, 9], laws[i, 10])
    return Law(
        int(laws[i, 0]),
        laws[i, 1],
        laws[i, 2],
        laws[i, 3],
        laws[i, 4],
        laws[i, 5],
        laws[i, 6],
        laws[i, 7],
        curve,
    )


@inlined
def _is_stuck(laws: Array, states: Array, i: int) -> bool:
    """Return whether dry friction holds an axis."""
    return laws[i, 0] == kernel_data.COULOMB and states[i, DIRECTION] == 0.0


@njit(nogil=True, error_model="numpy")
def invert_free_mass(machine: Array, laws: Array, states: Array) -> None:
    """Invert the mass matrix over the axes that are not stuck, zero elsewhere (Gauss and
    Jordan).
    """
    n = machine.shape[1]
    A = machine[_MASS].copy()
    for i in range(n):
        for j in range(n):
            machine[_INVERSE_MASS, i, j] = 1.0 if i == j and not _is_stuck(laws, states, i) else 0.0
    for i in range(n):
        if _is_stuck(laws, states, i):
            continue
        pivot = 1.0 / A[i, i]
        for k in range(n):
            A[i, k] *= pivot
            machine[_INVERSE_MASS, i, k] *= pivot
        for j in range(n):
            if j == i or _is_stuck(laws, states, j):
                continue
            factor = A[j, i]
            for k in range(n):
                A[j, k] -= factor * A[i, k]
                machine[_INVERSE_MASS, j, k] -= factor * machine[_INVERSE_MASS, i, k]


@compiled
def _memory_friction(
    law: Law,
    grid: Array,
    state: Array,
    stack: Array,
    d: float,
    move: float,
    x: float,
    v: float,
    p: float,
    q: float,
) -> tuple[float, float, float]:
    """Return the friction of a law with a memory on a trial step, and the rates of its two states p
    and q.

    p is z of the bristles; for generalised Maxwell slip p and q are the factor on, and the addition
    to, the force of slipping elements since the start of the step.
    """
    if law.form == kernel_data.GMS:
        rate = law.n / stribeck_force(law, v)
        return elements_force(law, grid, stack, d, move, v, p, q), -rate * p, law.n - rate * q
    if law.form == kernel_data.SLIDERS:
        return sliders_force(law, grid, stack, move, x, v), 0.0, 0.0
    dz, force = friction_rates(law, v, hysteresis_on_trial(law.curve, grid, state, stack, p))
    return force, dz, 0.0


@inlined
def _spring_force(machine: Array, work: Array, at: int, i: int) -> float:
    """Return the force of springs and dampers on axis i in the state at row `at` of the work
    space.
    """
    force = 0.0
    for j in range(machine.shape[1]):
        force -= machine[_STIFFNESS, i, j] * work[at, j] + machine[_DAMPING, i, j] * work[at + 1, j]
    if machine.shape[0] > _CUBIC:
        for j in range(machine.shape[1]):
            stretch = work[at, i] if j == i else work[at, i] - work[at, j]
            force -= machine[_CUBIC, i, j] * stretch * stretch * stretch
    return force


@inlined
def _axis_rates(
    axes: Axes,
    drive: Array,
    step: int,
    s: float,
    at: int,
    friction_row: int,
    turn_row: int,
) -> None:
    """Write the rates of the state at row `at` into RATE; friction and turning indicators go to the
    given rows.

    The drive is the parabola through start, middle and end of the step; s is the place in the step,
    0 to 1.
    """
    machine, laws, grids, states, stacks, work = axes
    n = machine.shape[1]
    for i in range(n):
        u1, u2, u3 = drive[step, 0, i], drive[step, 1, i], drive[step, 2, i]
        net = (
            u1
            + s * ((4.0 * u2 - 3.0 * u1 - u3) + s * 2.0 * (u1 - 2.0 * u2 + u3))
            + _spring_force(machine, work, at, i)
        )
        x, v, p, q = work[at, i], work[at + 1, i], work[at + 2, i], work[at + 3, i]
        force, dp, dq, form = 0.0, 0.0, 0.0, int(laws[i, 0])
        if form == kernel_data.COULOMB:
            d = states[
                i, DIRECTION
            ]  # the force of a stuck mass follows from the accelerations of the others
            law = _unpack_law(laws, i)
            force = d * stribeck_force(law, v) + law.sigma2 * v if d != 0.0 else 0.0
        elif form >= 0:
            law = _unpack_law(laws, i)
            if law.curve.kind == kernel_data.SPRING:  # no memory
                dp, force = friction_rates(law, v, law.curve.K0 * p)
            else:
                d, move = work[_HEADING, i], x - work[_PLACE, i]
                force, dp, dq = _memory_friction(
                    law, grids[i], states[i], stacks[i], d, move, x, v, p, q
                )
        work[_NET, i], work[friction_row, i] = net - force, force
        work[turn_row, i] = v if form == kernel_data.COULOMB or form == kernel_data.GMS else dp
        work[_RATE, i], work[_RATE + 2, i], work[_RATE + 3, i] = v, dp, dq
    for i in range(n):
        a = 0.0
        for j in range(n):
            a += machine[_INVERSE_MASS, i, j] * work[_NET, j]
        work[_RATE + 1, i] = a
    for i in range(n):
        if _is_stuck(laws, states, i):
            force = work[_NET, i]
            for j in range(n):
                force -= machine[_MASS, i, j] * work[_RATE + 1, j]
            work[friction_row, i], work[turn_row, i] = force, laws[i, 1] - abs(force)


@compiled
def _trial_step(
    axes: Axes,
    drive: Array,
    step: int,
    h: float,
    a: float,
    b: float,
) -> None:
    """Try the part a..b of a step with the committed memories, from PLACE to END."""
    machine, work = axes.machine, axes.work
    n, span = machine.shape[1], (b - a) * h
    for stage in range(4):
        s = a if stage == 0 else (b if stage == 3 else 0.5 * (a + b))
        at, held, turn = (
            (_PLACE, _FRICTION_BEGIN, _TURN_BEGIN)
            if stage == 0
            else (_STAGE, _FRICTION_END, _TURN_END)
        )
        _axis_rates(axes, drive, step, s, at, held, turn)
        share = span / 6.0 if stage == 0 or stage == 3 else span / 3.0
        reach = span if stage == 2 else 0.5 * span
        for row in range(4):
            for i in range(n):
                begin, rate = work[_PLACE + row, i], work[_RATE + row, i]
                work[_END + row, i] = (begin if stage == 0 else work[_END + row, i]) + share * rate
                work[_STAGE + row, i] = begin + reach * rate


@inlined
def _law_turns(laws: Array, states: Array, work: Array, i: int) -> bool:
    """Return whether the law of an axis turns in the step tried: its mass stops or breaks away, its
    bristles turn.
    """
    if laws[i, 0] == kernel_data.COULOMB:
        if states[i, DIRECTION] != 0.0:
            return work[_PLACE + 1, i] * work[_END + 1, i] < 0.0
        return work[_TURN_BEGIN, i] > 0.0 > work[_TURN_END, i]
    return work[_HAS_TURNED, i] == 0.0 and work[_TURN_BEGIN, i] * work[_TURN_END, i] < 0.0


@inlined
def _turn_indicator(
    laws: Array, states: Array, work: Array, i: int, by_velocity: bool, row: int
) -> float:
    """Return the indicator that passes zero where the law of an axis turns, at start or end of the
    trial step.
    """
    if by_velocity:
        return work[_PLACE + 1, i] if row == _TURN_BEGIN else work[_END + 1, i]
    return work[row, i]


@compiled
def _locate_turn(
    axes: Axes,
    drive: Array,
    step: int,
    h: float,
    a: float,
    b: float,
    i: int,
) -> float:
    """Find the place between a and b of a step where the law of an axis turns; the last trial ends
    there.
    """
    laws, states, work = axes.laws, axes.states, axes.work
    by_velocity = work[_PLACE + 1, i] * work[_END + 1, i] < 0.0 and not _is_stuck(laws, states, i)
    e0 = _turn_indicator(laws, states, work, i, by_velocity, _TURN_BEGIN)
    e1 = _turn_indicator(laws, states, work, i, by_velocity, _TURN_END)
    low, high, enough = a, b, 1e-12 * max(abs(e0), abs(e1))
    for _ in range(12):
        b = low + (high - low) * e0 / (e0 - e1)
        _trial_step(axes, drive, step, h, a, b)
        e = _turn_indicator(laws, states, work, i, by_velocity, _TURN_END)
        if abs(e) <= enough:
            break
        if e * e0 > 0.0:
            low, e0, e1 = b, e, 0.5 * e1
        else:
            high, e1, e0 = b, e, 0.5 * e0
    return b


@inlined
def _begin_part(
    axes: Axes,
    drive: Array,
    step: int,
    s: float,
) -> None:
    """Set the states of the laws at the start of a step or part; dry friction beyond its limit
    breaks away.
    """
    machine, laws, states, work = axes.machine, axes.laws, axes.states, axes.work
    n, dry = machine.shape[1], False
    for i in range(n):
        v = work[_PLACE + 1, i]
        form = laws[i, 0]
        work[_PLACE + 2, i], work[_PLACE + 3, i] = states[i, Z], 0.0
        if form == kernel_data.GMS:
            work[_PLACE + 2, i] = 1.0
            if work[_HAS_TURNED, i] == 0.0:
                work[_HEADING, i] = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
        if form == kernel_data.COULOMB:
            dry = True
            if states[i, DIRECTION] * v < 0.0:  # it started and stopped within the last step
                work[_PLACE + 1, i], states[i, DIRECTION] = 0.0, 0.0
                invert_free_mass(machine, laws, states)
    if not dry:
        return
    for _ in range(n):  # one after the other: each release changes the forces of the others
        _axis_rates(axes, drive, step, s, _PLACE, _FRICTION_BEGIN, _TURN_BEGIN)
        worst, most = -1, 0.0
        for i in range(n):
            excess = abs(work[_FRICTION_BEGIN, i]) - laws[i, 1] * (1.0 + 1e-9)
            if _is_stuck(laws, states, i) and excess > most:
                worst, most = i, excess
        if worst < 0:
            return
        states[worst, DIRECTION] = 1.0 if work[_FRICTION_BEGIN, worst] > 0.0 else -1.0
        invert_free_mass(machine, laws, states)


@inlined
def _commit_part(axes: Axes, span: float) -> bool:
    """Commit all memories at END; return whether the part was stable."""
    machine, laws, grids, states, stacks, work = axes
    stable = True
    for i in range(machine.shape[1]):
        form = int(laws[i, 0])
        x0, v0, x1, v1 = work[_PLACE, i], work[_PLACE + 1, i], work[_END, i], work[_END + 1, i]
        stable = stable and abs(x1) < 1e150 and abs(v1) < 1e150
        work[_PLACE, i], work[_PLACE + 1, i] = x1, v1
        if form < 0 or form == kernel_data.COULOMB:
            continue
        law = _unpack_law(laws, i)
        if form == kernel_data.GMS:
            d = work[_HEADING, i]
            if d == 0.0:
                d = 1.0 if v1 > 0.0 else -1.0
            keep, gain = work[_END + 2, i], work[_END + 3, i]
            commit_elements(
                law, grids[i], stacks[i], d, Step(x0, v0, (0.0, 0.0, 0.0), span), x1, v1, keep, gain
            )
        elif form == kernel_data.SLIDERS:
            commit_sliders(law, grids[i], stacks[i], x1 - x0, x1, v0, v1, span)
        else:
            slope = commit_hysteresis(law.curve, grids[i], states[i], stacks[i], work[_END + 2, i])
            states[i, ERROR] = max(states[i, ERROR], 1.0) * error_growth(
                law, v1, states[i, F], slope, span
            )
            stable = stable and states[i, ERROR] <= kernel_data.MAX_ERROR_GROWTH
    return stable


@compiled
def _turn_law(
    machine: Array, laws: Array, states: Array, stacks: Array, work: Array, i: int
) -> None:
    """Turn the law of an axis: elements stick, dry friction stops or breaks away."""
    work[_HAS_TURNED, i] = 1.0  # once per step
    if laws[i, 0] == kernel_data.GMS:
        stacks[i, 1, :] = 0.0  # all elements stick
        work[_HEADING, i] = -work[_HEADING, i]
    if laws[i, 0] == kernel_data.COULOMB:
        if states[i, DIRECTION] == 0.0:
            states[i, DIRECTION] = 1.0 if work[_FRICTION_END, i] > 0.0 else -1.0
        else:
            work[_PLACE + 1, i], states[i, DIRECTION] = 0.0, 0.0
        invert_free_mass(machine, laws, states)


@compiled
def advance_axes(
    machine: Array,
    laws: Array,
    grids: Array,
    states: Array,
    stacks: Array,
    work: Array,
    drive: Array,
    h: float,
    out: Array,
) -> bool:
    """Advance all axes over the steps of `drive` (n, 3, axes): start, middle, end of each; False if
    not stable.

    `out` (rows, 4, axes) gets position, velocity, z and friction force at the start of every (n /
    rows)th step. `machine` is overwritten in its inverse mass.
    """
    axes = Axes(machine, laws, grids, states, stacks, work)
    n, substeps = machine.shape[1], drive.shape[0] // out.shape[0]
    for i in range(n):
        work[_PLACE, i], work[_PLACE + 1, i] = states[i, X], states[i, V]
    for step in range(drive.shape[0]):
        a, parts = 0.0, 0
        for i in range(n):
            work[_HAS_TURNED, i] = 0.0
        while a < 1.0:
            _begin_part(axes, drive, step, a)
            b, which = 1.0, -1
            _trial_step(axes, drive, step, h, a, b)
            if parts == 0 and step % substeps == 0:
                for i in range(n):
                    row = step // substeps
                    out[row, 0, i], out[row, 1, i] = work[_PLACE, i], work[_PLACE + 1, i]
                    out[row, 2, i], out[row, 3, i] = states[i, Z], work[_FRICTION_BEGIN, i]
            for i in range(n):
                if parts < _MAX_PARTS and _law_turns(laws, states, work, i):
                    b, which = _locate_turn(axes, drive, step, h, a, b, i), i
            if not _commit_part(axes, (b - a) * h):
                return False
            if which >= 0:
                _turn_law(machine, laws, states, stacks, work, which)
            a, parts = b, parts + 1
    for i in range(n):
        states[i, X], states[i, V] = work[_PLACE, i], work[_PLACE + 1, i]
    return True


cached = njit(cache=True, nogil=True, error_model="numpy")


def _build_run_kernel(stamp: str) -> Callable[..., bool]:
    """Return the kernel that steps through given forces, cached under the digest of the files that
    it calls.
    """

    @cached
    def run(
        machine: Array,
        laws: Array,
        grids: Array,
        states: Array,
        stacks: Array,
        drive: Array,
        h: float,
        out: Array,
    ) -> bool:
        work = np.zeros((N_ROWS, machine.shape[1]))
        if len(stamp) == 0:
            return False
        invert_free_mass(machine, laws, states)
        return advance_axes(machine, laws, grids, states, stacks, work, drive, h, out)

    return run


@njit(nogil=True, error_model="numpy")
def _multiply_matrix(M: Array, x: Array, out: Array) -> None:
    """Write M x into `out`."""
    for row in range(M.shape[0]):
        total = 0.0
        for column in range(M.shape[1]):
            total += M[row, column] * x[column]
        out[row] = total


@njit(nogil=True, error_model="numpy")
def _step_controller(
    A: Array, B: Array, C: Array, D: Array, x: Array, new: Array, e: Array, u: Array
) -> None:
    """Write the output u of the controller for the error e, and step its state x by one sample;
    `new` is work space.
    """
    for row in range(u.size):
        total = 0.0
        for i in range(e.size):
            total += D[row, i] * e[i]
        for i in range(x.size):
            total += C[row, i] * x[i]
        u[row] = total
    for row in range(x.size):
        total = 0.0
        for i in range(e.size):
            total += B[row, i] * e[i]
        for i in range(x.size):
            total += A[row, i] * x[i]
        new[row] = total
    x[:] = new


def _build_loop_kernel(stamp: str) -> Callable[..., int]:
    """Return the kernel of the sampled loop, cached under the digest of the files that it calls."""

    @cached
    def loop(
        machine: Array,
        laws: Array,
        grids: Array,
        states: Array,
        stacks: Array,
        sensors: Array,
        actuators: Array,
        A: Array,
        B: Array,
        C: Array,
        D: Array,
        r: Array,
        disturbance: Array,
        noise: Array,
        fs: float,
        saturation: Array,
        resolution: Array,
        delay: float,
        steps: int,
        rows: Array,
        y: Array,
        u: Array,
    ) -> int:
        """Return the number of samples until the end, or until the loop diverged.

        r, noise, y (n, n_y); disturbance, u (n, n_u); rows (n, 4, axes): position, velocity, z,
        friction. delay in samples; steps : least number of integration steps in a sample.
        """
        n, axes, samples = sensors.shape[0], sensors.shape[1], r.shape[0]
        if len(stamp) == 0:
            return 0
        work, x, new = np.zeros((N_ROWS, axes)), np.zeros(A.shape[0]), np.zeros(A.shape[0])
        invert_free_mass(machine, laws, states)
        drive = np.empty((steps + 1, 3, axes))
        out = np.empty((1, 4, axes))
        force = np.empty(actuators.shape[1])
        e, whole = np.empty(n), int(delay)
        part = delay - whole
        for k in range(samples):
            _multiply_matrix(sensors, states[:, X], e)  # e is the position, then the error
            for i in range(n):
                y[k, i] = e[i] + noise[k, i]
                if resolution[i] > 0.0:
                    y[k, i] = resolution[i] * np.round(y[k, i] / resolution[i])
                e[i] = r[k, i] - y[k, i]
            _step_controller(A, B, C, D, x, new, e, u[k])
            for i in range(force.size):
                u[k, i] = min(max(u[k, i], -saturation[i]), saturation[i])
            # a delay that is no whole number cuts the sample in two: first the earlier command acts,
            # then the later one
            for piece in range(2):
                span = part if piece == 0 else 1.0 - part
                if span <= 0.0:
                    continue
                sample = k - whole - 1 + piece
                for i in range(force.size):
                    force[i] = disturbance[k, i] + (u[sample, i] if sample >= 0 else 0.0)
                count = int(np.ceil(span * steps))
                for i in range(axes):
                    total = 0.0
                    for column in range(force.size):
                        total += actuators[i, column] * force[column]
                    drive[:count, :, i] = total  # start, middle and end of each step: held
                h = span / (count * fs)
                if not advance_axes(
                    machine, laws, grids, states, stacks, work, drive[:count], h, out
                ):
                    return k
                if piece == 0 or part == 0.0:  # the piece that begins at the sampling instant
                    rows[k] = out[0]
        return samples

    return loop


_STAMP = digest_files(*CALLED_FILES)
run_axes: Callable[..., bool] = _build_run_kernel(_STAMP)
run_axes_loop: Callable[..., int] = _build_loop_kernel(_STAMP)
