"""Closed forms and published theorems:

PID on a mass with Coulomb friction, springs, bounded and passive friction.
"""

import control
import numpy as np
import pytest

import nlfrf
from robust import friction_plant, prove_friction
from robust.friction import Bounded, Bristle, MaxwellSlip, Passive
from robust.friction.proof.multipliers import multiplier_terms
from tests.support.friction_loops import ORACLES, RIG, T, pid


def pid_mobility(omega, m=1.0, Kp=200.0, Kd=20.0, Ki=400.0):
    s = 1j * omega
    return -(s**2) / (m * s**3 + Kd * s**2 + Kp * s + Ki)


@pytest.mark.parametrize(("a", "proves"), [(1.9, False), (2.1, True), (19.0, True), (21.0, False)])
def test_pid_and_coulomb_friction_on_a_free_mass(a, proves):
    """One filter proves it exactly for Ki/Kp < a < Kd/m: such an a exists where Kp Kd > m Ki
    (Bisoffi et al. 2018).
    """
    omega = np.geomspace(1e-3, 1e4, 4000)
    row = multiplier_terms(pid_mobility(omega), omega, rates=np.array([a]), K0=np.inf, rho=1.0)[
        :, 1
    ]
    assert bool((row < 0).all()) is proves


@pytest.mark.parametrize(
    ("rho", "K0"), [(1.1, 1996.5), (1.25, 796.8), (1.5, 397.6), (2.0, 198.3), (3.0, 98.9)]
)
def test_the_stiffest_stiction_that_one_filter_allows(rho, K0):
    """Nearly Kp/(rho - 1)."""
    omega = np.geomspace(1e-2, 1e4, 3000)
    rates = np.geomspace(1.7, 2.1, 200)

    def allowed(stiffness):
        return (
            (
                multiplier_terms(pid_mobility(omega), omega, rates=rates, K0=stiffness, rho=rho)[
                    :, 1:
                ]
                < 0
            )
            .all(axis=0)
            .any()
        )

    assert allowed(0.995 * K0)
    assert not allowed(1.005 * K0)


@pytest.mark.parametrize(("K0", "lag"), [(1e5, 1e-3), (1e6, 1e-3), (3e6, 1e-3), (1e6, 1e-4)])
def test_a_continuous_pid_on_a_free_mass_is_proved_with_stiff_friction(K0, lag):
    """O1 with a derivative that is proper:

    K_p K_d > m K_i, any K0 in the limit; taken as 1.001, rho = 1 stopped it.
    """
    s = control.tf("s")
    K = 200 + 400 / s + 20 * s / (1 + lag * s)
    proof = prove_friction(friction_plant(1.0, 0.0), K, MaxwellSlip(K0, 1.0))
    assert proof.verdict == "proved"
    assert proof.certificate.verify().verified
    unstable = prove_friction(friction_plant(1.0, 0.0), K + 4000 / s, MaxwellSlip(K0, 1.0))
    assert unstable.verdict == "refuted"


@pytest.mark.parametrize("name", ORACLES)
def test_the_largest_presliding_stiffness_of_a_proof(name):
    """Up to 0.8 of the largest K0 for which the weights exist a proof is found, and none beyond it;
    the lowest unstable spring refutes.
    """
    (Kp, Ki, Kd, delay), expected, spring = ORACLES[name]

    def verdict(K0, rho):
        return prove_friction(RIG, pid(Kp, Ki, Kd), MaxwellSlip(K0, rho), delay=delay).verdict

    for rho, K0 in zip((1.05, 1 / 0.7, 2.0), expected, strict=True):
        assert verdict(0.8 * K0, rho) == "proved"
        assert verdict(1.025 * K0, rho) != "proved"
    assert verdict(0.995 * spring, 1.05) != "refuted"
    assert verdict(1.005 * spring, 1.05) == "refuted"


def test_hunting_bound():
    """m, c, K = 1, 20, 1e4, continuous: coth(pi zeta / (2 sqrt(1 - zeta^2))) / K."""
    zeta = 0.1
    right = 1 / np.tanh(np.pi * zeta / 2 / np.sqrt(1 - zeta**2)) / 1e4
    for machine, K, bound in (
        (friction_plant(1.0, 0.0, 20.0), 1e4, right),
        (RIG, pid(*ORACLES["P1"][0][:3]), 9.379e-5),
        (RIG, pid(*ORACLES["P2"][0][:3]), 4.107e-5),
    ):
        proof = prove_friction(machine, K, Bounded(1.0))
        assert proof.error_bound == pytest.approx(bound, rel=2e-3)


@pytest.mark.parametrize(
    ("Ki", "pole", "kick"), [(4e5, 1.0022150, 0.2878), (2e6, 1.0120964, 0.0530)]
)
def test_sure_run_away(Ki, pole, kick):
    K = control.StateSpace([[1]], [[1]], [[Ki * T]], [[0]], T)
    proof = prove_friction(RIG, K, Bounded(1.0))
    assert proof.verdict == "refuted"
    assert abs(proof.counterexample[1]) == pytest.approx(pole, abs=1e-7)
    assert proof.kick_sure == pytest.approx(kick, rel=2e-3)


def test_sure_run_away_of_a_self_excited_oscillator():
    """c = -4, k = 8e4, Fc = 0.7: 0.787789 mm; the describing function says 0.787777.

    A velocity w0 x disturbs the unstable mode of the continuous loop as much as a displacement x.
    """
    machine = friction_plant(
        control.StateSpace([[0, 1], [-8e4, 4]], [[0], [1]], [[1, 0]], [[0]], 0)
    )
    kick = prove_friction(machine, 0.0, Bounded(0.7)).kick_sure / np.sqrt(8e4)
    assert kick == pytest.approx(7.87789e-4, rel=2e-3)
    assert kick > 7.87789e-4  # rounded outward


@pytest.mark.parametrize(
    ("K", "B", "needed"), [(1e3, 0.0, 0.5), (1e3, 5.0, 5.5), (20e3, 0.0, 10.0)]
)
def test_virtual_wall(K, B, needed):
    """A spring K with a damper B by backward difference: c > K T/2 + |B| (Colgate & Schenkel
    1997).
    """
    wall = control.StateSpace([[0.0]], [[1.0]], [[-B / T]], [[K + B / T]], T)
    for c, proves in ((0.98 * needed, False), (1.02 * needed, True)):
        proof = prove_friction(friction_plant(1.0, 80e3, c), wall, Passive())
        assert (proof.verdict == "proved") is proves


def test_passive_friction_and_integral_action_never():
    PI = control.ss(control.tf([1e3, 1e4], [1, 0]))
    PD = control.ss(control.tf([10.0, 1e3], [1e-3, 1.0]))
    machine = friction_plant(1.0, 80e3, 0.4)
    assert prove_friction(machine, PI, Passive()).verdict == "not decided"
    assert prove_friction(machine, PD, Passive()).verdict == "proved"


def lugre_work(law, legs, cycles=100):
    """[J] that LuGre takes in the last of many cycles of constant velocities [m/s] over ways [m],
    in closed form.
    """
    z = work = 0.0
    for _ in range(cycles):
        work = 0.0
        for v, way in legs:
            g = law.Fc + (law.Fs - law.Fc) * np.exp(-(np.abs(v / law.vs) ** law.delta))
            rate, span, goal = law.sigma0 * abs(v) / g, way / abs(v), np.sign(v) * g / law.sigma0
            end = goal + (z - goal) * np.exp(-rate * span)
            bent = goal * span - (z - goal) * np.expm1(-rate * span) / rate  # int z dt
            work += v * (law.sigma0 * bent + law.sigma1 * (end - z) + law.sigma2 * v * span)
            z = end
    return work


def test_lugre_gives_energy_back_where_its_viscous_friction_does_not_outweigh_its_bristles():
    """O3: passive iff sigma2 >= sigma1 (Fs - Fc)/Fc (Barabanov & Ortega 2000); the rig needs 5.571
    and has 0.4.

    Creeping 10 um at 1e-4 m/s, then 5 um at 1 m/s, over and over: the bristles bend slowly and let
    go at speed.
    """
    legs = ((1e-4, 10e-6), (1.0, 5e-6))
    numbers = {"sigma0": 64e3, "sigma1": 13.0, "Fc": 0.7, "Fs": 1.0, "vs": 0.01}
    needed = 13.0 * (1.0 - 0.7) / 0.7
    assert needed == pytest.approx(5.571, abs=1e-3)
    assert lugre_work(
        nlfrf.friction.LuGre(sigma2=0.4, delta=1.0, **numbers), legs
    ) == pytest.approx(-6.25e-7, rel=0.03)
    assert lugre_work(nlfrf.friction.LuGre(sigma2=0.4, **numbers), legs) < -7e-7
    rng = np.random.default_rng(0)
    for _ in range(50):
        sizes = rng.choice([-1, 1], 6) * 10 ** rng.uniform(-4, 0.5, 6)
        legs = tuple(zip(sizes, 10 ** rng.uniform(-6, -4, 6), strict=True))
        assert lugre_work(nlfrf.friction.LuGre(sigma2=needed, **numbers), legs) > 0


def test_the_rig_is_taken_for_no_passive_friction():
    """What the harness calls passive, the bristles' own class proves only above that viscous
    friction.
    """
    rig = nlfrf.friction.Leuven()
    needed = rig.sigma1 * ((rig.Fs / rig.Fc) ** rig.n - 1)
    creeping = Bristle(64e3, rig.Fs / rig.Fc, rig.sigma1)
    verdicts = [
        prove_friction(friction_plant(1.0, 80e3, c), 0.0, creeping).verdict
        for c in (0.95 * needed, 1.05 * needed)
    ]
    assert verdicts == ["not decided", "proved"]
