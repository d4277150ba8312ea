"""Gains of a PID: what was put in comes out, and the printed lines are the controller."""

import re
import sys

import control
import numpy as np
import pytest
from scipy.signal import dlsim

import robust
from robust import cli, design_frf, fit_nominal, save, uncertainty
from robust.io import pid_gains
from tests.support.bla import make_bla
from tests.support.printed import unwrapped


def random_pids(n):
    """Gains of many kinds, over decades."""
    rng = np.random.default_rng(7)
    for k in range(n):
        kp = 10 ** rng.uniform(-2, 6)
        tau = 10 ** rng.uniform(-3, -1)
        yield {
            "kp": 0.0 if k % 7 == 0 else kp * rng.choice([1, 1, -1]),
            "ki": 0.0 if k % 5 == 1 else kp * 10 ** rng.uniform(-1, 2),
            "kd": 0.0 if k % 3 == 1 else kp * 10 ** rng.uniform(-3, -1),
            "filter_time": 0.0 if k % 3 == 1 else tau,
        }


def typed_in(lines, e):
    """Run the printed lines as a PLC would, sample by sample."""
    state = dict.fromkeys(("i", "d", "u"), 0.0)
    code = []
    for line in lines:
        target, formula = line.split(" = ")
        formula = re.sub(r"([iduey])\[k-1\]", r"old_\1", formula)
        formula = re.sub(r"([iduey])\[k\]", r"\1", formula)
        formula = re.sub(r"(?<=[\d.]) (?=[a-z(])", " * ", formula)
        code.append((target[0], compile(formula, "plc", "eval")))
    out, old_e = [], 0.0
    for now in e:
        names = {f"old_{k}": v for k, v in state.items()} | {"old_e": old_e, "e": now}
        for target, formula in code:
            names[target] = state[target] = eval(formula, {}, names)
        out.append(state["u"])
        old_e = now
    return np.array(out)


@pytest.mark.parametrize("gains", list(random_pids(14)))
@pytest.mark.parametrize("dt", [0.0, 1e-3, 0.05])
def test_what_was_put_in_comes_out_and_the_lines_are_the_controller(gains, dt):
    if not any(gains[name] for name in ("kp", "ki", "kd")):
        pytest.skip("no controller at all")
    seen = pid_gains(robust.shaping.pid(**gains, dt=dt), dt=None if dt else 0.01)
    for name in ("kp", "ki", "kd"):
        size = abs(gains["kp"]) + abs(gains["ki"]) + abs(gains["kd"])
        assert getattr(seen, name) == pytest.approx(gains[name], rel=1e-6, abs=1e-9 * size)
    if gains["kd"]:
        assert seen.filter_time == pytest.approx(gains["filter_time"], rel=1e-6)
    step = dt or 0.01
    K = robust.shaping.pid(**gains, dt=step)
    e = np.random.default_rng(1).standard_normal(300)
    _, u, _ = dlsim((K.A, K.B, K.C, K.D, step), e)
    typed = typed_in(seen.difference_equation(), e)
    np.testing.assert_allclose(typed, u[:, 0], atol=1e-6 * np.abs(u).max())


def test_both_forms_are_the_same_controller():
    seen = pid_gains(robust.shaping.pid(2.0, 3.0, 0.1, filter_time=0.01), unit="mm/V")
    s = 7j
    ideal = seen.kp * (
        1 + 1 / (seen.integral_time * s) + seen.derivative_time * s / (seen.filter_time * s + 1)
    )
    assert ideal == pytest.approx(
        complex(robust.shaping.pid(2.0, 3.0, 0.1, filter_time=0.01)(s)), rel=1e-9
    )
    assert "Kp = 2 V/mm, Ki = 3 V/mm/s, Kd = 0.1 V/mm s, Tf = 0.01 s" in unwrapped(seen)
    assert "Ti = 0.666667 s, Td = 0.05 s" in unwrapped(seen)
    with pytest.raises(ValueError, match="dt must be given to pid_gains"):
        seen.difference_equation()


def test_what_is_no_pid_is_refused():
    for K in (
        control.tf([1], [1, 0, 0]),
        control.tf([1], [1, 2, 100]),
        control.tf([1, 1], [1, -1]),
        control.tf([1], np.poly([-1, -2, -3])),
        control.tf([1], [1, 3, 2]),
    ):
        with pytest.raises(ValueError, match="K must be a PID"):
            pid_gains(K)
    with pytest.raises(ValueError, match="dt must be the sampling time of K"):
        pid_gains(robust.shaping.pid(1.0, 2.0, dt=0.1), dt=0.2)


def test_a_design_is_a_pid_and_the_commands_print_it(tmp_path, monkeypatch, capsys):
    f = np.arange(1, 80, 2) * 0.3
    bla = make_bla(
        lambda s: 200 / (s * s + 30 * s + 900),
        f,
        f0=0.3,
        sigma_distortion=0.002,
        hold="band-limited",
    )
    K = design_frf(bla, "PID", M_S=2.0, dt=0.01).K
    seen = pid_gains(K)
    e = np.random.default_rng(1).standard_normal(200)
    _, u, _ = dlsim((K.A, K.B, K.C, K.D, 0.01), e)
    np.testing.assert_allclose(
        typed_in(seen.difference_equation(), e), u[:, 0], atol=1e-5 * np.abs(u).max()
    )
    save(uncertainty(bla, fit_nominal(bla, n_poles=2, n_zeros=0)), tmp_path / "m.json")
    save(K, tmp_path / "K.json")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["robust", "check", "m.json", "K.json", "--no-certify"])
    with pytest.raises(SystemExit):
        cli.main()
    said = capsys.readouterr().out
    assert f"PID {str(seen).splitlines()[0]}" in said
    assert "once a sample, at 100 Hz" in said


def anywhere(n):
    """PIDs of any size on any clock."""
    rng = np.random.default_rng(12)
    for k in range(n):
        dt = 0.0 if k % 3 == 0 else 10 ** rng.uniform(-9, 1)
        kp, ki, kd = (rng.choice([0, 1, 1, -1]) * 10 ** rng.uniform(-12, 12) for _ in range(3))
        if kp or ki or kd:
            yield kp, ki, kd, (dt or 1.0) * 10 ** rng.uniform(-0.3, 4) if kd else 0.0, dt


def test_every_gain_comes_back_from_any_scale_and_clock():
    """To 1e-9, Kp but for the rounding of what stands in D with it."""
    for kp, ki, kd, tau, dt in anywhere(600):
        found = pid_gains(
            robust.shaping.pid(kp, ki, kd, filter_time=tau, dt=dt)
            if kd
            else robust.shaping.pid(kp, ki, dt=dt)
        )
        assert found.ki == pytest.approx(ki, rel=1e-9, abs=0)
        assert found.kd == pytest.approx(kd, rel=1e-9, abs=0)
        beside = abs(ki) * dt / 2 + (abs(kd) / tau + (abs(kd) / dt if dt else 0.0) if kd else 0.0)
        assert abs(found.kp - kp) <= 1e-9 * abs(kp) + 3e-14 * beside
        assert kp or not found.kp


def test_small_gains_are_not_lost():
    for kp, dt in ((1e-8, 1e-6), (1e-9, 1e-9)):
        assert pid_gains(robust.shaping.pid(kp, 1.0, dt=dt)).kp == pytest.approx(kp, rel=1e-9)
    assert pid_gains(robust.shaping.pid(-8.04e-6, -538.5, dt=1.02e-6)).kp == pytest.approx(
        -8.04e-6, rel=1e-9
    )
    assert pid_gains(control.tf([-71.7, 1.4e-9], [1, 0])).ki == pytest.approx(1.4e-9, rel=1e-9)


@pytest.mark.parametrize("K", [0.0, robust.shaping.pid(0.0, dt=1e-3), control.tf([0.0], [1, 0])])
def test_a_controller_that_is_zero(K):
    found = pid_gains(K)
    assert (found.kp, found.ki, found.kd) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("dt", [0, 1e-3])
def test_a_controller_of_several_loops_has_the_gains_of_each(dt):
    gains = [
        {"kp": 2.0, "ki": 3.0, "kd": 0.1, "filter_time": 0.01},
        {"kp": -0.4, "ki": 0.0, "kd": 0.0},
    ]
    loops = [robust.shaping.pid(**one, dt=dt) for one in gains]
    rng = np.random.default_rng(1)
    K = control.append(*loops)
    order = rng.permutation(K.nstates)  # the states of the loops need not lie side by side
    mixed = control.ss(K.A[np.ix_(order, order)], K.B[order], K.C[:, order], K.D, K.dt)
    for found, wanted in zip(pid_gains(mixed), map(pid_gains, loops), strict=True):
        assert (found.kp, found.ki, found.kd) == pytest.approx((wanted.kp, wanted.ki, wanted.kd))
    if dt:
        for found, loop in zip(robust.io.controller_sections(mixed), loops, strict=True):
            np.testing.assert_allclose(found, robust.io.controller_sections(loop), atol=1e-9)


def test_a_controller_that_couples_its_channels_is_refused():
    K = control.ss([], [], [], [[1.0, 0.2], [0.0, 1.0]], inputs=["x", "y"], outputs=["fx", "fy"])
    for of in (pid_gains, robust.io.controller_sections):
        with pytest.raises(
            ValueError,
            match="K must be diagonal, a loop for each channel, got a coupling from y to fx",
        ):
            of(control.ss(K.A, K.B, K.C, K.D, 0.1, inputs=K.input_labels, outputs=K.output_labels))
    with pytest.raises(ValueError, match="K must have as many inputs as outputs, got 2 and 1"):
        pid_gains(np.ones((1, 2)))
