"""Machine and friction of an axis, read from what was measured of it.

assumed_class   ``FrictionClass``: machine and class that a proof assumes, made of numbers with intervals
balance         forces along measured motions, and the search for a machine that balances them
force           mass, delay and force of any friction, from an axis in motion and at rest
friction_class  the entry point: machine and class from BLAs, from records, or from what was identified
from_blas       machine and stiffness of the friction from BLAs at several levels, and what of it is refused
from_fit        machine and friction of a fit, of one mass or of a motor and a load
identification  the entry point: machine and friction with intervals, from records at several levels
in_motion       mass, viscous and Coulomb friction of an axis in motion
levels          what levels have to be before anything is read from them
load            where the search for a motor and a load begins
"""
