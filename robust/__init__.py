"""Robust control design on a measured FRF: uncertainty models, weights, controllers, and a check with proofs.

    Bla -> fit_nominal -> uncertainty -> UncertaintyModel -> ncfsyn -> K -> check -> RobustnessReport

What `tune` takes is in `robust.tuning`.

The public names stand in `__init__.pyi`, by wing; each is loaded when it is first asked for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__.remove("tuning")  # a part of the package that is public as a whole, no name of its own
