"""Robust control design on a measured FRF: uncertainty models, weights, controllers, and a check with proofs.

    Bla -> fit_nominal -> uncertainty -> UncertaintyModel -> ncfsyn -> K -> check -> RobustnessReport

`dir(robust)` shows what most scripts need. The rest is in submodules, each of which is loaded when it is first used:

    robust.models    nominal models, weights, sets of plants, validation
    robust.synthesis H-infinity, D-K iteration, fixed structure, tuning, two degrees of freedom, reduction
    robust.tuning    what `tune` takes: blocks, limits, plants
    robust.drive     gains of a drive (P-PI cascade) as a controller and back, feedforward, PLC code
    robust.shaping   loop shaping by hand: lead, lag, notch, PID, bounds on |L|
    robust.analysis  check, worst case, families of loops, gains, step responses, levels of motion
    robust.margins   disk margins, classical margins, nu-gap
    robust.mu        bounds on the structured singular value, certificates, real parameters
    robust.friction  machines with friction: classes, proofs, saturation, describing function
    robust.proofs    certificates
    robust.lti       sampled plants, discrete controllers
    robust.io        files: models, controllers, certificates, gains for a PLC, MATLAB
    robust.reports   pages
    robust.plot      pictures

Every name of a submodule is also found here, as in version 0.1: `robust.mu_upper` is `robust.mu.mu_upper`.
"""

import lazy_loader

__getattr__, _, _names = lazy_loader.attach_stub(__name__, __file__)
_submodules = (
    *("analysis", "drive", "friction", "io", "lti", "margins", "models", "mu", "plot", "proofs", "reports", "shaping"),
    *("synthesis", "tuning"),
)
#: Every public name of the package, those of its submodules, too.
_public_names = tuple(name for name in _names if name not in _submodules)
__all__ = [
    "Design",
    "RobustnessReport",
    "UncertaintyModel",
    "check",
    "design_frf",
    "disk_margin",
    "dk_iteration",
    "fit_nominal",
    "fit_weight",
    "frd",
    "friction_plant",
    "hinfsyn",
    "load",
    "mixsyn",
    "ncfsyn",
    "performance_weight",
    "prove_friction",
    "reduce_controller",
    "sampled",
    "save",
    "step_response",
    "tune",
    "uncertainty",
    "validate",
    "worst_case",
]


def __dir__() -> list[str]:
    """Return the names that most scripts need, and the submodules that hold the others."""
    return sorted([*__all__, *_submodules])
