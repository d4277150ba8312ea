"""Virgin curves in closed form, and Maxwell-slip elements made of the chords of one."""

import numpy as np

import nlfrf


def virgin(curve, z):
    """The force y(z) on the way out from rest [N]."""
    a, forces = (
        np.abs(z),
        {
            nlfrf.hysteresis.Linear: lambda a: curve.K0 * a,
            nlfrf.hysteresis.Tanh: lambda a: curve.Fy * np.tanh(curve.K0 * a / curve.Fy),
            nlfrf.hysteresis.Exponential: lambda a: (
                curve.Fy * (1 - np.exp(-curve.K0 * a / curve.Fy))
            ),
            nlfrf.hysteresis.Parabola: lambda a: (
                curve.Fy * (1 - np.maximum(1 - curve.K0 * a / (2 * curve.Fy), 0) ** 2)
            ),
            nlfrf.hysteresis.ElasticPlastic: lambda a: np.minimum(curve.K0 * a, curve.Fy),
            nlfrf.hysteresis.Table: lambda a: np.interp(
                a, np.append(0, curve.z), np.append(0, curve.F)
            ),
            nlfrf.hysteresis.MaxwellSlip: lambda a: np.minimum(
                np.multiply.outer(a, curve.stiffness), curve.strength
            ).sum(axis=-1),
        },
    )
    return np.sign(z) * forces[type(curve)](a)


def chord_elements(curve, knots):
    """Elements that slip at the knots (E,) [m], their forces together those of the curve there;
    flat beyond.
    """
    slope = np.append(np.diff(virgin(curve, knots), prepend=0.0) / np.diff(knots, prepend=0.0), 0.0)
    stiffness = -np.diff(slope)
    return nlfrf.hysteresis.MaxwellSlip(stiffness=stiffness, strength=stiffness * knots)
