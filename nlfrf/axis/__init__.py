"""Experiments on a servo axis under its running drive: designed, played, read back.

    axis_file  axis and drive in a TOML file
    design     a multisine for a set point of the drive: its spectrum of force, base motion, limits, level pre-test
    levels     which levels to take, from the trace of a level pre-test
    loop       the transfer from a port of the drive to force and position, computed or measured
    play       the simulated axis in place of a drive: a file to play in, a trace out
    trace      the trace of a drive, read into records, with its faults

`save` writes what is played, `load` reads the design back.
"""

from nlfrf.axis.design import design_experiment, design_ramp
from nlfrf.axis.levels import AxisLevels, FrictionRegime, find_levels
from nlfrf.axis.play import play_experiment
from nlfrf.axis.trace import LevelWarning, load_trace
from nlfrf.rig.bench.drive import Drive
from nlfrf.signals.axis_experiment import AxisExperiment, AxisLimits

__all__ = [
    "AxisExperiment",
    "AxisLevels",
    "AxisLimits",
    "Drive",
    "FrictionRegime",
    "LevelWarning",
    "design_experiment",
    "design_ramp",
    "find_levels",
    "load_trace",
    "play_experiment",
]
