"""Maxwell-slip elements whose virgin curve is made of the chords of another one."""

import numpy as np

from nlfrf.hysteresis import MaxwellSlip


def chord_elements(curve, knots):
    """Elements that slip at the knots (E,) [m], their forces together those of the curve there; flat beyond."""
    slope = np.append(np.diff(curve(knots), prepend=0.0) / np.diff(knots, prepend=0.0), 0.0)
    stiffness = -np.diff(slope)
    return MaxwellSlip(stiffness=stiffness, strength=stiffness * knots)
