"""Rigs of several axes: against exact discretisation, an adaptive integrator, and the rig of one
axis, law by law.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import nlfrf
from benchmarks.bench_axes import attack
from nlfrf import multisine, paper_rig, simulate
from nlfrf.rig import Rig, run, two_axis_stage
from tests.support.virgin_curves import chord_elements

FS = 1024.0
LUGRE = nlfrf.friction.LuGre(sigma0=64e3, sigma1=13.0, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)
COULOMB = nlfrf.friction.Coulomb(Fc=0.7, Fs=1.0, vs=0.01, sigma2=0.4)


def exactly(rig, force, fs):
    """Positions (n_y, n) of the rig without friction and cubic springs, its forces held over each
    sample.
    """
    n, m = rig.n_axes, rig.n_inputs
    block = np.zeros((2 * n + m, 2 * n + m))
    block[:n, n : 2 * n] = np.eye(n)
    forces = np.hstack([-rig.stiffness, -rig.damping, rig.actuators])
    block[n : 2 * n] = np.linalg.solve(rig.mass, forces)
    step = expm(block / fs)
    state, out = np.zeros(2 * n), []
    for u in force.T:
        out.append(rig.sensors @ state[:n])
        state = step[: 2 * n, : 2 * n] @ state + step[: 2 * n, 2 * n :] @ u
    return np.array(out).T


GYROSCOPE = Rig(
    mass=[[1.0, 0.3, 0.0], [0.3, 2.0, -0.2], [0.0, -0.2, 0.7]],
    stiffness=[[4e4, -1e4, 0.0], [-1e4, 9e4, -2e4], [0.0, -2e4, 5e4]],
    damping=[[9.0, 30.0, 0.0], [-30.0, 12.0, -2.0], [0.0, -2.0, 5.0]],
    friction=[None] * 3,
    actuators=[[1.0, 0.0], [0.2, 1.0], [0.0, -0.5]],
    sensors=[[0.0, 0.0, 1.0], [1.0, 0.5, 0.0]],
)


@pytest.mark.parametrize("rig", [two_axis_stage("none"), GYROSCOPE], ids=["stage", "gyroscope"])
def test_linear_axes_move_as_the_exact_discretisation_says(rig):
    force = np.random.default_rng(0).standard_normal((2, 800))
    motion = run(rig, force, fs=FS, oversampling=32, hold="zoh")
    exact = exactly(rig, force, FS)
    assert np.abs(rig.sensors @ motion.x - exact).max() < 5e-9 * np.abs(exact).max()
    assert not motion.friction.any()


@pytest.mark.parametrize("kind", ["friction", "springs"])
def test_the_stage_moves_as_an_adaptive_integrator_says(kind):
    rig, n = two_axis_stage(kind), 150
    force = np.random.default_rng(1).standard_normal((2, n)) * np.array([[8.0], [10.0]])
    law = nlfrf.friction.LuGre(sigma0=3e4, sigma1=13.0, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)

    def rates(t, state, u):
        x, v, z = state.reshape(3, 2)
        f = u - rig.stiffness @ x - rig.damping @ v
        if kind == "springs":
            inner = 4.5e10 * (x[0] - x[1]) ** 3
            return np.concatenate(
                [
                    v,
                    (f - [3.3e10 * x[0] ** 3 + inner, 1.2e11 * x[1] ** 3 - inner]) / [1, 1.5],
                    0 * z,
                ]
            )
        dz = (
            v
            - law.sigma0
            * np.abs(v)
            / (law.Fc + (law.Fs - law.Fc) * np.exp(-((v / law.vs) ** 2)))
            * z
        )
        return np.concatenate(
            [v, (f - law.sigma0 * z - law.sigma1 * dz - law.sigma2 * v) / [1, 1.5], dz]
        )

    state, exact = np.zeros(6), []
    for u in force.T:
        exact.append(state)
        state = solve_ivp(rates, (0, 1 / FS), state, "DOP853", args=(u,), rtol=1e-10, atol=1e-14).y[
            :, -1
        ]
    exact = np.array(exact).T
    motion = run(rig, force, fs=FS, oversampling=16, hold="zoh")
    assert np.abs(motion.x - exact[:2]).max() < 2e-6 * np.abs(exact[:2]).max()
    if kind == "friction":
        assert np.abs(motion.v).max() > 0.05  # it slides
        assert np.abs(motion.z - exact[4:]).max() < 2e-5 * np.abs(exact[4:]).max()


LAWS = {
    "Leuven": (paper_rig().friction, 1e-6),
    "Leuven, elements": (
        nlfrf.friction.Leuven(
            curve=chord_elements(nlfrf.hysteresis.Tanh(64e3, 1.0), np.geomspace(5e-7, 5e-5, 8))
        ),
        1e-6,
    ),
    "Leuven, table": (
        nlfrf.friction.Leuven(
            curve=nlfrf.hysteresis.Table(z=[1e-5, 3e-5, 9e-5], F=[0.5, 0.9, 1.2])
        ),
        1e-6,
    ),
    "Leuven, exponential": (
        nlfrf.friction.Leuven(n=2.0, curve=nlfrf.hysteresis.Exponential(64e3, 1.0)),
        1e-6,
    ),
    "LuGre": (LUGRE, 1e-8),
    "Dahl": (nlfrf.friction.Dahl(sigma0=64e3, Fc=0.7), 1e-8),
    "Coulomb": (COULOMB, 1e-6),
    "GMS": (
        nlfrf.friction.GeneralizedMaxwellSlip(
            stiffness=[4e4, 2.4e4], alpha=[0.5, 0.5], C=10, Fc=0.7, Fs=1.0, vs=0.01
        ),
        1e-7,
    ),
    "sliders": (
        nlfrf.friction.VaryingSliders(
            stiffness=[4e4, 2.4e4], strength=[0.5, 0.5], stiction=1.4, vs=0.01, seed=3
        ),
        1e-3,
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_one_axis_of_a_matrix_is_the_rig_of_one_axis(name):
    """Beside another axis with another law, to which nothing couples it, and alone."""
    law, tolerance = LAWS[name]
    force = np.convolve(
        2.5 * np.random.default_rng(2).standard_normal(2000), np.ones(8) / 2, "same"
    )
    single = run(Rig(1.0, 80e3, law, 0.4), force, fs=4096.0, oversampling=4)
    alone = run(Rig([[1.0]], [[80e3]], [law], [[0.4]]), force[None], fs=4096.0, oversampling=4)
    other = Rig(np.diag([2.0, 1.0]), np.diag([5e4, 80e3]), [LUGRE, law], np.diag([3.0, 0.4]))
    beside = run(other, np.stack([force[::-1], force]), fs=4096.0, oversampling=4)
    assert np.abs(single.v).max() > 0.02  # it slides
    for x, friction in ((alone.x[0], alone.friction[0]), (beside.x[1], beside.friction[1])):
        assert np.abs(x - single.x).max() < tolerance * np.abs(single.x).max()
        # at the very first sample dry friction of one axis says what would hold it, here what it
        # slides with
        assert np.abs(friction - single.friction)[1:].max() < 100 * tolerance


def test_dry_friction_holds_one_axis_while_the_other_moves():
    """A mass matrix that couples: what holds an axis includes the inertia of the others."""
    mass = np.array([[1.0, 0.4], [0.4, 1.5]])
    rig = Rig(
        mass,
        [[4e4, -2e4], [-2e4, 6e4]],
        [COULOMB, nlfrf.friction.Coulomb.constant(0.5)],
        np.diag([5.0, 8.0]),
    )
    t = np.arange(2000) / 4096
    force = np.stack([1.6 * np.sin(2 * np.pi * 3 * t), 1.2 * np.sin(2 * np.pi * 5 * t + 1)])
    motion = run(rig, force, fs=4096.0, oversampling=8)
    at_rest = motion.v == 0
    share = at_rest.mean(axis=1)
    assert share.min() > 0.05
    assert share.max() < 0.95
    assert (at_rest[0] & ~at_rest[1]).sum() > 50  # one moves while the other is held
    assert (
        np.abs(motion.friction)
        <= np.array([[1.0], [0.5]]) + 0.4 * np.abs(motion.v) * [[1], [0]] + 1e-6
    ).all()
    off = []
    for sigma0, oversampling in (
        (5e7, 64),
        (2e8, 256),
    ):  # dry friction is that of bristles that do not bend
        bristles = {"sigma0": sigma0, "sigma1": 0.1 * sigma0**0.5}
        laws = [
            nlfrf.friction.LuGre(sigma2=one.sigma2, Fc=one.Fc, Fs=one.Fs, vs=one.vs, **bristles)
            for one in rig.friction
        ]
        near = run(
            Rig(mass, rig.stiffness, laws, rig.damping), force, fs=4096.0, oversampling=oversampling
        )
        off.append(np.abs(near.x - motion.x).max() / np.abs(motion.x).max())
    assert off[1] < 0.5 * off[0] < 0.01


def test_random_machines_lose_energy_and_do_not_depend_on_the_step():
    """One to four axes with any laws, springs and mass matrices; `python -m benchmarks.bench_axes`
    tries more.
    """
    gained, changed, rigs = zip(*(attack(seed) for seed in range(12)), strict=True)
    assert max(gained) < 1e-9
    assert np.median(changed) < 1e-4
    assert max(changed) < 0.05  # sliders that vary take another way after a change that small
    assert {rig.n_axes for rig in rigs} == {1, 2, 3, 4}


def test_friction_sends_nothing_to_even_lines():
    ms = multisine(
        "odd", fs=FS, n_samples=1024, f_min=2, f_max=150, rms=(2.0, 3.0), n_inputs=2, rng=1
    )
    record = simulate(two_axis_stage(), ms, n_discard=6, oversampling=2)
    spectrum = np.abs(np.fft.rfft(record.y[:, :, 0]))
    assert spectrum[..., ms.lines.even].max() < 1e-8 * spectrum[..., ms.lines.excited].max()


@pytest.mark.parametrize("design", ["orthogonal", "zippered"])
def test_a_linear_stage_is_identified_as_it_is(design):
    options = {"fs": FS, "n_samples": 512, "f_min": 4, "f_max": 200, "n_inputs": 2, "rng": 1}
    ms = multisine("random-odd", rms=(1.0, 2.0), design=design, **options)
    rig = two_axis_stage("none")
    record = simulate(rig, ms, n_periods=2, n_discard=60, oversampling=16, hold="zoh")
    assert (record.inputs, record.outputs) == (("Fx", "Fy"), ("x", "y"))
    assert record.y.shape == (2, 2 if design == "orthogonal" else 1, 2, 512)
    expected = exactly(rig, np.tile(ms.u[:, 0], 62), FS)[:, -512:]
    assert np.abs(record.y[:, 0, 1] - expected).max() < 1e-7 * np.abs(expected).max()
    if design == "orthogonal":
        frm = nlfrf.identify(record)
        s = 2j * np.pi * frm.f
        # far below the resonances the hold is a delay of half a sample
        low = np.linalg.inv(rig.mass * s[0] ** 2 + rig.damping * s[0] + rig.stiffness) * np.exp(
            -s[0] / 2 / FS
        )
        assert np.abs(frm.G[..., 0] - rig.sensors @ low).max() < 1e-3 * np.abs(low).max()


def test_records_carry_what_the_rig_knows():
    ms = multisine(fs=FS, n_samples=512, f_min=4, f_max=100, rng=1)
    record = simulate(paper_rig(), ms, n_discard=12, oversampling=4)
    assert (record.u_name, record.y_name, record.u_unit, record.y_unit) == (
        "force",
        "position",
        "N",
        "m",
    )
    two_mass = Rig(
        mass=np.diag([1.0, 2.0]),
        stiffness=[[5e4, -5e4], [-5e4, 7e4]],
        friction=[LUGRE, None],
        damping=[[4.0, -4.0], [-4.0, 4.0]],
        actuators=[[1.0], [0.0]],
        sensors=[[0.0, 1.0]],
        outputs=("load",),
    )
    load = simulate(two_mass, ms, n_discard=40, oversampling=4)
    assert load.y.shape == (1, 1, 512)
    assert (load.u_name, load.y_name) == ("F1", "load")
    motion = run(two_mass, np.tile(ms.u, 41), fs=FS, oversampling=16)
    assert (
        np.abs(motion.x[1, -512:] - load.y[0, 0]).max() < 3e-2 * load.y.max()
    )  # straight lines between the samples


def test_finished_experiments_of_a_stage_are_kept(tmp_path):
    ms = multisine("random-odd", fs=FS, n_samples=256, f_min=8, f_max=200, n_inputs=2, rng=1)
    done = []
    first = simulate(two_axis_stage(), ms, n_discard=40, oversampling=4, resume=tmp_path)
    again = simulate(
        two_axis_stage(),
        ms,
        n_discard=40,
        oversampling=4,
        resume=tmp_path,
        progress=lambda *n: done.append(n),
    )
    assert np.array_equal(first.y, again.y)
    assert done == [(2, 2)]
    simulate(
        two_axis_stage("springs"),
        ms,
        n_discard=40,
        oversampling=4,
        resume=tmp_path,
        progress=lambda *n: done.append(n),
    )
    assert done[1:] == [(1, 2), (2, 2)]  # another machine


ONE = np.eye(2)
OWN = nlfrf.friction.OwnFriction(
    derivative=lambda x, v, z: v - z, force=lambda x, v, z: z[0], rest=[0.0], stiffness=1.0
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"mass": np.ones((2, 3))},
            r"mass must be a number or a square matrix, got shape \(2, 3\)",
        ),
        (
            {"mass": [[1.0, 0.1], [0.0, 1.0]]},
            "mass must be symmetric, got .* differs from its transpose by up to 0.1",
        ),
        (
            {"mass": [[1.0, 2.0], [2.0, 1.0]]},
            "mass must be positive definite, got eigenvalues from -1 to 3",
        ),
        ({"mass": [[1.0, 1.0], [1.0, 1.0]]}, "mass must be positive definite"),
        ({"stiffness": 3.0}, r"stiffness must have the shape of mass, \(2, 2\), got shape \(\)"),
        (
            {"stiffness": -ONE},
            "stiffness must be positive semidefinite, got eigenvalues from -1 to -1",
        ),
        (
            {"damping": np.ones(2)},
            r"damping must have the shape of mass, \(2, 2\), got shape \(2,\)",
        ),
        ({"damping": np.diag([1.0, -1.0])}, "damping must be positive semidefinite"),
        (
            {"friction": [None]},
            "friction must be a list with a law or None for each of the 2 axes, got 1",
        ),
        (
            {"friction": LUGRE},
            "friction must be a list with a law or None for each of the 2 axes, got 1",
        ),
        ({"friction": [None, 3.0]}, r"friction must be one of the laws of nlfrf.friction, got 3.0"),
        (
            {"friction": [OWN, None]},
            r"friction\[0\] must be one of the laws .* for several axes, got OwnFriction",
        ),
        ({"cubic": -ONE}, "cubic must hold springs of zero or positive stiffness, got -1"),
        ({"cubic": [[1.0, 2.0], [0.0, 1.0]]}, "cubic must be symmetric"),
        (
            {"sensors": np.ones((1, 3))},
            r"sensors must have 2 columns, one per axis, got shape \(1, 3\)",
        ),
        (
            {"actuators": np.ones((3, 1))},
            r"actuators must have 2 rows, one per axis, got shape \(3, 1\)",
        ),
        (
            {"actuators": [[1.0, 0.0], [1.0, 0.0]]},
            "actuators must act on some axis with every channel",
        ),
        ({"inputs": ("Fx",)}, r"inputs must be 2 different names, got \('Fx',\)"),
        (
            {"inputs": "xy"},
            "inputs must be 2 different names, got 'xy'",
        ),  # one text is one name, not two letters
        ({"outputs": ("x", "x")}, "outputs must be 2 different names"),
        ({"outputs": (1, 2)}, r"outputs must be 2 different names, got \(1, 2\)"),
    ],
)
def test_matrices_that_make_no_machine_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Rig(**{"mass": ONE, "stiffness": ONE, "friction": [None, None], **change})


@pytest.mark.parametrize("name", ["cubic", "actuators", "sensors"])
def test_what_only_several_axes_have_is_refused_of_one(name):
    with pytest.raises(ValueError, match=f"{name} must be left out for one axis"):
        Rig(1.0, 80e3, LUGRE, **{name: [[1.0]]})


def test_the_one_channel_of_an_axis_has_one_name():
    assert Rig(1.0, 80e3, LUGRE, inputs="force").inputs == ("force",)
    with pytest.raises(ValueError, match=r"outputs must be one name, got \('x', 'y'\)"):
        Rig(1.0, 80e3, LUGRE, outputs=("x", "y"))


def test_multisines_that_do_not_fit_the_rig_are_refused():
    options = {"fs": FS, "n_samples": 512, "f_min": 4, "f_max": 100, "rng": 1}
    with pytest.raises(ValueError, match="ms must have the inputs of the rig, 2, got 1"):
        simulate(two_axis_stage(), multisine(**options))
    with pytest.raises(ValueError, match="ms must have the inputs of the rig, 2, got 3"):
        simulate(two_axis_stage(), multisine(n_inputs=3, **options))
    with pytest.raises(ValueError, match="ms must have the inputs of the rig, 1, got 2"):
        simulate(paper_rig(), multisine(n_inputs=2, **options))
    with pytest.raises(ValueError, match="signal must have 2 channels, like the rig, got 3"):
        run(two_axis_stage(), np.zeros((3, 10)), fs=FS)
    with pytest.raises(
        ValueError, match="oversampling must be at least 2 for a stable integration step"
    ):
        run(two_axis_stage(), np.zeros((2, 10)), fs=100.0)
    with pytest.raises(
        ValueError, match="nonlinearity must be one of 'friction', 'springs', 'none', got 'both'"
    ):
        two_axis_stage("both")


def test_a_machine_that_runs_away_between_steps_is_refused():
    """Cubic springs grow stiffer than the step can follow."""
    with pytest.raises(
        ValueError, match=r"oversampling must be about .* for a stable integration step in sliding"
    ):
        run(two_axis_stage("springs"), np.full((2, 200), 3e8), fs=FS, oversampling=8)
