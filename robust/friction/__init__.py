"""Loops with friction: the plant, classes of friction, proofs for a class, saturation, describing function.

balance              forces along measured motions, and the search for a machine that balances them
classes              classes of friction laws, without their parameters
describing_function  the entry point: amplitude, initial velocity and outcome of a loop around given friction
dissipation          the dissipation inequality of the multipliers, in states that come to rest
exact                verification of friction proofs in exact arithmetic
force                mass, delay and force of any friction, from an axis in motion and at rest
identification       the entry point: machine and friction with intervals, from records at several levels
in_motion            mass, viscous and Coulomb friction of an axis in motion
levels               machine and class read from BLAs at several levels, and what of it is refused
load                 where the search for a motor and a load begins
linear_uncertainty   the class beside an LTI error of the linear part: a test at frequencies, no proof
multipliers          weights of filters on the friction, by a linear program
passivity            every passive friction: what damping a loop leaves at its port
plant                a machine with friction and its sampled loop; bounded motion
ports                friction at several places: weights of the filters at each, and a bound
prove                a proof for every friction of a class
reading              the entry point: machine and class from BLAs or records at several levels
saturation           a machine with friction whose actuator saturates
settling             how far from rest friction with stiction can keep a loop
storage              quadratic storage functions, and polynomials that keep their sign
two_masses           machine and class of a motor and a load that were identified
units                units of an axis that moves or turns
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
