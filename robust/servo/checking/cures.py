"""Changes of a drive that improve its friction verdict, best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust._base.states import FrictionVerdict
from robust.friction.loop import friction_loop
from robust.friction.plant import FrictionPlant
from robust.friction.proof.ports import largest_forces
from robust.friction.proof.protocol import FrictionClass
from robust.friction.proof.prove import prove_friction
from robust.servo.gains.p_pi import cascade

#: Factor on a gain or a time: large enough to matter, small enough to be tried on a machine in one
#: step.
_STEP = 1.5
#: Remaining share of a compensated friction.
_COMPENSATED = 0.3


@value
class FrictionCure:
    """One change of a drive, and the verdict with it.

    Fields
    ------
    change : str
        Name of the gain, with its old and its new value.
    verdict : FrictionVerdict
        Verdict with the change.
    error : float
        Bound on the final distance from the set point [m] or [rad], with every friction of the
        class up to the force Fs, whether the axis comes to rest or hunts (moves on in a limit
        cycle). Infinite if no bound is known.
    unit : str
        Unit of the error.

    References
    ----------
    B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30, 1994 (cures of stick-slip).

    Examples
    --------
    >>> cure = FrictionCure(change="tn 10 ms -> 15 ms", verdict=FrictionVerdict.SETTLES, error=2e-6, unit="m")
    >>> print(cure)
    tn 10 ms -> 15 ms: settles, may move within 2e-06 m for ever
    """

    change: str
    verdict: FrictionVerdict
    error: float
    unit: str

    def __str__(self) -> str:
        within = f"within {self.error:.3g} {self.unit}"
        if self.verdict is not FrictionVerdict.PROVED:
            within = f"may move {within} for ever"
        return (
            f"{self.change}: {self.verdict},"
            f" {within if np.isfinite(self.error) else 'without a bound'}"
        )


def friction_cures(
    machine: FrictionPlant,
    settings: Drive,
    friction: FrictionClass | Sequence[FrictionClass],
    *,
    Fs: float | Sequence[float],
    output_unit: str = "",
) -> tuple[FrictionCure, ...]:
    """Return the changes of a drive that improve its friction verdict, best first.

    Use this if `prove_friction` does not prove that an axis comes to rest. The proof is repeated
    with each of four changes:

    - velocity gain times 1.5;
    - reset time times 1.5;
    - no integral action, as with a large dead band or a leaky integrator;
    - a friction compensation that leaves at most 30 % of the friction. Nothing else is assumed
      about the remaining friction. A compensation computed from the set point acts only while the
      set point moves.

    Parameters
    ----------
    machine : FrictionPlant
        The axis in the units of the velocity loop (m or rad).
    settings : Drive
        Drive with its present gains.
    friction : FrictionClass or sequence of FrictionClass
        Class of friction; for several friction ports one class for each.
    Fs : float or sequence of float
        Largest friction force [N] or [Nm], one for each friction port.
    output_unit : str
        "N" or "Nm", as for `cascade`.

    Returns
    -------
    tuple of FrictionCure
        First the changes with which the axis comes to rest, then the changes with a smaller error
        than the present gains. Each group is sorted by error. Changes that do not help are left
        out.

    Raises
    ------
    ValueError
        Settings that are not a Drive, a force that is not positive, or units that differ.

    References
    ----------
    B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30, 1994 (cures of stick-slip).

    Examples
    --------
    >>> from robust.friction import MaxwellSlip
    >>> from robust import friction_plant
    >>> settings = Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04)
    >>> cures = friction_cures(friction_plant(1.0, 0.0), settings, MaxwellSlip(1e5, 3.0), Fs=1.0)
    >>> str(cures[0].verdict), cures[0].change
    ('proved', 'no integral action (dead band or leak of the integrator)')
    """
    require_kind("settings", settings, Drive)
    forces = largest_forces(machine, Fs)
    unit = settings.kp_unit
    changed = {
        f"kp {settings.kp:.4g} -> {_STEP * settings.kp:.4g} {unit}": replace(
            settings, kp=_STEP * settings.kp
        ),
    }
    if np.isfinite(settings.tn):
        longer = f"tn {1e3 * settings.tn:.4g} -> {1e3 * _STEP * settings.tn:.4g} ms"
        changed[longer] = replace(settings, tn=_STEP * settings.tn)
        changed["no integral action (dead band or leak of the integrator)"] = replace(
            settings, tn=np.inf
        )
    found = []
    for change, other in changed.items():
        verdict, error, _ = _judge(machine, other, friction, forces=forces, output_unit=output_unit)
        found.append(
            FrictionCure(change=change, verdict=verdict, error=error, unit=machine.position_unit)
        )
    _, present, bound = _judge(machine, settings, friction, forces=forces, output_unit=output_unit)
    found.append(
        FrictionCure(
            change=f"friction compensated to {100 * _COMPENSATED:g} %, while the compensation acts",
            verdict=FrictionVerdict.SETTLES if np.isfinite(bound) else FrictionVerdict.NOT_DECIDED,
            error=_COMPENSATED * bound,
            unit=machine.position_unit,
        )
    )
    helps = [
        cure for cure in found if cure.verdict is FrictionVerdict.PROVED or cure.error < present
    ]
    return tuple(
        sorted(helps, key=lambda cure: (cure.verdict is not FrictionVerdict.PROVED, cure.error))
    )


def _judge(
    machine: FrictionPlant,
    settings: Drive,
    friction: FrictionClass | Sequence[FrictionClass],
    *,
    forces: np.ndarray,
    output_unit: str,
) -> tuple[FrictionVerdict, float, float]:
    """Return the verdict, its error, and the bound for any friction up to `forces` (P,); infinite
    if there is none.
    """
    K = cascade(settings, output_unit=output_unit)
    proof = prove_friction(machine, K, friction, delay=settings.delay, Fs=forces.tolist())
    bound = proof.error_bound
    if proof.verdict is FrictionVerdict.PROVED:
        loop = friction_loop(machine, K, settings.delay)
        still, off = (part.reshape(-1, forces.size) for part in loop.rest())
        moved = np.abs(loop.displacements @ still) + np.abs(loop.displacements) @ off
        return proof.verdict, float((moved @ forces).max()), bound
    known = proof.settling_error if proof.verdict is FrictionVerdict.SETTLES else bound
    return proof.verdict, known, bound
