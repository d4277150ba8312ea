"""The level of a loop against closed forms, Lyapunov equations, brute force over the set, and
simulated loops.
"""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_lyapunov

import nlfrf
import robust
from robust import UncertaintyModel
from robust.analysis import LevelState, LoopSignals, NoiseSignal, StepSignal
from tests.support.forms import FORMS, PERTURBED
from tests.support.printed import unwrapped
from tests.support.responses import response

LAG = control.tf([1], [1, 1])
OMEGA, RADIUS = np.array([1.0, 2.0]), np.array([0.1, 0.2])
INSIDE = LevelState.INSIDE
BELOW = LevelState.BELOW
ABOVE = LevelState.ABOVE
UNKNOWN = LevelState.UNKNOWN


def plant_set(G=LAG, w=0.2, form="multiplicative", **known):
    weight = control.tf([w], [1], G.dt) if np.isscalar(w) else w
    return UncertaintyModel(G, weight, form, OMEGA, np.minimum(RADIUS, 0.1), **known)


def level_of(model, K, delay=0.0, **signals):
    return robust.analysis.predict_level(model, K, LoopSignals(**signals), delay=delay)


def sine(amplitude, omega):
    """Noise of the power of a sinusoid, in a band so narrow that it has the gain of one
    frequency.
    """
    return NoiseSignal(amplitude / np.sqrt(2), omega * (1 - 1e-6), omega * (1 + 1e-6))


def gains(G, K, omega, name):
    """|.| from a signal to u and y, from the responses of the parts."""
    G, K = G(1j * omega), K(1j * omega)
    S = 1 / (1 + G * K)
    return (abs(S), abs(G * S)) if name == "disturbance" else (abs(K * S), abs(G * K * S))


@pytest.mark.parametrize("name", ["reference", "disturbance", "noise"])
def test_a_sinusoid_goes_through_the_gain_at_its_frequency(name):
    K, omega = control.tf([3, 2], [1, 0]), 1.7
    level = level_of(plant_set(), K, **{name: sine(0.3, omega)})
    wanted = np.multiply(gains(LAG, K, omega, name), 0.3 / np.sqrt(2))
    np.testing.assert_allclose([level.u, level.y], wanted, rtol=1e-9)


def test_a_first_order_loop_under_noise_in_a_band():
    """y = 1/(s + 2) w has the variance atan(h/2)/2 where w has density one from 0 to h."""
    for high in (0.01, 1.0, 1e4):
        level = level_of(plant_set(), 1.0, disturbance=NoiseSignal(np.sqrt(high), omega_max=high))
        assert level.y**2 == pytest.approx(np.arctan(high / 2) / 2, rel=1e-6)


def test_sampled_white_noise_on_a_pole():
    """y+ = p y + b w, p = c - (1 - c) k, of a sampled lag with pole c under gain k: variance b^2/(1
    - p^2).
    """
    T, k, sigma = 0.1, 3.0, 0.7
    c = np.exp(-T)
    level = level_of(plant_set(), control.ss([], [], [], [[k]], T), disturbance=NoiseSignal(sigma))
    assert level.y**2 == pytest.approx(
        (sigma * (1 - c)) ** 2 / (1 - (c - (1 - c) * k) ** 2), rel=1e-6
    )


def random_loop(seed):
    """A stable sampled loop around a plant with a light mode, K strictly proper in continuous
    time.
    """
    rng = np.random.default_rng(seed)
    w0, zeta = 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-3.5, 0)
    G, T = control.ss(control.tf([w0**2], [1, 2 * zeta * w0, w0**2])), 0.3 / w0
    for gain in rng.uniform(0.1, 2) * 0.5 ** np.arange(30):
        K = control.ss(control.tf([gain * w0], [1, w0]))
        closed = robust.sampled(G, T), robust.lti.discretize(K, T)
        if np.all(np.abs(control.feedback(closed[0] * closed[1], 1).poles()) < 1):
            return closed
    raise AssertionError


@pytest.mark.parametrize("name", ["reference", "disturbance", "noise"])
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_random_loops_against_lyapunov(seed, name):
    G, K = random_loop(seed)
    model = UncertaintyModel(
        G, control.ss([], [], [], [[0.01]], G.dt), "multiplicative", OMEGA * 1e-3, RADIUS * 0.01
    )
    level = level_of(model, K, **{name: NoiseSignal(1.0)})
    if name == "disturbance":
        parts = (
            control.feedback(control.ss([], [], [], [[1.0]], G.dt), G * K),
            control.feedback(G, K),
        )
    else:
        parts = control.feedback(K, G), control.feedback(G * K, 1)
    for H, found in zip(parts, (level.u, level.y), strict=True):
        P = solve_discrete_lyapunov(
            H.A, H.B @ H.B.T, method="bilinear"
        )  # the direct one squares the order
        assert found**2 == pytest.approx((H.C @ P @ H.C.T + H.D @ H.D.T)[0, 0], rel=1e-5)


def test_noise_in_a_band():
    """Of y = S w, S = s/(s + 1) under an integrator, rms^2/(b - a) (b - a - atan b + atan a) is
    left.
    """
    integrator, low, high = control.tf([1], [1, 0]), 0.5, 7.0
    level = level_of(plant_set(integrator), 1.0, disturbance=NoiseSignal(2.0, low, high))
    wanted = 4 / (high - low) * (high - low - np.arctan(high) + np.arctan(low))
    assert level.u**2 == pytest.approx(wanted, rel=1e-9)
    measured = 4 / (high - low) * (1 - np.arctan(2) + np.arctan(1))  # from 1 to 2 rad/s
    assert level.signals[0].noise.u_in_band == pytest.approx(measured / wanted, rel=1e-9)


def test_signals_add_as_independent():
    given_signals = {"reference": sine(1.0, 2.0), "disturbance": NoiseSignal(0.5, omega_max=9.0)}
    both = level_of(plant_set(), 2.0, **given_signals)
    alone = [level_of(plant_set(), 2.0, **{name: signal}) for name, signal in given_signals.items()]
    for part in ("u", "y", "u_worst", "y_worst"):
        assert getattr(both, part) ** 2 == pytest.approx(
            sum(getattr(one, part) ** 2 for one in alone), rel=1e-12
        )


def test_a_step_is_the_sinusoid_of_its_swing():
    """K = 9 at 1/(s + 1): y goes to 0.9, u from 9 to 0.9 and counts from rest: swings of 0.9
    and 9.
    """
    level = level_of(plant_set(), 9.0, reference=StepSignal(-2.0))
    np.testing.assert_allclose([level.u, level.y], np.array([9.0, 0.9]) * 2 / np.sqrt(8), rtol=1e-3)
    pushed = level_of(plant_set(), 9.0, disturbance=StepSignal(1.0))  # u from 1 to 0.1
    np.testing.assert_allclose([pushed.u, pushed.y], np.array([1.0, 0.1]) / np.sqrt(8), rtol=1e-3)
    assert np.isnan([level.u_worst, level.y_worst, level.share_in_band("y")]).all()
    assert level.signals[0].noise is None


def test_a_delay_counts_as_itself():
    """Far from the crossover of a loop with a delay:

    |1 + L exp(-j omega tau)| at one frequency, exactly.
    """
    omega, tau = 3.0, 0.4
    G = 1 / (1 + 1j * omega) * np.exp(-1j * omega * tau)
    level = level_of(plant_set(), 1.0, delay=tau, disturbance=sine(1.0, omega))
    np.testing.assert_allclose(
        [level.u, level.y], np.abs([1 / (1 + G), G / (1 + G)]) / np.sqrt(2), rtol=1e-9
    )


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["reference", "disturbance"])
def test_the_bound_over_the_set_is_reached_at_one_frequency(form, name):
    G, K, w, omega = control.tf([2, 3], [1, 0.4, 4]), control.tf([1, 1], [1, 5]), 0.15, 1.9
    model = plant_set(G, w, form)
    level = level_of(model, K, **{name: sine(1.0, omega)})
    at = np.array([omega])
    g, k, W = response(model.nominal, at)[0], K(1j * omega), response(model.shaping, at)[0]
    every = np.exp(1j * np.linspace(0, 2 * np.pi, 20001)) * np.array([[1.0], [0.5]])
    plants = PERTURBED[form](W * g, w, every) / W
    found = np.abs([1 / (1 + plants * k), plants / (1 + plants * k)]) * (
        1 if name == "disturbance" else abs(k)
    )
    largest = found.reshape(2, -1).max(axis=1) / np.sqrt(2)
    np.testing.assert_allclose([level.u_worst, level.y_worst], largest, rtol=1e-6)


def test_a_plant_that_is_zero_has_what_the_set_adds():
    """At the zero of G, G + w D is w D, and so is y for a disturbance: w/(1 - w |K|) at the
    most.
    """
    G, K, w, omega = control.tf([1, 0, 4], [1, 3, 3]), 0.5, 0.3, 2.0
    level = level_of(plant_set(G, w, "additive"), K, disturbance=sine(np.sqrt(2), omega))
    assert level.y == pytest.approx(0, abs=1e-5)
    assert level.y_worst == pytest.approx(w / (1 - w * K), rel=1e-5)


@pytest.mark.parametrize("dt", [0, 0.05])
def test_no_plant_of_the_set_moves_more_than_the_bound(dt):
    nominal = control.ss(control.tf([4], [1, 0.3, 4]))
    nominal = robust.sampled(nominal, dt) if dt else nominal
    w = control.ss(control.tf([0.3, 0.1], [1, 1]))
    w = robust.lti.discretize(w, dt) if dt else w
    model = UncertaintyModel(
        nominal, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.05, 0.1])
    )
    K = control.ss([], [], [], [[0.3]], dt)
    signals = {"disturbance": NoiseSignal(1.0, omega_max=20.0)}
    level = level_of(model, K, **signals)
    members = [
        level_of(replace(model, nominal=plant), K, **signals) for plant in model.sample(12, rng=1)
    ]
    assert all(one.u <= level.u_worst and one.y <= level.y_worst for one in members)
    assert max(one.y for one in members) > level.y


def test_a_set_with_an_unstable_loop_has_no_bound():
    level = level_of(plant_set(w=0.9), 50.0, disturbance=NoiseSignal(1.0, omega_max=20.0))
    assert np.isfinite([level.u_worst, level.y_worst]).all()
    level = level_of(plant_set(w=1.2), 50.0, disturbance=NoiseSignal(1.0, omega_max=20.0))
    assert np.isinf([level.u_worst, level.y_worst]).all()
    assert "at most" not in unwrapped(level)


def record_of(seed, n_realizations, rms, hold="unknown"):
    """A cubic behind a mode, so that realisations scatter."""
    ms = nlfrf.multisine(
        "special-odd",
        fs=256,
        n_samples=1024,
        f_min=1,
        f_max=60,
        rms=rms,
        rng=seed,
        n_realizations=n_realizations,
    )
    U = np.fft.rfft(ms.u, axis=-1)
    s = 2j * np.pi * np.arange(U.shape[1]) / 4
    x = np.fft.irfft(U * 400 / (s**2 + 8 * s + 400), axis=-1)
    return nlfrf.Record(
        u=ms.u[:, None], y=(x + 2 * x**3)[:, None], fs=256, lines=ms.lines, hold=hold
    )


@pytest.mark.parametrize("n_realizations", [1, 4])
@pytest.mark.parametrize("dt", [0.0, 1 / 256, 0.005])
def test_a_model_remembers_the_level_of_its_records(n_realizations, dt):
    records = [record_of(1, n_realizations, rms, "band-limited") for rms in (0.3, 0.1)]
    blas = [nlfrf.identify(record) for record in records]
    model = robust.uncertainty(blas, robust.fit_nominal(blas, n_poles=2, dt=dt))
    for evidence, record in zip(model.records, records, strict=True):
        assert evidence.level.rms_u == pytest.approx(record.u.std(), rel=1e-9)
        on_lines = np.abs(np.fft.rfft(record.y[:, 0])[:, record.lines.excited]) / 1024
        assert evidence.level.rms_y == pytest.approx(
            np.sqrt(2 * np.mean(np.sum(on_lines**2, axis=1))), rel=1e-9
        )


def test_noise_records_have_a_level_too():
    rng = np.random.default_rng(0)
    u = 0.7 * rng.standard_normal(60_000)
    bla = nlfrf.identify_noise(
        u, 2 * u + 0.4 * rng.standard_normal(u.size), fs=1.0, n_samples=400, f_min=0.1, f_max=0.4
    )
    evidence = robust.uncertainty(bla, control.tf([2.0], [1.0]), order=0, above="flat").records[0]
    # white: the band from 0.1 to 0.4 of 0.5 holds six tenths of the power; chi-square of 2 x 150 x
    # 121 numbers
    assert evidence.level.rms_u == pytest.approx(0.7 * np.sqrt(0.6), rel=0.03)
    assert evidence.level.rms_y == pytest.approx(np.sqrt(0.6 * (4 * 0.49 + 0.16)), rel=0.03)


def test_states_against_the_measured_levels():
    blas = [nlfrf.identify(record_of(1, 1, rms)) for rms in (0.1, 0.2)]
    model = robust.uncertainty(blas, robust.fit_nominal(blas, n_poles=2))
    low, high = model.records
    K = 0.0  # u is the disturbance itself
    for rms, state in (
        (0.1 / 1.6, BELOW),
        (0.1 / 1.4, INSIDE),
        (0.2 * 1.4, INSIDE),
        (0.2 * 1.6, ABOVE),
    ):
        level = level_of(model, K, disturbance=NoiseSignal(rms, 2 * np.pi, 2 * np.pi * 60))
        assert level.u_state is state
    np.testing.assert_allclose(level.u_measured, [low.level.rms_u, high.level.rms_u])
    np.testing.assert_allclose(level.y_measured, [low.level.rms_y, high.level.rms_y])
    assert "1.6 times above the measured 0.1 to 0.2" in unwrapped(level)
    # a sinusoid at the mode moves far with little force
    level = level_of(model, K, disturbance=sine(0.09, 20.0))
    assert (level.u_state, level.y_state, level.inside) == (BELOW, ABOVE, False)
    assert "disagree" in unwrapped(level)
    still = level_of(model, K, disturbance=sine(0.0, 20.0))
    assert (still.u_state, still.y_state) == (BELOW, BELOW)
    assert "inf times below" in unwrapped(still)


def test_numbers_out_of_all_proportion_are_above():
    bla = nlfrf.identify(record_of(1, 1, 0.1))
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2))
    for signal in (sine(1e300, 20.0), NoiseSignal(1e300, 2 * np.pi, 2 * np.pi * 60)):
        level = level_of(model, 0.1, disturbance=signal)
        assert (level.u_state, level.y_state) == (ABOVE, ABOVE)


def test_what_is_not_known_is_said_so(tmp_path):
    bla = nlfrf.identify(record_of(1, 1, 0.1))
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2))
    robust.save(model, tmp_path / "new.json")
    new = robust.load(tmp_path / "new.json")
    old = replace(model, records=tuple(replace(one, level=None) for one in model.records))
    robust.save(old, tmp_path / "old.json")
    assert robust.load(tmp_path / "old.json").records[0].level is None
    signals = {"disturbance": NoiseSignal(0.1, 2 * np.pi, 2 * np.pi * 60)}
    assert new.records[0].level.rms_u == model.records[0].level.rms_u
    assert level_of(new, 0.0, **signals).inside
    level = level_of(old, 0.0, **signals)
    assert (level.u_state, level.y_state, level.inside) == (UNKNOWN, UNKNOWN, False)
    assert "unknown" in unwrapped(level)
    assert robust.analysis.predict_level(old, 0.0, LoopSignals(**signals), bla=bla).inside
    assert level_of(plant_set(), 1.0, **signals).u_state is UNKNOWN  # a radius of one's own


def test_power_outside_the_measured_band_is_named():
    said = unwrapped(level_of(plant_set(), 1.0, disturbance=sine(1.0, 30.0)))
    assert said.count("100 % of its power outside the measured band") == 2
    assert "outside" not in unwrapped(level_of(plant_set(), 1.0, disturbance=sine(1.0, 1.5)))


@pytest.mark.parametrize(
    ("K", "signals", "message"),
    [
        (-2.0, {"noise": sine(1.0, 1.0)}, "K must stabilise"),
        (1.0, {"noise": NoiseSignal(1.0)}, "noise must have a highest frequency"),
        (
            control.tf([1], [1], 0.1),
            {"noise": sine(1.0, 40.0)},
            "noise must lie below the Nyquist frequency",
        ),
        (
            control.tf([1], [1], 0.1),
            {"noise": NoiseSignal(1.0, 0.0, 40.0)},
            "noise must lie below the Nyquist",
        ),
    ],
)
def test_signals_that_do_not_fit_the_loop(K, signals, message):
    with pytest.raises(ValueError, match=message):
        level_of(plant_set(), K, **signals)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LoopSignals(), "reference, disturbance or noise must be given"),
        (
            lambda: LoopSignals(reference="step"),
            "reference must be of type NoiseSignal or StepSignal",
        ),
        (lambda: NoiseSignal(1.0, 3.0, 2.0), "omega_max must lie above omega_min"),
        (lambda: NoiseSignal(float("nan")), "rms must be finite"),
        (lambda: StepSignal(float("inf")), "height must be finite"),
        (lambda: robust.analysis.predict_level(LAG, 1.0, LoopSignals(noise=sine(1, 1))), "model"),
        (
            lambda: robust.analysis.predict_level(
                plant_set(), 1.0, LoopSignals(noise=sine(1, 1)), bla=[1]
            ),
            "bla must be an",
        ),
        (
            lambda: robust.analysis.predict_level(plant_set(), 1.0, sine(1.0, 1.0)),
            "signals must be of type LoopSignals",
        ),
    ],
)
def test_bad_signals(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.attack
def test_the_built_in_rig_moves_as_predicted_inside_its_level():
    """One record at 0.5 N, a loop disturbed by 0.5 N: rms of force and motion within a tenth; 30 s
    of noise.
    """
    ms = nlfrf.multisine(
        "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=250, rms=0.5, rng=1
    )
    bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2, n_discard=1))
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=3))
    plant, fs = robust.sampled(model.nominal, 1e-3), 1000
    K = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * 20)).K
    force = 0.5 * np.random.default_rng(0).standard_normal(30 * fs)
    motion = nlfrf.rig.run(nlfrf.paper_rig(), np.zeros(force.size), K, disturbance=force)
    level = level_of(model, K, disturbance=NoiseSignal(0.5))
    assert level.inside
    assert np.std(motion.u + force) == pytest.approx(level.u, rel=0.1)
    assert np.std(motion.x) == pytest.approx(level.y, rel=0.1)
