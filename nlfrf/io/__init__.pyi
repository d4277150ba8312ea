from .axis_trace import LevelWarning as LevelWarning
from .axis_trace import in_design_units as in_design_units
from .axis_trace import load_trace as load_trace
from .designs import SetPoints as SetPoints
from .designs import load_set_points as load_set_points
from .frf_tables import load_frf as load_frf
from .readers.matlab import read_mat as read_mat
