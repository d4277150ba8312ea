"""Models: a nominal with weights, the set of plants around it, and its validation by records.

fit         fits of nominal models and weights
lpv         `LpvModel`: matrices that are polynomials of an operating point
operating_points  one model from BLAs at several operating points
sets        uncertainty sets
validation  comparison of a second record with a model
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
