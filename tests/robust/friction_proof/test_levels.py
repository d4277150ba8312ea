"""Machine and class from measured levels: what is read is right, and levels that do not reach are refused."""

import sys

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf import save_bla
from robust import cli
from robust.sliding.loop import sliding_loop
from tests.support.bla import make_bla
from tests.support.friction_loops import RIG, Element, motion, pid

F = 1.25 * np.arange(4, 160)


def level(k, c=10.0, m=1.0, seed=0):
    """A BLA of a mass on a spring, with a little noise."""
    size = 1 / 80e3
    noise = {"sigma_noise": 1e-4 * size, "sigma_distortion": 1e-4 * size}
    return make_bla(lambda s: 1 / (m * s**2 + c * s + k), F, f0=1.25, rng=seed, fs=1000, **noise)


def test_closed_form_levels_are_read():
    found = robust.friction_class([level(80e3, 2.0), level(142e3), level(144e3, seed=1), level(110e3, 60.0)])
    assert found.mass == pytest.approx(1.0, rel=1e-2)
    assert found.stiffness == pytest.approx([80e3, 110e3, 142e3, 144e3], rel=1e-2)
    assert np.isclose(found.friction.K0, 1.25 * 64e3, rtol=0.02)
    assert abs(found.mass[0] - 1) < 5 * found.mass_std + 1e-3
    assert "no level shows" in found.evidence
    assert "they do not prove it" in str(found)


@pytest.mark.parametrize(
    ("stiffnesses", "message"),
    [
        ((80e3, 144e3), "blas must hold at least three levels, from sticking to sliding, got 2"),
        (
            (80e3, 110e3, 144e3),
            "it is 110 and 144 kN/m at the two lowest levels, more than 10 % apart",
        ),
        ((80e3, 80e3, 80e3), "blas must span from sticking to sliding"),
    ],
)
def test_levels_that_do_not_reach_are_refused(stiffnesses, message):
    with pytest.raises(ValueError, match=message):
        robust.friction_class([level(k, seed=i) for i, k in enumerate(stiffnesses)])


@pytest.fixture(scope="module")
def measured_levels():
    """The rig of the paper at three levels."""
    rig, grid = nlfrf.paper_rig(), {"fs": 4096, "n_samples": 16384, "f_min": 1.25, "f_max": 250, "rng": 1}
    found = []
    for rms in (0.1, 0.25, 2.5):
        ms = nlfrf.multisine("special-odd", rms=rms, **grid)
        found.append(nlfrf.identify(nlfrf.simulate(rig, ms, n_periods=2)))
    return found


def test_the_rig_is_read_from_three_levels(measured_levels):
    found = robust.friction_class(measured_levels)
    assert found.mass[0] == pytest.approx(1.0, rel=0.08)
    assert found.stiffness[0] == pytest.approx(80e3, rel=0.03)
    assert 64e3 < found.friction.K0 < 1.3 * 64e3


def test_what_is_proved_from_levels_is_true(measured_levels):
    """Most of what the truth lets be proved, and nothing that it refutes."""
    found, rng = robust.friction_class(measured_levels), np.random.default_rng(3)
    truth = robust.any_maxwell_slip(64e3, 1.5)
    counts = {}
    for _ in range(24):
        K = pid(rng.uniform(-20e3, 60e3), 10 ** rng.uniform(4.5, 6.5), rng.uniform(10, 200))
        verdicts = (
            robust.prove_friction(RIG, K, truth).verdict,
            robust.prove_friction(found.machine, K, found.friction).verdict,
        )
        counts[verdicts] = counts.get(verdicts, 0) + 1
    assert counts.get(("refuted", "proved"), 0) == 0
    proved = sum(n for (true, _), n in counts.items() if true == "proved")
    assert counts[("proved", "proved")] >= 0.75 * proved > 5


def test_the_command(measured_levels, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    for i, bla in enumerate(measured_levels):
        save_bla(bla, f"{i}.npz")
    robust.save_controller(pid(20e3, 3e5, 60.0), "K.json")

    def run(words):
        monkeypatch.setattr(sys, "argv", ["robust", "prove", *words.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    code, out, _ = run("0.npz 1.npz 2.npz K.json --stiction 1.2 --force 1 -o proof.txt")
    assert code == 0
    assert "proved: Comes to rest from every state with every Maxwell-slip friction" in out
    text = (tmp_path / "proof.txt").read_text()
    assert text.removesuffix("\n\n(written by 'robust prove')\n") in out
    assert "Two standard deviations. Frequency test, not a proof" in out
    assert robust.verify_certificate("proof.certificate.json").verified
    nominal = robust.fit_nominal(measured_levels[2], n_poles=2, n_zeros=0)
    robust.save_model(robust.uncertainty(measured_levels[2], nominal), "m.json")
    code, out, _ = run("m.json K.json --stiffness 74e3 --stiction 1.2")
    assert code == 0
    assert "model of order 2" in out
    assert out.count("proved: Comes to rest") == 2  # without damping, and with that of the fit
    assert "modal damping" in out
    code, out, _ = run("0.npz 1.npz 2.npz K.json --nominal m.json --stiction 1.2")
    assert code == 0
    assert "around a nominal of order 2 at the highest level, modal damping" in out
    code, _, err = run("m.json K.json")
    assert code == 2
    assert "stiffness must be given with a model" in err


TWO_MASSES = {"m": (1.0, 0.5), "k": (80e3, 4e5), "c": (0.4, 2.0)}  # motor on a spring to ground, load on a spring


def two_masses(s, k=0.0, c=0.0):
    """Position over force of the motor, with a spring and a damper more that stand for its friction."""
    (m1, m2), (k1, k2), (c1, c2) = TWO_MASSES.values()
    coupling = c2 * s + k2
    load = m2 * s**2
    return 1 / (m1 * s**2 + (c1 + c) * s + k1 + k + coupling * load / (load + coupling))


@pytest.fixture(scope="module")
def flexible_levels():
    """Friction as a spring and a damper at three levels: sliding, nearly stuck, stuck."""
    f = np.arange(2, 400, 0.5)
    found = []
    for k, c in ((0.0, 1.5), (52e3, 30.0), (60e3, 13.0)):
        size = np.abs(two_masses(2j * np.pi * f, k, c))
        found.append(make_bla(lambda s, k=k, c=c: two_masses(s, k, c), f, f0=0.5, sigma_noise=1e-3 * size, rng=1))
    return found


def test_a_flexible_machine_is_read_around_its_nominal(flexible_levels):
    nominal = robust.fit_nominal(flexible_levels[0], n_poles=4, n_zeros=2)
    found = robust.friction_class(flexible_levels[::-1], nominal=nominal)
    assert found.mass == pytest.approx(1.0, rel=1e-3)  # what the motor feels beyond every resonance
    assert found.stiffness == pytest.approx([0.0, 52e3, 60e3], rel=5e-3, abs=50)
    assert pytest.approx(1.25 * 60e3, rel=5e-3) == found.friction.K0
    assert "modal damping" in str(found)
    assert "176" in str(found)  # the second mode of the sliding machine [Hz]
    still, damped = found.machines
    assert np.abs(np.linalg.eigvals(still.A).real).max() < 1e-6
    assert np.linalg.eigvals(damped.A).real.max() < -0.1
    with pytest.raises(ValueError, match="so low that the friction gets no stiffer: it is 40 and 60"):
        robust.friction_class([flexible_levels[0], flexible_levels[2], stiffer(40e3)], nominal=nominal)
    with pytest.raises(ValueError, match="blas must be stiffer at the lowest level than the nominal"):
        robust.friction_class([flexible_levels[0]] * 3, nominal=nominal)


def stiffer(k):
    f = np.arange(2, 400, 0.5)
    return make_bla(lambda s: two_masses(s, k, 20.0), f, f0=0.5)


def test_a_flexible_machine_is_proved_with_each_damping_and_comes_to_rest(flexible_levels):
    """The proof of a fit speaks of the machine behind it: random members of the class around the true one settle."""
    nominal = robust.fit_nominal(flexible_levels[0], n_poles=4, n_zeros=2)
    found = robust.friction_class(flexible_levels, nominal=nominal)
    clock = 2.5e-4
    K = control.StateSpace([[1, 0], [0, 0]], [[1], [1]], [[3e5 * clock, -60 / clock]], [[20e3 + 60 / clock]], clock)
    proofs = [robust.prove_friction(machine, K, found.friction) for machine in found.machines]
    assert [proof.verdict for proof in proofs] == ["proved", "proved"]
    loop = sliding_loop(robust.sliding_machine(truth()), K)
    rng = np.random.default_rng(0)
    for _ in range(3):
        elements = [
            Element(k, W, 1.5, rng) for k, W in zip(64e3 * rng.dirichlet(np.ones(3)), rng.random(3), strict=True)
        ]
        kicked = np.zeros(loop.F.shape[0])
        kicked[:4] = np.linalg.pinv(np.vstack([loop.x[:4], loop.v[:4]])) @ [0.0, 0.3]
        path = np.array([loop.v @ xi for xi, _, _ in motion(loop, elements, kicked, np.array([100.0]), 2400, steps=8)])
        assert np.abs(path[-200:]).max() < 1e-3 * np.abs(path).max()


def truth():
    """The two masses as a state space, force to position of the motor."""
    (m1, m2), (k1, k2), (c1, c2) = TWO_MASSES.values()
    rows = [[0, 1, 0, 0], [-(k1 + k2) / m1, -(c1 + c2) / m1, k2 / m1, c2 / m1]]
    rows += [[0, 0, 0, 1], [k2 / m2, c2 / m2, -k2 / m2, -c2 / m2]]
    return control.StateSpace(rows, [[0], [1 / m1], [0], [0]], [[1, 0, 0, 0]], 0)
