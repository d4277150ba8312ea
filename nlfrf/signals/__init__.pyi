from .axis_experiment import AssumedDrive as AssumedDrive
from .axis_experiment import AxisExperiment as AxisExperiment
from .axis_experiment import AxisLimits as AxisLimits
from .lines import LineGrid as LineGrid
