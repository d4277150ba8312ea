"""Experiments on a servo axis under its running drive: design, simulation, and the levels of a
pre-test.

axis_file  axis and drive in a TOML file
design     a multisine for a set point of the drive: its spectrum of force, base motion, limits, level pre-test
levels     the levels to use, from the trace of a pre-test
loop       the transfer function from a port of the drive to force and position
play       a simulated axis instead of the machine: set points in, a trace out
"""
