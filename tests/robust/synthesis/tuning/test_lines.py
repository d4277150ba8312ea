"""Plants known on lines: the same loop as a system, its winding number, what a coarse or unstable
start is told.
"""

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust import tuning

ERROR = control.summing_junction(["r", "-y"], "e")
FORCE = control.summing_junction(["u", "d"], "f")
DT = 0.01
PLANT = control.tf([400], [1, 4, 400])
OMEGA = np.geomspace(0.1, 250, 600)
LIMITS = {
    "hard": [tuning.Limit("d", "f", 1.8)],
    "soft": [tuning.Limit("d", "y", 1.0, band=(0.0, 3.0))],
}


def measured(omega=OMEGA):
    """The plant as an FRF, with the hold of the controller in it."""
    z = np.exp(1j * omega * DT)
    return control.FrequencyResponseData(robust.sampled(PLANT, DT)(z), omega, dt=DT)


def blocks(ki=1.0):
    return {
        "K": tuning.Pid(kp=0.05, ki=ki, reads="e", drives="u_c"),
        "N": tuning.Notch(omega=20.0, reads="u_c", drives="u"),
    }


@pytest.mark.attack
def test_an_frf_gives_what_its_system_gives():
    """The same limits on 600 lines and on the system: the same optimum, within what lies between
    the lines.
    """
    on_lines = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(measured(), inputs="f", outputs="y"),
        blocks(),
        **LIMITS,
        dt=DT,
        rng=1,
    )
    exact = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(PLANT, inputs="f", outputs="y"),
        blocks(),
        **LIMITS,
        dt=DT,
        rng=1,
    )
    assert on_lines.met
    assert exact.met
    assert on_lines.gamma == pytest.approx(exact.gamma, rel=0.02)
    assert all(one.n_lines for one in on_lines.limits)
    hard = next(one for one in on_lines.limits if one.hard)
    assert hard.n_lines == OMEGA.size
    report = robust.check(measured(), on_lines.controller("y", "u"), w_P=1 / (1.8 * hard.ratio))
    assert report.nominally_stable
    assert np.max(report.curves.np_[np.isin(report.curves.omega, OMEGA)]) == pytest.approx(
        1.0, abs=1e-6
    )


def test_a_bla_is_tuned_at_worst_over_its_discs():
    """A record of a lag with noise: no plant in the discs has a larger |S| on the lines."""
    rng = np.random.default_rng(2)
    ms = nlfrf.multisine(fs=256, n_samples=512, f_min=0.5, f_max=100, rms=1.0, rng=2)
    u = np.repeat(ms.u.reshape(1, 1, -1), 6, axis=1)
    y = np.real(
        np.fft.irfft(np.fft.rfft(u, axis=-1) * 1 / (1 + 1j * np.arange(257) / 12), n=512, axis=-1)
    )
    y += 0.02 * rng.normal(size=y.shape)
    bla = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines, hold="band-limited"))
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(bla, inputs="f", outputs="y"),
        {"K": tuning.Pid(kp=0.2, ki=1.0, reads="e", drives="u")},
        hard=[tuning.Limit("d", "f", 1.7, worst=True)],
        soft=[tuning.Limit("r", "e", 1.0, band=(0.0, 5.0))],
        dt=1 / 256,
        rng=1,
        n_starts=1,
    )
    assert design.met
    hard = next(one for one in design.limits if one.hard)
    report = robust.check(bla, design.controller("y", "u"), w_P=1 / (1.7 * hard.ratio))
    assert report.nominally_stable
    assert np.max(report.curves.rp) == pytest.approx(1.0, abs=1e-6)


def test_a_start_that_does_not_stabilise_is_refused():
    with pytest.raises(
        ValueError,
        match=r"must start with gains that stabilise every plant that is an FRF.*design_frf",
    ):
        robust.tune(
            [ERROR, FORCE],
            tuning.Plants(measured(), inputs="f", outputs="y"),
            blocks(ki=200.0),
            **LIMITS,
            dt=DT,
        )


def test_lines_too_coarse_for_a_mode_are_refused():
    """Two lines about a mode of 2 % damping: the winding number is open."""
    omega = np.array([0.1, 1.0, 5.0, 15.0, 26.0, 60.0, 200.0])
    with pytest.raises(ValueError, match=r"lines so close.*Measure with more lines"):
        robust.tune(
            [ERROR, FORCE],
            tuning.Plants(measured(omega), inputs="f", outputs="y"),
            {"K": tuning.Pid(kp=2.0, ki=1.0, reads="e", drives="u")},
            **LIMITS,
            dt=DT,
        )


def test_a_band_without_lines_is_refused():
    with pytest.raises(ValueError, match=r"soft\[0\] must have lines of plant 0 in its band"):
        robust.tune(
            [ERROR, FORCE],
            tuning.Plants(measured(), inputs="f", outputs="y"),
            blocks(),
            soft=[tuning.Limit("d", "y", band=(0.0, 0.01))],
            dt=DT,
        )


def test_several_channels_on_lines():
    """Two lags with coupling, a matrix of gains, as FRF and as system."""
    G = control.ss(-np.eye(2), np.eye(2), [[1.0, 0.3], [-0.2, 1.0]], np.zeros((2, 2)))
    omega = np.geomspace(0.01, 100, 300)
    frf = control.FrequencyResponseData(G(1j * omega), omega)
    errors = [control.summing_junction([f"r{k}", f"-y{k}"], f"e{k}") for k in (1, 2)]
    common = {
        "hard": [tuning.Limit(["r1", "r2"], ["u1", "u2"], 5.0)],
        "soft": [tuning.Limit(["r1", "r2"], ["e1", "e2"], 1.0, band=(0.0, 0.5))],
        "rng": 1,
        "n_starts": 1,
    }
    block = {"K": tuning.Gain(K=np.eye(2), reads=["e1", "e2"], drives=["u1", "u2"])}
    found = [
        robust.tune(
            errors, tuning.Plants(one, inputs=["u1", "u2"], outputs=["y1", "y2"]), block, **common
        )
        for one in (frf, G)
    ]
    assert all(one.met for one in found)
    assert found[0].gamma == pytest.approx(found[1].gamma, rel=0.01)
