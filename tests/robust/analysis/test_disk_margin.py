"""Disk margins against published numbers, SLICOT's, a search over perturbations, and `check`."""

import control
import numpy as np
import pytest

from robust import disk_margin
from robust.analysis.disk_margin import of_system

L = control.tf([25], [1, 10, 10, 10])
#: Two channels of a spinning body under a static controller (the example of python-control's documentation).
SPINNING = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], 0) * control.ss(
    [], [], [], [[1, -2], [0, 1]]
)


def test_seiler_packard_gahinet():
    """Their first loop: 0.458, 4.05 dB, 25.8 deg at 1.94 rad/s."""
    margin = disk_margin(L)
    assert margin.alpha == pytest.approx(0.458, abs=5e-4)
    assert 20 * np.log10(margin.gain_margin[1]) == pytest.approx(4.05, abs=5e-3)
    assert margin.gain_margin[0] == pytest.approx(1 / margin.gain_margin[1])
    assert np.degrees(margin.phase_margin) == pytest.approx(25.8, abs=0.05)
    assert margin.omega == pytest.approx(1.94, abs=0.02)


@pytest.mark.parametrize("skew", [0.0, 0.5, 1.0, -1.0])
def test_python_control_on_a_single_loop(skew):
    alpha, gain, phase = control.disk_margins(L, np.linspace(1.8, 2.2, 4001), skew=skew)
    margin = disk_margin(L, skew=skew)
    assert margin.alpha == pytest.approx(alpha, rel=1e-6)
    assert np.degrees(margin.phase_margin) == pytest.approx(phase, rel=1e-5)
    smaller = min(margin.gain_margin[1], 1 / margin.gain_margin[0])
    assert 20 * np.log10(smaller) == pytest.approx(gain, rel=1e-5)


@pytest.mark.parametrize(("skew", "alpha"), [(0.0, 0.3769872636944), (1.0, 0.3697398698410), (-1.0, 0.3683035923740)])
def test_two_channels_as_slicot_has_them(skew, alpha):
    """AB13MD through python-control 0.10.2, least over 0.1 to 1000 rad/s; towards zero frequency it falls a little."""
    margin = disk_margin(SPINNING, skew=skew)
    assert alpha * 0.995 < margin.alpha <= alpha


def test_on_the_rim_a_pole_stands_on_the_axis():
    """Perturbations of the size of the margin in both channels: none destabilises, one just about does."""
    margin = disk_margin(SPINNING)
    rng = np.random.default_rng(0)

    def growth(size, phases):
        factor = (1 + size / 2 * np.exp(1j * phases)) / (1 - size / 2 * np.exp(1j * phases))
        return np.linalg.eigvals(SPINNING.A - SPINNING.B @ np.diag(factor) @ SPINNING.C).real.max()

    phases = rng.uniform(-np.pi, np.pi, (4000, 2))
    assert max(growth(0.999 * margin.alpha, p) for p in phases) < 0
    assert max(growth(1.03 * margin.alpha, p) for p in phases) > 0


def test_every_gain_and_phase_inside_keeps_the_loop_stable():
    margin = disk_margin(L, skew=0.5)
    for gain in np.linspace(*margin.gain_margin, 9):
        assert control.feedback(gain * 0.9999 ** np.sign(gain - 1) * L, 1).poles().real.max() < 1e-9
    gain, _, _, _ = control.margin(L)
    assert margin.gain_margin[1] < gain


def test_an_frf_on_its_lines():
    omega = np.geomspace(0.01, 1e3, 3000)
    margin = disk_margin(control.frd(L, omega))
    assert margin.alpha == pytest.approx(disk_margin(L).alpha, rel=1e-4)
    damped = control.ss(SPINNING.A - 2 * np.eye(2), SPINNING.B, SPINNING.C, SPINNING.D)
    lines = disk_margin(control.frd(damped, omega))
    assert lines.alpha == pytest.approx(disk_margin(damped).alpha, rel=1e-3)


def test_a_discrete_loop():
    sampled = control.c2d(control.ss(L), 0.1)
    margin = disk_margin(sampled)
    z = np.exp(1j * np.linspace(1e-3, np.pi, 20_001))
    S = 1 / (1 + sampled(z))
    assert margin.alpha == pytest.approx(1 / np.abs(S - 0.5).max(), rel=1e-5)


def test_no_margin_for_an_unstable_loop():
    for loop in (5 * L, control.frd(5 * L, np.geomspace(0.01, 1e3, 3000))):
        margin = disk_margin(loop)
        assert np.isnan([margin.alpha, margin.phase_margin, *margin.gain_margin]).all()
        assert "unstable" in str(margin)
    assert "tell" in disk_margin(control.frd(L, [0.1, 2.0, 50.0])).reason


def test_refusals():
    with pytest.raises(ValueError, match="L must have as many inputs as outputs, got 1 inputs and 2 outputs"):
        disk_margin(control.ss([[-1.0]], [[1.0]], [[1.0], [2.0]], 0))
    with pytest.raises(ValueError, match="well posed"):
        disk_margin(control.ss([], [], [], [[-1.0]]))
    with pytest.raises(ValueError, match="L must have a finite FRF"):
        disk_margin(control.frd(np.array([1.0, np.nan, 0.1]), [1.0, 2.0, 3.0]))


def test_a_loop_that_bears_anything():
    assert np.isinf(of_system(control.ss([], [], [], [[1.0]]), 0.0)[1])
