"""Synthesis of controllers.

blocks         elements of controllers: what all share, the free parameters for `tune`, sections of a drive
conic          convex programs of designs, in the form of the solver
fixed          controllers of fixed structure, from the FRF or with a proof
filters        blocks of first and second order: notch, lead, lag, low-pass, biquad
hinf           H-infinity synthesis
learning       iterative learning control: the next input of a trial that repeats
matrix_blocks  blocks whose numbers are matrices: a gain, a system of a given order
pid            the PID as a block
pid_file       a PID with its filters in a TOML file, as blocks
reduction      a controller of lower order that keeps the proved properties
shaping        compensators: lead, lag, notch, low-pass, PID
tuning         blocks of any structure in any loops, tuned together for several plants
two_dof        prefilter and feedforward filter
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
