"""Robust control design on a measured FRF: uncertainty models, weights, controllers, and a check
with proofs.

    Bla -> fit_nominal -> uncertainty -> UncertaintyModel -> ncfsyn -> K -> check ->
    RobustnessReport

`dir(robust)` shows what most scripts need. The rest is in submodules, each of which is loaded when
it is first used:

    robust.models    nominal models, weights, sets of plants, validation
    robust.synthesis H-infinity, D-K iteration, fixed structure, tuning, two degrees of freedom, reduction
    robust.tuning    what `tune` takes: blocks, limits, plants
    robust.servo     a servo axis: gains of its drive as a controller and back, a check against traces, PLC code
    robust.shaping   loop shaping by hand: lead, lag, notch, PID, bounds on |L|
    robust.analysis  check, worst case, families of loops, gains, step responses, levels of motion
    robust.margins   disk margins, classical margins, nu-gap
    robust.mu        bounds on the structured singular value, certificates, real parameters
    robust.friction  machines with friction: classes, proofs, saturation
    robust.scheduling  gain scheduling: proofs while the operating point moves
    robust.proofs    certificates
    robust.lti       sampled plants, discrete controllers
    robust.io        files: models, controllers, certificates, gains for a PLC, MATLAB
    robust.reports   pages
    robust.plot      pictures

Each public name is in one module only.
"""

import lazy_loader

if not hasattr(lazy_loader, "attach_stub"):
    raise ImportError(f"{lazy_loader.__file__} hides the package 'lazy_loader': rename that file")

__getattr__, __dir__, _names = lazy_loader.attach_stub(__name__, __file__)
_submodules = (
    *(
        "analysis",
        "friction",
        "io",
        "lti",
        "margins",
        "models",
        "mu",
        "plot",
        "proofs",
        "reports",
        "scheduling",
        "servo",
    ),
    *("shaping", "synthesis", "tuning"),
)
__all__ = [name for name in _names if name not in _submodules]
