"""Machines made of what was identified: the numbers of a fit, and those at the ends of its
intervals.
"""

from dataclasses import replace

import numpy as np
import pytest

from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.reading.from_fit import machines_of_fit, plant_of_fit
from robust.friction.reading.in_motion import SlidingFit

NUMBERS = {"mass": 22.0, "damping": 30.0, "delay": 5e-4}
COUPLED = {"load_mass": 15.0, "coupling": 1.3e6, "coupling_damping": 100.0}
SLIDING = SlidingFit(
    **NUMBERS,
    coulomb=20.0,
    offset=0.0,
    stds=dict.fromkeys(NUMBERS, 1.0),
    velocities=np.array([0.1]),
    misfit=1.0,
)
AT_REST = FrictionFit(
    **NUMBERS,
    stiffness=5e3,
    K0=1e6,
    Fs=30.0,
    coulomb=20.0,
    stiction=1.5,
    vs=0.01,
    lag=0.0,
    softening=0.0,
    stds={
        "mass": 0.1,
        "damping": 2.0,
        "stiffness": 500.0,
        "load_mass": 0.2,
        "coupling": 1e4,
        "coupling_damping": 5.0,
    },
    element_stiffness=np.array([1e6]),
    element_strength=np.array([30.0]),
    seen_from=1e-6,
    levels=(),
    questions=(),
)


def frequency_response(plant, s=2j * np.pi * 30.0):
    """Measured position over force at 30 Hz, with the delay."""
    states = np.linalg.solve(s * np.eye(plant.A.shape[0]) - plant.A, plant.B_force)
    return plant.C_measured @ states * np.exp(-s * plant.delay)


@pytest.mark.parametrize("fit", [SLIDING, AT_REST])
def test_the_plant_of_one_mass_is_that_of_its_numbers(fit):
    s = 2j * np.pi * 30.0
    wanted = np.exp(-5e-4 * s) / (22.0 * s**2 + 30.0 * s + 700.0)
    assert frequency_response(plant_of_fit(fit, spring=700.0)) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("encoder", ["motor", "load"])
@pytest.mark.parametrize("fit", [SLIDING, AT_REST])
def test_the_plant_of_two_masses_is_that_of_its_numbers(fit, encoder):
    """Ellis 2012, chapter 16, with viscous friction to ground at either: a fifth of it at the
    motor.
    """
    s = 2j * np.pi * 30.0
    between, at_load = 100.0 * s + 1.3e6, 15.0 * s**2 + 24.0 * s
    denominator = (7.0 * s**2 + 6.0 * s + between) * (at_load + between) - between**2
    wanted = (
        np.exp(-5e-4 * s) * (at_load + between if encoder == "motor" else between) / denominator
    )
    found = plant_of_fit(replace(fit, **COUPLED), load_share=0.8, encoder=encoder)
    assert frequency_response(found) == pytest.approx(wanted, rel=1e-12)


def test_the_machines_of_a_fit_have_the_ends_of_its_intervals():
    """Masses by the force that accelerates them at once, m = 1/b; viscous friction c = -a m; 95 %
    are 1.96 std.
    """
    mass, *others = machines_of_fit(AT_REST)
    assert len(others) == 4
    low, high = AT_REST.interval("mass")
    assert [1 / one.B_force[1] for one in (mass, *others)] == pytest.approx(
        [22.0, low, low, high, high]
    )
    damping = [-one.A[1, 1] / one.B_force[1] for one in (mass, *others)]
    most = AT_REST.interval("damping")[1]
    assert damping == pytest.approx([0.0, 0.0, most, 0.0, most])
    spring = AT_REST.interval("stiffness")[0]
    assert [-one.A[1, 0] / one.B_force[1] for one in (mass, *others)] == pytest.approx([spring] * 5)

    fit = replace(AT_REST, **COUPLED)
    read, *ends = machines_of_fit(fit)
    masses = np.array([1 / np.diag(one.B_port[2:]) for one in (read, *ends)])
    off, load = 1.96 * (0.1 + 0.2), 1.96 * 0.2  # of the motor the deviations of a difference, added
    assert masses[:5] == pytest.approx(
        np.array([[7, 15], [7 - off, 15], [7 + off, 15], [7, 15 - load], [7, 15 + load]]), rel=1e-4
    )
    assert masses[5:] == pytest.approx(np.array([[7.0, 15.0]] * 4))
    coupling = [one.A[2, 1] * 7 for one in ends[4:]]
    assert coupling == pytest.approx([1.3e6 - 1.96e4, 1.3e6 + 1.96e4, 1.3e6, 1.3e6], rel=1e-4)
    viscous = np.array([-(one.A[2:, 2:] * [[7], [15]]).sum(axis=1) for one in ends[4:]])
    assert viscous == pytest.approx(
        np.array([[0, 0], [0, 0], [33.92, 0], [0, 33.92]]), rel=1e-4, abs=1e-9
    )
    assert all(one.delay == 5e-4 for one in (read, *ends))
