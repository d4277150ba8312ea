"""Best linear approximations of nonlinear systems, with a bound on their distortion, from one
multisine experiment.

    multisine -> Record -> identify -> Bla

`dir(nlfrf)` lists the names for most scripts. The rest is in submodules, each loaded at its first
use:

    nlfrf.io          files: records, results, designs, inspection
    nlfrf.rig         simulated machines: the friction rig, the stage, the servo axis, a controller around them
    nlfrf.friction    friction laws
    nlfrf.hysteresis  virgin curves of presliding friction
    nlfrf.bla         levels of distortion, gains of a matrix, the second opinion
    nlfrf.signals     grids of lines, multisines for several inputs
    nlfrf.plot        pictures

Each public name is in one place.
"""

import lazy_loader

if not hasattr(lazy_loader, "attach_stub"):
    raise ImportError(f"{lazy_loader.__file__} hides the package 'lazy_loader': rename that file")

__version__ = "0.1.0"

__getattr__, __dir__, _names = lazy_loader.attach_stub(__name__, __file__)
_submodules = ("bla", "friction", "hysteresis", "io", "plot", "rig", "signals")
__all__ = [name for name in _names if name not in _submodules]
