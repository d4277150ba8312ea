"""Best linear approximations of nonlinear systems, with a bound on their distortion, from one multisine experiment.

    multisine -> Record -> identify -> Bla

Pictures are in `nlfrf.plot`, friction laws in `nlfrf.friction`, hysteresis in `nlfrf.hysteresis`.

The public names stand in `__init__.pyi`, by wing; each is loaded when it is first asked for.
"""

from importlib import import_module
from typing import Any

import lazy_loader

__version__ = "0.1.0"

public_name, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """A public name, or a part of the package that is public as a whole."""
    return import_module(f"nlfrf.{name}") if name in ("friction", "hysteresis", "plot") else public_name(name)
