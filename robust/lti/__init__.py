"""Linear systems: state space, responses, sampling, norms, grids, stability.

connections  connections, closed loops, linear fractional transformations
grids        frequency grids that resolve every mode, and the peaks of curves on them
lti          response at frequencies, poles, zeros, sampling time; scaling of states
low_frequency  a plant below the first line of its FRF: integrators, sign, response
minimal      modes of the entries of a transfer matrix, summed with a minimal number of states
norms        norms, Riccati equations, the bilinear map
realisation  any form of a system, an FRF or a weight, checked, as one state space; roots into sections
sampling     plants with hold and delay as discrete systems; discrete controllers
stability    stability from a realisation or by Nyquist
truncation   systems of lower order: balanced, with weights, by coprime factors
wiring       systems joined by the names of their signals, with some left out as ports
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
