"""Loops with friction: the plant, classes of friction, proofs for a class, saturation.

bounds     two consequences of a bounded force: divergence, and how far the loop can hunt
classes    classes of friction laws, described by bounds, one module each
exact      verification of friction proofs in exact arithmetic
loop       the loop around a machine while it slides, in time and over frequency
nominal    machines of a nominal model, damped and undamped
plant      a machine without its friction, and the port at which friction acts
proof      proofs that a loop comes to rest, for every friction of a class
reading    machine and friction, estimated from measurements
units      units of an axis that moves or turns
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
