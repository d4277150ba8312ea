"""Slopes of every limit and pole against differences, wiring against python-control's
interconnection.
"""

import control
import numpy as np
import pytest

from robust import tuning
from robust.lti.wiring import Port, join_by_name
from robust.synthesis.tuning.parameters import controller_of_blocks
from robust.synthesis.tuning.problem import TuningProblem
from robust.synthesis.tuning.scenes import make_loops
from tests.support.random_tunings import joined_as_control, random_tuning

BLOCKS = [
    tuning.Gain(K=[[0.5, -0.2], [0.0, 1.0]], reads=["a", "b"], drives=["c", "d"]),
    tuning.Pid(kp=2.0, ki=3.0, kd=0.5, filter_time=0.05, reads="a", drives="c"),
    tuning.Pid(kp=-2.0, reads="a", drives="c"),
    tuning.Pid(ki=0.3, reads="a", drives="c"),
    tuning.Notch(omega=5.0, depth=0.2, width=0.4, reads="a", drives="c"),
    tuning.Lead(omega=3.0, phase=0.9, reads="a", drives="c"),
    tuning.Lag(omega=3.0, gain=20.0, reads="a", drives="c"),
    tuning.Lag(omega=3.0, reads="a", drives="c"),
    tuning.LowPass(omega=7.0, zeta=0.4, reads="a", drives="c"),
    tuning.LowPass(omega=7.0, order=1, reads="a", drives="c"),
    tuning.Biquad(
        omega=7.0, zeta=0.4, numerator_omega=5.0, numerator_zeta=0.1, reads="a", drives="c"
    ),
    tuning.Biquad(
        omega=7.0, zeta=0.4, numerator_omega=5.0, numerator_zeta=0.0, reads="a", drives="c"
    ),
    tuning.StateSpace(n_states=2, reads=["a", "b"], drives="c"),
]


def sampling_time_of(model):
    """That of a system or of the nominal of a set; none of an FRF."""
    if isinstance(model, control.FrequencyResponseData):
        return 0.0
    return float(getattr(model, "nominal", model).dt or 0)


def on_clock(part, dt):
    """The same part on the clock of the loop."""
    part = control.ss(part)
    names = {"inputs": part.input_labels, "outputs": part.output_labels}
    return control.ss(part.A, part.B, part.C, part.D, dt, remove_useless_states=False, **names)


def problem_of(arguments):
    """The problem that `tune` makes of its arguments."""
    plant = arguments["plant"]
    dt = arguments["dt"] or sampling_time_of(plant.models[0])
    controller = controller_of_blocks(arguments["blocks"], dt)
    limits = [(limit, True) for limit in arguments["hard"]] + [
        (limit, False) for limit in arguments["soft"]
    ]
    parts = [on_clock(part, dt) for part in arguments["system"]]
    scenes = make_loops(
        parts, plant, controller=controller, limits=limits, dt=dt, delay=arguments["delay"]
    )
    return TuningProblem(controller, scenes, decay=0.0, dt=dt, deadline=np.inf, progress=None)


def differences(function, x, step=1e-6):
    """Central differences of fourth order."""
    found = []
    for k in range(x.size):
        e = np.zeros(x.size)
        e[k] = step * 40
        values = [function(x + i * e) for i in (-2, -1, 1, 2)]
        found.append((values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step * 40))
    return np.array(found)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: type(block).__name__)
@pytest.mark.parametrize("dt", [0.0, 0.02])
def test_a_block_is_what_it_says(block, dt):
    """Its response is that of its formula, the sampled one exact at its omega; its slopes are those
    of differences.
    """
    controller = controller_of_blocks({"K": block}, dt)
    omega = np.array([0.3, 2.0, 9.0])
    system = block.system(dt)
    z = np.exp(1j * omega * dt) if dt else 1j * omega
    at = getattr(block, "omega", 1e-9)
    s = 1j * (at * np.tan(omega * dt / 2) / np.tan(at * dt / 2) if dt else omega)
    if isinstance(block, tuning.Pid):
        expected = (
            (block.kp or 0)
            + (block.ki or 0) / s
            + (block.kd or 0) * s / ((block.filter_time or 0) * s + 1)
        )
        assert np.allclose(system(z), expected, rtol=1e-12)
    elif isinstance(block, tuning.Notch):
        w, b = block.omega, block.width
        expected = (s**2 + block.depth * b * w * s + w**2) / (s**2 + b * w * s + w**2)
        assert np.allclose(system(z), expected, rtol=1e-12)
    elif isinstance(block, tuning.LowPass):
        expected = 49 / (s**2 + 2 * 0.4 * 7 * s + 49) if block.order == 2 else 7 / (s + 7)
        assert np.allclose(system(z), expected, rtol=1e-12)
    elif isinstance(block, tuning.Biquad):
        zeta = block.numerator_zeta
        expected = (s**2 / 25 + 2 * zeta * s / 5 + 1) / (s**2 / 49 + 2 * 0.4 * s / 7 + 1)
        assert np.allclose(system(z), expected, rtol=1e-12)
    elif isinstance(block, tuning.Lag):
        assert np.allclose(system(z), (s + 3) / (s + 3 / block.gain), rtol=1e-12)
    elif isinstance(block, tuning.Lead):
        there = np.exp(3j * dt) if dt else 3j
        assert abs(system(there)) == pytest.approx(1, rel=1e-12)
        assert np.angle(system(there)) == pytest.approx(0.9, rel=1e-12)
    if dt and hasattr(block, "section"):
        b, a = block.section(1 / dt).reshape(2, 3)
        assert a[0] == 1
        assert np.allclose(np.polyval(b, z) / np.polyval(a, z), system(z), rtol=1e-12)
    slopes = controller.slopes(controller.start)
    by_difference = differences(controller.matrix, controller.start)
    assert np.abs(slopes - by_difference).max() <= 1e-7 * np.abs(slopes).max()
    again = controller.blocks_at(controller.start)["K"]
    assert np.allclose(again.system(dt)(z), system(z), rtol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_slopes_of_limits_and_poles(seed):
    """At a fixed frequency: d log(gain) and d(real part of a pole) against differences, 1e-7 of the
    largest.
    """
    rng = np.random.default_rng(seed)
    problem = problem_of(random_tuning(rng))
    controller = problem.controller
    x = controller.start + 0.1 * rng.normal(size=controller.start.size)
    slopes = controller.slopes(x)
    for scene in problem.scenes:
        loop = scene.close(controller.matrix(x))
        for channel in scene.channels:
            low, high = scene.band(channel)
            omega = float(np.clip(10 ** rng.uniform(-1, 1), low + 1e-3, min(high, 1e6) * 0.99))
            (peak, *_) = scene.peaks_at(channel, omega, loop.sensitivity_factors(omega), slopes)

            def level(x, scene=scene, channel=channel, omega=omega):
                H = scene.close(controller.matrix(x)).responses_by_elimination(np.array([omega]))
                return np.log(scene.levels(channel, np.array([omega]), H)[0])

            assert peak.level == pytest.approx(level(x), abs=1e-9)
            expected = differences(level, x)
            assert np.abs(peak.gradient - expected).max() <= 1e-7 * max(1.0, np.abs(expected).max())
    found = problem.evaluate(x, peaks=False)
    separate = min(
        (abs(a.excess - b.excess) for a in found.poles for b in found.poles if a is not b),
        default=1,
    )
    if found.poles and separate > 1e-3:
        expected = differences(lambda x: problem.evaluate(x, peaks=False).excess, x)
        scale = max(1.0, np.abs(expected).max())
        assert np.abs(found.poles[0].gradient - expected).max() <= 1e-6 * scale


def random_system(rng, inputs, outputs):
    """A stable system with these signals, in half of the cases with a direct term."""
    n = int(rng.integers(1, 4))
    A = rng.normal(size=(n, n)) - 3 * np.eye(n)
    D = rng.normal(size=(len(outputs), len(inputs))) * (rng.random() < 0.5) * 0.3
    B, C = rng.normal(size=(n, len(inputs))), rng.normal(size=(len(outputs), n))
    return control.ss(A, B, C, D, inputs=inputs, outputs=outputs, remove_useless_states=False)


@pytest.mark.parametrize("seed", range(60))
def test_wiring_is_that_of_python_control(seed):
    """Random parts and ports joined by name, ports closed afterwards: the response of
    `control.interconnect`.
    """
    rng = np.random.default_rng([7, seed])
    driven = [f"s{k}" for k in range(int(rng.integers(2, 5)))]
    parts = []
    for k in range(len(driven)):
        parts.append(
            random_system(
                rng,
                sorted({*rng.choice([*driven, "s5"], 2), *(["w"] if k == 0 else [])}),
                [driven[k]],
            )
        )
    block = random_system(rng, [driven[int(rng.integers(len(driven)))]], ["s5"])
    reading = random_system(rng, ["s5"], ["z"])
    port = Port(reads=tuple(block.input_labels), drives=tuple(block.output_labels))
    open_loop = join_by_name([*parts, reading], [port], external=["w"], looked_at=["z", driven[-1]])
    s = 0.7j
    P, K = open_loop(s, squeeze=False), block(s, squeeze=False)
    closed = P[:2, :1] + P[:2, 1:] @ K @ np.linalg.inv(np.eye(1) - P[2:, 1:] @ K) @ P[2:, :1]
    own = joined_as_control([*parts, reading, block], ["w"], ["z", driven[-1]], 0)(s, squeeze=False)
    assert np.abs(closed - own).max() <= 1e-12 * max(1.0, np.abs(own).max())
    direct = any(np.any(part.D) for part in [*parts, block, reading])
    if not direct:
        theirs = control.interconnect(
            [*parts, reading, block], inputs=["w"], outputs=["z", driven[-1]], check_unused=False
        )
        assert np.abs(closed - theirs(s, squeeze=False)).max() <= 1e-12 * max(
            1.0, np.abs(own).max()
        )
