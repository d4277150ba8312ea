"""The verdict: what is proved falls along motions, what is refuted grows, and nothing passes the
judge by mistake.
"""

from dataclasses import replace
from typing import ClassVar

import control
import numpy as np
import pytest

from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust import friction_plant, prove_friction, sampled
from robust.friction import Bounded, MaxwellSlip
from robust.friction.nominal import machines_of_nominal
from robust.friction.proof.protocol import FrictionClass
from robust.servo import cascade
from tests.support.friction_loops import (
    ORACLES,
    RIG,
    Element,
    T,
    energy_of,
    growth,
    motion,
    oracle_loop,
    pd,
    pid,
    poles_of,
    sliding_loop,
)
from tests.support.printed import unwrapped

SLIP = MaxwellSlip(64e3, 1.05)


def closed_poles(K, delay, kappa=0.0):
    """Poles of the loop with a spring by another way: the sampled plant, and 1 + GK."""
    G = sampled(control.ss([[0, 1], [-80e3 - kappa, -0.4]], [[0], [1]], [[1, 0]], 0), T, delay)
    A = np.block([[G.A, G.B @ K.C], [-K.B @ G.C, K.A]])
    A[: G.nstates, : G.nstates] -= G.B @ K.D @ G.C
    return np.sort_complex(np.linalg.eigvals(A))


def load_with_port(sign):
    """Two masses on a spring, pushed and measured at the first; friction at the second, by the sign
    of its force.
    """
    A = [[0, 1, 0, 0], [-50, 0, 50, 0], [0, 0, 0, 1], [80, 0, -80, 0]]
    B, C = [[0, 0], [1, 0], [0, 0], [0, sign * 1.6]], [[1, 0, 0, 0], [0, 0, 1, 0]]
    return control.StateSpace(A, B, C, np.zeros((2, 2)), 0)


def test_a_machine_whose_friction_brakes_is_taken():
    assert friction_plant(control.tf([1], [2, 3, 100])).resonance == pytest.approx(np.sqrt(50))
    assert friction_plant(load_with_port(1.0), port=True).n_ports == 1


@pytest.mark.parametrize("damping", [0.0, 0.5, 20.0])
def test_viscous_friction_of_a_free_mass_takes_no_proof_away(damping):
    """Filters that were placed by its pole -c/m found no proof of a loop that is proved without
    that friction.
    """
    drive = Drive(fs=4000, kv=100, kp=7550, kp_unit="N/(m/s)", tn=0.01)
    machine = friction_plant(12.0, 0.0, damping)
    assert (
        prove_friction(machine, cascade(drive), MaxwellSlip(2.5e6), delay=0.5e-3).verdict
        == "proved"
    )


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 1e-3, 1.7e-3, 2e-3])
def test_the_pole_of_a_refuted_loop_is_that_of_the_sampled_plant(delay):
    """Without friction it is unstable: the sampled plant with its delay, and 1 + GK, say where."""
    K = pid(20e3, 3e6, 0)
    proof = prove_friction(RIG, K, SLIP, delay=delay)
    assert proof.verdict == "refuted"
    kappa, pole = proof.counterexample
    poles = closed_poles(K, delay, kappa)
    assert abs(pole) == pytest.approx(np.abs(poles).max(), rel=1e-9)
    assert np.abs(poles - pole).min() < 1e-6


@pytest.mark.parametrize("name", ["P1", "P2", "P4"])
@pytest.mark.parametrize(
    ("limits", "seed"), [(((30e3, 0.5), (20e3, 0.3), (13e3, 0.2)), 0), (((64e3, 1.0),), 3)]
)
def test_the_energy_of_the_certificate_falls_at_every_sample(name, limits, seed):
    """The loop by another hand, and elements of the class that break away and drop at random."""
    (Kp, Ki, Kd, delay), _, _ = ORACLES[name]
    claim = prove_friction(RIG, pid(Kp, Ki, Kd), SLIP, delay=delay).certificate.claim
    (port,) = claim.ports
    loop, rng = oracle_loop(name), np.random.default_rng(seed)
    elements = [Element(k, W, SLIP.stiction, rng) for k, W in limits]
    start = np.zeros(loop.F.shape[0])
    start[1] = 0.02  # a kick
    energies = np.array(
        [
            energy_of(
                claim,
                loop,
                xi,
                elements=[(k, f, 0) for (k, _), f in zip(limits, forces, strict=True)],
                filters=filters,
            )
            for xi, filters, forces in motion(loop, elements, start, port.rates, 250)
        ]
    )
    assert (energies > 0).all()
    assert (np.diff(energies) < 1e-9 * energies[0]).all()
    assert energies[-1] < 1e-2 * energies[0]


def test_nothing_unstable_is_ever_proved():
    """Loops that a spring of the class makes unstable, by a scan of the springs."""
    rng = np.random.default_rng(5)
    tried = 0
    while tried < 12:
        K = pid(rng.uniform(-60e3, 60e3), 10 ** rng.uniform(4, 7), rng.uniform(0, 200))
        loop = sliding_loop(RIG, K)
        if max(growth(loop, kappa) for kappa in np.linspace(0, 64e3, 40)) > 1e-6:
            tried += 1
            assert prove_friction(RIG, K, SLIP).verdict == "refuted"


def test_a_proof_is_not_verified_for_a_class_with_an_unstable_spring():
    """The exact check refutes nothing: it knows no springs, and finds the energy that grows."""
    K = pid(80e3, 1e5, 240.0)
    proof = prove_friction(RIG, K, MaxwellSlip(1e3, 1.05), delay=T)
    claim = proof.certificate.claim
    (port,) = claim.ports
    assert proof.certificate.again(claim).verified
    loop = sliding_loop(RIG, K, T)
    springs = np.linspace(0, 64e3, 257)
    first = springs[np.argmax([growth(loop, kappa) > 0 for kappa in springs])]
    assert first > 1e3
    wider = replace(claim, ports=(replace(port, K0=first),))
    assert not proof.certificate.again(wider).verified


def test_a_refuting_spring_is_named_and_grows():
    K = pid(80e3, 1e5, 240.0)
    assert prove_friction(RIG, K, MaxwellSlip(1e3), delay=T).verdict == "proved"
    proof = prove_friction(RIG, K, SLIP, delay=T)
    assert proof.verdict == "refuted"
    kappa, pole = proof.counterexample
    assert 0 < kappa <= 64e3
    assert abs(pole) > 1
    assert "your friction may be another member" in proof.reason
    poles = poles_of(sliding_loop(RIG, K, T), kappa)
    assert np.abs(poles - pole).min() < 1e-9
    assert abs(pole) ** 20_000 > 1e2


def test_a_hidden_integrator_is_not_cancelled():
    """An unstable mode of the controller that neither sees nor drives anything: never proved."""
    K = pid(20e3, 3e5, 60)
    A = np.block([[K.A, np.zeros((2, 1))], [np.zeros((1, 2)), np.array([[1.01]])]])
    hidden = control.StateSpace(A, np.vstack([K.B, [[0.0]]]), np.hstack([K.C, [[0.0]]]), K.D, T)
    assert prove_friction(RIG, K, SLIP).verdict == "proved"
    assert prove_friction(RIG, hidden, SLIP).verdict == "refuted"


def test_an_integrator_that_nothing_shows_is_kept():
    """A minimal realisation would drop it, and the loop would be proved."""
    K = pid(20e3, 3e5, 60)
    A = np.block([[K.A, np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])
    unseen = control.StateSpace(A, np.vstack([K.B, [[1.0]]]), np.hstack([K.C, [[0.0]]]), K.D, T)
    undriven = control.StateSpace(A, np.vstack([K.B, [[0.0]]]), np.hstack([K.C, [[1.0]]]), K.D, T)
    for hidden in (unseen, undriven):
        assert prove_friction(RIG, hidden, SLIP).verdict != "proved"


def test_a_numerical_failure_is_told(monkeypatch):
    def fails(*_args, **_options):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(MaxwellSlip, "certify", fails)
    proof = prove_friction(RIG, pid(20e3, 3e5, 60), SLIP)
    assert (proof.verdict, proof.reason) == ("not decided", "numerical failure: Singular matrix")
    assert proof.certificate is None


def test_what_is_said():
    proof = prove_friction(RIG, pid(20e3, 3e5, 60), SLIP, Fs=1.0)
    text = unwrapped(proof)
    assert text.startswith(
        "proved: Comes to rest from every state with every Maxwell-slip friction with a presliding"
    )
    assert "up to 64 kN/m" in text
    assert "sampled at 1 kHz" in text
    assert "not claimed: a law that creeps below break-away (LuGre, Dahl, Leuven)" in text
    assert proof.error_bound == pytest.approx(9.379e-5, rel=2e-3)
    assert np.isinf(proof.kick_sure)


def test_continuous_controllers_are_proved_and_refuted():
    PID = control.ss(control.tf([60.0, 20e3, 3e5], [1e-5, 1, 0]))
    assert prove_friction(RIG, PID, SLIP).verdict == "proved"
    assert prove_friction(RIG, control.ss(control.tf([4e5], [1, 0])), SLIP).verdict == "refuted"


def test_friction_at_the_motor_of_two_masses():
    """Friction at the motor, position measured at the load: force and friction at one mass, the
    sensor at the other.
    """
    k, c = 1e6, 5.0
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k, k, -c, c], [k, -k, c, -c]]
    B, C = [[0, 0], [0, 0], [1, 1], [0, 0]], [[0, 1, 0, 0], [1, 0, 0, 0]]
    machine = friction_plant(control.StateSpace(A, B, C, 0), port=True)
    PD = control.StateSpace([[0.0]], [[1.0]], [[-20 / T]], [[2e3 + 20 / T]], T)
    assert prove_friction(machine, PD, MaxwellSlip(64e3, 1.2)).verdict == "proved"
    assert prove_friction(machine, 30 * PD, MaxwellSlip(64e3, 1.2)).verdict == "refuted"


def test_a_model_of_the_rig_is_the_rig():
    G = control.ss(control.tf([1.0], [1.0, 0.4, 80e3]))
    for name, ((Kp, Ki, Kd, delay), _, _) in ORACLES.items():
        proof = prove_friction(friction_plant(G), pid(Kp, Ki, Kd), SLIP, delay=delay)
        assert proof.verdict == "proved", name


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: friction_plant(0.0, 1.0), "mass must be positive, got 0"),
        (lambda: friction_plant(1.0), "stiffness must be given with a mass"),
        (
            lambda: friction_plant(control.ss(control.tf([1, 0], [1, 1, 1]))),
            "whose velocity at the friction port does not jump",
        ),
        (
            lambda: friction_plant(control.ss(control.tf([1, 0, 0], [1, 1, 1]))),
            "mass must be a strictly proper model",
        ),
        (
            lambda: friction_plant(-control.tf([1], [2, 3, 100])),
            "got -0.5 m/s per second and N: friction would drive it",
        ),
        (
            lambda: friction_plant(-control.tf([1], [2, 0, 0])),
            "friction would drive it. Change the sign of the model and of K",
        ),
        (
            lambda: friction_plant(load_with_port(-1.0), port=True),
            "accelerates in the direction of the force at the friction",
        ),
        (
            lambda: friction_plant(control.ss([[0.5]], [[1]], [[1]], 0, T)),
            "mass must be a continuous model, got one",
        ),
        (lambda: MaxwellSlip(0.0), "K0 must be positive, got 0"),
        (lambda: MaxwellSlip(np.inf), "K0 must be"),
        (lambda: MaxwellSlip(np.nan), "K0 must be"),
        (lambda: MaxwellSlip(1.0, 0.9), "stiction must be at least 1"),
        (lambda: MaxwellSlip(1.0, np.inf), "stiction must be"),
        (lambda: prove_friction(RIG, control.tf([1.0, 0.0], [1.0]), SLIP), "K must be"),
        (lambda: Bounded(-1.0), "Fs must be positive, got -1"),
        (lambda: prove_friction(RIG, 1.0, 3.0), "friction must be a class such as"),
        (lambda: prove_friction(3.0, 1.0, SLIP), "machine must be of type FrictionPlant, got 3.0"),
        (
            lambda: prove_friction(RIG, 1.0, SLIP, delay=1e-3),
            "delay must be 0 s with a continuous controller",
        ),
        (
            lambda: prove_friction(RIG, pid(1, 1, 1), SLIP, delay=1.0),
            "delay must be at most 20 samples",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_bounded_class_has_its_own_friction():
    with pytest.raises(
        ValueError, match=r"Fs must be left out or equal to Fs of the class, 1 N, got 5"
    ):
        prove_friction(RIG, 1e3, Bounded(1.0), Fs=5.0)
    assert (
        prove_friction(RIG, 1e3, Bounded(1.0), Fs=1.0).verdict
        == prove_friction(RIG, 1e3, Bounded(1.0)).verdict
    )


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_pade_approximation_is_taken_as_the_delay_it_stands_for(order):
    """Its roots were turned onto the axis with those of the machine: "a state does not come to
    rest".
    """
    tau = 5e-4
    late = control.ss(control.tf(*control.pade(tau, order)) * control.tf([1.0], [1.0, 4.0, 80e3]))
    exact = friction_plant(1.0, 80e3, 4.0)
    K, friction = pd(20e3, 60.0), MaxwellSlip(64e3)
    for machine in machines_of_nominal(late)[0]:
        assert machine.delay == pytest.approx(tau, rel=1e-6)
        assert machine.A.shape == (2, 2)
        assert prove_friction(machine, K, friction).verdict == "proved"
    mine = np.sort_complex(poles_of(sliding_loop(replace(machine, delay=0.0), K, machine.delay)))
    assert mine == pytest.approx(np.sort_complex(poles_of(sliding_loop(exact, K, tau))), abs=1e-6)
    proof = prove_friction(friction_plant(late), K, friction, delay=2e-4)
    assert "with 0.7 ms of delay" in proof.claim
    assert proof.certificate.verify().verified
    with pytest.raises(
        ValueError, match=r"delay must be 0 s with a continuous controller, got 0\.0005 s"
    ):
        prove_friction(friction_plant(late), 1e3, friction)


def without_damping(denominator):
    """The machine that a proof takes for a nominal 1 / denominator, without its damping."""
    return machines_of_nominal(control.ss(control.tf([1.0], denominator)))[0][0]


def test_real_poles_lose_their_damping_too():
    """A free mass whose friction slides has none that swing: left where they were, "without
    damping" was damped.
    """
    free = without_damping([2.0, 46.0, -20.0])
    assert np.sort(np.linalg.eigvals(free.A).real) == pytest.approx([-(10**0.5), 10**0.5])
    slow = without_damping([2.0, 500.0, 2e4])
    assert np.abs(np.linalg.eigvals(slow.A)) == pytest.approx([100.0, 100.0])
    assert np.abs(np.linalg.eigvals(slow.A).real).max() < 1e-6
    assert 1 / (slow.velocity @ slow.B_port) == pytest.approx(2.0)


@value(kw_only=False)
class Damped(FrictionClass):
    """Sliders with a viscous part, whose force has no limit: proved as sliders."""

    K0: float
    description: ClassVar[str] = "sliders with a viscous part"
    excluded: ClassVar[str] = "rigid stiction, "

    def largest_force(self, Fs):
        return np.nan

    def decide(self, undecided, task, others=()):
        return MaxwellSlip(self.K0).decide(undecided, task, others)


def test_a_class_with_a_viscous_part_bounds_nothing_and_takes_no_actuator():
    """As the docstring of `FrictionClass` says."""
    K = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)
    bounded = prove_friction(RIG, K, MaxwellSlip(64e3), Fs=1.0)
    viscous = prove_friction(RIG, K, Damped(64e3), Fs=1.0)
    assert viscous.verdict == bounded.verdict == "proved"
    assert np.isfinite(bounded.error_bound)
    assert np.isinf([viscous.error_bound, viscous.settling_error, viscous.kick_sure]).all()
    with pytest.raises(ValueError, match="saturation must be left out for sliders with a viscous"):
        prove_friction(RIG, K, Damped(64e3), Fs=1.0, saturation=20.0)
