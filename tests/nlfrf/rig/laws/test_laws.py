"""Friction laws: their numbers, what they refuse, and the properties the paper claims of its
model.
"""

import numpy as np
import pytest

import nlfrf
from nlfrf.rig import run
from nlfrf.rig.bench.rig import Rig

SLIDING = {"Fs": 1.0, "Fc": 0.7, "vs": 0.01, "sigma2": 0.4}
GMS = {"stiffness": [20e3, 20e3, 24e3], "alpha": [0.2, 0.3, 0.5], "C": 20.0}
LAWS = [
    nlfrf.friction.Leuven(),
    nlfrf.friction.Leuven(curve=nlfrf.hysteresis.Exponential(64e3, 1.0), n=2.0),
    nlfrf.friction.Leuven(curve=nlfrf.hysteresis.MaxwellSlip([32e3, 32e3], [0.3, 0.8])),
    nlfrf.friction.LuGre(sigma0=64e3, sigma1=13.0, **SLIDING),
    nlfrf.friction.GeneralizedMaxwellSlip(**GMS, **SLIDING),
    nlfrf.friction.Coulomb(**SLIDING),
]


def name(law):
    return type(law).__name__


@pytest.mark.parametrize("law", LAWS, ids=name)
@pytest.mark.parametrize("v", [3e-4, 3e-3, -0.01, 0.03, 0.2])
def test_stribeck_curve_is_recovered_from_constant_velocities(law, v):
    fs = 20 * abs(v) / 5e-5
    friction = run(
        law, np.full(2000, v), fs=fs, oversampling=int(np.ceil(2e4 / fs))
    ).friction  # 5 mm of travel
    stribeck = np.sign(v) * (
        law.Fc + (law.Fs - law.Fc) * np.exp(-(np.abs(v / law.vs) ** law.delta))
    )
    assert friction[-1] == pytest.approx(stribeck + 0.4 * v, rel=0.01)


def test_break_away_force_falls_as_the_force_rate_rises():
    peaks = []
    for rate, end in ((1.0, 1.05), (10.0, 1.2), (100.0, 2.5)):
        fs = max(8192.0, 10000 * rate / end)
        force = np.arange(0, end, rate / fs)
        motion = run(Rig(1.0, 0.0, nlfrf.friction.Leuven()), force, fs=fs, oversampling=4)
        assert motion.v[-1] > 1e-3  # it has broken away
        peaks.append(motion.friction.max())
    assert peaks[0] == pytest.approx(0.963, abs=0.01)
    assert peaks[1] == pytest.approx(0.917, abs=0.01)
    assert peaks[2] < 0.85


def test_friction_lag_opens_with_frequency():
    areas = []
    for f in (1.0, 10.0, 50.0):
        t = np.arange(3 * 2000) / (2000 * f)
        motion = run(
            nlfrf.friction.Leuven(),
            0.008 + 0.006 * np.sin(2 * np.pi * f * t),
            fs=2000 * f,
            oversampling=4,
        )
        last = slice(2 * 2000, None)
        areas.append(abs(np.trapezoid(motion.friction[last], motion.v[last])))
    assert areas[1] > 5 * areas[0]
    assert areas[2] > 2 * areas[1]


def test_presliding_is_hysteresis_with_non_local_memory():
    # slow motion between turning points; at the same position the force depends on which of them
    # came before
    z = np.array([0.0, 8e-6, -4e-6, 4e-6, 0.0, 4e-6, 8e-6])
    speed, fs = 1e-5, 1e4
    v = np.concatenate(
        [np.sign(step) * np.full(round(abs(step) / speed * fs), speed) for step in np.diff(z)]
    )
    motion = run(nlfrf.friction.Leuven(sigma1=0.0, sigma2=0.0, n=8.0), v, fs=fs)
    exact = nlfrf.hysteresis.hysteresis_force(nlfrf.hysteresis.Tanh(64e3, 1.0), motion.z)
    assert np.abs(motion.friction - exact).max() < 1e-5  # the motion turns between two samples
    turns = np.cumsum([round(abs(step) / speed * fs) for step in np.diff(z)])
    up, again = motion.friction[turns[2]], motion.friction[turns[4]]
    assert again == pytest.approx(up, abs=2e-3)  # the inner loop closes, but for creep
    assert motion.friction[turns[0]] - motion.friction[turns[1]] > 0.4


@pytest.mark.parametrize("law", [LAWS[0], LAWS[3], LAWS[4], LAWS[5]], ids=name)
def test_slow_spring_sticks_and_slips(law):
    pull, fs = 5e-3, 1000.0
    t = np.arange(30_000) / fs
    motion = run(Rig(1.0, 100.0, law), 100.0 * pull * t, fs=fs, oversampling=8)
    v = motion.v[15_000:]
    cycles = np.count_nonzero((v[1:] > pull) & (v[:-1] <= pull))
    assert 5 <= cycles <= 40
    assert v.max() > 3 * pull
    assert 0.3 < np.mean(np.abs(v) < 0.1 * pull) < 0.9


def test_elements_of_gms_hold_the_hysteresis_of_maxwell_slip_in_presliding():
    law = nlfrf.friction.GeneralizedMaxwellSlip(**GMS, **SLIDING)
    rng = np.random.default_rng(7)
    v = np.repeat(rng.uniform(-1e-5, 1e-5, 60), 200)
    motion = run(law, v, fs=1000.0)
    elements = nlfrf.hysteresis.MaxwellSlip(GMS["stiffness"], GMS["alpha"])  # at rest s(v) = Fs = 1
    assert (
        np.abs(
            motion.friction - 0.4 * motion.v - nlfrf.hysteresis.hysteresis_force(elements, motion.x)
        ).max()
        < 3e-3
    )


def test_gms_slips_with_the_lag_it_was_given():
    # at a jump of the velocity every slipping element relaxes with the rate C / |s(v)|
    law = nlfrf.friction.GeneralizedMaxwellSlip(**GMS, **{**SLIDING, "sigma2": 0.0})
    v = np.where(np.arange(40_000) < 20_000, 2e-3, 0.1)
    motion = run(law, v, fs=2e4, oversampling=1)
    later = np.arange(20_010, 22_000)
    lag = (motion.friction[later] - 0.7) / (motion.friction[20_010] - 0.7)
    assert np.allclose(lag, np.exp(-20.0 / 0.7 * (later - 20_010) / 2e4), atol=1e-5)


def test_coulomb_sticks_until_static_friction_is_passed():
    force = np.linspace(0, 1.2, 12_001)
    motion = run(Rig(1.0, 0.0, nlfrf.friction.Coulomb(Fc=0.7, Fs=1.0, vs=0.01)), force, fs=1000.0)
    still = motion.x == 0
    assert force[still].max() == pytest.approx(1.0, abs=2e-4)
    assert np.array_equal(motion.friction[still], force[still])
    assert motion.v[-1] > 0.1


def test_coulomb_sliding_loses_exactly_its_work():
    rig = Rig(1.0, 400.0, nlfrf.friction.Coulomb.constant(0.5))
    start = np.where(np.arange(12_000) < 600, 40.0, 0.0)  # pulled out, then let go
    motion = run(rig, start, fs=4000.0, oversampling=4, hold="zoh")
    peaks = motion.x[1:-1][(np.diff(motion.x)[:-1] > 0) & (np.diff(motion.x)[1:] <= 0)]
    drops = -np.diff(peaks)[1:-1]  # without the last, after which it rests
    assert drops.size >= 3
    assert np.allclose(drops, 4 * 0.5 / 400.0, rtol=1e-3)  # 4 Fc / k a period, the classical result


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"Fs": 0.5}, "Fs must be at least Fc = 0.7 N, got 0.5 N"),
        ({"vs": 0.0}, "vs must be positive, got 0"),
        ({"n": 0.0}, "n must be positive, got 0"),
        ({"n": -1.0}, "n must be positive, got -1"),
        ({"sigma1": -1.0}, "sigma1 must be zero or positive, got -1"),
        ({"delta": np.nan}, "delta must be finite, got nan"),
        (
            {"curve": nlfrf.hysteresis.ElasticPlastic(64e3, 0.5)},
            "curve must reach the static friction Fs = 1 N",
        ),
        ({"curve": lambda z: z}, "curve must be one of Linear, Tanh"),
    ],
)
def test_leuven_refuses(kwargs, message):
    with pytest.raises(ValueError, match=message):
        nlfrf.friction.Leuven(**kwargs)


def test_the_other_laws_refuse():
    with pytest.raises(ValueError, match="sigma0 must be positive"):
        nlfrf.friction.LuGre(sigma0=0.0, sigma1=1.0, sigma2=1.0, Fc=1.0, Fs=1.0, vs=1.0)
    with pytest.raises(ValueError, match="Fc must be positive"):
        nlfrf.friction.Dahl(sigma0=1.0, Fc=0.0)
    with pytest.raises(ValueError, match="Fc must be positive"):
        nlfrf.friction.Coulomb.constant(0.0)
    with pytest.raises(ValueError, match=r"Fs must be at least Fc = 0\.7 N, got 0\.5 N"):
        nlfrf.friction.Coulomb(Fc=0.7, Fs=0.5, vs=1.0)
    with pytest.raises(ValueError, match="Fs must be a real number, got None"):
        nlfrf.friction.Coulomb(Fc=0.7, Fs=None, vs=0.01)
    with pytest.raises(ValueError, match="vs must be a real number, got None"):
        nlfrf.friction.Coulomb(Fc=0.7, Fs=0.8, vs=None)
    with pytest.raises(ValueError, match=r"alpha must add up to 1, got 0\.9"):
        nlfrf.friction.GeneralizedMaxwellSlip(**{**GMS, "alpha": [0.2, 0.3, 0.4]}, **SLIDING)
    with pytest.raises(ValueError, match="C must be positive, got 0"):
        nlfrf.friction.GeneralizedMaxwellSlip(**{**GMS, "C": 0.0}, **SLIDING)


def test_leuven_defaults_are_the_paper_s():
    law = nlfrf.friction.Leuven()
    assert (law.Fs, law.Fc, law.vs, law.delta, law.sigma1, law.sigma2) == (
        1.0,
        0.7,
        0.01,
        2.0,
        13.0,
        0.4,
    )
    assert isinstance(law.curve, nlfrf.hysteresis.Tanh)


def test_drive_refuses_bad_arguments():
    with pytest.raises(ValueError, match="signal must be finite"):
        run(nlfrf.friction.Leuven(), [0.0, np.inf], fs=1e3)
    with pytest.raises(ValueError, match="signal must hold at least one sample, got none"):
        run(nlfrf.friction.Leuven(), [], fs=1e3)
    with pytest.raises(
        ValueError, match=r"oversampling must be about \d+ for a stable integration step in sliding"
    ):
        run(nlfrf.friction.Leuven(), np.full(100, 5.0), fs=1e3)
