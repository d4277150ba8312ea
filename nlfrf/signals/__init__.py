"""Excitation signals: harmonic grids, multisines, orthogonal sets, crest factor.

axis_experiment  the experiment on a running drive: multisine, port, base motion, amplitudes
crest            multisines with a lower crest factor; the peaks expected for random phases
lines            harmonic grids: excited lines, detection lines, and the kind of a grid
multisine        the design of a random-phase multisine
orthogonal       several inputs: orthogonal experiments, or zippered lines (each line excites one input)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
