"""The sampled loop against linear theory where friction acts as a spring, and what friction does to
it.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import nlfrf
from nlfrf.rig import Controller, Trajectory, run, run_loops
from nlfrf.rig.bench.rig import Rig, paper_rig

FS = 2000.0


def controller(A, B, C, D, dt=1 / FS):
    return SimpleNamespace(A=np.array(A), B=np.array(B), C=np.array(C), D=np.array(D), dt=dt)


PI = controller([[1.0]], [[1.0]], [[200.0]], [[3e3]])


def linear_loop(K, r, *, delay, disturbance=None):
    """The stuck rig, (k + K0) stiff and 13.4 Ns/m damped, under the same controller: exact between
    samples.
    """
    A = np.array([[0.0, 1.0], [-144e3, -13.4]])
    whole, part = divmod(delay * FS, 1)

    def hold(span):
        block = np.zeros((3, 3))
        block[:2, :2], block[1, 2] = A * span / FS, span / FS
        big = expm(block)
        return big[:2, :2], big[:2, 2]

    first, second = hold(part), hold(1 - part)
    x = np.zeros(2)
    state = np.zeros(K.A.shape[0])
    forces = np.zeros(r.size + int(whole) + 1)
    out = []
    for k in range(r.size):
        out.append(x[0])
        e = r[k] - x[0]
        forces[k + int(whole)] = (K.C @ state)[0] + K.D[0, 0] * e
        state = K.A @ state + K.B[:, 0] * e
        added = 0.0 if disturbance is None else disturbance[k]
        x = first[0] @ x + first[1] * (added + (forces[k - 1] if k else 0.0))
        x = second[0] @ x + second[1] * (added + forces[k])
    return np.array(out)


@pytest.mark.parametrize("delay", [0.0, 0.25e-3, 0.5e-3, 1.1e-3])
def test_small_motion_is_that_of_the_linear_loop(delay):
    rig = Rig(
        1.0,
        80e3,
        nlfrf.friction.LuGre(sigma0=64e3, sigma1=13.0, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01),
    )
    r = 1e-10 * np.ones(600)  # so small that friction is a spring and a damper
    response = run(rig, r, Controller(PI, delay=delay), oversampling=8)
    exact = linear_loop(PI, r, delay=delay)
    assert np.abs(response.x - exact).max() < 1e-5 * np.abs(exact).max()
    assert not response.diverged


def test_disturbance_enters_at_the_input_of_the_rig():
    rig = Rig(
        1.0,
        80e3,
        nlfrf.friction.LuGre(sigma0=64e3, sigma1=13.0, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01),
    )
    disturbance = 1e-6 * np.ones(600)
    response = run(rig, np.zeros(600), PI, disturbance=disturbance, oversampling=8)
    exact = linear_loop(PI, np.zeros(600), delay=0.0, disturbance=disturbance)
    assert np.abs(response.x - exact).max() < 1e-5 * np.abs(exact).max()


def hunting(Fs):
    """The example of Canudas de Wit, Olsson, Astrom and Lischinsky (1995):

    PID on a mass, Kp = 3, Ki = 4, Kv = 6.
    """
    fs = 500.0
    rig = Rig(
        1.0,
        0.0,
        nlfrf.friction.LuGre(sigma0=1e5, sigma1=np.sqrt(1e5), sigma2=0.4, Fc=1.0, Fs=Fs, vs=1e-3),
    )
    PID = controller(
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0], [1.0]],
        [[4 / fs, -6 * fs]],
        [[6 * fs + 3 + 4 / fs]],
        dt=1 / fs,
    )
    response = run(rig, np.minimum(np.arange(20_000) / fs / 2, 1.0), PID)
    assert not response.diverged
    return response.e


def test_integral_action_hunts_against_static_friction():
    e = hunting(1.5)
    swings = [np.abs(e[k : k + 5000]).max() for k in (5000, 10_000, 15_000)]
    assert np.allclose(swings, 0.0637, rtol=0.03)  # a limit cycle: it neither dies out nor grows
    assert e[5000:].min() < -0.06 < 0.06 < e[5000:].max()
    assert np.mean(np.abs(np.diff(e[5000:])) < 1e-6) > 0.7  # and it stands still most of the time


def test_hunting_dies_out_where_static_friction_is_no_larger():
    e = hunting(1.0)
    assert np.abs(e[15_000:]).max() < 0.5 * np.abs(e[3000:5000]).max()


def test_saturation_quantisation_and_noise_act_where_they_stand():
    rng = np.random.default_rng(1)
    r = np.full(400, 1e-4)
    response = run(paper_rig(), r, Controller(PI, saturation=1.5, resolution=1e-6))
    assert np.abs(response.u).max() == 1.5
    assert np.allclose(response.y / 1e-6, np.round(response.y / 1e-6), atol=1e-9)
    assert np.abs(response.y - response.x).max() <= 0.5e-6 * (1 + 1e-9)
    noise = 1e-6 * rng.standard_normal(400)
    noisy = run(paper_rig(), r, PI, noise=noise)
    assert np.allclose(noisy.y - noisy.x, noise, atol=1e-18)
    assert np.allclose(noisy.e, noisy.r - noisy.x)


def test_loop_that_runs_away_is_a_result():
    unstable = controller(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[-2e5]])
    response = run(paper_rig(), np.full(2000, 1e-3), unstable)
    assert response.diverged
    assert 5 < response.x.size < 2000
    assert np.isfinite(response.x).all()
    assert np.abs(response.x[-1]) > 20 * 1e-3


def test_refinement_changes_little():
    r = 2e-4 * np.sin(2 * np.pi * 20 * np.arange(1000) / FS)
    x = [run(paper_rig(), r, PI, oversampling=n).x for n in (4, 32)]
    assert np.sqrt(np.mean((x[0] - x[1]) ** 2)) < 1e-5 * x[1].std()


def limited(K, options):
    """The controller with its limits, which are taken out of the options."""
    return Controller(
        K,
        **{
            name: options.pop(name)
            for name in ("delay", "saturation", "resolution")
            if name in options
        },
    )


@pytest.mark.parametrize(
    ("K", "options", "message"),
    [
        (
            controller([[1.0]], [[1.0]], [[1.0]], [[1.0]], dt=0),
            {},
            r"K must be sampled with a time dt in seconds, got dt = 0",
        ),
        (
            controller([[1.0]], [[1.0, 1.0]], [[1.0]], [[1.0, 1.0]]),
            {},
            "K must have one input and one output, got 2 and 1",
        ),
        (
            controller([[np.nan]], [[1.0]], [[1.0]], [[1.0]]),
            {},
            "K must have finite matrices, got a nonfinite number in A",
        ),
        (
            controller([[1.0j]], [[1.0]], [[1.0]], [[1.0]]),
            {},
            "K must have real matrices, got A of dtype complex128",
        ),
        (
            controller([[1.0, 2.0]], [[1.0]], [[1.0]], [[1.0]]),
            {},
            (
                r"K must have A \(s, s\), B \(s, 1\) and C \(1, s\), got shapes \(1, 2\), \(1, 1\)"
                r" and \(1, 1\)"
            ),
        ),
        (3.0, {}, "K must have A, B, C, D and dt, got float without A, B, C, D, dt"),
        (PI, {"delay": -1.0}, "delay must be zero or positive, got -1"),
        (PI, {"saturation": 0.0}, "saturation must be positive, got 0"),
        (
            PI,
            {"initial": np.zeros((2, 2))},
            r"initial must hold .* shape \(2, 1\), got .*\(2, 2\)",
        ),
        (PI, {"resolution": -1.0}, "resolution must be zero or positive, got -1"),
        (
            PI,
            {"noise": np.zeros(3)},
            "noise must have one value for each of the 10 samples of r, got 3",
        ),
        (PI, {"oversampling": 0}, "oversampling must be a whole number of at least 1, got 0"),
    ],
)
def test_refusals_name_the_parameter(K, options, message):
    with pytest.raises(ValueError, match=message):
        run(paper_rig(), np.zeros(10), limited(K, options), **options)


def test_a_rig_far_too_fast_for_the_clock_is_refused():
    light = Rig(mass=1e-12, stiffness=paper_rig().stiffness, friction=paper_rig().friction)
    with pytest.raises(
        ValueError,
        match=r"fs must leave the rig at most 10000 integration steps per sample, got 2000 Hz",
    ):
        run(light, np.zeros(10), PI)


def test_delay_beyond_the_end_leaves_the_rig_at_rest():
    response = run(paper_rig(), np.full(10, 1e-3), Controller(PI, delay=1e300))
    assert not response.x.any()
    with pytest.raises(ValueError, match="signal must hold at least one sample, got none"):
        run(paper_rig(), [], PI)


def left_alone(error, diverged=False):
    """A response with a given error, a burst before 0.5 s."""
    n = error.size
    nothing = np.zeros(n)
    signals = {"r": error, "x": nothing, "friction": nothing}
    return Trajectory(t=np.arange(n) / FS, signals=signals, units={}, diverged=diverged)


T_AFTER = np.arange(4000) / FS
BURST = np.where(T_AFTER < 0.5, 1.0, 0.0)


@pytest.mark.parametrize(
    ("after", "outcome"),
    [
        (1e-3 * np.sin(300 * T_AFTER), "limit cycle"),  # small, but it goes on
        (np.full(T_AFTER.size, 0.7), "settled"),  # at rest, wherever
        (np.exp(-20 * T_AFTER) * np.sin(300 * T_AFTER), "settled"),
        (np.exp(-2 * T_AFTER) * np.sin(300 * T_AFTER), "stable"),
        (0.4 * np.exp(-T_AFTER / 2), "stable"),  # creeping
        (0.2 * np.sin(300 * T_AFTER), "limit cycle"),
        (0.02 * np.exp(T_AFTER) * np.sin(300 * T_AFTER), "limit cycle"),
    ],
)
def test_outcome_of_a_loop_left_alone(after, outcome):
    response = left_alone(np.where(BURST > 0, np.sin(300 * T_AFTER), after))
    assert response.outcome(0.5) == outcome
    assert response.residual(0.5) == pytest.approx(
        np.ptp(after[T_AFTER >= 1.625]) / 2, rel=0.01, abs=1e-12
    )


def test_a_loop_that_ran_away_has_no_residual():
    response = left_alone(BURST[:800], diverged=True)
    assert response.outcome(0.5) == "ran away"
    assert response.residual(0.5) == np.inf


def test_outcome_needs_some_silence():
    with pytest.raises(ValueError, match="calm must leave at least 8 samples"):
        left_alone(BURST).outcome(1.999)
    with pytest.raises(ValueError, match="calm must be positive"):
        left_alone(BURST).outcome(0.0)


def test_the_rig_settles_under_little_gain_and_cycles_under_too_much():
    force = np.zeros(2000)
    force[:500] = np.random.default_rng(0).standard_normal(500)
    for gain, outcome in ((1.0, "settled"), (1e3, "limit cycle")):
        K = controller([[1.0]], [[gain]], [[200.0]], [[3.0 * gain]])
        response = run(
            paper_rig(), np.zeros(2000), Controller(K, saturation=5.0), disturbance=force
        )
        assert response.outcome(0.25) == outcome


def test_a_machine_that_sticks_while_its_integrator_winds_up_has_not_settled():
    """It slips again later: no swing in two quarters of the silence is not rest while the force
    still rises.
    """
    K = controller([[1.0, 0.0], [0.0, 0.0]], [[1.0], [1.0]], [[30.0, -150e3]], [[230e3]], dt=1e-3)
    force = 2 * np.random.default_rng(0).standard_normal(300)
    rig = Rig(1.0, 0.0, nlfrf.friction.Coulomb(Fc=0.7, Fs=1.0, vs=0.01), 0.4)
    seen = {}
    for n in (1500, 12000):
        disturbance = np.append(force, np.zeros(n - 300))
        seen[n] = run(rig, np.zeros(n), K, disturbance=disturbance)
    assert seen[1500].residual(0.3) == 0
    assert np.ptp(seen[12000].x[1500:]) > 1e-6  # it did slip again
    assert seen[1500].outcome(0.3) == "stable"


def test_a_loop_without_integral_action_rests_beside_its_reference():
    K = controller([[0.0]], [[1.0]], [[-60e3]], [[80e3]], dt=1e-3)
    for rms in (0.5, 20.0):
        force = np.append(rms * np.random.default_rng(0).standard_normal(300), np.zeros(1200))
        response = run(paper_rig(), np.full(1500, 1e-5), K, disturbance=force)
        assert abs(response.e[-1]) > 5e-6
        assert response.outcome(0.3) == "settled"


LAWS = [
    paper_rig().friction,
    nlfrf.friction.Coulomb(Fc=0.7, Fs=1.0, vs=0.01),
    nlfrf.friction.GeneralizedMaxwellSlip(
        stiffness=[4e4, 2.4e4], alpha=[0.5, 0.5], C=10, Fc=0.7, Fs=1.0, vs=0.01
    ),
    nlfrf.friction.VaryingSliders(
        stiffness=[4e4, 2.4e4], strength=[0.5, 0.5], stiction=1.4, vs=0.01, dwell=0.1, seed=3
    ),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_a_stack_is_its_runs(law):
    """Controllers of different order, bursts, delays and initial states, each as if it had run
    alone.
    """
    rig, rng = Rig(1.0, 80e3, law, 0.4), np.random.default_rng(2)
    PID = controller([[1.0, 0.0], [0.0, 0.0]], [[1.0], [1.0]], [[20.0, -4e3]], [[9e3]])
    Ks, delays = [PI, PID, PI], [0.0, 0.7e-3, 1.2e-3]
    bursts = rng.standard_normal((3, 300))
    begins = np.array([[0.0, 0.0], [1e-5, 0.02], [0.0, -0.01]])
    done = []
    together = run_loops(
        rig,
        np.zeros(300),
        [Controller(K, delay=delay) for K, delay in zip(Ks, delays, strict=True)],
        disturbance=bursts,
        initial=begins,
        progress=lambda number, total: done.append((number, total)),
    )
    for K, delay, burst, begin, response in zip(Ks, delays, bursts, begins, together, strict=True):
        alone = run(
            rig, np.zeros(300), Controller(K, delay=delay), disturbance=burst, initial=begin
        )
        for name in ("x", "v", "u", "friction"):
            assert np.array_equal(getattr(alone, name), getattr(response, name)), name
        assert (alone.x[0], alone.v[0]) == tuple(begin)
    assert done == [(1, 1)]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"initial": np.zeros((2, 3))},
            r"initial must hold a position and a velocity, got shape \(2, 3\)",
        ),
        (
            {"controllers": [PI, PI], "initial": np.zeros((3, 2))},
            "controllers must be given once or for each of the 3 runs, got 2",
        ),
        (
            {"controllers": [PI, controller([[1.0]], [[1.0]], [[1.0]], [[1.0]], dt=1e-3)]},
            r"controllers must have one sampling time, got 0\.0005 s and 0\.001 s",
        ),
        (
            {"disturbance": np.zeros((1, 4))},
            "disturbance must have one value for each of the 10 samples of r, got 4",
        ),
    ],
)
def test_stacks_that_do_not_agree_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        run_loops(paper_rig(), np.zeros(10), **{"controllers": PI, **options})


VARIED = {
    "stiction": 1.5,
    "vs": 1e-3,
    "dwell": 0.01,
    "wavelength": 3e-5,
    "asymmetry": 0.5,
    "seed": 7,
}


@pytest.mark.parametrize("options", [{}, VARIED], ids=["constant", "varying"])
def test_sliders_slip_between_their_limits_and_never_give_energy_back(options):
    fs, k, W = 2000.0, 64e3, 1.0
    law = nlfrf.friction.VaryingSliders(stiffness=[k], strength=[W], **options)
    rig, t = Rig(1.0, 1e6, law, 500.0), np.arange(8000) / fs
    nothing = controller([[0.0]], [[0.0]], [[0.0]], [[0.0]])
    motion = run(rig, 0 * t, nothing, disturbance=120 * np.sin(2 * np.pi * t), oversampling=8)
    assert np.abs(motion.friction).max() <= W * (1 + 1e-9)
    slip = np.diff(motion.x - motion.friction / k)  # what the spring does not take
    before, after = motion.friction[:-1], motion.friction[1:]
    slips = np.abs(slip) > 1e-3 * np.abs(np.diff(motion.x)).max()
    assert slips.sum() > 3000
    clear = slips & (np.sign(before) == np.sign(after))
    assert (slip[clear] * after[clear] > 0).all()
    assert np.abs(after[slips]).min() > W / law.stiction * (1 - 1e-9) * (
        1 if not options else 0.999
    )


def test_compiled_loops_are_found_again_by_the_next_process():
    """The cache on disk knows code by what it closes over; a compiled function among that is new in
    every process.
    """
    from nlfrf.rig.kernels.loops import run_loops

    assert [type(cell.cell_contents) for cell in run_loops.py_func.__closure__] == [str]


def test_a_law_alone_has_no_loop_whatever_else_is_given():
    with pytest.raises(ValueError, match="machine must be of type Rig"):
        run(nlfrf.friction.Coulomb.constant(1.0), np.zeros(10), PI, fs=FS)
