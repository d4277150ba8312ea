from .biquads import controller_sections as controller_sections
from .certificates import verify_certificate as verify_certificate
from .frd import bla_from_frd as bla_from_frd
from .matlab import export_matlab as export_matlab
from .pid import PidGains as PidGains
from .pid import pid_gains as pid_gains
