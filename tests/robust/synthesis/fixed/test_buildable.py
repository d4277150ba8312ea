"""What a design says of its loop, and of gains that cannot be built."""

import re

import control
import numpy as np
import pytest

import robust
from tests.support.printed import unwrapped

PLANT = control.tf([60.0**2], [1, 36.0, 60.0**2])
ASKED = {"M_S": 1.8, "dt": 5e-3, "delay": 0.02}


def filter_pole(K):
    """The pole of the derivative filter of a sampled PID."""
    return min(K.poles().real)


def test_a_filter_chosen_by_the_design_does_not_ring():
    """A pole of z below zero alternates from sample to sample; 4aa289a let it go down to -0.67."""
    for M_S in (1.3, 1.8, 2.5):
        K = robust.design_frf(control.tf([1], [1, 1, 0]), "PID", **ASKED | {"M_S": M_S}).K
        assert filter_pole(K) > -1e-6


def test_a_filter_time_that_rings_is_warned_of():
    for filter_time, pole in ((1e-3, -3 / 7), (2.4e-3, -0.1 / 4.9)):
        with pytest.warns(
            robust.DesignWarning,
            match=r"the derivative rings, d\[k\] = -0\.\d+ d.*use two samples, 0.01 s",
        ):
            design = robust.design_frf(
                PLANT, "PID", filter_time=filter_time, n_iterations=1, **ASKED
            )
        assert filter_pole(design.K) == pytest.approx(pole, rel=1e-6)
    robust.design_frf(
        PLANT, "PID", filter_time=2.5e-3, n_iterations=1, **ASKED
    )  # warnings are errors here


def test_an_integral_that_is_nothing_is_named(said_of):
    _, err = said_of(robust.shaping.pid(2.0, 2.0 / 3.75e9, dt=1e-3))
    warned = "Ti = 3.75e+09 s: the integral is negligible; --structure P leaves it out"
    assert warned in " ".join(err.split())
    assert "Ti" not in said_of(robust.shaping.pid(2.0, 2.0 / 900, dt=1e-3))[1]


def test_a_design_says_where_its_loop_crosses_over_and_how_far_it_peaks():
    design = robust.design_frf(PLANT, "PI", M_S=1.6, M_T=1.2, dt=5e-3, delay=0.02)
    L = (
        control.sample_system(PLANT, 5e-3, "zoh")
        * control.tf([1], [1, 0, 0, 0, 0], 5e-3)
        * design.K
    )
    z = np.exp(1j * np.linspace(0.1, np.pi / 5e-3, 20000) * 5e-3)
    L = L(z)
    loop, S = design.loop, np.abs(1 / (1 + L))
    assert loop.peak_S.value == pytest.approx(S.max(), rel=1e-3)
    assert S[np.argmin(np.abs(np.angle(z) / 5e-3 - loop.peak_S.omega))] > 0.99 * S.max()
    assert loop.peak_T.value == pytest.approx(max(1.0, np.abs(L / (1 + L)).max()), rel=1e-3)
    (crossover,) = loop.crossovers
    near = np.argmin(np.abs(np.log(np.abs(L))))
    assert crossover == pytest.approx(np.angle(z[near]) / 5e-3, rel=1e-2)
    row = str(design).splitlines()[1]
    assert re.fullmatch(
        r"  crossover [\d.]+ Hz; nominal max \|S\| 1\.\d+, max \|T\| 1(\.\d+)?", row
    )


def test_the_command_takes_a_limit_on_T_and_a_filter_time(command_on_light_mode):
    run = command_on_light_mode
    line = (
        "robust design m.json --sample-time 0.005 --delay 0.02 --peak 1.8 -o K.json --peak-t 1.1"
        " --filter-time 0.01"
    )
    code, out, err = run(f"{line} --method pid")
    assert code == 0, err
    assert "Tf = 0.01 s" in unwrapped(out).replace("PID ", "")
    peak = float(re.search(r"max \|T\| (\S+)", out)[1])
    assert peak <= 1.1
    code, _, err = run(f"{line} --bandwidth 1")
    assert code == 2
    assert "filter-time must be given with --method pid" in err


def test_a_design_is_told_to_save_its_controller(tmp_path):
    design = robust.design_frf(PLANT, "PI", n_iterations=1, **ASKED)
    with pytest.raises(
        ValueError, match=r"^thing must be the controller, got a Design: save its K, of order 1$"
    ):
        robust.save(design, tmp_path / "K.json")
