"""Proofs: search for certificates in floating point, and verification in exact arithmetic.

exact   verification in exact arithmetic
search  search for certificates
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
