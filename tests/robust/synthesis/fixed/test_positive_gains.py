"""PID gains that a PLC takes: all of one sign, under the names of its blocks; and a warning where
they are not.
"""

import re

import control
import numpy as np
import pytest

import robust
from robust.io import PidGains
from tests.support.printed import unwrapped
from tests.support.responses import response

PLANT = control.tf([60.0**2], [1, 36.0, 60.0**2])  # with a delay as long as a third of its period
ASKED = {"M_S": 1.8, "dt": 5e-3, "delay": 0.02}


def gains_of(K):
    found = robust.io.pid_gains(K)
    return np.array([found.kp, found.ki, found.kd])


def test_free_gains_have_different_signs_here():
    """Else nothing below was tried."""
    design = robust.design_frf(PLANT, "PID", **ASKED)
    assert design.met
    kp, ki, kd = gains_of(design.K)
    assert kp < 0 < min(ki, kd)


@pytest.mark.parametrize(
    "structure",
    ["PI", *(pytest.param(one, marks=pytest.mark.attack) for one in ("P", "I", "PD", "PID"))],
)
def test_positive_gains_are_positive_and_meet_the_limits(structure):
    """Of a PID the command below designs one with the same limits."""
    design = robust.design_frf(PLANT, structure, positive=True, **ASKED)
    assert design.met, design.reason
    assert_positive_and_within_limits(design.K)


def assert_positive_and_within_limits(K):
    assert np.all(gains_of(K) >= 0)
    loop = control.sample_system(PLANT, 5e-3, "zoh") * control.tf([1], [1, 0, 0, 0, 0], 5e-3) * K
    S = control.feedback(1, loop)
    assert np.all(np.abs(S.poles()) < 1)
    w = np.linspace(0.1, np.pi / 5e-3, 4000)
    assert np.abs(S(np.exp(1j * w * 5e-3))).max() < 1.8 * 1.002  # a demand may be missed by 1e-3


@pytest.mark.attack
def test_what_three_gains_can_do_two_cannot_do_better():
    """Of positive gains PI is a PID, so the gain at low frequency of the latter is no smaller."""
    pid, pi = (
        gains_of(robust.design_frf(PLANT, name, positive=True, **ASKED).K)[1]
        for name in ("PID", "PI")
    )
    assert pid > 0.99 * pi


@pytest.mark.attack
def test_no_filter_that_is_given_does_better():
    """Six filter times alone reached 0.92 of the integral gain, with a proportional gain of
    zero.
    """
    w = 2 * np.pi * np.arange(1.0, 60.0)
    P = control.tf([1], [2, 60, 2 * (2 * np.pi * 20) ** 2]) * control.tf([300], [1, 300])
    asked = {"M_S": 1.8, "dt": 1e-3, "delay": 5e-3, "positive": True}
    frf = control.frd(P(1j * w), w)
    given = [
        robust.design_frf(frf, "PID", filter_time=T, **asked) for T in np.geomspace(5e-4, 5e-2, 20)
    ]
    best = max(gains_of(design.K)[1] for design in given if design.met)
    assert gains_of(robust.design_frf(frf, "PID", **asked).K)[1] > 0.99 * best


def test_gains_that_are_positive_of_themselves_are_not_touched():
    plant, asked = control.tf([1], [1 / 6000, 1 / 20 + 1 / 300, 1]), {"M_S": 1.6, "dt": 5e-4}
    free, kept = (robust.design_frf(plant, "PID", positive=only, **asked) for only in (False, True))
    assert np.all(gains_of(free.K) > 0)
    np.testing.assert_allclose(gains_of(kept.K), gains_of(free.K), rtol=1e-6)


@pytest.mark.parametrize(
    ("asked", "refusal"),
    [
        ({"structure": "lead"}, "positive must be used with P, I, PI, PD, PID, got it with 'lead'"),
        ({"structure": 2}, "positive must be used with"),
        (
            {
                "structure": "PID",
                "start": robust.shaping.pid(-0.1, 1.0, 1e-3, filter_time=1e-3),
                "filter_time": 1e-3,
            },
            "negative",
        ),
    ],
)
def test_what_positive_is_not_asked_of(asked, refusal):
    with pytest.raises(ValueError, match=refusal):
        robust.design_frf(control.tf([1], [0.1, 1]), M_S=1.8, positive=True, **asked)


def test_a_plant_of_the_other_sign_is_told_what_to_do():
    with pytest.raises(ValueError, match="y falls as u rises: change the sign of one of them"):
        robust.design_frf(control.tf([-1], [0.1, 1]), "PI", M_S=1.8, positive=True)


def test_the_ideal_form_of_the_blocks_is_the_controller():
    """From the names of a block back to the transfer function, by the formula of its manual."""
    gains = PidGains(kp=2.5, ki=40.0, kd=0.03, filter_time=0.002)
    s = 1j * np.geomspace(0.1, 1e4, 30)
    wanted = gains.kp + gains.ki / s + gains.kd * s / (gains.filter_time * s + 1)
    compact, classic, twincat = (
        {
            name.strip(): float(number.split()[0])
            for name, number in (one.split("=") for one in row.split(":")[1].split(","))
        }
        for row in gains.plc_parameters()
    )
    Kp, Ti, Td, a = (compact[name] for name in ("Gain", "Ti", "Td", "TdFiltRatio"))
    np.testing.assert_allclose(
        Kp * (1 + 1 / (Ti * s) + Td * s / (a * Td * s + 1)), wanted, rtol=1e-5
    )
    Kp, Ti, Td, lag = (classic[name] for name in ("GAIN", "TI", "TD", "TM_LAG"))
    np.testing.assert_allclose(Kp * (1 + 1 / (Ti * s) + Td * s / (lag * s + 1)), wanted, rtol=1e-5)
    Kp, Tn, Tv, Td = (twincat[name] for name in ("fKp", "tTn", "tTv", "tTd"))
    np.testing.assert_allclose(Kp * (1 + 1 / (Tn * s) + Tv * s / (Td * s + 1)), wanted, rtol=1e-5)


def test_no_ideal_form_and_no_plc_where_times_are_negative_or_below_a_sample():
    """4aa289a printed Ti = -0.003 s and Td = -0.165 s without a word."""
    gains = PidGains(kp=-2.61, ki=870.0, kd=0.43, filter_time=0.01)
    assert (
        "ideal: none that a PLC takes, as Ti = -0.003 s and Td = -0.1648 s would be negative"
        in unwrapped(gains)
    )
    assert gains.plc_parameters() == []
    for integral_time, takes in ((1.001e-3, True), (0.999e-3, False)):  # a cycle of 1 ms
        gains = PidGains(kp=2.0, ki=2.0 / integral_time, dt=1e-3)
        assert gains.has_ideal_form == takes == bool(gains.plc_parameters())
    assert (
        "Ti = 0.000999 s would be shorter than a sample of 1 ms; use the parallel form"
        in unwrapped(gains)
    )
    inverted = PidGains(kp=-2.0, ki=-4.0)  # a plant of negative gain: the times are positive
    assert inverted.has_ideal_form
    assert "Gain = -2, Ti = 0.5 s, Td = 0 s" in inverted.plc_parameters()[0]


def test_the_command_takes_positive_with_the_method_pid_alone(command_on_light_mode):
    code, _, err = command_on_light_mode(
        "robust design m.json --method ncfsyn --positive --bandwidth 1 -o K.json"
    )
    assert code == 2
    assert "positive must be given with --method pid" in err


@pytest.mark.attack
def test_the_command_warns_and_positive_cures(command_on_light_mode):
    run = command_on_light_mode
    line = "robust design m.json --method pid --sample-time 0.005 --delay 0.02 --peak 1.8 -o K.json"
    code, out, err = run(line)
    assert code == 0
    assert "no PLC takes gains of different signs; --positive keeps them positive" in err
    assert "PID ideal: none that a PLC takes" in out
    assert "Siemens" not in out
    code, out, err = run(f"{line} --positive")
    assert code == 0
    assert "warning" not in err
    assert "PID Siemens PID_Compact: Gain = " in out
    assert "PID TwinCAT FB_CTRL_PID: fKp = " in out
    assert_positive_and_within_limits(robust.load("K.json"))


def test_a_proportional_gain_that_does_nothing_is_named_and_an_integrator_is_as_good(said_of):
    plant = control.tf([60.0**2], [1, 2.4, 60.0**2])
    design = robust.design_frf(plant, "PI", positive=True, **ASKED)
    assert re.search(
        r"Kp = \S+ is at most \S+ % of \|K\| on the lines: K is an integrator. Use --structure I",
        unwrapped(said_of(design.K)[0]),
    )
    alone = robust.design_frf(plant, "I", positive=True, **ASKED)
    assert gains_of(alone.K)[1] == pytest.approx(gains_of(design.K)[1], rel=1e-3)


def test_an_integrator_and_a_derivative_are_no_integrator(said_of):
    K = robust.shaping.pid(1e-4, 1.3e8, 930.0, filter_time=1.3e-3)
    advice = "has Ti and Td. Use the parallel form, or --structure PI or I"
    assert advice in unwrapped(said_of(K)[0])


@pytest.mark.parametrize(
    "K",
    [
        robust.shaping.pid(2.0, 3.0),
        robust.shaping.pid(1.0),
        control.tf([1], [1, 1]),
        robust.shaping.pid(0.0, 0.0, 1.0, filter_time=0.1),
    ],
)
def test_other_controllers_get_no_advice(K, said_of):
    assert "% of |K|" not in unwrapped(said_of(K)[0])


def test_a_design_without_a_weight_has_no_gamma_to_print():
    design = robust.design_frf(PLANT, "PI", positive=True, **ASKED)
    assert np.isnan(design.gamma)
    assert (
        str(design).splitlines()[0] == "controller of order 1, sampled at 200 Hz: every limit met"
    )
    missed = robust.design_frf(PLANT, "PI", M_S=0.9, dt=5e-3, delay=0.02)
    assert str(missed).splitlines()[0] == "controller of order 1, sampled at 200 Hz: LIMITS NOT MET"


def test_gains_in_front_of_a_fixed_factor_are_positive():
    """A fixed notch was refused; the gains are those of the PID in front of it."""
    plant = control.tf([1], [1 / 6000, 1 / 20 + 1 / 300, 1])
    notch = robust.shaping.notch(250.0, depth=0.3, width=0.4, dt=5e-4)
    design = robust.design_frf(plant, "PI", positive=True, M_S=1.6, dt=5e-4, fixed=notch)
    assert design.met
    assert np.all(gains_of(design.K_free)[:2] > 0)
    omega = np.array([10.0, 240.0, 1000.0])
    product = response(design.K_free, omega) * response(notch, omega)
    np.testing.assert_allclose(response(design.K, omega), product, rtol=1e-9)


def test_the_command_keeps_the_filters_of_a_file(command_on_light_mode, tmp_path):
    notch = '[[filters]]\nnotch = "9.5 Hz"\nbandwidth = "4 Hz"\ndepth = 0.3\n'
    head = 'sample_time = "2 ms"\nKp = 1\n'
    (tmp_path / "pid.toml").write_text(f"{head}{notch}", encoding="utf-8")
    (tmp_path / "plain.toml").write_text(head, encoding="utf-8")
    line = "robust design m.json --method pid --structure PI --peak 1.8 --sample-time 0.002"
    code, out, _ = command_on_light_mode(f"{line} --positive --fixed pid.toml -o K.json")
    assert code == 0
    assert "fixed, behind it: notch" in out
    assert re.search(r"PID parallel, Kp \+ Ki/s: Kp = [\d.]+", out)
    K = robust.load(tmp_path / "K.json")
    assert abs(response(K, np.array([2 * np.pi * 9.5])))[0] < 0.5 * min(
        abs(response(K, 2 * np.pi * np.array([5.0, 20.0])))
    )
    code, _, err = command_on_light_mode(f"{line} --fixed plain.toml -o K.json")
    assert code == 2
    assert "fixed must have [[filters]], got plain.toml without" in err
    code, _, err = command_on_light_mode(
        "robust design m.json --bandwidth 3 --fixed pid.toml -o K.json"
    )
    assert code == 2
    assert "--fixed must be given with --method pid" in err
