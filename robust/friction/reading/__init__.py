"""Machine and friction of an axis, estimated from measurements.

assumed_class   ``MachineWithFriction``: machine and class that a proof assumes, made of numbers with intervals
balance         forces along measured motions, and what a candidate machine leaves of them
flexibility     signs in the levels that the machine is not one rigid mass
force           mass, delay and force of any friction, from an axis in motion and at rest
friction_fit    `FrictionFit`: machine and friction identified, and what the levels leave open
from_blas       machine and stiffness of the friction from BLAs at several levels, and the refusals
from_fit        machine and friction of a fit, for one mass or for a motor and a load
identification  the entry point: machine and friction with intervals, from records at several levels
in_motion       mass, viscous and Coulomb friction of an axis in motion
intervals       standard deviations of the numbers of a fitted machine
levels          conditions that levels must satisfy before they are used
load            starts of the search for a motor and a load
machine_with_friction  the entry point: machine and class from BLAs, from records, or from an identified fit
numbers         estimated numbers of a machine: intervals, units, text
questions       the questions that levels leave open, and what to measure
search          the search for a machine that balances the forces
"""
