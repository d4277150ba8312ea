"""Linear systems: state space, responses, sampling, norms, grids, stability.

connections  connections, closed loops, linear fractional transformations
grids        frequency grids that resolve every mode, and the peaks of curves on them
lti          response at frequencies, poles, zeros, sampling time; scaling of states
low_frequency  a plant below the first line of its FRF: integrators, sign, response
minimal      minimal realisation of a transfer matrix from the modes of its entries
norms        norms, Riccati equations, the bilinear map
realisation  conversion of any form of system to a checked state space; second-order sections
sampling     plants with hold and delay as discrete systems; discrete controllers
stability    stability from a realisation or by Nyquist
truncation   systems of lower order: balanced, with weights, by coprime factors
wiring       systems connected by the names of their signals, with ports for tuned blocks and FRFs
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
