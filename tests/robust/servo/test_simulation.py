"""An axis as it was read, run under its drive: what it does in the end, and which change of the
drive is advised.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import nlfrf
from nlfrf.rig import Drive
from robust.friction.reading.force import FrictionForce
from robust.friction.reading.in_motion import SlidingFit
from robust.servo import check
from robust.servo.checking.rest import bound_and_simulate
from robust.servo.checking.simulation import simulate_rest, with_advice
from tests.support.linear_axis import frictionless, settings_of

#: Simulated runs, and how many of them must move for ever to be called hunting.
RUNS, FEWEST = 12, 4
#: A kilogram with 1 N of Coulomb friction, and gains that hunt where stiction is twice that.
SETTINGS = Drive(fs=2000, kv=60, kp=200, kp_unit="N/(m/s)", tn=0.012)


def force(stiction=2.0, *, K0=(np.nan, np.nan), stribeck=(1e-3, 2e-3), creeps=False):
    """The force of friction as read, known to 5 %."""
    sliding = SlidingFit(
        mass=1.0,
        damping=0.5,
        coulomb=1.0,
        offset=np.nan,
        delay=5e-4,
        stds={"mass": 0.005, "damping": 0.05, "coulomb": 0.02, "delay": 1e-6},
        velocities=np.array([0.1]),
        misfit=1.0,
    )
    return FrictionForce(
        sliding=sliding,
        Fs=stiction * np.array([0.98, 1.03]),
        K0=np.array(K0),
        bristle_time=np.nan,
        creeps=creeps,
        stribeck=np.array(stribeck),
    )


@pytest.fixture(scope="module")
def linear():
    """The check of one linear trace, whose friction is unknown."""
    axis = frictionless("linear motor", kv=20, kp=40, tn=0.05)
    ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rms=5, rng=1)
    record = nlfrf.rig.simulate_servo(axis, ms, n_periods=3)
    noise = 1e-3 * np.std(record.y) * np.random.default_rng(0).standard_normal(record.y.shape)
    found = check([replace(record, y=record.y + noise)], settings_of(axis))
    assert found.linear_passed
    return found


@pytest.fixture(scope="module")
def unknown(linear):
    """The friction of a drive of which nothing is known."""
    return replace(linear.friction, note="", unsimulated="")


def runs(amplitudes, periods=1.0):
    """The end of simulated runs, with these amplitudes and periods."""
    found = simulate_rest(force(1.0), SETTINGS)
    ended = {"amplitudes": amplitudes * np.ones(RUNS), "periods": periods * np.ones(RUNS)}
    return replace(found, laws=("rigid",), offsets=None, **ended)


def test_stiction_makes_an_axis_hunt_and_no_stiction_lets_it_rest():
    """A loop with integral part hunts under much stiction, and comes to rest where the force does
    not fall with speed.

    Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, 4.2: hunting takes a static friction above
    Coulomb friction.
    """
    hunting = simulate_rest(force(3.0), SETTINGS)
    assert hunting.hunts
    assert np.count_nonzero(hunting.amplitudes) > RUNS / 2
    assert (
        1e-5 < hunting.amplitude < 3.0 / (SETTINGS.kp * SETTINGS.kv)
    )  # below what holds the largest friction
    assert np.nanmin(hunting.periods) > 4 * SETTINGS.tn
    resting = simulate_rest(force(1.0), SETTINGS)
    assert not resting.amplitudes.any()
    assert "rests in all of 12 runs" in str(resting)
    assert not simulate_rest(force(3.0), replace(SETTINGS, tn=np.inf)).amplitudes.any()
    assert not simulate_rest(force(3.0, stribeck=(0.5, 1.0)), SETTINGS).amplitudes.any()


@pytest.mark.parametrize("K0", [(5e6, 6e6), (2e6, np.inf)])
def test_laws_of_friction_hunt_alike(K0):
    found = simulate_rest(force(3.0, K0=K0), SETTINGS)
    several = found.amplitudes[found.amplitudes > 0]
    assert several.size > RUNS / 2
    assert np.ptp(several) < np.median(several)


def test_the_records_refute_laws():
    for stiction, more, laws in (
        (2.0, {}, ("rigid", "Maxwell slip or GMS", "LuGre", "Leuven")),
        (1.0, {}, ("rigid", "Maxwell slip or GMS", "Dahl", "LuGre", "Leuven")),
        (2.0, {"K0": (1e5, 2e5)}, ("Maxwell slip or GMS", "LuGre", "Leuven")),
        (1.0, {"K0": (1e5, 2e5), "creeps": True}, ("Dahl", "LuGre", "Leuven")),
    ):
        assert simulate_rest(force(stiction, **more), SETTINGS).laws == laws


def simulated(unknown, force, settings=SETTINGS, *, fit=None, masses=1):
    """The friction of a drive after its simulation, in a linear loop with every margin."""
    margins, proofs = SimpleNamespace(S_worst=1.2), SimpleNamespace(robustly_stable=True)
    report = SimpleNamespace(nominally_stable=True, proofs=proofs, peak=2.0, margins=margins)
    loop = SimpleNamespace(stable=True, machine=None, model=None, report=report, unit="N")
    return bound_and_simulate(
        replace(unknown, force=force, fit=fit),
        loop,
        settings,
        frozenset(),
        misled=True,
        Fs=None,
        masses=masses,
        advance=lambda: None,
    )


def test_what_is_not_simulated_has_its_reason(unknown):
    one = force(1.0)  # it rests, so that no advice is searched
    assert simulated(unknown, one).simulated.ended == RUNS
    for given, settings, masses, reason in (
        (None, SETTINGS, 1, "break-away force"),
        (replace(one, Fs=np.full(2, np.nan)), SETTINGS, 1, "break-away force"),
        (one, replace(SETTINGS, encoder="load"), 1, "velocity from differences"),
        (one, replace(SETTINGS, kv=0.0), 1, "position loop"),
        (one, SETTINGS, 2, "were not separated"),
    ):
        found = simulated(unknown, given, settings, masses=masses)
        assert found.simulated is None
        assert reason in found.unsimulated


def test_the_advice_is_the_mildest_change_that_keeps_the_linear_verdict(unknown):
    found = simulate_rest(force(3.0), SETTINGS)
    asked = []

    def keeps(other):
        asked.append(other)
        return True

    advised = with_advice(found, force(3.0), SETTINGS, keeps)
    assert advised.advice
    assert replace(unknown, simulated=advised).answers("m")["change"] == advised.advice
    last = simulate_rest(force(3.0), asked[-1])  # played again
    assert last.amplitude <= found.amplitude / 2
    refused = with_advice(found, force(3.0), SETTINGS, lambda other: False)
    assert (
        replace(unknown, simulated=refused)
        .answers("m")["change"]
        .startswith("none of the tried changes ")
    )
    assert (
        with_advice(simulate_rest(force(1.0), SETTINGS), force(1.0), SETTINGS, keeps).advice == ""
    )


def test_a_load_on_a_stiff_spring_does_what_one_mass_does(unknown):
    """The friction is shared between both, and each has its numbers from the same draws."""
    one, omega = force(3.0), 2 * np.pi * 400
    spring = {
        "stiffness": one.sliding.mass * omega**2 / 4,
        "damping": 0.02 * one.sliding.mass * omega,
    }
    fit = SimpleNamespace(
        load_mass=0.4, coupling=spring["stiffness"], coupling_damping=spring["damping"]
    )
    fit.stds, fit.Fs, fit.load_Fs = dict.fromkeys(("mass", "load_mass", "coupling"), 0.01), 3.0, 0.9
    resting = simulated(unknown, force(1.0), fit=fit, masses=2)
    assert resting.simulated.ended == RUNS
    both = replace(one, load=resting.force.load)
    assert both.load.share == pytest.approx(0.3)
    found, rigid = simulate_rest(both, SETTINGS), simulate_rest(one, SETTINGS)
    assert found.count == rigid.count == RUNS
    assert found.amplitude == pytest.approx(rigid.amplitude, rel=0.01)
    fit.stds["coupling"] = np.inf
    assert (
        simulated(unknown, one, fit=fit, masses=2).unsimulated
        == "motor and load were not separated"
    )


def test_the_distance_that_was_asked_for_is_answered(unknown):
    """It is answered by what is proved, else by a hunting axis that swings by more."""
    hunting = runs(4e-6)
    assert (
        replace(unknown, simulated=hunting)
        .answers("m", 3e-6)["within"]
        .endswith("Within 3 um: no, as simulated")
    )
    assert (
        replace(unknown, simulated=hunting)
        .answers("m", 5e-6)["within"]
        .endswith("Within 5 um: not proved; in simulation yes")
    )
    rests = replace(hunting, amplitudes=np.zeros(RUNS))
    assert replace(unknown, simulated=rests).answers("m", 7e-6)["within"].endswith("not proved")
    away = replace(rests, offsets=np.full(RUNS, 8e-6))  # at rest, off the set point
    assert (
        replace(unknown, simulated=away).answers("m", 7e-6)["within"].endswith("no, as simulated")
    )
    assert "eventually at most 8 um off the set point" in str(away)
    assert "Asked" not in replace(unknown, simulated=rests).answers("m")["within"]


def test_what_hunts_in_simulation_has_not_passed_and_a_bound_is_named(linear, unknown):
    """The first line said that the linear loop passed, and "not judged" stood above a bound that
    was proved.
    """
    hunting = runs(4e-6)
    rests = replace(hunting, amplitudes=np.zeros(RUNS))

    def judged(**friction):
        seen = replace(linear, friction=replace(unknown, **friction))
        return seen.verdict, seen.findings[0]

    assert judged(simulated=hunting) == (
        "not passed",
        "NOT PASSED, friction: the axis hunts by +-4 um in simulation",
    )
    known = SimpleNamespace(error_bound=2e-5)
    assert judged(simulated=hunting, bounded=known)[0] == "not passed"
    bounded, line = judged(simulated=rests, bounded=known)
    assert bounded == "linear loop passed; friction bounded, rest unproved"
    assert line.startswith(
        "linear loop passed; friction bounded, rest unproved: the axis stays within 20 um, proved"
    )
    assert judged(simulated=rests)[0] == judged()[0] == "linear loop passed; friction not judged"


def test_one_run_alone_is_no_hunting():
    one = np.zeros(RUNS)
    one[3] = 1e-5
    found = runs(one, np.nan)
    assert not found.hunts
    assert f"rests in {RUNS - 1} of {RUNS} runs" in str(found)
    one[4] = np.nan  # the integration did not come to its end
    found = replace(found, amplitudes=one)
    assert not found.hunts
    assert (found.ended, found.amplitude) == (RUNS - 1, 1e-5)
    assert f"rests in {RUNS - 2} of {RUNS - 1} runs" in str(found)
    assert "1 more failed" in " ".join(str(found).split())
    one[: FEWEST - 1] = 1e-5
    assert runs(one, 0.1).hunts


def test_a_run_without_an_end_is_neither_rest_nor_hunting(unknown, monkeypatch):
    run = nlfrf.rig.run
    monkeypatch.setattr(
        nlfrf.rig, "run", lambda axis, *_, **__: replace(run(axis, np.zeros(8)), diverged=True)
    )
    found = simulate_rest(force(3.0), SETTINGS)
    assert (found.ended, found.count, found.hunts) == (0, 0, False)
    known = simulated(unknown, force(3.0))
    assert known.simulated is None
    assert "succeeded in 0 runs only" in known.unsimulated
