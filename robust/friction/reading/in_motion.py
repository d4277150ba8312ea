"""Mass, viscous and Coulomb friction of an axis that slides in one direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import nlfrf
from nlfrf._base.arguments import require_list, require_one_channel
from nlfrf._base.values import value
from robust.friction.reading.balance import (
    MODEL_ERROR,
    Candidate,
    Motion,
    Terms,
    motion_of_record,
    pack,
)
from robust.friction.reading.intervals import (
    FORCE_ERROR,
    derived_numbers,
    deviations,
    mode_error,
    mode_term,
)
from robust.friction.reading.levels import require_si, weighted_mean
from robust.friction.reading.load import fit_sliding_level
from robust.friction.reading.numbers import NumbersRead, number_facts, unit_of, units_of
from robust.friction.reading.search import N_PASSES, extend, refine, reweight
from robust.pages.text import format_facts

#: Numbers of a load that are estimated in addition to those of the whole.
_COUPLED = ("load_mass", "coupling", "coupling_damping")


@value
class SlidingFit(NumbersRead):
    """Mass, viscous and Coulomb friction of an axis in motion, with intervals.

    Fields
    ------
    mass, damping, coulomb : float
        Mass m [kg] of motor and load together, viscous friction c [Ns/m], and Coulomb friction [N].
    offset : float
        Force that does not depend on the direction of motion, such as weight [N]; nan if only one
        direction was measured.
    delay : float
        Delay from the command to the force, including a lag [s]. A mode above the band looks like a
        lag.
    stds : dict of str to float
        Standard deviation of each of these numbers.
    velocities : (R,) ndarray
        Base velocities [m/s].
    misfit : float
        Mean square misfit of forces and slopes, divided by their variance. A value above about 4
        means that the friction is not Coulomb friction with a viscous part; Stribeck friction, for
        instance, still falls with velocity.
    units : tuple of str
        Units of force and position; all other units follow from them.
    load_mass, coupling, coupling_damping : float
        For two masses: load [kg], spring [N/m] and damper [Ns/m] between motor and load; zero for
        one mass.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, 1991 (friction from the force at
    constant velocity).

    Examples
    --------
    Example of the fields; `identify_sliding` has one with numbers.

    >>> sorted(name for name in ("mass", "damping", "coulomb", "offset") if name in SlidingFit.__dataclass_fields__)
    ['coulomb', 'damping', 'mass', 'offset']
    """

    mass: float
    damping: float
    coulomb: float
    offset: float
    delay: float
    stds: dict[str, float]
    velocities: np.ndarray
    misfit: float
    units: tuple[str, str] = ("N", "m")
    load_mass: float = 0.0
    coupling: float = 0.0
    coupling_damping: float = 0.0

    def __str__(self) -> str:
        speeds = ", ".join(f"{v:.3g}" for v in self.velocities) + " " + unit_of("L/s", self.units)
        last = f"95 % intervals, in motion at {speeds}; break-away and K0 need levels at rest"
        return f"{format_facts(number_facts(self))}\n{last}"


def identify_sliding(
    records: Sequence[nlfrf.Record], velocities: Sequence[float], *, masses: int = 1
) -> SlidingFit:
    """Identify mass, viscous and Coulomb friction of an axis from records in motion.

    While an axis slides in one direction, Coulomb friction is a constant force. The FRF is then
    that of the machine, and the slope of the friction over velocity acts as damping. The mean force
    at each velocity is the friction force.

    Use this for the mass and the viscous friction of an axis that can move at a constant velocity.
    Break-away force and presliding stiffness need records at rest (`identify_friction`).

    Parameters
    ----------
    records : sequence of Record
        Force [N] as input, with its mean, and position [m] minus the base motion as output. The
        velocity must not reverse.
    velocities : (R,) sequence of float
        Base velocity of each record [m/s], with its sign. Measure in two directions to identify a
        constant force such as weight.
    masses : int
        1 for one mass. 2 for a motor with the encoder, and a load coupled by a spring and a damper;
        measure beyond the resonance then.

    Returns
    -------
    SlidingFit

    Raises
    ------
    ValueError
        No record; a velocity that is zero or missing; several channels; units with a prefix; a
        reversed sign; masses other than one or two.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, 1991 (friction from the force at
    constant velocity).

    Examples
    --------
    >>> import nlfrf
    >>> axis = nlfrf.servo_axis("linear motor")                  # 12 kg, 20 Ns/m, 20 N of stiction over 1.3
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rms=5.0, rng=1)
    >>> records = [nlfrf.rig.simulate_servo(axis, ms, base_velocity=v, n_periods=4) for v in (0.1, 0.3)]
    >>> fit = identify_sliding(records, (0.1, 0.3))
    >>> round(fit.mass, 1), round(fit.damping), round(fit.coulomb, 1)
    (12.0, 20, 15.4)
    """
    records = require_list("records", records, nlfrf.Record)
    for one in records:
        require_one_channel("records", one)
    speeds = np.asarray(velocities, dtype=float)
    if speeds.shape != (len(records),) or not np.all(np.isfinite(speeds) & (speeds != 0)):
        raise ValueError(
            f"velocities must contain one nonzero velocity for each of the {len(records)}"
            f" records, got {speeds}"
        )
    if masses not in (1, 2):
        raise ValueError(f"masses must be 1, or 2 for a motor and a load, got {masses}")
    for record in records:
        require_si("records", f"{record.y_unit}/{record.u_unit}")
    motions = [motion_of_record(record, 1) for record in records]
    fits = [fit_linear(motion, masses) for motion in motions]

    def joined(name: str) -> tuple[float, float]:
        return weighted_mean([one[0][name] for one in fits], [one[1][name] for one in fits])

    mass, mass_std = joined("mass")
    if not mass > 0:
        raise ValueError(
            f"records must be from force to position, got a mass of {mass:.3g} kg: the output falls"
            " when the input rises. Reverse the sign of the sensor"
        )
    slopes = np.array([[one[i]["damping"] for one in fits] for i in (0, 1)])
    found, spread, misfit = _fit_forces(speeds, _mean_forces(records), slopes)
    both = found.size == 3
    delay, delay_std = joined("delay")
    if masses == 2:
        coupled = {name: joined(name) for name in _COUPLED}
    else:
        coupled = {}
    if coupled and not 0 < coupled["load_mass"][0] < mass:
        raise ValueError(
            "records must distinguish motor and load, got a load of"
            f" {coupled['load_mass'][0]:.3g} kg of {mass:.3g} kg in all. Measure beyond the"
            " resonance"
        )
    stds = {
        # the errors of all records are correlated, so averaging does not reduce them
        "mass": float(
            np.hypot(max(mass_std, min(one[1]["mass"] for one in fits)), MODEL_ERROR / 2 * mass)
        ),
        "damping": float(spread[0]),
        "coulomb": float(spread[1]),
        "delay": delay_std,
    }
    return SlidingFit(
        mass=mass,
        damping=float(found[0]),
        coulomb=float(found[1]),
        offset=float(found[2]) if both else np.nan,
        delay=delay,
        stds=stds
        | ({"offset": float(spread[2])} if both else {})
        | {name: std for name, (_, std) in coupled.items()},
        velocities=speeds,
        misfit=misfit,
        units=units_of(records[0]),
        **{name: number for name, (number, _) in coupled.items()},
    )


def _mean_forces(records: Sequence[nlfrf.Record]) -> np.ndarray:
    """Return (2, R) mean force of each record and its standard deviation [N]."""
    means = [np.asarray(record.u).mean(axis=-1).ravel() for record in records]
    forces = np.array([one.mean() for one in means])
    scatter = [one.std(ddof=1) / np.sqrt(one.size) if one.size > 1 else 0.0 for one in means]
    return np.stack([forces, np.hypot(scatter, MODEL_ERROR * np.abs(forces))])


def _fit_forces(
    speeds: np.ndarray, forces: np.ndarray, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return viscous and Coulomb friction, and a constant force if both directions are given;
    deviations; misfit.

    forces, slopes : (2, R) mean force and slope of the friction at each speed, and their standard
    deviations.
    """
    both = bool(np.any(speeds > 0) and np.any(speeds < 0))
    # mean force: c v + Fc sgn v + offset; slope: c
    table = np.column_stack([speeds, np.sign(speeds), *([np.ones(speeds.size)] if both else [])])
    below = np.column_stack([np.ones(speeds.size), np.zeros((speeds.size, table.shape[1] - 1))])
    b, std = np.hstack([forces, slopes])
    A, b = np.vstack([table, below]) / std[:, np.newaxis], b / std
    found = np.linalg.lstsq(A, b, rcond=None)[0]
    misfit = float(((b - A @ found) ** 2).sum() / max(1, b.size - found.size))
    return found, np.sqrt(max(1.0, misfit) * np.diag(np.linalg.inv(A.T @ A))), misfit


def fit_linear(motion: Motion, masses: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return the parameters of a linear machine with delay, with standard deviations."""
    kept = motion.excited  # the other lines contain noise alone
    motion = replace(
        motion,
        **{
            name: getattr(motion, name)[..., kept] for name in ("omega", "U", "Y", "noise", "lines")
        },
        excited=kept[kept],
    )
    none, two = np.zeros(0), masses == 2
    size = -(motion.omega**2) * motion.Y
    mass = float((size.conj() * motion.U).real.sum() / (np.abs(size) ** 2).sum())
    numbers = {"mass": mass, "damping": 0.0, "delay": 0.0}
    if two:
        numbers = fit_sliding_level(motion, none, spring=False).numbers
    terms = Terms(spring=False, lag=two, load=two)
    candidate = Candidate(terms=terms, numbers=numbers, stiffness=none, breakaway=none)
    stds = [np.full(motion.U.shape, np.sqrt((np.abs(motion.U) ** 2).mean()))]
    for _ in range(N_PASSES):
        candidate = refine([motion], stds, candidate=candidate, span=(1e-9, 1.0))
        stds = reweight([motion], candidate)
        if (
            not candidate.terms.lag
        ):  # a lag stands for a mode above the band too: the data show only one of them
            candidate = extend([motion], stds, candidate=candidate, span=(1e-9, 1.0)) or candidate
    candidate = refine([motion], stds, candidate=candidate, span=(1e-9, 1.0))
    found = derived_numbers(pack(candidate), candidate)
    spread = deviations([motion], reweight([motion], candidate), candidate)
    # behind an estimated load a lag is a lag
    if two:
        lag = 0.0
    else:
        lag = candidate.numbers.get("lag_squared", 0.0)
    # a lag that stands for a mode changes the phase a little, which looks like damping
    errors = {
        "mass": mode_error(motion, found, lag) * abs(found["mass"]),
        "damping": mode_term(motion, found, lag) * abs(found["damping"]),
        "delay": FORCE_ERROR / float(motion.omega[-1]),
    }
    return found, spread | {
        name: float(np.hypot(spread[name], error)) for name, error in errors.items()
    }
