"""Gain scheduling: proofs for a loop whose operating point moves.

attack  trajectories on which a scheduled loop grows
prove   `prove_schedule`: proved, refuted by a trajectory, or not decided
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
