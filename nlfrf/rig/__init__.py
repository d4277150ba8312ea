"""Simulated machines with friction.

bench    the friction rig, simulated
kernels  compiled steps of friction laws and of sampled loops; numba is imported only here
laws     friction laws and hysteresis
studies  the figures of the paper, and what was found beside them
"""
