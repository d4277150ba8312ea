"""Experiments on a servo axis under its running drive: designed, played, and the levels of a pre-test.

axis_file  axis and drive in a TOML file
design     a multisine for a set point of the drive: its spectrum of force, base motion, limits, level pre-test
levels     which levels to take, from the trace of a level pre-test
loop       the transfer from a port of the drive to force and position, computed or measured
play       the simulated axis in place of a drive: a file to play in, a trace out
"""
