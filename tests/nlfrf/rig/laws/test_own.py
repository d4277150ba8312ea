"""A friction law of the user's own: against the laws that are there, against SciPy, compiled and
not.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlfrf
from nlfrf import simulate
from nlfrf.rig import Controller, Rig, run

SIGMA0, SIGMA1, SIGMA2, FC, FS, VS = 64e3, 13.0, 0.4, 0.7, 1.0, 0.01
BUILT_IN = nlfrf.friction.LuGre(sigma0=SIGMA0, sigma1=SIGMA1, sigma2=SIGMA2, Fc=FC, Fs=FS, vs=VS)


def level(v):
    return FC + (FS - FC) * np.exp(-((v / VS) ** 2))


def lugre_rate(x, v, z):
    return v - SIGMA0 * np.abs(v) * z / (FC + (FS - FC) * np.exp(-((v / VS) ** 2)))


def lugre_force(x, v, z):
    rate = v - SIGMA0 * np.abs(v) * z[0] / (FC + (FS - FC) * np.exp(-((v / VS) ** 2)))
    return SIGMA0 * z[0] + SIGMA1 * rate + SIGMA2 * v


def viscous_rate(x, v, z):
    return np.zeros(0)


def tanh_force(x, v, z):
    return 0.7 * np.tanh(v / 0.01)


OWN = nlfrf.friction.OwnFriction(
    derivative=lugre_rate, force=lugre_force, rest=[0.0], stiffness=SIGMA0, damping=SIGMA1 + SIGMA2
)
SLIDING = nlfrf.friction.OwnFriction(
    derivative=viscous_rate, force=tanh_force, rest=[], stiffness=0.0, damping=70.0
)


def test_lugre_written_by_hand_is_lugre():
    t = np.arange(4000) / 4000
    force = 1.5 * np.sin(2 * np.pi * 12 * t)
    mine, theirs = (
        run(Rig(1.0, 80e3, law), force, fs=4000.0, oversampling=16) for law in (OWN, BUILT_IN)
    )
    assert np.max(np.abs(mine.x - theirs.x)) < 1e-3 * np.max(np.abs(theirs.x))
    assert np.max(np.abs(mine.friction - theirs.friction)) < 5e-3 * np.max(np.abs(theirs.friction))
    assert OWN.compiled


def test_a_prescribed_motion_gives_its_force():
    motion = run(OWN, np.full(3000, 0.02), fs=20e3)
    assert motion.friction[-1] == pytest.approx(level(0.02) + SIGMA2 * 0.02, rel=1e-6)
    assert motion.x[-1] == pytest.approx(0.02 * 2999 / 20e3, rel=1e-9)


def test_a_law_without_a_state_agrees_with_scipy():
    t = np.arange(2000) / 4000
    force = 2.0 * np.sin(2 * np.pi * 10 * t)
    found = run(Rig(1.0, 4e3, SLIDING, 0.5), force, fs=4000.0, oversampling=8)

    def rates(now, y):
        u = np.interp(now, t, force)
        return [y[1], u - 0.5 * y[1] - 4e3 * y[0] - 0.7 * np.tanh(y[1] / 0.01)]

    wanted = solve_ivp(
        rates, (0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-8, atol=1e-12, max_step=1e-3
    )
    assert np.max(np.abs(found.x - wanted.y[0])) < 1e-3 * np.max(np.abs(wanted.y[0]))


def test_what_numba_cannot_compile_runs_as_it_is():
    table = {"stiffness": 0.7}  # a dictionary of its own kind: numba takes none from outside

    def force(x, v, z):
        return table["stiffness"] * float(np.tanh(v / 0.01))

    plain = nlfrf.friction.OwnFriction(
        derivative=viscous_rate, force=force, rest=[], stiffness=0.0, damping=70.0
    )
    assert not plain.compiled
    push = np.linspace(0, 2, 200)
    slow, quick = (
        run(Rig(1.0, 4e3, law), push, fs=4000.0, oversampling=4) for law in (plain, SLIDING)
    )
    assert slow.x == pytest.approx(quick.x, rel=1e-12, abs=1e-18)


def test_a_multisine_is_identified_on_it():
    ms = nlfrf.multisine(fs=2048, n_samples=2048, f_min=4, f_max=150, rms=0.5, rng=1)
    rig = Rig(1.0, 80e3, OWN)
    mine, theirs = (
        nlfrf.identify(simulate(r, ms, n_periods=2)) for r in (rig, Rig(1.0, 80e3, BUILT_IN))
    )
    assert np.max(np.abs(mine.G - theirs.G) / np.abs(theirs.G)) < 0.02


def test_a_step_too_long_is_refused_with_one_that_would_do():
    with pytest.raises(ValueError, match="oversampling must be at least"):
        run(Rig(1e-3, 80e3, OWN), np.ones(10), fs=100.0)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"derivative": 3.0}, "derivative must be a function"),
        ({"force": lambda x, v, z: z[5]}, "force must be a function .* IndexError"),
        ({"force": lambda x, v, z: np.nan}, "force must give one finite number"),
        ({"derivative": lambda x, v, z: np.zeros(3)}, "derivative must give 1 finite numbers"),
        ({"stiffness": -1.0}, "stiffness must be zero or positive"),
        ({"rest": np.zeros(300)}, "rest must hold at most 256"),
    ],
)
def test_what_is_no_law_is_refused(fields, said):
    given = {
        "derivative": lugre_rate,
        "force": lugre_force,
        "rest": [0.0],
        "stiffness": SIGMA0,
    } | fields
    with pytest.raises(ValueError, match=said):
        nlfrf.friction.OwnFriction(**given)


def loop(law, **options):
    import control

    K = control.ss([[1.0]], [[1.0]], [[200.0]], [[3e3]], 1 / 2000)
    r = 2e-4 * np.sin(2 * np.pi * 20 * np.arange(300) / 2000)
    return run(Rig(1.0, 80e3, law), r, Controller(K, delay=0.7e-3), initial=(1e-5, 0.02), **options)


def test_a_loop_around_it_is_the_loop_around_the_law_that_is_there():
    mine, theirs = (loop(law, oversampling=32) for law in (OWN, BUILT_IN))
    assert np.max(np.abs(theirs.friction)) > FC  # it slides
    for name in ("x", "u", "friction"):
        own, built_in = getattr(mine, name), getattr(theirs, name)
        assert np.max(np.abs(own - built_in)) < 2e-3 * np.max(np.abs(built_in)), name
    again = loop(OWN, oversampling=32)
    assert np.array_equal(mine.x, again.x)  # it begins at rest each time


def test_a_loop_around_what_numba_cannot_compile_runs_as_it_is():
    table = {"stiffness": 0.7}

    def force(x, v, z):
        return table["stiffness"] * float(np.tanh(v / 0.01))

    plain = nlfrf.friction.OwnFriction(
        derivative=viscous_rate, force=force, rest=[], stiffness=0.0, damping=70.0
    )
    slow, quick = loop(plain), loop(SLIDING)
    assert slow.x == pytest.approx(quick.x, rel=1e-9, abs=1e-15)


def test_results_of_own_functions_are_not_resumed(tmp_path):
    import control

    K = Controller(control.ss([], [], [], [[1.0]], 1e-3))
    with pytest.raises(ValueError, match="resume must be left out"):
        nlfrf.rig.run_loops(Rig(1.0, 80e3, OWN), np.zeros(10), [K], resume=tmp_path)
