"""The gains of a drive: as a controller and back, as blocks, in a file, for a PLC.

blocks       the gains of a drive as blocks of `tune`, and back
controller   a controller as the gains of a drive
feedforward  mass, friction and jerk as gains of the drive, and the remaining force
gains_file   gains in a TOML file, every number with its unit
p_pi         the gains of a drive as one controller
plc          a function block for a PLC
"""
