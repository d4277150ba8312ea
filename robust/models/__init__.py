"""Models: a nominal with weights, the set of plants around it, and its validation by records.

fit         fits
lpv         `LpvModel`: matrices that are polynomials of an operating point
operating_points  one model from BLAs at several operating points
sets        uncertainty sets
validation  does a record contradict a model, does another record confirm it
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
