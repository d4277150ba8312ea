"""Linear systems: state space, responses, sampling, norms, grids, stability.

connections  connections, closed loops, linear fractional transformations
grids        frequency grids that see every mode, and the peaks of curves on them
lti          response at frequencies, poles, zeros, sampling time; states in units of their own
low_frequency  what a plant does below the first line of its FRF: integrators, sign, response
minimal      modes of the entries of a transfer matrix, summed with as few states as it has
norms        norms, Riccati equations, the bilinear map
realisation  whatever a user calls a system, an FRF or a weight, checked, as one state space; roots into sections
sampling     plants behind hold and delay as a sampled controller sees them; controllers made discrete
stability    stability from a realisation or by Nyquist
truncation   systems of lower order: balanced, seen through weights, by coprime factors
wiring       systems joined by the names of their signals, some of them left out as ports
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
