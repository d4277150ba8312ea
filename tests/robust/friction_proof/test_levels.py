"""Machine and class from measured levels: what is read is right, and levels that do not reach are refused."""

import sys

import numpy as np
import pytest

import nlfrf
import robust
from nlfrf import save_bla
from robust import cli
from tests.support.bla import make_bla
from tests.support.friction_loops import RIG, pid

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
    assert (tmp_path / "proof.txt").read_text() in out
    nominal = robust.fit_nominal(measured_levels[2], n_poles=2, n_zeros=0)
    robust.save_model(robust.uncertainty(measured_levels[2], nominal), "m.json")
    code, out, _ = run("m.json K.json --stiffness 74e3 --stiction 1.2")
    assert code == 0
    assert "model of order 2" in out
    code, _, err = run("m.json K.json")
    assert code == 2
    assert "stiffness must be given with a model" in err
