"""What a check claims of a loop, put into the exact form in which someone else can prove it again."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from robust.analysis.loop import Loop, nominal_instability
from robust.certificates.certificate import Certificate
from robust.systems.norms import EPS
from robust.systems.realisation import state_space
from robust.systems.stability import certain_poles
from robust.uncertain.forms import FORMS
from robust.uncertain.model import UncertaintyModel
from robust.verification.claim import STABILITY, LoopClaim, as_given
from robust.verification.poles import stable_loop

__all__ = ["claim_of", "claimed", "decided"]


BESIDE = 1e6  # times what rounding moves a pole by
LARGEST_EXACT = 60  # states, delay line included: seconds beyond


def claim_of(model: UncertaintyModel, K: Any, w_P: Any, delay: float) -> LoopClaim:
    """Robust stability of a model with its controller, with all numbers as they were given."""
    form = FORMS[model.form]
    return LoopClaim(
        plant=as_given(model.nominal),
        controller=as_given(state_space("K", K)),
        weight=as_given(model.weight),
        performance=None if w_P is None else as_given(state_space("w_P", w_P)),
        reads=tuple(name for name in form.read if name != "w"),
        inverse=form.inverse,
        perturbation=model.perturbation,
        delay=float(delay),
        claims=(STABILITY,),
        shaping=tuple(as_given(W) for W in (model.W1, model.W2)) if form.scaled else (),
    )


def claimed(found: Certificate, claim: LoopClaim, name: str, *, scaling: float = 1.0) -> Certificate:
    """A certificate with what it claims, by that name; one that does not hold claims nothing."""
    return replace(found, claim=replace(claim, claims=(name,), scaling=scaling) if found.holds else None)


def decided(loop: Loop, claim: LoopClaim) -> str:
    """Empty where every pole of the nominal loop is strictly stable, else what is wrong.

    Floating point decides far from the boundary, exact arithmetic beside it, unless the loop is too large.
    """
    said = nominal_instability(loop)
    if not beside_boundary(loop):
        return said
    plant, K = claim.plant, claim.controller
    dt = plant.dt or K.dt
    if plant.order + K.order + (claim.delay / dt if dt else 0) > LARGEST_EXACT:
        return said
    found = stable_loop(plant, K, delay=claim.delay)
    if found.holds or found.unclear:
        return "" if found.holds else said
    if said.startswith("unstable"):
        return said
    where = said.partition("a pole of the nominal loop ")[2].partition(" cannot")[0]
    return f"unstable: the nominal loop has a pole {where}".rstrip() + ", on the stability boundary or beyond it"


def beside_boundary(loop: Loop) -> bool:
    """Whether a pole lies so near the stability boundary that rounding may matter, by a wide margin."""
    closed = loop.closed(("e",), ("r",))
    poles, moved = certain_poles(closed)
    excess = np.abs(poles) - 1 if loop.dt else poles.real
    rounding = np.maximum(moved, EPS * np.linalg.norm(closed.A))  # putting the loop together rounds too
    return bool(np.any(np.abs(excess) <= BESIDE * rounding))
