from nlfrf.rig.bench.drive import Drive as Drive
from nlfrf.signals.axis_experiment import AxisExperiment as AxisExperiment
from nlfrf.signals.axis_experiment import AxisLimits as AxisLimits

from .design import design_experiment as design_experiment
from .design import design_ramp as design_ramp
from .levels import AxisLevels as AxisLevels
from .levels import FrictionRegime as FrictionRegime
from .levels import find_levels as find_levels
from .play import play_experiment as play_experiment
from .trace import LevelWarning as LevelWarning
from .trace import load_trace as load_trace
