"""Proofs: one loop in exact arithmetic; matrices found in floating point, and where possible
verified exactly.

exact   verification in exact arithmetic
search  search for certificates
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
