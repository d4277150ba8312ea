"""What a check claims of a loop, put into the exact form in which someone else can prove it again."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robust.certificates.certificate import Certificate
from robust.systems.realisation import state_space
from robust.uncertain.forms import FORMS
from robust.uncertain.model import UncertaintyModel
from robust.verification.claim import STABILITY, LoopClaim, as_given

__all__ = ["claim_of", "claimed"]


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
