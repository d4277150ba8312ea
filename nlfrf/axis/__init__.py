"""Experiments on a servo axis under its running drive: designed, played, read back.

    axis_file  axis and drive in a TOML file
    design     a multisine for a set point of the drive: its spectrum of force, base motion, limits, level pre-test
    levels     which levels to take, from the trace of a level pre-test
    loop       the transfer from a port of the drive to force and position, computed or measured
    play       the simulated axis in place of a drive: a file to play in, a trace out
    trace      the trace of a drive, read into records, with its faults

`save` writes what is played, `load` reads the design back.
"""

import lazy_loader

from nlfrf.rig.bench.drive import Drive as Drive
from nlfrf.signals.axis_experiment import AxisExperiment as AxisExperiment
from nlfrf.signals.axis_experiment import AxisLimits as AxisLimits

__getattr__, _, _late = lazy_loader.attach(
    __name__,
    submod_attrs={
        "design": ["design_experiment", "design_ramp"],
        "levels": ["AxisLevels", "FrictionRegime", "find_levels"],
        "play": ["play_experiment"],
        "trace": ["LevelWarning", "load_trace"],
    },
)
__all__ = sorted(["AxisExperiment", "AxisLimits", "Drive", *_late])


def __dir__() -> list[str]:
    return __all__
