"""Machine and class of a motor and a load with friction on both, from what was identified of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from robust.friction.classes import FrictionAtPorts, any_maxwell_slip
from robust.friction.plant import FrictionPlant, two_mass_plant
from robust.friction.reading.balance import HALF_WIDTH
from robust.friction.reading.levels import ASSUMPTION_NOTE
from robust.friction.units import format_length, format_plain, position_unit_of

FrictionFit: TypeAlias = Any  # of robust.friction.reading.identification, which takes the class from here
PORTS = ("motor", "load")


def interval_at_port(fit: FrictionFit, name: str, port: str) -> tuple[float, float]:
    """Return the 95 % interval of mass, K0, Fs or Coulomb friction at the motor or the load.

    Of the motor it is the difference of two numbers, whose deviations are added.
    """
    if port == "load":
        return fit.interval(f"load_{name}")
    number = getattr(fit, name) - getattr(fit, f"load_{name}")
    half = HALF_WIDTH * (fit.stds[name] + fit.stds[f"load_{name}"])
    return number - half, number + half


def machines_with_load(fit: FrictionFit) -> list[FrictionPlant]:
    """Return the machine without viscous friction, and with one number each at an end of its interval.

    The first has motor, load and coupling as they were read. The viscous friction of the last two, the upper end of
    that of both together, is all at the motor and all at the load.
    """
    masses = {port: np.array(interval_at_port(fit, "mass", port)) for port in PORTS}
    damper = max(0.0, fit.interval("coupling_damping")[0])
    spring = max(0.0, fit.interval("stiffness")[0])

    def machine(
        *,
        motor: float | None = None,
        load: float | None = None,
        stiffness: float = fit.coupling,
        motor_damping: float = 0.0,
        load_damping: float = 0.0,
    ) -> FrictionPlant:
        plant = two_mass_plant(
            float(masses["motor"].mean()) if motor is None else motor,
            float(masses["load"].mean()) if load is None else load,
            stiffness,
            damper,
            motor_damping=motor_damping,
            load_damping=load_damping,
            spring=spring,
            position_unit=position_unit_of(fit.units[1]),
        )
        return replace(plant, delay=max(0.0, fit.delay))

    ends = [machine(motor=float(end)) for end in masses["motor"] if end > 0]
    ends += [machine(load=float(end)) for end in masses["load"] if end > 0]
    ends += [machine(stiffness=end) for end in fit.interval("coupling") if end > 0]
    if np.isfinite(fit.stds["damping"]) and (viscous := fit.interval("damping")[1]) > 0:
        ends += [machine(motor_damping=viscous), machine(load_damping=viscous)]
    return [machine(), *ends]


def read_two_masses(
    fit: FrictionFit, low: float, *, stiction: float, margin: float
) -> tuple[FrictionPlant, FrictionAtPorts, str]:
    """Return motor and load, a class of friction at either, and what was identified, is assumed, and is not shown.

    low : spring from the motor to ground [N/m]. stiction : largest over smallest force of a slider; the upper end of
    what was identified at a port where that is more. margin : times the upper end of K0 of each port.
    """
    machine, *_ = machines_with_load(fit)
    classes = []
    for port in PORTS:
        largest, least = interval_at_port(fit, "Fs", port)[1], interval_at_port(fit, "coulomb", port)[0]
        ratio = max(stiction, largest / least) if least > 0 and np.isfinite(largest) else stiction
        K0 = margin * interval_at_port(fit, "K0", port)[1] + (fit.stiffness - low if port == "motor" else 0.0)
        classes.append(any_maxwell_slip(K0, ratio, position_unit=machine.position_unit))
    friction = FrictionAtPorts(ports=tuple(classes), names=machine.port_names)
    highest, lowest = fit.levels[0], fit.levels[-1]
    ratios = " and ".join(f"{one.stiction:.3g}" for one in friction.ports)
    stiffest = " and ".join(format_plain(one.K0 / 1e3) for one in friction.ports)
    evidence = (
        f"Assumed, identified from {len(fit.levels)} records of {lowest.force:.3g} to {highest.force:.3g} "
        f"{fit.units[0]} rms, by the balance of forces along the measured motion: {machine.description}, "
        f"{1e3 * machine.delay:.3g} ms of delay (its lag taken for delay); c = 0; K0 at motor and load "
        f"{stiffest} {friction.units.stiffness}, {margin:g} times "
        f"the upper ends, given that no element slips below {format_length(fit.seen_from, fit.units[1])}; stiction "
        f"{ratios}; at most {100 * max(level.unexplained for level in fit.levels):.2g} % of the force unexplained. "
        f"{ASSUMPTION_NOTE}"
    )
    return machine, friction, evidence
