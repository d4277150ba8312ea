"""Loops in cascade (position over velocity) as one controller, so that they are checked, and fail, as one.

r -->(+)--[K_outer]-->(+)--[K_inner]-- u -->[ G ]---+--> y        K = K_inner (inner + K_outer outer)
     -^               -^                            |
      |                +---------[inner]------------+
      +--------------------------[outer]------------+
"""

from __future__ import annotations

import control

from robust._base.types import Controller, Weight
from robust.lti.connections import in_parallel, in_series
from robust.lti.realisation import state_space
from robust.lti.wiring import shared_timebase


def nested_loops(
    K_outer: Controller, K_inner: Controller, *, outer: Weight = 1.0, inner: Weight = 1.0
) -> control.StateSpace:
    """Put an outer and an inner controller together into the one that their plant sees: for `check` and all the rest.

    A margin of each loop by itself says little: the inner one is closed through the outer one too. What is broken in
    the check of the equivalent controller is the actuator, through which both run.

    Parameters
    ----------
    K_outer, K_inner : control.StateSpace, TransferFunction or float
        u = K_inner (K_outer (r - outer y) - inner y).
    outer, inner : control.StateSpace, TransferFunction or float
        What makes the signal of each loop of the plant output y. For a plant from force to velocity outer = 1/s; for
        one to position, under a clock, inner = (z - 1)/(z dt), the difference that is taken for a velocity.

    Returns
    -------
    control.StateSpace
        K = K_inner (inner + K_outer outer), all states kept: u = -K y.

    Raises
    ------
    ValueError
        Sampling times that differ, parts with several inputs or outputs.

    References
    ----------
    SP 10.5 (cascade control).

    Examples
    --------
    Position over velocity for a mass, 1/s from force to velocity: s^2 + 4 s + 4 = 0.

    >>> K = nested_loops(1.0, 4.0, outer=control.tf([1], [1, 0]))
    >>> control.feedback(control.tf([1], [1, 0]), control.ss2tf(K)).poles().real.round(6).tolist()
    [-2.0, -2.0]
    """
    parts = {"K_outer": K_outer, "K_inner": K_inner, "outer": outer, "inner": inner}
    systems = [state_space(name, part) for name, part in parts.items()]
    dt = shared_timebase(systems)
    K_outer, K_inner, outer, inner = (control.StateSpace(s.A, s.B, s.C, s.D, dt) for s in systems)
    return in_series(in_parallel(inner, in_series(outer, K_outer, dt=dt)), K_inner, dt=dt)
