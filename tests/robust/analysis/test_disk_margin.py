"""Disk margins against published numbers, SLICOT's, a search over perturbations, and `check`."""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check
from tests.support.printed import unwrapped

L = control.tf([25], [1, 10, 10, 10])
#: Two channels of a spinning body under a static controller (the example of python-control's
#: documentation).
SPINNING = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], 0) * control.ss(
    [], [], [], [[1, -2], [0, 1]]
)


def test_seiler_packard_gahinet():
    """Their first loop: 0.458, 4.05 dB, 25.8 deg at 1.94 rad/s."""
    margin = robust.margins.disk_margin(L)
    assert margin.alpha == pytest.approx(0.458, abs=5e-4)
    assert 20 * np.log10(margin.gain_margin[1]) == pytest.approx(4.05, abs=5e-3)
    assert margin.gain_margin[0] == pytest.approx(1 / margin.gain_margin[1])
    assert np.degrees(margin.phase_margin) == pytest.approx(25.8, abs=0.05)
    assert margin.omega == pytest.approx(1.94, abs=0.02)


@pytest.mark.parametrize("skew", [0.0, 0.5, 1.0, -1.0])
def test_python_control_on_a_single_loop(skew):
    alpha, gain, phase = control.disk_margins(L, np.linspace(1.8, 2.2, 4001), skew=skew)
    margin = robust.margins.disk_margin(L, skew=skew)
    assert margin.alpha == pytest.approx(alpha, rel=1e-6)
    assert np.degrees(margin.phase_margin) == pytest.approx(phase, rel=1e-5)
    smaller = min(margin.gain_margin[1], 1 / margin.gain_margin[0])
    assert 20 * np.log10(smaller) == pytest.approx(gain, rel=1e-5)


@pytest.mark.parametrize(
    ("skew", "alpha"), [(0.0, 0.3769872636944), (1.0, 0.3697398698410), (-1.0, 0.3683035923740)]
)
def test_two_channels_as_slicot_has_them(skew, alpha):
    """AB13MD through python-control 0.10.2, least over 0.1 to 1000 rad/s; towards zero frequency it
    falls a little.
    """
    margin = robust.margins.disk_margin(SPINNING, skew=skew)
    assert alpha * 0.995 < margin.alpha <= alpha


def test_on_the_rim_a_pole_stands_on_the_axis():
    """Perturbations of the size of the margin in both channels: none destabilises, one just about
    does.
    """
    margin = robust.margins.disk_margin(SPINNING)
    rng = np.random.default_rng(0)

    def growth(size, phases):
        factor = (1 + size / 2 * np.exp(1j * phases)) / (1 - size / 2 * np.exp(1j * phases))
        return np.linalg.eigvals(SPINNING.A - SPINNING.B @ np.diag(factor) @ SPINNING.C).real.max()

    phases = rng.uniform(-np.pi, np.pi, (4000, 2))
    assert max(growth(0.999 * margin.alpha, p) for p in phases) < 0
    assert max(growth(1.03 * margin.alpha, p) for p in phases) > 0


def test_every_gain_and_phase_inside_keeps_the_loop_stable():
    margin = robust.margins.disk_margin(L, skew=0.5)
    for gain in np.linspace(*margin.gain_margin, 9):
        assert control.feedback(gain * 0.9999 ** np.sign(gain - 1) * L, 1).poles().real.max() < 1e-9
    gain, _, _, _ = control.margin(L)
    assert margin.gain_margin[1] < gain


def test_an_frf_on_its_lines():
    omega = np.geomspace(0.01, 1e3, 3000)
    margin = robust.margins.disk_margin(control.frd(L, omega))
    assert margin.alpha == pytest.approx(robust.margins.disk_margin(L).alpha, rel=1e-4)
    damped = control.ss(SPINNING.A - 2 * np.eye(2), SPINNING.B, SPINNING.C, SPINNING.D)
    lines = robust.margins.disk_margin(control.frd(damped, omega))
    assert lines.alpha == pytest.approx(robust.margins.disk_margin(damped).alpha, rel=1e-3)


def test_a_discrete_loop():
    sampled = control.c2d(control.ss(L), 0.1)
    margin = robust.margins.disk_margin(sampled)
    z = np.exp(1j * np.linspace(1e-3, np.pi, 20_001))
    S = 1 / (1 + sampled(z))
    assert margin.alpha == pytest.approx(1 / np.abs(S - 0.5).max(), rel=1e-5)


def test_no_margin_for_an_unstable_loop():
    for loop in (5 * L, control.frd(5 * L, np.geomspace(0.01, 1e3, 3000))):
        margin = robust.margins.disk_margin(loop)
        assert np.isnan([margin.alpha, margin.phase_margin, *margin.gain_margin]).all()
        assert "unstable" in unwrapped(margin)
    assert "do not show" in robust.margins.disk_margin(control.frd(L, [0.1, 2.0, 50.0])).reason


def test_refusals():
    with pytest.raises(
        ValueError, match="L must have as many inputs as outputs, got 1 inputs and 2 outputs"
    ):
        robust.margins.disk_margin(control.ss([[-1.0]], [[1.0]], [[1.0], [2.0]], 0))
    with pytest.raises(ValueError, match="well posed"):
        robust.margins.disk_margin(control.ss([], [], [], [[-1.0]]))
    with pytest.raises(ValueError, match="L must have a finite FRF"):
        robust.margins.disk_margin(control.frd(np.array([1.0, np.nan, 0.1]), [1.0, 2.0, 3.0]))


def test_a_loop_that_bears_anything():
    one = robust.margins.disk_margin(control.ss([], [], [], [[1.0]]))  # 1 + f = 0 at f = -1 alone
    assert (one.gain_margin, one.phase_margin) == ((-1.0, np.inf), pytest.approx(np.pi))
    nothing = robust.margins.disk_margin(control.ss([], [], [], [[0.0]]), skew=-1)
    assert (nothing.gain_margin, nothing.phase_margin) == ((-np.inf, np.inf), np.inf)


#: Seiler, Packard & Gahinet's spinning satellite, unit feedback.
SATELLITE = control.ss([[0, 10], [-10, 0]], np.eye(2), [[1, 10], [-10, 1]], np.zeros((2, 2)))


def test_a_satellite_bears_anything_in_one_loop_and_little_in_both():
    """Alone each loop is 1/s: alpha = 2, all gains, 90 degrees.

    Both at once 1/sqrt(100.5), a tenth.
    """
    margins = robust.margins.disk_margins(SATELLITE, np.eye(2))
    for alone in (*margins.inputs, *margins.outputs):
        assert alone.alpha == pytest.approx(2.0, rel=1e-6)
        assert np.degrees(alone.phase_margin) == pytest.approx(90, abs=0.1)
    for both in (margins.all_inputs, margins.all_outputs):
        assert both.alpha == pytest.approx(1 / np.sqrt(100.5), rel=1e-5)
    assert margins.everywhere.alpha < margins.all_inputs.alpha
    assert (
        str(margins)
        .splitlines()[4]
        .startswith("all inputs   disk margin 0.09975: gain -0.87 to +0.87 dB")
    )


def test_one_loop_at_a_time_by_closing_the_others_by_hand():
    """The channel's own loop transfer with all others closed, entry by entry, at inputs and at
    outputs.
    """
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4)) - 3 * np.eye(4)
    G = control.ss(A, rng.standard_normal((4, 2)), rng.standard_normal((3, 4)), np.zeros((3, 2)))
    K = control.ss(
        -np.eye(2), rng.standard_normal((2, 3)), 0.5 * rng.standard_normal((2, 2)), np.zeros((2, 3))
    )
    margins = robust.margins.disk_margins(G, K)
    for side, L in ((margins.inputs, K * G), (margins.outputs, G * K)):
        assert len(side) == L.ninputs
        for k, alone in enumerate(side):
            rest = np.diag([0.0 if j == k else 1.0 for j in range(L.ninputs)])
            others = control.feedback(L, control.ss([], [], [], rest))[k, k]
            assert alone.alpha == pytest.approx(robust.margins.disk_margin(others).alpha, rel=2e-3)
            assert alone.channels == (k if side is margins.inputs else 2 + k,)
    assert margins.all_inputs.alpha == pytest.approx(
        robust.margins.disk_margin(K * G).alpha, rel=2e-3
    )
    assert margins.all_outputs.alpha == pytest.approx(
        robust.margins.disk_margin(G * K).alpha, rel=2e-3
    )
    least = min(m.alpha for m in (*margins.inputs, *margins.outputs))
    assert margins.everywhere.alpha <= min(margins.all_inputs.alpha, margins.all_outputs.alpha) * (
        1 + 1e-6
    )
    assert max(margins.all_inputs.alpha, margins.all_outputs.alpha) <= max(
        *(m.alpha for m in (*margins.inputs, *margins.outputs)), least
    )


def test_gains_and_phases_at_inputs_and_outputs_at_once():
    """No factors inside the disk everywhere destabilise; some a little beyond it do."""
    G = control.ss(SATELLITE.A - 0.5 * np.eye(2), SATELLITE.B, SATELLITE.C, SATELLITE.D)
    K = np.array([[1.0, 0.05], [0.0, 0.8]])
    size = robust.margins.disk_margins(G, K).everywhere.alpha
    rng = np.random.default_rng(1)

    def growth(size, phases):
        factor = (1 + size / 2 * np.exp(1j * phases)) / (1 - size / 2 * np.exp(1j * phases))
        return np.linalg.eigvals(
            G.A - G.B @ np.diag(factor[:2]) @ K @ np.diag(factor[2:]) @ G.C
        ).real.max()

    phases = rng.uniform(-np.pi, np.pi, (6000, 4))
    assert max(growth(0.999 * size, p) for p in phases) < 0
    assert max(growth(1.06 * size, p) for p in phases) > 0


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e6])
def test_margins_know_no_units(unit):
    """Positions in metres and forces in newtons: gains of 1e9 N/m beside 1e-9 m/N are no loop
    without a solution.
    """
    G = control.ss(
        np.diag([-60.0, -90.0]), np.diag([60.0, 90.0]), [[1.0, 0.2], [-0.1, 1.0]], np.zeros((2, 2))
    )
    K = control.ss(-np.eye(2), np.eye(2), np.diag([30.0, 40.0]), np.diag([1.0, 1.5]))
    G_m, K_m = control.ss(G.A, G.B, unit * G.C, G.D), control.ss(K.A, K.B, K.C / unit, K.D / unit)
    wanted, found = robust.margins.disk_margins(G, K), robust.margins.disk_margins(G_m, K_m)
    for name in ("all_inputs", "all_outputs", "everywhere"):
        assert getattr(found, name).alpha == pytest.approx(getattr(wanted, name).alpha, rel=1e-9)
    for one, other in zip(
        (*found.inputs, *found.outputs), (*wanted.inputs, *wanted.outputs), strict=True
    ):
        assert one.alpha == pytest.approx(other.alpha, rel=1e-9)
    omega = np.geomspace(0.1, 1e5, 400)
    lines = [control.FrequencyResponseData(plant(1j * omega), omega) for plant in (G, G_m)]
    of_lines = [
        robust.margins.disk_margins(one, k).everywhere.alpha
        for one, k in zip(lines, (K, K_m), strict=True)
    ]
    assert of_lines[1] == pytest.approx(of_lines[0], rel=1e-9)
    one_way = control.ss(
        [], [], [], [[1.0, 1.0 / unit], [0.0, 1.0]]
    )  # triangular: what couples counts for nothing
    assert robust.margins.disk_margin(one_way, skew=-1).alpha == pytest.approx(2.0, rel=1e-3)


def test_of_a_measured_plant_on_its_lines():
    G = control.ss(SATELLITE.A - 2 * np.eye(2), SATELLITE.B, SATELLITE.C, SATELLITE.D)
    omega = np.geomspace(0.01, 1e3, 2000)
    lines, whole = (
        robust.margins.disk_margins(control.frd(G, omega), np.eye(2)),
        robust.margins.disk_margins(G, np.eye(2)),
    )
    for one, other in (
        (lines.inputs[1], whole.inputs[1]),
        (lines.all_outputs, whole.all_outputs),
        (lines.everywhere, whole.everywhere),
    ):
        assert one.alpha == pytest.approx(other.alpha, rel=2e-3)


def test_of_a_loop_that_is_not_stable():
    margins = robust.margins.disk_margins(SATELLITE, -np.eye(2))
    assert margins.reason.startswith("the loop is unstable")
    assert str(margins).startswith("no disk margins: the loop is unstable")


def test_the_report_of_a_matrix_tells_them():
    w = control.ss([], [], [], [[0.05]])
    model = UncertaintyModel(
        nominal=SATELLITE, form="additive", left=(w, w), right=(w, w), omega=np.array([1.0]),
        radius=np.full((4, 1), 0.05), confidence=0.95, inputs=("torque_x", "torque_y"),
    )  # fmt: skip
    report = check(model, np.eye(2))
    assert report.channels.all_inputs.alpha == pytest.approx(1 / np.sqrt(100.5), rel=1e-5)
    assert report.channels.input_names == ("torque_x", "torque_y")
    assert "all inputs at once gain -0.87 to +0.87 dB" in " ".join(str(report).split())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: robust.margins.disk_margin(SATELLITE, channels=[2]),
            r"channels must be some of 0 to 1, each once, got \[2\]",
        ),
        (
            lambda: robust.margins.disk_margin(SATELLITE, channels=[]),
            "channels must be some of 0 to 1",
        ),
        (
            lambda: robust.margins.disk_margins(SATELLITE, np.eye(3)),
            "K must have 2 inputs and 2 outputs",
        ),
        (
            lambda: robust.margins.disk_margins(SATELLITE, control.ss(0.5, 1, 1, 0, 0.1)),
            "K must have 2 inputs and 2 outputs",
        ),
        (
            lambda: robust.margins.disk_margins(
                SATELLITE, control.append(*[control.ss(0.5, 1, 1, 0, 0.1)] * 2)
            ),
            "the sampling time of G",
        ),
    ],
)
def test_refusals_of_channels(call, message):
    with pytest.raises(ValueError, match=message):
        call()
