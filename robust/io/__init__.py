"""Files: models, controllers, certificates, gains of controllers, MATLAB.

biquads       second-order sections of a discrete controller
rounded       a sampled controller in the arithmetic of its target, with bounds on the rounding
rounded_schedule  the same for a schedule, whose coefficients are polynomials
target_code   a sampled controller as a C header or a function block in structured text
python_script a model as a script for python-control
certificates  proofs in files, to be repeated by others
frd           an FRF of python-control as a `Bla`
learning      learning filters as JSON
matlab        MATLAB structs, and a loader for them
from_matlab   systems that MATLAB saved
models        models and controllers as JSON with a schema, exact to the bit
stored        files of any kind, by their schema: the part of `nlfrf.load` and `nlfrf.save` for this package
pid           a PID controller as its gains, and as the lines to type into a programmable controller
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
