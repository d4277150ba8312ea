"""Excitation signals: harmonic grids, multisines, orthogonal sets, crest factor.

axis_experiment  what is played into a running drive: multisine, port, base motion, levels
crest            peaks: crest factors lowered or drawn low, and what random phases are expected to have
lines            harmonic grids: excited lines, detection lines, which grid a set of lines is
multisine        the design of a random-phase multisine
orthogonal       several inputs: orthogonal sets of experiments, zippered lines
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
