"""Friction at several places of a machine, as at motor and load: proofs, bounds, and what is
refused.
"""

import re
from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from benchmarks.friction_ports import draw_case, draw_law, prove_case, run_case
from nlfrf.rig import Drive
from robust import friction_plant, prove_friction
from robust.friction import Bounded, Bristle, MaxwellSlip, two_mass_plant
from robust.io import verify_certificate
from robust.servo import cascade
from tests.support.friction_loops import energy_of, sliding_loop

T = 1 / 4000
#: The ball screw preset with twice its velocity gain, without the lag of its current.
SCREW = two_mass_plant(232.9, 150.0, 80e6, 5e3)
DRIVE = Drive(fs=4000, kv=50, kp=2 * 280 * 342, kp_unit="N/(m/s)", tn=0.02, delay_periods=1)
CLASSES = (MaxwellSlip(25e6, 1.2), MaxwellSlip(12.5e6, 1.3))


def screw_proof(**changed):
    given = {"machine": SCREW, "friction": CLASSES, "settings": DRIVE} | changed
    settings = given.pop("settings")
    K = cascade(settings, output_unit="N")
    return prove_friction(
        given.pop("machine"), K, given.pop("friction"), delay=settings.delay, **given
    )


@pytest.fixture(scope="module")
def proof():
    return screw_proof(Fs=(100, 60))


def doubled(stiffness=80e3, damping=0.4):
    """One mass of 1 kg whose friction is counted at two ports in the same place."""
    one = friction_plant(1.0, stiffness, damping)
    return replace(
        one,
        B_port=np.column_stack([one.B_port] * 2),
        C_port=np.vstack([one.C_port] * 2),
        port_names=("one", "two"),
    )


def PD(Kp=20e3, Kd=60.0):
    return control.StateSpace([[0.0]], [[1.0]], [[-Kd / 1e-3]], [[Kp + Kd / 1e-3]], 1e-3)


# ---- What is proved, and that it is verified.


def test_motor_and_load_are_proved_and_verified(proof):
    assert proof.verdict == "proved"
    assert proof.certificate.verify().verified
    text = " ".join(str(proof).split())
    for stiffness, ratio, place in (("25000", "1.2", "motor"), ("12500", "1.3", "load")):
        assert re.search(
            rf"up to {stiffness} kN/m, [^(]*at most {ratio} times [^)]*\) at the {place}", text
        )
    assert proof.counterexample is None
    assert np.isinf(proof.kick_sure)


@pytest.mark.parametrize(
    "change",
    [
        {"K0": 60e6},
        {"stiction": 6.0},
        {"weights": np.zeros(1)},
        {"free": -1.0},
    ],
)
def test_another_class_at_the_second_port_is_not_verified(proof, change):
    claim = proof.certificate.claim
    first, second = claim.ports
    if "weights" in change:
        change = {"weights": 0 * second.weights}
    changed = replace(claim, ports=(first, replace(second, **change)))
    assert not proof.certificate.again(changed).verified


def test_files_keep_the_ports(proof, tmp_path):
    path = tmp_path / "proof.json"
    robust.save(proof, path)
    found = verify_certificate(path, model=SCREW, K=cascade(DRIVE, output_unit="N"))
    assert found.verified
    other = two_mass_plant(232.9, 151.0, 80e6, 5e3)
    assert not verify_certificate(path, model=other, K=cascade(DRIVE, output_unit="N")).verified


def test_two_ports_in_one_place_are_as_one():
    """Half of K0 at each is in the class of all of it at one, and has the same springs and the same
    bound.
    """
    K, K0 = PD(), 64e3
    one = prove_friction(friction_plant(1.0, 80e3, 0.4), K, MaxwellSlip(K0), Fs=1.0)
    two = prove_friction(doubled(), K, [MaxwellSlip(K0 / 2)] * 2, Fs=(0.3, 0.7))
    assert one.verdict == two.verdict == "proved"
    assert two.certificate.verify().verified
    assert two.error_bound == pytest.approx(one.error_bound, rel=1e-9)


def test_a_loop_that_a_spring_refutes_at_one_port_is_refuted_with_both_halves():
    single = prove_friction(friction_plant(1.0, 80e3, 0.4), PD(), MaxwellSlip(4e6))
    double = prove_friction(doubled(), PD(), [MaxwellSlip(2e6)] * 2)
    assert single.verdict == double.verdict == "refuted"
    springs, pole = double.counterexample
    # the worst of a coarse grid
    assert np.sum(springs) == pytest.approx(single.counterexample[0], rel=0.4)
    assert abs(pole) > 1
    assert "at one and a spring of" in double.reason


def test_a_port_with_next_to_no_friction_changes_nothing():
    alone = prove_friction(
        one_port(SCREW, 0), cascade(DRIVE, output_unit="N"), CLASSES[0], delay=DRIVE.delay
    )
    with_little = screw_proof(friction=(CLASSES[0], MaxwellSlip(100.0, 1.3)))
    assert alone.verdict == with_little.verdict == "proved"


def one_port(machine, port):
    return replace(
        machine, B_port=machine.B_port[:, port], C_port=machine.C_port[port], port_names=()
    )


def test_the_bound_is_the_sum_over_the_ports_at_the_worst_of_them(proof):
    K = cascade(DRIVE, output_unit="N")
    bounds = [
        sum(
            force * prove_at(column, row, K)
            for force, column in zip((100, 60), SCREW.B_port.T, strict=True)
        )
        for row in SCREW.C_port
    ]
    assert proof.error_bound == pytest.approx(max(bounds), rel=1e-9)


def prove_at(column, row, K):
    machine = replace(SCREW, B_port=column, C_port=row, port_names=())
    return prove_friction(machine, K, Bounded(1.0), delay=DRIVE.delay).error_bound


# ---- The inequality: the stored energy falls along exact motions with elements at both ports.


class Slider:
    """A spring in series with a slider of constant force, at a port."""

    def __init__(self, k, W, port):
        self.k, self.W, self.port, self.force = k, W, port, 0.0


def test_the_energy_falls_with_elements_at_both_ports(proof):
    """V of the certificate with the stored energy of each element, of known elements, along a fine
    simulation.
    """
    claim = proof.certificate.claim
    loop = sliding_loop(SCREW, cascade(DRIVE, output_unit="N"), DRIVE.delay)
    elements = [Slider(15e6, 40.0, 0), Slider(10e6, 60.0, 0), Slider(12.5e6, 60.0, 1)]
    rng = np.random.default_rng(3)
    xi = (
        1e-6 * rng.standard_normal(loop.F.shape[0]) * np.where(np.arange(loop.F.shape[0]) < 4, 1, 0)
    )
    rates = [claim.ports[one.port].rates for one in elements]
    filters = [np.zeros(own.size) for own in rates]
    steps, values = 400, []
    h = T / steps
    flow = control.StateSpace(loop.F, loop.B, np.eye(loop.F.shape[0]), 0)
    step = control.sample_system(flow, h, "zoh")
    for _ in range(60):
        stored = [(one.k, one.force, one.port) for one in elements]
        values.append(energy_of(claim, loop, xi, elements=stored, filters=filters))
        xi = loop.jumps[0] @ xi
        for _ in range(steps):
            f = np.array(
                [sum(one.force for one in elements if one.port == port) for port in (0, 1)]
            )
            xi = np.asarray(step.A) @ xi + np.asarray(step.B) @ f
            v = loop.v @ xi
            for i, one in enumerate(elements):
                one.force = float(np.clip(one.force + one.k * v[one.port] * h, -one.W, one.W))
                filters[i] = one.force + (filters[i] - one.force) * np.exp(-rates[i] * h)
    values = np.array(values)
    assert np.all(values > 0)
    assert np.all(np.diff(values) < 1e-6 * values[0])
    assert values[-1] < 0.9 * values[0]


@pytest.mark.attack
def test_friction_with_stiction_at_both_settles_within_a_bound_that_is_verified(tmp_path):
    """Half of the bound of any friction on this axis; a spring of the class beside any rest is
    below it.
    """
    soft = replace(DRIVE, kp=DRIVE.kp / 2)
    given = {"settings": soft, "friction": (MaxwellSlip(25e6, 1.5), MaxwellSlip(12.5e6, 1.5))}
    found = screw_proof(**given, Fs=(100, 60))
    assert found.verdict == "settles"
    assert found.settling_error < 0.6 * found.error_bound
    assert found.certificate.verify().verified
    assert "of at most 100 N at the motor and 60 N at the load" in found.claim
    robust.save(found, tmp_path / "settles.json")
    assert verify_certificate(
        tmp_path / "settles.json", model=SCREW, K=cascade(soft, output_unit="N")
    ).verified
    claim = found.certificate.claim
    own = claim.settling
    for changed in (
        replace(own, error=0.99 * own.error),
        replace(own, Fs=own.Fs * [1.0, 1.05]),
        replace(own, rest_weights=0.9 * own.rest_weights),
        replace(own, rest_weights=1.01 * own.rest_weights),
    ):
        assert not found.certificate.again(replace(claim, settling=changed)).verified
    with pytest.raises(ValueError, match="a force and a weight for each port"):
        replace(claim, settling=replace(own, Fs=own.Fs[:1]))


# ---- Where the machine rests.


def test_without_integral_action_the_ports_share_the_weight_of_their_rests():
    """A spring at the motor moves both masses: X is symmetric, and s is made equal."""
    proof = screw_proof(settings=replace(DRIVE, tn=np.inf))
    assert proof.verdict == "proved"
    assert proof.certificate.verify().verified


def test_a_load_encoder_is_not_decided_with_its_reason():
    machine = two_mass_plant(232.9, 150.0, 80e6, 5e3, encoder="load")
    soft = replace(DRIVE, kv=5, kp=20e3, tn=0.5, encoder="load")
    light = (MaxwellSlip(1e4, 1.2), MaxwellSlip(1e4, 1.2))
    proof = screw_proof(machine=machine, settings=soft, friction=light)
    assert proof.verdict == "not decided"
    assert "encoder of the load" in proof.reason


# ---- Refusals.


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"friction": CLASSES[0]},
            "friction must be a class for each friction port of the machine, 2, got 1",
        ),
        ({"friction": (*CLASSES, CLASSES[0])}, "2, got 3"),
        ({"friction": (CLASSES[0], 64e3)}, "friction must be a class such as"),
        (
            {"friction": (CLASSES[0], Bristle(64e3))},
            "MaxwellSlip at each of several ports, got bristle friction",
        ),
        (
            {"friction": (CLASSES[0], Bounded(1.0))},
            "MaxwellSlip at each of several ports, got friction of at most 1 N",
        ),
        (
            {"friction": (MaxwellSlip(1e3, position_unit="rad"),) * 2},
            "in the units of the machine, m, got rad",
        ),
        ({"Fs": 100.0}, "Fs must be a force for each friction port, 2, got 1"),
        ({"Fs": (100.0, -1.0)}, "Fs must be"),
    ],
)
def test_refusals(given, message):
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        screw_proof(**given)


def test_what_knows_one_port_refuses_several():
    K = cascade(DRIVE, output_unit="N")
    for call in (
        lambda: robust.prove_friction(SCREW, K, CLASSES, Fs=(1.0, 1.0), saturation=20.0),
        lambda: robust.design_frf(
            control.tf([1], [1, 1, 1]), "PD", M_S=2.0, dt=T, prove=(SCREW, CLASSES[0])
        ),
    ):
        with pytest.raises(ValueError, match="port"):
            call()


def test_a_model_with_several_ports():
    A, B = SCREW.A, np.column_stack([SCREW.B_force, SCREW.B_port])
    C = np.vstack([SCREW.C_measured, SCREW.C_port])
    machine = friction_plant(control.StateSpace(A, B, C, 0), port=True)
    assert type(machine) is type(SCREW)
    assert machine.n_ports == 2
    assert screw_proof(machine=machine).verdict == "proved"
    with pytest.raises(ValueError, match="velocity at the friction port"):
        friction_plant(control.StateSpace(A, B, np.vstack([C[:2], [0, 0, 0, 1]]), 0), port=True)


# ---- The attack of benchmarks/friction_ports.py, a part of it.


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("number", [1, 4, 7])
def test_what_is_proved_comes_to_rest_on_the_simulated_axis(number):
    case, rng = draw_case(number), np.random.default_rng([number, 9])
    proof = prove_case(case)
    laws = tuple(draw_law(rng, one, Fs) for one, Fs in zip(case.friction, case.Fs, strict=True))
    far, moves = run_case(case, laws, sum(case.Fs))
    if proof.verdict == "proved":
        assert not moves
    if np.isfinite(proof.error_bound):
        assert far < proof.error_bound
