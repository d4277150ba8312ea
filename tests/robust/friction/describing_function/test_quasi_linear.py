"""Friction as a spring and a damper of its amplitude: closed forms, and the compiled bench as judge."""

import warnings

import control
import numpy as np
import pytest

import nlfrf
from nlfrf.friction import Coulomb, VaryingSliders
from robust import friction_plant, prove_friction
from robust.friction import quasi_linear
from robust.friction.classes import any_maxwell_slip
from robust.friction.describing_function import describing_function
from robust.friction.passivity import measured_impedances
from tests.support.friction_loops import ORACLES, RIG, T, pid
from tests.support.printed import unwrapped

FRICTION = nlfrf.paper_rig().friction
A = np.geomspace(1e-6, 1e-1, 31)


def integrator(gain):
    return control.StateSpace([[1.0]], [[1.0]], [[gain]], [[0.0]], T)


def test_an_elastic_plastic_element_has_its_closed_form():
    """O7: k (1, theta - sin(2 theta)/2) / pi and 4 W (1 - W/(k a)) / (pi a), at 64 kN/m, 1 N and 20 um."""
    stop = VaryingSliders(stiffness=[64e3], strength=[1.0])
    N = describing_function(stop, 2e-5, 300.0)
    assert N.real == pytest.approx(53644.66, rel=2e-4)
    assert N.imag == pytest.approx(13926.06, rel=2e-4)
    assert describing_function(stop, 1e-5, 50.0) == pytest.approx(64e3, rel=1e-6)


def test_coulomb_friction_is_a_damper_alone():
    for a in (1e-5, 1e-3):
        N = describing_function(Coulomb(Fc=0.7, sigma2=5.0), a, 200.0)
        assert N.imag == pytest.approx(4 * 0.7 / (np.pi * a), rel=1e-3)
        assert abs(N.real) < 1e-9 * N.imag


def test_coulomb_friction_on_negative_damping_runs_away_from_4_fc_over_pi_w_c():
    """O5: c = -4 Ns/m, k = 80 kN/m, Fc = 0.7 N, continuous."""
    machine = friction_plant(control.ss([[0, 1], [-8e4, 4]], [[0], [1]], [[1, 0]], 0))
    found = quasi_linear(Coulomb(Fc=0.7), machine, 0.0, amplitudes=A)
    assert found.amplitude == pytest.approx(7.87777e-4, rel=2e-3)
    assert found.kick == pytest.approx(found.amplitude * found.omega)
    assert found.cycles.size == 0
    assert "not proved" in unwrapped(found)


@pytest.mark.parametrize(("zeta", "omega", "Fc"), [(0.1, 100.0, 1.0), (0.02, 30.0, 5.0), (0.2, 2000.0, 0.1)])
def test_rigid_friction_on_negative_damping_has_its_closed_form_at_the_default_amplitudes(zeta, omega, Fc):
    """O5: a mass on a spring with negative damping grows beyond Fc coth(pi zeta/(2 sqrt(1 - zeta^2)))/k.

    While the friction holds, the loop does not swing. The frequency of the slow pole that is left of it says nothing
    of a motion: driven there, the friction came out as a damper some ten times too strong, and the limit 66 % too high.
    """
    A = [[0, 1], [-(omega**2), 2 * zeta * omega]]
    machine = friction_plant(control.ss(A, [[0], [1]], [[1, 0]], 0))
    exact = Fc / np.tanh(np.pi * zeta / 2 / np.sqrt(1 - zeta**2)) / omega**2
    found = quasi_linear(Coulomb(Fc=Fc), machine, 0.0)
    assert 1 - 1.2 * (np.pi * zeta / 2) ** 2 / 3 - 1e-3 < found.amplitude / exact < 1 + 1e-3
    assert found.omega == pytest.approx(omega, rel=1e-2)


def test_a_boundary_is_crossed_where_the_motion_begins_to_grow():
    found = quasi_linear(FRICTION, RIG, integrator(400.0), amplitudes=A)
    i = np.searchsorted(found.amplitudes, found.amplitude)
    falls, grows = found.frequencies[i - 1 : i + 1] * found.dampings[i - 1 : i + 1]
    nearest = found.boundary[np.argmin(np.abs(found.boundary_omega - found.omega))]
    assert grows < nearest.imag < falls
    proof = prove_friction(RIG, integrator(400.0), any_maxwell_slip(64e3), Fs=1.0)
    assert 0.5 < found.kick / proof.kick_sure < 1  # what is sure for every friction of 1 N is sure for this one


def test_it_says_where_it_is_blind():
    (Kp, Ki, Kd, delay), _, _ = ORACLES["P1"]
    assert "hunting" in quasi_linear(FRICTION, RIG, pid(Kp, Ki, Kd), delay=delay, amplitudes=A).not_claimed
    assert "hunting" not in quasi_linear(FRICTION, RIG, 1e3, amplitudes=A).not_claimed


def test_levels_give_back_the_spring_and_damper_they_were_made_with():
    from tests.support.bla import make_bla

    f = np.arange(5, 200, 0.5)
    springs = {1e-6: (60e3, 20.0), 1e-4: (3e3, 9.0)}
    for swing, (k, c) in springs.items():
        bla = make_bla(lambda s, k=k, c=c: 1 / (s**2 + (0.4 + c) * s + 80e3 + k), f, f0=0.5)
        (level,) = [measured_impedances([bla], RIG)]
        assert level.stiffness[0] == pytest.approx(k, rel=1e-3), swing
        assert level.damping[0] == pytest.approx(c, rel=1e-3)


@pytest.mark.parametrize(("rms", "least"), [(2.0, 0.8), (20.0, 0.9)])
def test_outcomes_are_those_of_the_bench(rms, least):
    """A seeded part of benchmarks.bench_quasi_linear: integral action and damping from timid to far too bold."""
    rng = np.random.default_rng(3)
    burst = rms * rng.standard_normal(300)
    force = np.append(burst, np.zeros(900))
    controllers = [integrator(g) for g in np.geomspace(20, 4e4, 6)]
    controllers += [pid(2e4, g, 40.0) for g in np.geomspace(1e4, 3e7, 6)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        seen = nlfrf.rig.run_loops(
            nlfrf.paper_rig(),
            np.zeros(force.size),
            [nlfrf.rig.Controller(K, saturation=1e3) for K in controllers],
            disturbance=force,
        )
    moves = np.array([response.outcome(0.3) in ("limit cycle", "ran away") for response in seen])
    found = [quasi_linear(FRICTION, RIG, K, burst=burst, amplitudes=A) for K in controllers]
    said = np.array([prediction.outcome != "settled" for prediction in found])
    assert 2 < moves.sum() < 11
    assert np.mean(said == moves) >= least


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((FRICTION, 3.0, 1.0), "machine must be a friction_plant, got 3.0"),
        (([], RIG, 1.0), "friction must be a law or at least one BLA, got none"),
        (([3.0], RIG, 1.0), "friction must be a law or BLAs from nlfrf.identify, got 3.0"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ValueError, match=message):
        quasi_linear(*arguments)


def test_refusals_of_options():
    with pytest.raises(ValueError, match="burst must be left out with a continuous controller"):
        quasi_linear(FRICTION, RIG, 1e3, burst=np.ones(3), amplitudes=A)
    with pytest.raises(ValueError, match="amplitudes must be at least two, positive and rising"):
        quasi_linear(FRICTION, RIG, 1e3, amplitudes=[2.0, 1.0])
