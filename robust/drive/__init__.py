"""The language of a drive: position P and velocity PI with their filters, both ways, checked against traces.

blocks             the gains of a drive as blocks of `tune`, and back
check              the entry point: gains of a drive checked against traces of its axis
controller_gains   a controller as the gains of a drive
cures              what a change of the drive does to a friction verdict
feedforward_gains  mass, friction and jerk as gains of the drive, and what they leave
friction           friction in the loop of a drive, read from traces at rest, and the proof with it
gains_file         gains in a TOML file, every number with its unit
p_pi               the gains of a drive as one controller
plc                a function block for a PLC
simulation         an axis as it was read, run under its drive: whether it rests, and what to change where it hunts
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
