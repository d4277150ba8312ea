"""An actuator that saturates: up to the kick that is told it never does, and the machine comes to rest."""

import control
import numpy as np
import pytest

import nlfrf
from nlfrf.friction import Leuven, VaryingSliders
from robust import any_bristle, any_maxwell_slip, prove_friction
from tests.support.friction_loops import ORACLES, RIG, T, pd, pid

LIMIT, FS = 20.0, 1.0
SLIP = any_maxwell_slip(64e3, 1.05)


def played(law, K, delay, kick, c=0.4):
    """Largest force of the actuator, and swing of the last tenth over the largest, after a kick."""
    rig = nlfrf.Rig(1.0, 80e3, law, c)
    options = {"fs": 1 / T, "delay": delay, "initial": (0.0, kick), "oversampling": 16, "saturation": LIMIT}
    response = nlfrf.simulate_loop(rig, K, np.zeros(4000), **options)
    return np.abs(response.u).max(), np.ptp(response.x[-400:]) / np.ptp(response.x)


@pytest.mark.filterwarnings("ignore:the hysteresis memory")
@pytest.mark.parametrize("name", ["P1", "P2", "P3", "P4"])
def test_no_friction_of_the_class_makes_it_saturate(name):
    (Kp, Ki, Kd, delay), _, _ = ORACLES[name]
    K, rng = pid(Kp, Ki, Kd), np.random.default_rng(0)
    proof = prove_friction(RIG, K, SLIP, delay=delay, Fs=FS, saturation=LIMIT)
    assert 5e-4 < proof.kick_linear < LIMIT / Kd
    assert "proved locally" in str(proof)
    for _ in range(3):
        elements = {"stiffness": 64e3 * rng.dirichlet(np.ones(3)), "strength": FS * rng.dirichlet(np.ones(3))}
        law = VaryingSliders(stiction=1.05, vs=0.01, dwell=0.05, wavelength=1e-4, asymmetry=0.3, **elements)
        force, swing = played(law, K, delay, proof.kick_linear)
        assert force < LIMIT
        assert swing < 0.05


def test_the_rig_of_the_paper_neither():
    proof = prove_friction(RIG, pd(20e3, 60.0), any_bristle(64e3, 1 / 0.7, 13.0), Fs=FS, saturation=LIMIT)
    force, swing = played(Leuven(), pd(20e3, 60.0), 0.0, proof.kick_linear, c=0.0)
    assert force < LIMIT
    assert swing < 0.05


def test_it_grows_with_what_is_left_over_friction():
    """With integral action the actuator holds the friction: the kick is in proportion to the limit less Fs."""
    K = pid(20e3, 3e5, 60.0)
    kicks = [prove_friction(RIG, K, SLIP, Fs=FS, saturation=limit).kick_linear for limit in (2.0, 3.0, 11.0)]
    assert np.allclose(np.array(kicks) / kicks[0], [1, 2, 10], rtol=1e-6)
    assert np.isnan(prove_friction(RIG, K, SLIP, Fs=FS).kick_linear)


def test_a_continuous_controller_too():
    PID = control.ss(control.tf([60.0, 20e3, 3e5], [1e-5, 1, 0]))
    assert prove_friction(RIG, PID, SLIP, Fs=FS, saturation=LIMIT).kick_linear > 0


@pytest.mark.parametrize("options", [{"saturation": 20.0}, {"saturation": 1.0, "Fs": 1.0}])
def test_refusals(options):
    with pytest.raises(ValueError, match="saturation must be above Fs, the largest friction"):
        prove_friction(RIG, pd(20e3, 60.0), SLIP, **options)
