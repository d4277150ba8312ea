"""Maxwell slip: friction made of springs in series with sliders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Self

import numpy as np

from nlfrf._base.arguments import require_nonnegative, require_positive
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.exact.claim import Actuator
from robust.friction.exact.classes import MaxwellSlipPort
from robust.friction.exact.settling import Settling
from robust.friction.exact.verify import verify_friction
from robust.friction.loop import FrictionLoop, loop_frequencies, mobility
from robust.friction.proof.certify import (
    build_claim,
    certificate_of,
    certified_verdict,
    reference_rate,
    settled_by_bound,
)
from robust.friction.proof.dissipation import ROUNDED_UP, maxwell_slip_dissipation
from robust.friction.proof.multipliers import filter_rates, weighed_port
from robust.friction.proof.ports import coupling_of_rests, weights_of_ports
from robust.friction.proof.protocol import (
    CertifiedClass,
    FrictionCertificate,
    FrictionProof,
    ProofTask,
    require_stiction,
)
from robust.friction.proof.saturation import largest_region
from robust.friction.proof.settling import largest_rest, settling_numbers
from robust.friction.proof.storage import certified_dissipation
from robust.friction.units import format_plain

_N_POINTS = 300  # of the frequencies, with several ports
_SETTLING_ROUNDED_UP = 1 + 1e-9


@value(kw_only=False)
class MaxwellSlip(CertifiedClass):
    """Class of all friction laws made of elements, each a spring in series with a slider.

    The friction force is the sum of the forces f_i of any number of elements. Element i is a spring
    k_i, with a damper k_i tau_i in parallel to the spring, in series with a slider. The slider
    holds |f_i| <= W_i and slips at a force of at least W_i/stiction. The springs satisfy sum k_i <=
    K0.

    Use this class for friction that sticks fully below break-away. It contains Maxwell-slip and
    Prandtl-Ishlinskii laws with any hysteresis curve, Stribeck friction, stiction that increases
    during rest, and sliders that depend on position, load, direction or time. It does not contain
    LuGre, Dahl and Leuven, which creep below break-away. It does not contain the generalised
    Maxwell-slip model with a finite attraction parameter, nor rigid stiction.

    Fields
    ------
    K0 : float
        Largest presliding stiffness of all elements together [N/m].
    stiction : float
        Ratio of the largest force of a slider to the smallest force at which it slips; at least 1.
        It is an assumption, because no frequency response shows it.
    bristle_time : float
        Largest ratio of damping to stiffness of an element [s].
    position_unit : str
        "m", or "rad" with Nm.

    Raises
    ------
    ValueError
        A stiffness that is not positive, a stiction below one, or a negative time.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements and
    sliders).

    Examples
    --------
    >>> MaxwellSlip(64e3).stiction
    1.5
    """

    K0: float
    stiction: float = 1.5
    bristle_time: float = 0.0

    excluded: ClassVar[str] = (
        "a law that creeps below break-away (LuGre, Dahl, Leuven), rigid stiction, "
    )
    joins_ports: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "K0", require_positive("K0", self.K0))
        object.__setattr__(self, "stiction", require_stiction(self.stiction))
        object.__setattr__(
            self, "bristle_time", require_nonnegative("bristle_time", self.bristle_time)
        )

    @property
    def description(self) -> str:
        """Noun phrase for the laws of the class, for texts."""
        if self.bristle_time:
            damped = f" and damping up to {1e3 * self.bristle_time:g} ms of it"
        else:
            damped = ""
        return (
            "Maxwell-slip friction with a presliding stiffness of up to"
            f" {format_plain(self.K0 / 1e3)} {self.units.stiffness}{damped}, in which each slider"
            f" holds at most {self.stiction:.4g} times its smallest slip force (anywhere, in any"
            " direction, at any speed or time)"
        )

    @property
    def limits(self) -> MaxwellSlipPort:
        """Limits of the class as constraints of a proof."""
        none = np.zeros(0)
        return MaxwellSlipPort(
            K0=self.K0,
            stiction=self.stiction,
            bristle_time=self.bristle_time,
            free=0.0,
            rates=none,
            weights=none,
        )

    def stuck(self) -> tuple[float, float]:
        """Return stiffness [N/m] and damping [Ns/m] of the stiffest element that never slips."""
        return self.K0, 0.0

    def decide(
        self, undecided: FrictionProof, task: ProofTask, others: Sequence[Self] = ()
    ) -> FrictionProof:
        """Return "proved" if a decreasing storage function is found, else a bound on the final
        position if there is one.
        """
        found = certified_verdict(undecided, task, partial(self.certify, others=others))
        if found.verdict is FrictionVerdict.NOT_DECIDED and np.isfinite(task.forces).all():
            return self.settle(found, task, others)
        return found

    def certify(
        self, loop: FrictionLoop, reference: float, others: Sequence[Self] = ()
    ) -> FrictionCertificate:
        """Search and verify a storage function that decreases with every friction law."""
        ports = (self, *others)
        K0 = np.array([one.K0 for one in ports])
        rho = np.array([one.stiction for one in ports])
        n_ports = len(ports)
        omega = loop_frequencies(loop, _N_POINTS if n_ports > 1 else 900)
        response = mobility(loop, omega).reshape(omega.size, n_ports, n_ports)
        if n_ports > 1:
            wrong, balanced = coupling_of_rests(loop)
        else:
            wrong, balanced = "", False
        if wrong:
            return FrictionCertificate(wrong)
        reason = "no multiplier weights make the loop dissipate at every frequency"
        for rates in filter_rates(reference, max(one.bristle_time for one in ports)):
            mu = weights_of_ports(response, omega, rates=rates, K0=K0, rho=rho, balanced=balanced)
            if mu is None:
                continue
            reason, energy = certified_dissipation(
                maxwell_slip_dissipation(loop, rates, mu=mu, K0=K0, rho=rho)
            )
            if not reason:
                weighed = tuple(
                    weighed_port(rates, one.limits, own) for one, own in zip(ports, mu, strict=True)
                )
                return FrictionCertificate("", weighed, energy)
        return FrictionCertificate(reason)

    def region(self, task: ProofTask, known: Actuator, left: float) -> FrictionCertificate:
        """Prove the largest region from which the loop with a saturated actuator comes to rest."""
        return largest_region(task, self.limits, known, left)

    def settle(
        self, undecided: FrictionProof, task: ProofTask, others: Sequence[Self] = ()
    ) -> FrictionProof:
        """Return a bound on the final position, proved over the rationals, or else `error_bound`."""
        loop, forces, error_bound = task.loop, task.forces, undecided.error_bound
        classes, any_friction = (self, *others), settled_by_bound(undecided)
        if any(one.bristle_time for one in classes) or not loop.growth() < 0:
            return any_friction
        stiffest = np.array([one.K0 for one in classes])
        ratios = np.array([one.stiction for one in classes])
        rests = np.array(
            [largest_rest(Fs, ratio) for Fs, ratio in zip(forces, ratios, strict=True)]
        )
        most = rests.max()
        try:
            if most:
                shares = rests / most
            else:
                shares = np.ones(rests.size)
            proposed = settling_numbers(loop, stiffest, reference_rate(task.machine, loop), shares)
            still, off = (part.reshape(-1, forces.size) for part in loop.rest())
        except (np.linalg.LinAlgError, ValueError, FloatingPointError):
            return any_friction
        moved = np.abs(loop.displacements @ still) + np.abs(loop.displacements) @ off
        held = moved @ ((1 + 1 / ratios) / 2 * forces)
        for one in proposed:
            # a bound of zero, for a rest of zero and a stiction of one, could not be claimed
            error = max(float((one.reach * most + held).max()) * _SETTLING_ROUNDED_UP, 1e-300)
            ports = tuple(
                replace(
                    its.limits, stiction=max(its.stiction, ROUNDED_UP), rates=one.rates, weights=own
                )
                for its, own in zip(classes, one.weights, strict=True)
            )
            own_settling = Settling(
                decay=one.decay, Fs=forces, error=error, rest_weights=one.rest_weights
            )
            exact = replace(build_claim(task, ports, one), settling=own_settling)
            if verify_friction(exact).verified:
                smaller = min(error_bound, error)
                proved = certificate_of(exact)
                return replace(
                    undecided,
                    verdict=FrictionVerdict.SETTLES,
                    settling_error=smaller,
                    certificate=proved,
                )
        return any_friction
