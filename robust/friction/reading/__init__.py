"""Machine and friction of an axis, read from what was measured of it.

balance         forces along measured motions, and the search for a machine that balances them
force           mass, delay and force of any friction, from an axis in motion and at rest
friction_class  the entry point: machine and class from BLAs or records at several levels
identification  the entry point: machine and friction with intervals, from records at several levels
in_motion       mass, viscous and Coulomb friction of an axis in motion
levels          machine and class read from BLAs at several levels, and what of it is refused
load            where the search for a motor and a load begins
two_masses      machine and class of a motor and a load that were identified
"""
