"""Pictures of models, loops and results; they convert units and compute nothing else.

    models   pictures of models: nominal, set, weight, radius, fit, order scan
    loops    pictures of loops: gains, check, Nyquist with discs, family, step
    shaping  |L| between its bounds
    friction pictures of friction, and of its effect on a loop
    learning factor of a learning filter over frequency, error over trials
    scheduling  gain of a scheduled controller at its operating points
    tuning   limits of a tuned design over frequency, before and after
    style    colours, units, and the measured band in white

Import them from here: `from robust.plot import plot_check`.
"""

from robust.plot.friction import RestCase, plot_friction_fit, plot_friction_force, plot_rest
from robust.plot.learning import plot_contraction, plot_trials
from robust.plot.loops import (
    plot_check,
    plot_family,
    plot_loop,
    plot_nyquist,
    plot_step,
)
from robust.plot.models import (
    plot_budget,
    plot_fit,
    plot_orders,
    plot_set,
    plot_weight,
)
from robust.plot.scheduling import plot_schedule
from robust.plot.shaping import plot_loop_bounds
from robust.plot.tuning import plot_limits

__all__ = [
    "RestCase",
    "plot_budget",
    "plot_check",
    "plot_contraction",
    "plot_family",
    "plot_fit",
    "plot_friction_fit",
    "plot_friction_force",
    "plot_limits",
    "plot_loop",
    "plot_loop_bounds",
    "plot_nyquist",
    "plot_orders",
    "plot_rest",
    "plot_schedule",
    "plot_set",
    "plot_step",
    "plot_trials",
    "plot_weight",
]
