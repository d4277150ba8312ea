from .both_bounds import StructuredBounds as StructuredBounds
from .both_bounds import bounds as bounds
from .both_bounds import worst_gain as worst_gain
from .certification import certify as certify
from .parameters import parameter_margin as parameter_margin
from .perturbations import lower as lower
from .scalings import MuBound as MuBound
from .scalings import upper as upper
