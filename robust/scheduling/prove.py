"""``prove_schedule``: proof or refutation of stability of a loop whose operating point moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import (
    require_choice,
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
)
from nlfrf._base.values import value
from robust._base.states import Outcome
from robust._base.types import Controller
from robust.lti.lti import timebase
from robust.models.lpv import LpvModel, constant_model
from robust.models.sets.forms import FORMS
from robust.proofs.exact.claim import LpvMatrices, Matrices, to_matrices
from robust.proofs.exact.scheduled_kyp import (
    ScheduleClaim,
    describe,
    require_schedule,
    verify_schedule,
)
from robust.proofs.exact.scheduled_loop import GAINS
from robust.proofs.exact.trajectories import Trajectory
from robust.proofs.exact.verification import Verification
from robust.proofs.search.certificate import SCALED_KYP, Certificate, failed_certificate
from robust.proofs.search.scheduled import search_schedule
from robust.scheduling.attack import growing_jumps, slowest_growth

_DEGREES, _SAMPLED_DEGREES = (0, 1, 2, 3), (1, 2)
_STEP = 1.2  # relative, to which the provable rate is searched
_WIDEST = 16.0  # times the rate that is asked for, at most
_WHOLE = 1e-6  # of a sample


@value
class ScheduleProof:
    """Result of a proof for a scheduled loop whose operating point moves.

    Fields
    ------
    outcome : Outcome
        "holds": stability (and the level of the gain, if given) is proved at every rate up to
        `rate`. "violated": `broken` is a trajectory within this rate on which the state grows.
        "undecided": neither.
    rate : float
        Rate of the claim, in units of the operating point per second; inf for jumps.
    provable : float
        Largest rate for which the same claim was found to be provable (a lower bound); inf: any
        rate; 0: none.
    certificate : Certificate
        Certificate of stability, or of a gain (which includes stability), at the rate of the claim.
    broken : BrokenRate or None
        The slowest trajectory found on which the state of the loop grows.
    degree : int
        Degree in theta of the matrix P(theta) of the Lyapunov function.
    plant, K : LpvModel
        Plant and controller, u = -K y.
    delay : float
        Delay between controller and plant [s].

    References
    ----------
    Wu, Yang, Packard & Becker, "Induced L2-norm control for LPV systems with bounded parameter
    variation rates", 1996.

    Examples
    --------
    >>> import control, robust
    >>> from robust.models import LpvModel
    >>> soft, stiff = (control.ss([[0, 1], [-k, -1.0]], [[0], [1]], [[1, 0]], 0) for k in (4.0, 6.0))
    >>> plant = LpvModel.from_points([soft, stiff], at=[0, 1], over="position", unit="m")
    >>> proof = robust.prove_schedule(plant, 1.0, rate=0.5, limit=False)
    >>> proof.outcome, proof.degree
    ('holds', 0)
    >>> print(proof.verify())
    stability on every trajectory: proved, rigorous
    """

    outcome: Outcome
    rate: float
    provable: float
    certificate: Certificate
    broken: BrokenRate | None
    degree: int
    plant: LpvModel
    K: LpvModel
    delay: float

    @property
    def holds(self) -> bool:
        """True if the whole claim is proved."""
        return self.outcome is Outcome.HOLDS

    def verify(self, *, time_cap: float = 60.0) -> Verification:
        """Prove the claim again from its numbers, without the search.

        Parameters
        ----------
        time_cap : float
            Limit of the processor time [s].

        Returns
        -------
        Verification
        """
        return self.certificate.verify(time_cap=time_cap)

    def __str__(self) -> str:
        if self.plant.unit:
            unit = f"{self.plant.unit}/s"
        else:
            unit = "per second"
        if np.isinf(self.rate):
            speed = "jumping at will"
        else:
            speed = f"at most {self.rate:g} {unit}"
        if self.K.dt:
            clock = f"at {1 / self.K.dt:g} Hz"
        else:
            clock = "in continuous time"
        lines = [
            f"{self.plant.describe_range()}, {speed}, controller of order {self.K.order} {clock}"
        ]
        whom = "" if self.plant.weight is None else ", for every operator within the weight"
        one, no = self.certificate, "refuted" if self.certificate.violated else "not decided"
        if one.holds:
            how = f"proved, rigorous (P of degree {self.degree})"
        else:
            how = f"{no}: {one.reason}"
        lines.append(f"  {one.subject}{whom}: {how}")
        if self.provable not in (0, self.rate):
            lines.append(
                "  provable"
                f" {f'up to {self.provable:.3g} {unit}' if np.isfinite(self.provable) else 'at any rate'}"
            )
        if self.broken is not None:
            lines.append(f"  {self.broken.describe(unit)}")
        held = " and held within a sample" if self.K.dt and np.isinf(self.rate) else ""
        if self.K.dt and self.plant.weight is not None:
            held += (
                "; the perturbation acts from sample to sample, aliases of the set above Nyquist"
                " are not in it"
            )
        seen = ""
        if self.plant.held_out > 1:
            seen = f" (a left-out point deviates by {self.plant.held_out:.2g} times the weight)"
        lines.append(
            f"  assumed: matrices go with {self.plant.over} as polynomials of degree"
            f" {len(self.plant.A) - 1}{seen}, in this realisation; {self.plant.over} is known to the"
            f" controller{held}"
        )
        return "\n".join(lines)


@value
class BrokenRate:
    """A periodic trajectory of the operating point on which the state of the loop provably grows.

    Fields
    ------
    rate : float
        Largest rate of the operating point on the trajectory, per second; inf for jumps; 0 if the
        state grows at a fixed operating point.
    points : (N,) ndarray
        Operating points at the vertices of the trajectory, which is linear between them, or
        constant for jumps.
    step : float
        Time between two vertices [s].
    delta : float
        Value of the perturbation Delta, a constant; 0 without a perturbation.

    References
    ----------
    Shamma & Athans, "Gain scheduling: potential hazards and possible remedies", IEEE Control
    Systems, 1992.

    Examples
    --------
    >>> import control, robust
    >>> from robust.models import LpvModel
    >>> plant = LpvModel.from_points([control.ss(a, 1, 1, 0) for a in (-2.0, 1.0)], at=[0, 1], over="load", unit="kg")
    >>> proof = robust.prove_schedule(plant, 0.0, rate=0.1)
    >>> proof.outcome, proof.broken.rate, proof.broken.points
    ('violated', 0.0, array([1.]))
    """

    rate: float
    points: np.ndarray
    step: float
    delta: float

    def describe(self, unit: str) -> str:
        """Describe the trajectory in one line."""
        if not self.rate:
            return f"unstable with the operating point held at {self.points[0]:.3g} (proved)"
        if np.isinf(self.rate):
            speed = "jumping"
        else:
            speed = f"at {self.rate:.3g} {unit}"
        up = np.diff(self.points, append=self.points[:1]) > 0
        times = int(np.count_nonzero(up & ~np.roll(up, 1)))
        if self.delta:
            whom = f" with Delta = {self.delta:+g}"
        else:
            whom = ""
        low, high = self.points.min(), self.points.max()
        seconds = self.points.size * self.step
        if times > 1:
            much = f"{times} times in {seconds:.3g} s"
        else:
            much = f"in {seconds:.3g} s"
        return f"grows {speed}{whom}: to and fro from {low:.3g} to {high:.3g}, {much} (proved)"


def prove_schedule(
    plant: LpvModel,
    K: LpvModel | Controller,
    *,
    rate: float,
    delay: float = 0.0,
    gain: str = "",
    level: float | None = None,
    degree: int | None = None,
    limit: bool = True,
) -> ScheduleProof:
    """Prove that a scheduled loop u = -K(p) y stays stable while its operating point p moves.

    The proof is a Lyapunov function V = x'P(p)x that decreases on every trajectory with |p'| <=
    rate, for every causal perturbation of the set of the plant. The inequality is decided at every
    p in ball arithmetic. Stability at every fixed p does not suffice for this (Shamma & Athans).

    A sampled controller acts on the continuous plant through a hold, and the proof includes the
    motion of p within a sample. The perturbation then acts from sample to sample, so the proof does
    not include aliases of the set above the Nyquist frequency.

    Parameters
    ----------
    plant : LpvModel
        Plant without direct feedthrough, continuous or discrete with the sampling time of K. Its
        weight, if any, must have the sampling time of K.
    K : LpvModel or control.StateSpace
        Controller with the same operating point, or one controller for all operating points.
    rate : float
        Largest rate of the operating point, in its units per second. inf: the operating point may
        jump, with a sampled K at the sampling instants.
    delay : float
        Delay between controller and plant [s]: a whole number of samples, or 0 for a continuous K.
    gain : str
        L2 gain to bound. "S": from the reference to the error. "GS": from a disturbance at the
        plant input to the plant output. "": stability only.
    level : float, optional
        Bound of the L2 gain to prove.
    degree : int, optional
        Degree of P(p). By default 1 and 2 are tried for a sampled K, 0 to 3 for a continuous K, and
        0 and 1 for jumps.
    limit : bool
        Whether to search for the largest provable rate (within 20 %), and for a trajectory on which
        the state of the loop grows.

    Returns
    -------
    ScheduleProof

    Raises
    ------
    ValueError
        Plants or controllers of other types, ranges, units, sizes or sampling times; a rate that is
        not positive; a delay that is not whole samples; a gain without a level.

    References
    ----------
    Wu, Yang, Packard & Becker, "Induced L2-norm control for LPV systems with bounded parameter
    variation rates", 1996. Shamma & Athans, "Guaranteed properties of gain scheduled control for
    linear parameter-varying plants", 1991.

    Examples
    --------
    >>> import control, robust
    >>> from robust.models import LpvModel
    >>> soft, stiff = (control.ss([[0, 1], [-k, -1.0]], [[0], [1]], [[1, 0]], 0) for k in (4.0, 6.0))
    >>> plant = LpvModel.from_points([soft, stiff], at=[0, 1], over="position", unit="m")
    >>> proof = robust.prove_schedule(plant, 1.0, rate=0.5, limit=False)
    >>> print(proof)
    position from 0 to 1 m, at most 0.5 m/s, controller of order 0 in continuous time
      stability on every trajectory: proved, rigorous (P of degree 0)
      assumed: matrices go with position as polynomials of degree 1, in this realisation; position is
        known to the controller
    """
    claim = _claim(plant, K, rate=rate, delay=delay, gain=gain, level=level)
    sampled = bool(claim.controller.dt)
    degrees: tuple[int, ...]
    if claim.jumps:
        degrees = (0, 1) if sampled else (0,)
    else:
        degrees = _SAMPLED_DEGREES if sampled else _DEGREES
    if degree is not None:
        degrees = (require_integer("degree", degree, least=0),)
    found, used, reason = None, degrees[-1], ""
    for used in degrees:
        found, decision = search_schedule(claim, used)
        reason = decision.reason
        if found is not None:
            break
    break_it = growing_jumps if claim.jumps else slowest_growth
    if limit or found is None:
        broken = break_it(claim)
    else:
        broken = None
    provable = claim.speed if found is not None else 0.0
    if limit and not claim.jumps:
        any_rate = found is not None and not used and not sampled
        if any_rate:
            provable = np.inf
        else:
            provable = _largest_rate(
                claim, used, provable, np.inf if broken is None else broken.rate
            )
    outcome = Outcome.HOLDS if found is not None else Outcome.UNDECIDED
    if found is None and broken is not None and broken.rate <= claim.speed:
        outcome, reason = Outcome.VIOLATED, "a trajectory grows"
    half = plant.half_range
    return ScheduleProof(
        outcome=outcome,
        rate=claim.speed * half,
        provable=provable * half,
        certificate=_certificate(claim, found, reason, outcome),
        broken=None if broken is None else _in_units(broken, plant),
        degree=used,
        plant=plant,
        K=constant_model("K", K, plant),
        delay=delay,
    )


def _claim(
    plant: LpvModel,
    K: LpvModel | Controller,
    *,
    rate: float,
    delay: float,
    gain: str,
    level: float | None,
) -> ScheduleClaim:
    """Return the claim in theta, without P; refuse what does not fit."""
    require_kind("plant", plant, LpvModel)
    controller = constant_model("K", K, plant)
    mine, own = controller.points[[0, -1]], plant.points[[0, -1]]
    if not np.array_equal(mine, own) or (controller.over, controller.unit) != (
        plant.over,
        plant.unit,
    ):
        raise ValueError(
            f"K must be scheduled over the range of the plant, {plant.describe_range()}, "
            f"got {controller.describe_range()}"
        )
    if rate != np.inf:
        rate = require_positive("rate", rate)
    require_choice("gain", gain, ("", *GAINS))
    if gain and level is None:
        raise ValueError(f"level must be given with gain {gain!r}, got none")
    level = require_positive("level", 1.0 if level is None else level)
    dt, samples = controller.dt, require_nonnegative("delay", delay)
    if dt:
        samples = samples / dt
    if abs(samples - round(samples)) > _WHOLE or (not dt and samples):
        if dt:
            wanted = f"a whole number of samples of {dt:g} s"
        else:
            wanted = "zero for a continuous K"
        raise ValueError(f"delay must be {wanted}, got {delay:g} s")
    if not plant.order:
        raise ValueError("plant must have states, got a gain")
    machine, law = (
        LpvMatrices(A=one.A, B=one.B, C=one.C, D=one.D, dt=one.dt) for one in (plant, controller)
    )
    weight = _weight(plant, dt)
    reads = tuple(one for one in FORMS[plant.form].rs_factors if one in ("G", "K"))
    require_schedule(machine, law, weight, reads)
    return ScheduleClaim(
        plant=machine, controller=law, weight=weight, reads=reads, delay=round(samples),
        rate=0.0 if rate == np.inf else rate / plant.half_range, jumps=rate == np.inf, gain=gain, level=level,
        P=np.zeros((1, 0, 0)), S=np.zeros((0, 0)), scalings=np.zeros(0),
    )  # fmt: skip


def _weight(plant: LpvModel, dt: float) -> Matrices | None:
    """Return the weight on the time base of the controller."""
    weight = plant.weight
    if weight is None:
        return None
    if weight.nstates and not np.isclose(timebase(weight), dt, rtol=1e-9, atol=0):
        if dt:
            wanted = f"have the sampling time of K, {dt:g} s"
        else:
            wanted = "be continuous like K"
        if timebase(weight):
            found = f"{timebase(weight):g} s"
        else:
            found = "a continuous one"
        raise ValueError(f"weight must {wanted}, got {found}")
    return replace(to_matrices(weight), dt=dt)


def _in_units(found: Trajectory, plant: LpvModel) -> BrokenRate:
    middle = (plant.points[0] + plant.points[-1]) / 2
    return BrokenRate(
        rate=found.rate * plant.half_range,
        points=middle + plant.half_range * found.theta,
        step=found.step,
        delta=found.delta,
    )


def _largest_rate(claim: ScheduleClaim, degree: int, proved: float, broken: float) -> float:
    """Return the largest rate of theta that is proved with a degree of P, to a step of 20
    percent.
    """
    low, high = proved, min(broken, claim.rate * _WIDEST)
    if low:
        trial = 2 * low
    else:
        trial = claim.rate / 2
    while high > _STEP * low and trial > claim.rate / _WIDEST:
        if low:
            trial = min(trial, np.sqrt(low * high))
        if search_schedule(replace(claim, rate=float(trial)), degree)[0] is None:
            high = trial
            if low:
                trial = np.sqrt(low * high)
            else:
                trial = trial / 2
        else:
            low, trial = trial, 2 * trial
    return float(low)


def _certificate(
    claim: ScheduleClaim, found: ScheduleClaim | None, reason: str, outcome: Outcome
) -> Certificate:
    subject = describe(claim)
    if found is None:
        return failed_certificate(subject, claim.level, reason, outcome=outcome)
    return Certificate(
        subject=subject,
        outcome=Outcome.HOLDS,
        level=claim.level,
        method=SCALED_KYP,
        intervals=np.array([[0.0, np.inf]]),
        reason="",
        claim=found,
        again=verify_schedule,
    )
