from .fixed.structures import ControllerStructure as ControllerStructure
from .hinf.dk import DkDesign as DkDesign
from .hinf.synthesis import Synthesis as Synthesis
from .learning import Learning as Learning
from .reduction import Reduction as Reduction
from .two_dof import feedforward_filter as feedforward_filter
from .two_dof import prefilter as prefilter
