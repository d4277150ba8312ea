from .certify import certify_mu as certify_mu
from .gain import worst_gain as worst_gain
from .lmi import mu_upper_lmi as mu_upper_lmi
from .lower import mu_lower as mu_lower
from .parameters import ParameterMargin as ParameterMargin
from .parameters import parameter_margin as parameter_margin
from .upper import MuBound as MuBound
from .upper import mu_upper as mu_upper
