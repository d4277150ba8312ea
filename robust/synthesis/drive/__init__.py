"""The language of a drive: position P and velocity PI with their filters, both ways.

blocks           the gains of a drive as blocks of `tune`, and back
cascade          the gains of a drive as one controller
cures            what a change of the drive does to a friction verdict
feedforward      mass, friction and jerk as gains of the drive, and what they leave
filters          filter slots: notch, low-pass, biquad
gains            a controller as the gains of a drive
gains_file       gains in a TOML file, every number with its unit
settings         the settings of a drive, with their units
structured_text  a function block for a PLC
"""
