"""``FrictionClass``: machine and friction assumed for a proof, made of numbers that were read with their intervals."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_real, short_form
from nlfrf._base.values import value
from robust.friction.classes import AnyFriction, FrictionAtPorts, any_maxwell_slip
from robust.friction.plant import FrictionPlant, require_one_port
from robust.friction.units import format_plain

ASSUMPTION_NOTE = (
    "The levels support this class, they do not prove it: friction that creeps below break-away looks the same, what "
    "sticks even at the highest level is read as a spring of the machine, what slips even at the lowest is not seen."
)


@value
class FrictionClass:
    """A linear part and a class of friction, read from measured levels: an assumption, with what it was read from.

    Of an axis that turns, N is Nm and m is rad; `machine` and `friction` know their unit.

    Fields
    ------
    machines : tuple of FrictionPlant
        Mass, and the least stiffness that the levels allow, with each damping that is to be proved: without any, and
        around a nominal with that of its fit. A stiffer machine is in the class: the difference is a spring that does
        not slip. A delay that was read is kept.
    friction : AnyFriction or FrictionAtPorts
        Maxwell slip with the stiffness from that of `machine` to that at rest, and a margin; of motor and load at both.
    evidence : str
        What it was read from, and what the data cannot show.
    mass, mass_std : float
        What a force at the friction port feels, of motor and load together, and its standard deviation [kg].
    stiffness_low : float
        Stiffness of `machine` at its port [N/m]; with a nominal relative to it.
    stiffness_std : float
        Standard deviation of the stiffness that was read [N/m].

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements" (resonance against level).

    Examples
    --------
    >>> import nlfrf
    >>> from robust.friction import friction_class
    >>> grid = dict(fs=4096, n_samples=16384, f_min=1.25, f_max=250, rng=1)
    >>> rig = nlfrf.paper_rig()
    >>> blas = [nlfrf.identify(nlfrf.simulate(rig, nlfrf.multisine("special-odd", rms=rms, **grid), n_periods=2))
    ...         for rms in (0.1, 0.25, 2.5)]
    >>> found = friction_class(blas)                        # the rig has 1 kg, 80 kN/m and 64 kN/m
    >>> bool(abs(found.mass - 1) < 0.02), bool(0.9 < found.stiffness_low / 80e3 < 1)
    (True, True)
    >>> bool(144e3 < found.stiffness_low + found.friction.K0 < 170e3)
    True
    """

    machines: tuple[FrictionPlant, ...]
    friction: AnyFriction | FrictionAtPorts
    evidence: str
    mass: float
    mass_std: float
    stiffness_low: float
    stiffness_std: float

    @property
    def machine(self) -> FrictionPlant:
        """The machine without damping."""
        return self.machines[0]

    def __str__(self) -> str:
        return self.evidence


@value
class MachineRead:
    """A machine and its friction as they were read, with the ends of their intervals.

    Fields
    ------
    machines : tuple of FrictionPlant
        The linear part, with each damping that is to be proved.
    mass, mass_std, stiffness_low, stiffness_std : float
        As of `FrictionClass`.
    stiffness : float
        Stiffness that was read [N/m], of which `stiffness_low` is the lower end.
    K0, stiction : (P,) ndarray
        Upper end of stiffness [N/m] and ratio of forces at each port; a ratio of nan was not seen.
    source, description, K0_note, stiction_note, misfit : str
        From what it was read, the machine, of what K0 is a multiple, the ratio that was read, and what is left.
    """

    machines: tuple[FrictionPlant, ...]
    mass: float
    mass_std: float
    stiffness: float
    stiffness_low: float
    stiffness_std: float
    K0: np.ndarray
    stiction: np.ndarray
    source: str
    description: str
    K0_note: str
    stiction_note: str
    misfit: str


def assume_class(read: MachineRead, *, stiction: float, margin: float) -> FrictionClass:
    """Return the class of what was read: a margin on the upper end of K0, and what the machine was lowered by.

    stiction : largest over smallest force of a slider; the upper end of what was read where that is more.
    """
    if require_real("margin", margin) < 1:
        raise ValueError(f"margin must be at least 1, got {margin:g}")
    machine = read.machines[0]
    stiffness, ratio = margin * read.K0, np.fmax(stiction, read.stiction)
    stiffness[0] += read.stiffness - read.stiffness_low
    ports = tuple(
        any_maxwell_slip(float(K0), float(rho), position_unit=machine.position_unit)
        for K0, rho in zip(stiffness, ratio, strict=True)
    )
    friction = ports[0] if machine.n_ports == 1 else FrictionAtPorts(ports=ports, names=machine.port_names)
    places = "" if machine.n_ports == 1 else " at " + " and ".join(machine.port_names)
    stiffest = " and ".join(format_plain(one.K0 / 1e3) for one in ports)
    ratios = " and ".join(f"{one.stiction:.3g}" for one in ports)
    if np.isnan(read.stiction).all():
        ratios += ", which no level shows"
    elif ports[0].stiction > read.stiction[0]:
        ratios += read.stiction_note
    evidence = (
        f"Assumed, {read.source}: {read.description}; K0 = {stiffest} {friction.units.stiffness}{places}, {margin:g} "
        f"times {read.K0_note}; stiction {ratios}; {read.misfit}. {ASSUMPTION_NOTE}"
    )
    return FrictionClass(
        machines=read.machines,
        friction=friction,
        evidence=evidence,
        mass=read.mass,
        mass_std=read.mass_std,
        stiffness_low=read.stiffness_low,
        stiffness_std=read.stiffness_std,
    )


def machines_of(
    machine: FrictionPlant | FrictionClass, friction: AnyFriction | None
) -> tuple[tuple[FrictionPlant, ...], AnyFriction]:
    """Return the machines to prove, and the class; from a class read from levels both."""
    if isinstance(machine, FrictionClass) and friction is None:
        require_one_port(machine.machine)
        assert isinstance(machine.friction, AnyFriction)
        return machine.machines, machine.friction
    if not isinstance(machine, FrictionPlant):
        raise ValueError(f"machine must be a friction_plant, or a FrictionClass alone, got {short_form(machine)}")
    require_one_port(machine)
    if not isinstance(friction, AnyFriction) or friction.kind != "Maxwell slip":
        raise ValueError(f"friction must be a class such as any_maxwell_slip(64e3), got {short_form(friction)}")
    return (machine,), friction
