"""Structures of the user's own, and denominators that are given."""

import control
import numpy as np
import pytest

import robust
from robust.synthesis import ControllerStructure

PLANT = control.tf([1], [0.1, 1])


def test_a_pid_by_its_degrees_is_the_pid_by_its_name():
    asked = {"M_S": 1.5, "omega_c": 8.0}
    plant = control.tf([4], [1, 0.8, 4])
    named = robust.design_frf(plant, "PID", filter_time=0.02, **asked)
    own = ControllerStructure(n_zeros=2, n_integrators=1, poles=(-50.0,), name="PID of mine")
    given = robust.design_frf(plant, own, **asked)
    at = 1j * np.array([0.1, 1.0, 10.0])
    assert named.met
    assert given.met
    assert given.K(at) == pytest.approx(named.K(at), rel=0.05)
    assert sorted(given.K.poles().real) == pytest.approx([-50, 0])


@pytest.mark.parametrize("dt", [0.0, 0.002])
def test_a_resonant_denominator_takes_a_known_disturbance_away(dt):
    resonant = ControllerStructure(n_zeros=3, n_integrators=1, poles=(-0.05 + 50j, -0.05 - 50j))
    design = robust.design_frf(PLANT, resonant, M_S=1.7, omega_c=(4.0, 8.0), dt=dt)
    plain = robust.design_frf(PLANT, "PI", M_S=1.7, omega_c=(4.0, 8.0), dt=dt)
    assert design.met
    warped = 2 / dt * np.arctan(50 * dt / 2) if dt else 50.0  # where a sampled controller has them
    left = {}
    for name, K in (("own", design.K), ("PI", plain.K)):
        G = robust.sampled(control.ss(PLANT), dt) if dt else PLANT
        z = np.exp(1j * warped * dt) if dt else 1j * warped
        left[name] = abs(1 / (1 + G(z) * K(z)))
    assert left["own"] < 0.05 < left["PI"]
    p = np.array([-0.05 + 50j, -0.05 - 50j, 0])
    wanted = (1 + p * dt / 2) / (1 - p * dt / 2) if dt else p
    assert np.sort_complex(design.K.poles()) == pytest.approx(np.sort_complex(wanted), rel=1e-6)


def test_poles_that_are_given_are_kept_and_free_ones_are_chosen():
    free = robust.design_frf(
        PLANT, ControllerStructure(n_zeros=1, n_integrators=1, n_poles=1), M_S=1.5
    )
    assert free.K.nstates == 2
    lag = ControllerStructure(n_zeros=1, poles=(-3.0,))
    assert robust.design_frf(PLANT, lag, M_S=1.5, omega_c=5.0).K.poles() == pytest.approx([-3.0])


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"n_zeros": 2, "n_integrators": 1}, "n_zeros must be at most"),
        ({"n_zeros": 0, "poles": (1.0,)}, "poles must be stable"),
        ({"n_zeros": 0, "poles": (-1 + 2j,)}, "conjugate pairs"),
        (
            {"n_zeros": 0, "poles": (-1.0,), "n_poles": 2},
            "n_poles must be the number of the given poles",
        ),
        ({"n_zeros": -1}, "n_zeros must be"),
        ({"n_zeros": 0, "n_integrators": 30}, "at most 12"),
    ],
)
def test_what_is_no_structure_is_refused(fields, said):
    with pytest.raises(ValueError, match=said) as refused:
        ControllerStructure(**fields)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("beside", [{"filter_time": 0.1}, {"integrators": 1}])
def test_what_a_structure_says_is_not_said_twice(beside):
    with pytest.raises(ValueError, match="left out with a ControllerStructure"):
        robust.design_frf(PLANT, ControllerStructure(n_zeros=1, n_integrators=1), M_S=1.5, **beside)
