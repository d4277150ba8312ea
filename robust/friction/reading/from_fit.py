"""Machine and friction of a fit, one mass or motor and load, with the ends of the intervals that a proof assumes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robust.friction.plant import FrictionPlant, friction_plant, two_mass_plant
from robust.friction.reading.assumed_class import MachineRead
from robust.friction.reading.balance import HALF_WIDTH
from robust.friction.reading.identification import FrictionFit
from robust.friction.units import format_length, mechanical_units, position_unit_of

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


def read_fit(fit: FrictionFit) -> MachineRead:
    """Return what was identified, with the ends of the intervals; refuse a fit that leaves machine or K0 open."""
    if fit.reason:
        raise ValueError(f"fit must leave neither machine nor K0 open, got: {fit.reason}")
    two, low = bool(fit.load_mass), max(0.0, fit.interval("stiffness")[0])
    position_unit, half_delay = position_unit_of(fit.units[1]), HALF_WIDTH * fit.stds["delay"]
    if two:
        machine = machines_with_load(fit)[0]
        K0, forces = (np.array([interval_at_port(fit, name, port)[1] for port in PORTS]) for name in ("K0", "Fs"))
        least = np.array([interval_at_port(fit, "coulomb", port)[0] for port in PORTS])
        ratio = np.where((least > 0) & np.isfinite(forces), forces / np.where(least > 0, least, 1.0), np.nan)
        described = machine.description
    else:
        plant = friction_plant(fit.mass, low, position_unit=position_unit)
        machine = replace(plant, delay=max(0.0, fit.delay))
        K0 = np.array([fit.interval("K0")[1]])
        ratio = np.array([fit.interval("stiction")[1] if np.isfinite(fit.stds["stiction"]) else np.nan])
        half_mass = HALF_WIDTH * fit.stds["mass"]
        described = f"m = {fit.mass:.4g} +- {half_mass:.1g} {plant.units.mass}; {describe_spring(fit)}"
    seen = f"slips below {format_length(fit.seen_from, fit.units[1])}"
    if fit.stds["stiffness"]:
        seen += f" and none sticks at {format_length(fit.seen_to, fit.units[1])}"
    highest, lowest = fit.levels[0], fit.levels[-1]
    return MachineRead(
        machines=(machine,),
        mass=fit.mass,
        mass_std=fit.stds["mass"],
        stiffness=fit.stiffness,
        stiffness_low=low,
        stiffness_std=fit.stds["stiffness"],
        K0=K0,
        stiction=ratio,
        source=(
            f"identified from {len(fit.levels)} records of {lowest.force:.3g} to {highest.force:.3g} {fit.units[0]} "
            "rms, by the balance of forces along the measured motion, in intervals of 95 % each"
        ),
        description=(
            f"{described}; {1e3 * machine.delay:.3g} +- {1e3 * half_delay:.1g} ms of delay (its lag taken for delay); "
            "c = 0"
        ),
        K0_note=f"the upper end, and what k was lowered by, given that no element {seen}",
        stiction_note=f", of which {fit.stiction:.3g} +- {HALF_WIDTH * fit.stds['stiction']:.1g} were read",
        misfit=f"at most {100 * max(level.unexplained for level in fit.levels):.2g} % of the force unexplained",
    )


def describe_spring(fit: FrictionFit) -> str:
    """Describe the spring to ground that is assumed, the lower end of what was read."""
    units, low = mechanical_units(position_unit_of(fit.units[1])), fit.interval("stiffness")[0]
    if not fit.stds["stiffness"]:
        return "no spring, as was assumed"
    if low < 0:
        return f"k = 0 (+- {HALF_WIDTH * fit.stds['stiffness'] / 1e3:.2g} {units.stiffness} were read)"
    return f"k = {low / 1e3:.4g} {units.stiffness} (lower end)"
