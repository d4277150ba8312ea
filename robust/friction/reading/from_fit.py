"""Machine and friction class from a `FrictionFit`, at the ends of its intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robust.friction.plant import FrictionPlant, friction_plant, two_mass_plant
from robust.friction.reading.assumed_class import MachineRead
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.reading.in_motion import SlidingFit
from robust.friction.reading.numbers import HALF_WIDTH
from robust.friction.units import format_length, mechanical_units, position_unit_of

_PORTS = ("motor", "load")


def interval_at_port(fit: FrictionFit, name: str, port: str) -> tuple[float, float]:
    """Return the 95 % interval of mass, K0, Fs or Coulomb friction at the motor or the load.

    For the motor it is the difference of two numbers; their deviations are added.
    """
    if port == "load":
        return fit.interval(f"load_{name}")
    number = getattr(fit, name) - getattr(fit, f"load_{name}")
    half = HALF_WIDTH * (fit.stds[name] + fit.stds[f"load_{name}"])
    return number - half, number + half


def plant_of_fit(
    fit: SlidingFit | FrictionFit,
    *,
    spring: float = 0.0,
    load_share: float = 0.5,
    encoder: str = "motor",
) -> FrictionPlant:
    """Return the machine of a fit without its friction but with its delay, for one mass or for
    motor and load.

    spring : stiffness to ground [N/m]. load_share : share of the viscous friction at the load.
    encoder : "motor" or "load".
    """
    unit, damping = position_unit_of(fit.units[1]), max(0.0, fit.damping)
    if fit.load_mass:
        plant = two_mass_plant(
            fit.mass - fit.load_mass,
            fit.load_mass,
            fit.coupling,
            max(0.0, fit.coupling_damping),
            motor_damping=(1 - load_share) * damping,
            load_damping=load_share * damping,
            spring=spring,
            encoder=encoder,
            position_unit=unit,
        )
    else:
        plant = friction_plant(fit.mass, spring, damping, position_unit=unit)
    return replace(plant, delay=max(0.0, fit.delay))


def largest_damping(fit: FrictionFit) -> float:
    """Return the upper end of the viscous friction [Ns/m]; zero if the levels leave it open."""
    if np.isfinite(fit.stds["damping"]):
        return max(0.0, fit.interval("damping")[1])
    return 0.0


def machines_of_fit(fit: FrictionFit) -> list[FrictionPlant]:
    """Return the machine without viscous friction, and machines with numbers at the ends of their
    intervals.

    The first is the estimate, with the lower ends of the spring to ground and of the damper of the
    coupling. For one mass the others combine both ends of mass and of viscous friction. For motor,
    load and coupling each other machine has one of them at an end. The last two have the upper end
    of the total viscous friction, all at the motor and all at the load.
    """
    viscous, spring = largest_damping(fit), max(0.0, fit.interval("stiffness")[0])
    read = replace(fit, damping=0.0)
    if not fit.load_mass:
        dampings = sorted({0.0, viscous})
        masses = [mass for mass in fit.interval("mass") if 0 < mass < np.inf]
        ends = [replace(fit, mass=mass, damping=damping) for mass in masses for damping in dampings]
        return [plant_of_fit(one, spring=spring) for one in (read, *ends)]
    read = replace(read, coupling_damping=fit.interval("coupling_damping")[0])
    motors, loads = (interval_at_port(fit, "mass", port) for port in _PORTS)
    ends = [replace(read, mass=fit.load_mass + end) for end in motors if end > 0]
    ends += [
        replace(read, mass=fit.mass - fit.load_mass + end, load_mass=end)
        for end in loads
        if end > 0
    ]
    ends += [replace(read, coupling=end) for end in fit.interval("coupling") if end > 0]
    damped = [(replace(read, damping=viscous), share) for share in (0.0, 1.0) if viscous]
    cases = [*((one, 0.5) for one in (read, *ends)), *damped]
    return [plant_of_fit(one, spring=spring, load_share=share) for one, share in cases]


def read_fit(fit: FrictionFit) -> MachineRead:
    """Return an identified fit at the ends of its intervals; raise if it leaves K0 open."""
    if fit.reason:
        raise ValueError(f"fit must determine machine and K0, got an open question: {fit.reason}")
    low = max(0.0, fit.interval("stiffness")[0])
    half_delay = HALF_WIDTH * fit.stds["delay"]
    machine = machines_of_fit(fit)[0]
    if fit.load_mass:
        K0, forces = (
            np.array([interval_at_port(fit, name, port)[1] for port in _PORTS])
            for name in ("K0", "Fs")
        )
        least = np.array([interval_at_port(fit, "coulomb", port)[0] for port in _PORTS])
        ratio = np.where(
            (least > 0) & np.isfinite(forces), forces / np.where(least > 0, least, 1.0), np.nan
        )
        described = machine.description
    else:
        K0 = np.array([fit.interval("K0")[1]])
        ratio = np.array(
            [fit.interval("stiction")[1] if np.isfinite(fit.stds["stiction"]) else np.nan]
        )
        half_mass = HALF_WIDTH * fit.stds["mass"]
        described = (
            f"m = {fit.mass:.4g} +- {half_mass:.1g} {machine.units.mass}; {_describe_spring(fit)}"
        )
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
            f"identified from {len(fit.levels)} records of {lowest.force:.3g} to"
            f" {highest.force:.3g} {fit.units[0]} rms, by the balance of forces along the measured"
            " motion, in intervals of 95 % each"
        ),
        description=(
            f"{described}; {1e3 * machine.delay:.3g} +- {1e3 * half_delay:.1g} ms of delay (its lag"
            " taken for delay); c = 0"
        ),
        K0_note=f"the upper end, plus the reduction of k, given that no element {seen}",
        stiction_note=(
            f", from an estimate of {fit.stiction:.3g} +- {HALF_WIDTH * fit.stds['stiction']:.1g}"
        ),
        misfit=(
            f"at most {100 * max(level.unexplained for level in fit.levels):.2g} % of the force"
            " unexplained"
        ),
    )


def _describe_spring(fit: FrictionFit) -> str:
    """Describe the assumed spring to ground, the lower end of the estimate."""
    units, low = mechanical_units(position_unit_of(fit.units[1])), fit.interval("stiffness")[0]
    if not fit.stds["stiffness"]:
        return "no spring (assumed)"
    if low < 0:
        return (
            f"k = 0 (its estimate is within +- {HALF_WIDTH * fit.stds['stiffness'] / 1e3:.2g}"
            f" {units.stiffness})"
        )
    return f"k = {low / 1e3:.4g} {units.stiffness} (lower end)"
