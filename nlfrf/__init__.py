"""Best linear approximations of nonlinear systems, with a bound on their distortion, from one multisine experiment.

    multisine -> Record -> identify -> Bla

`dir(nlfrf)` shows what most scripts need. The rest is in submodules, each of which is loaded when it is first used:

    nlfrf.axis        experiments on a running drive: design, level pre-test, traces
    nlfrf.io          files: records, results, designs, inspection
    nlfrf.rig         simulated machines: the friction rig, the stage, the servo axis, a controller around them
    nlfrf.friction    friction laws
    nlfrf.hysteresis  virgin curves of presliding friction
    nlfrf.plot        pictures

Every name of `nlfrf.io` and `nlfrf.rig` is also found here, as in version 0.1.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, _, _names = lazy_loader.attach_stub(__name__, __file__)
_submodules = ("axis", "friction", "hysteresis", "io", "plot", "rig")
#: Every public name of the package, those of its submodules, too.
_public_names = tuple(name for name in _names if name not in _submodules)
__all__ = [
    "Bla",
    "DataWarning",
    "Multisine",
    "Record",
    "bla_from_frf",
    "export_csv",
    "identify",
    "identify_noise",
    "inspect_file",
    "join_records",
    "level_study",
    "load",
    "load_record",
    "multisine",
    "paper_rig",
    "record_from_samples",
    "reduce_crest",
    "save",
    "second_opinion",
    "servo_axis",
    "simulate",
    "simulate_loop",
]


def __dir__() -> list[str]:
    """Return the names that most scripts need, and the submodules that hold the others."""
    return sorted([*__all__, *_submodules])
