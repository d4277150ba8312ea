"""The check of an FRF of several channels: on its lines, without a set around it."""

import control
import numpy as np
import pytest

import robust
from robust import check
from tests.support.printed import unwrapped

OMEGA = np.geomspace(0.1, 100, 60)
G = control.ss(
    np.diag([-1.0, -2, -3]),
    [[1.0, 0], [0, 1], [1, 1]],
    [[1.0, 0.2, 0], [0, 1, 0.3]],
    np.zeros((2, 2)),
)
K = control.ss(
    np.zeros((2, 2)), np.eye(2), 2 * np.eye(2), 2 * np.eye(2)
)  # 2 (1 + 1/s) in both loops


def frf(plant, dt=0):
    return control.FrequencyResponseData(plant(1j * OMEGA), OMEGA, dt)


def test_its_peak_and_margins_are_those_of_the_plant():
    w_P = control.tf([0.5], [1])
    report = check(frf(G), K, w_P=w_P)
    S = np.linalg.inv(
        np.eye(2) + np.moveaxis(G(1j * OMEGA), 2, 0) @ np.moveaxis(K(1j * OMEGA), 2, 0)
    )
    sizes = np.linalg.norm(S, 2, axis=(1, 2))
    assert (report.verdict, report.nominally_stable) == ("not certified", True)
    assert report.margins.S_worst == pytest.approx(sizes.max(), rel=1e-9)
    assert report.margins.omega_S_worst == OMEGA[sizes.argmax()]
    np.testing.assert_allclose(report.curves.np_, 0.5 * sizes, rtol=1e-9)
    assert "The largest singular value of S on 60 lines is" in unwrapped(str(report))
    assert report.channels.everywhere.alpha == pytest.approx(
        robust.margins.disk_margins(frf(G), K).everywhere.alpha, rel=1e-9
    )


def test_the_winding_of_the_determinant_decides():
    unstable = check(frf(-10 * G), K)
    assert (unstable.verdict, unstable.nominally_stable) == ("not robust", False)
    assert "1 + L winds" in unstable.reason
    few = check(control.FrequencyResponseData((20 * G)(1j * OMEGA[:3]), OMEGA[:3]), K)
    assert few.verdict == "not certified"
    assert "do not show the winding number of 1 + L: it turns by" in few.reason


def test_hold_and_delay_are_put_in():
    K_d = control.ss([], [], [], 2 * np.eye(2), 0.01)
    late = check(frf(G), K_d, delay=0.05)
    assert (
        late.margins.S_worst
        > check(frf(G), K_d).margins.S_worst
        > check(frf(G), 2 * np.eye(2)).margins.S_worst
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: check(frf(G), 2.0), "K must have"),
        (
            lambda: check(frf(G * np.nan), K),
            "model must have a finite FRF on every line, got .* at 0.01592 Hz",
        ),
        (
            lambda: check(frf(G), control.ss([], [], [], np.eye(2), 0.1)),
            "K must have its Nyquist frequency above the last line",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("zeta", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("times", [50, -50, 0.5])
def test_a_light_mode_of_the_controller_between_two_lines_is_counted(times, zeta):
    """The loop with 1 - 50 times a mode is unstable, and was said to be stable on its lines."""
    lines = np.geomspace(0.1, 100, 200)
    at = float(np.sqrt(lines[120] * lines[121]))
    mode = 1 - control.tf([2 * times * zeta * at, 0], [1, 2 * zeta * at, at**2])
    G = control.ss(-np.eye(2), np.eye(2), [[1, 0.2], [0.1, 1]], np.zeros((2, 2)))
    K = control.append(control.ss(5 * mode), control.ss([], [], [], [[2.0]]))
    stable = bool(np.all(control.feedback(G * K, np.eye(2)).poles().real < 0))
    frf = control.FrequencyResponseData(G(1j * lines), lines)
    report, margins = robust.check(frf, K), robust.margins.disk_margins(frf, K)
    assert report.nominally_stable == stable
    assert (not margins.reason) == stable
    if stable:
        omega = np.union1d(lines, at * (1 + zeta * np.linspace(-100, 100, 4001)))
        L = np.moveaxis(G(1j * omega), 2, 0) @ np.moveaxis(K(1j * omega), 2, 0)
        S = np.linalg.norm(np.linalg.inv(np.eye(2) + L), 2, axis=(1, 2)).max()
        assert report.margins.S_worst == pytest.approx(S, rel=0.02)
