"""Robust control design on a measured FRF: uncertainty models, weights, controllers, and a check with proofs.

    Bla -> fit_nominal -> uncertainty -> UncertaintyModel -> ncfsyn -> K -> check -> RobustnessReport

What `tune` takes is in `robust.tuning`.

The public names stand in `__init__.pyi`, by wing; each is loaded when it is first asked for.
"""

from importlib import import_module
from typing import Any

import lazy_loader

public_name, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """A public name, or a part of the package that is public as a whole."""
    return import_module(f"robust.{name}") if name == "tuning" else public_name(name)
