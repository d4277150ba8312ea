"""Best linear approximations of nonlinear systems, with a bound on their distortion, from one
multisine experiment.

    multisine -> Record -> identify -> Bla

`dir(nlfrf)` lists the names that most scripts need. The other public names are in submodules:

    nlfrf.io          files: records, results, FRFs and drive traces
    nlfrf.rig         simulated machines: a mass with friction, a two-axis stage, a servo axis
    nlfrf.friction    friction laws
    nlfrf.hysteresis  force over displacement of friction before it slides
    nlfrf.bla         singular values and relative gains of a measured matrix
    nlfrf.signals     excited and detection lines, experiments on a running drive
    nlfrf.plot        pictures

"""

import lazy_loader

if not hasattr(lazy_loader, "attach_stub"):
    raise ImportError(f"{lazy_loader.__file__} hides the package 'lazy_loader': rename that file")

__version__ = "0.1.0"

__getattr__, __dir__, _names = lazy_loader.attach_stub(__name__, __file__)
_submodules = ("bla", "friction", "hysteresis", "io", "plot", "rig", "signals")
__all__ = [name for name in _names if name not in _submodules]
