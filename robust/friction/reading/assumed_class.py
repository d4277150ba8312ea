"""``MachineWithFriction``: machine and friction class of a proof, made from estimates and
intervals.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from nlfrf._base.arguments import require_kind, require_real, short_form
from nlfrf._base.values import value
from robust.friction.classes.maxwell_slip import MaxwellSlip
from robust.friction.plant import FrictionPlant, require_one_port
from robust.friction.units import format_plain

ASSUMPTION_NOTE = (
    "The levels support this class, they do not prove it. Friction that creeps below break-away"
    " looks the same. An element that sticks at all levels counts as a spring of the machine; one"
    " that slips at all levels is not seen."
)


@value
class MachineWithFriction:
    """A linear plant and a class of friction, estimated from measurements at several levels.

    It is an assumption that the machine consists of this plant and a friction of this class;
    `evidence` states what supports the assumption. For a rotary axis read N as Nm and m as rad.

    Fields
    ------
    machines : tuple of FrictionPlant
        The plants of the proof, which have the lowest stiffness that the levels allow. One plant
        has no damping. If a nominal was given, a second plant has the damping of the nominal. A
        stiffer machine is covered, because the class contains the difference as a spring that does
        not slip. The plants contain an estimated delay.
    friction : tuple of MaxwellSlip
        The class at each friction port. Its stiffness K0 is the difference between the stiffness at
        rest and that of `machine`, the first of `machines`, with a margin.
    evidence : str
        Source of the estimate, and what the measurements cannot show.
    mass, mass_std : float
        Mass of motor and load together, and its standard deviation [kg].
    stiffness_low : float
        Stiffness of `machine` at its friction port [N/m]; with a nominal, the stiffness to ground
        that is added to the nominal at this port.
    stiffness_std : float
        Standard deviation of the estimated stiffness [N/m].

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements" (resonance
    against level).

    Examples
    --------
    >>> import nlfrf
    >>> from robust.friction import machine_with_friction
    >>> grid = dict(fs=4096, n_samples=16384, f_min=1.25, f_max=250, rng=1)
    >>> rig = nlfrf.paper_rig()
    >>> blas = [nlfrf.identify(nlfrf.simulate(rig, nlfrf.multisine("special-odd", rms=rms, **grid), n_periods=2))
    ...         for rms in (0.1, 0.25, 2.5)]
    >>> found = machine_with_friction(blas)                        # the rig has 1 kg, 80 kN/m and 64 kN/m
    >>> bool(abs(found.mass - 1) < 0.02), bool(0.9 < found.stiffness_low / 80e3 < 1)
    (True, True)
    >>> bool(144e3 < found.stiffness_low + found.friction[0].K0 < 170e3)
    True
    """

    machines: tuple[FrictionPlant, ...]
    friction: tuple[MaxwellSlip, ...]
    evidence: str
    mass: float
    mass_std: float
    stiffness_low: float
    stiffness_std: float

    @property
    def machine(self) -> FrictionPlant:
        """Plant without damping."""
        return self.machines[0]

    def __str__(self) -> str:
        return self.evidence


@value
class MachineRead:
    """Estimates of a machine and its friction, with the ends of their intervals.

    Fields
    ------
    machines : tuple of FrictionPlant
        The linear plant, for each damping of a proof.
    mass, mass_std, stiffness_low, stiffness_std : float
        As in `MachineWithFriction`.
    stiffness : float
        Estimated stiffness [N/m]; `stiffness_low` is its lower end.
    K0, stiction : (P,) ndarray
        Upper end of the stiffness [N/m] and of the ratio of forces at each port; nan for a ratio
        that was not seen.
    source, description, K0_note, stiction_note, misfit : str
        Phrases for the evidence: source, machine, meaning of K0, estimate of the ratio, and what is
        unexplained.
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


def assume_class(read: MachineRead, *, stiction: float, margin: float) -> MachineWithFriction:
    """Return the class of an estimate: a margin on the upper end of K0, plus the reduction of the
    stiffness.

    stiction : largest over smallest force of a slider; the upper end of the estimate is used if it
    is larger.
    """
    if require_real("margin", margin) < 1:
        raise ValueError(f"margin must be at least 1, got {margin:g}")
    machine = read.machines[0]
    stiffness, ratio = margin * read.K0, np.fmax(stiction, read.stiction)
    stiffness[0] += read.stiffness - read.stiffness_low
    ports = tuple(
        MaxwellSlip(float(K0), float(rho), position_unit=machine.position_unit)
        for K0, rho in zip(stiffness, ratio, strict=True)
    )
    if machine.n_ports == 1:
        places = ""
    else:
        places = " at " + " and ".join(machine.port_names)
    stiffest = " and ".join(format_plain(one.K0 / 1e3) for one in ports)
    ratios = " and ".join(f"{one.stiction:.3g}" for one in ports)
    if np.isnan(read.stiction).all():
        ratios += ", which no level shows"
    elif ports[0].stiction > read.stiction[0]:
        ratios += read.stiction_note
    evidence = (
        f"Assumed, {read.source}: {read.description}; K0 = {stiffest}"
        f" {machine.units.stiffness}{places}, {margin:g} times {read.K0_note}; stiction {ratios};"
        f" {read.misfit}. {ASSUMPTION_NOTE}"
    )
    return MachineWithFriction(
        machines=read.machines,
        friction=ports,
        evidence=evidence,
        mass=read.mass,
        mass_std=read.mass_std,
        stiffness_low=read.stiffness_low,
        stiffness_std=read.stiffness_std,
    )


def machines_of(
    machine: FrictionPlant | MachineWithFriction, friction: MaxwellSlip | None
) -> tuple[tuple[FrictionPlant, ...], MaxwellSlip]:
    """Return the machines to prove and the class, from both or a `MachineWithFriction`."""
    if isinstance(machine, MachineWithFriction) and friction is None:
        require_one_port(machine.machine)
        return machine.machines, machine.friction[0]
    if not isinstance(machine, FrictionPlant):
        raise ValueError(
            "machine must be a friction_plant, or a MachineWithFriction alone, got"
            f" {short_form(machine)}"
        )
    require_one_port(machine)
    require_kind("friction", friction, MaxwellSlip)
    return (machine,), cast("MaxwellSlip", friction)
