"""Simulated machines with friction.

bench    the friction rig, simulated
kernels  compiled steps of friction laws and of sampled loops; numba is imported only here
laws     friction laws and hysteresis
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
