"""Values of the faces sent to other processes: by plain pickle, by joblib and by dask."""

import inspect
import pickle
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path

import cloudpickle
import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf import friction, hysteresis
from tests.support.bla import make_bla


def lag(s):
    return 2 / (s / 60 + 1)


BLA = make_bla(
    lag, np.arange(1.0, 31.0), f0=1.0, sigma_noise=0.01, sigma_distortion=0.03, rng=1, fs=500
)
FIT = robust.fit_nominal(BLA, n_poles=1)
MODEL = robust.uncertainty(BLA, FIT, order=2)
K = robust.shaping.pid(0.5, 4.0)
N = control.ss([[-1.0]], [[0.3, 0.2]], [[1.0], [0.5]], np.zeros((2, 2)))
DELTA = [(1, 1), (1, 1)]


def values_of_nlfrf():
    ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, n_realizations=2, rng=1)
    u = ms.u[:, None]
    record = nlfrf.Record(u=u, y=2 * u + 0.1 * u**3, fs=128, lines=ms.lines)
    rig = nlfrf.rig.Rig(
        mass=1.0, stiffness=100.0, damping=2.0, friction=friction.Coulomb.constant(0.1)
    )
    band = nlfrf.multisine(fs=512, n_samples=512, f_min=2, f_max=60, rng=1)
    yield from (BLA, BLA.levels, BLA.lines, ms, record, rig, nlfrf.second_opinion(record))
    yield nlfrf.level_study(rig, band, [0.5, 1.0], n_discard=10)
    axis = nlfrf.servo_axis("linear motor")
    yield from (axis, axis.drive, nlfrf.rig.run(axis, np.zeros(40)))
    yield nlfrf.rig.run(rig, np.zeros(20), fs=512.0)
    yield nlfrf.rig.run(rig, np.ones(20), control.ss([], [], [], [[1.0]], 0.01))
    two = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    u = np.repeat(two.u[:, :, None], 2, axis=2)
    several = nlfrf.Record(u=u, y=u[::-1], fs=256, lines=two.lines)
    frm = nlfrf.identify(replace(several, y=several.y + 0.1 * several.u**3))
    yield from (two, several, frm)
    yield friction.LuGre(sigma0=1e5, sigma1=1.0, sigma2=0.0, Fc=1.0, Fs=1.5, vs=0.01)
    with tempfile.TemporaryDirectory() as folder:
        nlfrf.save(record, Path(folder) / "record.mat")
        yield nlfrf.inspect_file(Path(folder) / "record.mat")
    yield hysteresis.MaxwellSlip(stiffness=[1.0, 2.0], strength=[0.3, 0.7])


def values_of_robust():
    yield from (
        robust.analysis.StepSignal(1.0),
        robust.analysis.NoiseSignal(0.3),
        robust.analysis.LevelState.INSIDE,
    )
    signals = robust.analysis.LoopSignals(
        disturbance=robust.analysis.NoiseSignal(0.3, omega_max=100.0)
    )
    level = robust.analysis.predict_level(MODEL, K, signals)
    yield from (signals, level, level.signals[0])
    two = control.ss(
        [[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y"
    )
    loop = control.ss([], [], [], [[-4.0]], inputs="y", outputs="u")
    block = robust.models.Block("y", "pole", 2.5, kind="real")
    system = robust.models.interconnection([two, loop], {"pole": block})
    P = control.ss(
        [[-1.0]], [[1, 0, 1]], [[0], [-0.5], [-1]], [[0, 0, 0.5], [0, 0.5, 0], [0, 1, 0]]
    )
    w = control.ss([], [], [], [[0.5]])
    two_by_two = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    several = robust.UncertaintyModel(
        nominal=two_by_two, form="additive", left=(w, w), right=(w, w), omega=[1.0], radius=0.5 * np.ones((4, 1)),
        confidence=0.95,
    )  # fmt: skip
    ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    frm = nlfrf.identify(nlfrf.Record(u=u, y=u + 0.1 * u**3, fs=256, lines=ms.lines))
    yield robust.validate(frm, frm)
    yield robust.analysis.loop_gains(two_by_two, np.eye(2))
    yield from (
        several,
        robust.analysis.breaking_perturbation(several, control.ss([], [], [], np.eye(2))),
    )
    yield robust.margins.disk_margins(several, np.eye(2))
    yield from (BLA, FIT, MODEL, K, block, system, robust.analysis.check_structure(system))
    yield from (robust.models.scan_orders(BLA, n_poles=(1, 2)), robust.validate(MODEL, BLA))
    yield from (
        robust.fit_weight(MODEL.omega, MODEL.radius, order=2),
        robust.margins.disk_margin(FIT.G * K),
    )
    yield from (robust.check(MODEL, K), robust.check(BLA, K), robust.worst_case(MODEL, K))
    yield from (robust.analysis.sample_loops(MODEL, K, 3, rng=0), robust.ncfsyn(FIT.G, 1.0))
    yield from (robust.hinfsyn(P, 1, 1), robust.dk_iteration(P, DELTA, 1, 1, n_rounds=1))
    PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)
    machine, slip = robust.friction_plant(1.0, 80e3, 0.4), robust.friction.MaxwellSlip(64e3)
    known = {
        "mass": 1.0,
        "mass_std": 0.01,
        "stiffness_low": 79e3,
        "stiffness_std": 100.0,
        "evidence": "three levels",
    }
    yield from (
        robust.prove_friction(machine, PD, slip),
        robust.friction.MachineWithFriction(machines=(machine,), friction=slip, **known),
    )
    yield robust.prove_friction(machine, 1e3, slip, Fs=1.0, saturation=20.0)
    yield robust.synthesis.ControllerStructure(
        n_zeros=3, n_integrators=1, poles=(-0.5 + 50j, -0.5 - 50j)
    )
    yield from (
        robust.io.pid_gains(K),
        robust.step_response(FIT.G, K),
        robust.check(MODEL, K).classical,
    )
    lag, exact = control.tf([1], [1, 1]), control.tf([0.1], [1])
    small = robust.UncertaintyModel(
        lag, exact, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI"
    )
    PI = control.tf([2, 2], [1, 0])
    yield robust.synthesis.feedforward_filter(small, 2.0, control.tf([1], [0.5, 1]))
    yield from (
        robust.synthesis.prefilter(small, PI, lag),
        robust.check(small, PI).proofs.certificates[0].verify(),
    )
    yield robust.reduce_controller(control.tf([1], [1e-4, 1]) * control.tf([3], [1e-3, 1]), small)
    yield robust.mu.parameter_margin(
        control.ss([[-5.0]], [[1.0]], [[1.0]], [[0.0]]), [(1, 1, "real")]
    )
    yield from (
        robust.mu.upper(np.full((2, 2, 3), 0.3 + 0j), DELTA),
        robust.certify_norm(FIT.G, 10.0),
    )


def same(a, b):
    """Whether two values hold the same numbers to the bit."""
    assert type(a) is type(b)
    if isinstance(a, control.StateSpace):
        assert (a.name, a.dt, a.state_labels) == (b.name, b.dt, b.state_labels)
        for m in "ABCD":
            same(getattr(a, m), getattr(b, m))
    elif is_dataclass(a):
        for field in fields(a):
            same(getattr(a, field.name), getattr(b, field.name))
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        assert np.array_equal(a, b, equal_nan=a.dtype.kind in "fc")
    elif isinstance(a, (tuple, list)):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            same(one, other)
    elif isinstance(a, dict):
        same(list(a.items()), list(b.items()))
    elif isinstance(a, (str, int, float, complex)):
        assert a == b or a != a


@pytest.mark.parametrize("values", [values_of_nlfrf, values_of_robust])
def test_every_public_value_survives_a_pickle(values):
    seen = set()
    for thing in values():
        seen.add(type(thing))
        for how in (pickle, cloudpickle):
            same(thing, how.loads(how.dumps(thing)))
    module = nlfrf if values is values_of_nlfrf else robust
    classes = {thing for name in module.__all__ if inspect.isclass(thing := getattr(module, name))}
    assert {c for c in classes if not issubclass(c, Warning)} <= seen


def test_names_of_signals_survive():
    plant = control.ss(
        [[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], 0, inputs="force", outputs="x", states=["x", "v"]
    )
    again = pickle.loads(pickle.dumps(plant))
    assert (again.input_labels, again.output_labels, again.state_labels) == (
        ["force"],
        ["x"],
        ["x", "v"],
    )


def peak(K, model=MODEL):
    return float(robust.check(model, K, certify=False).curves.rs.max())


def test_a_function_that_names_robust_can_be_sent_to_a_worker():
    assert cloudpickle.loads(cloudpickle.dumps(lambda K: robust.check(MODEL, K, certify=False)))(
        K
    ).nominally_stable


@pytest.mark.filterwarnings(
    "ignore::DeprecationWarning"
)  # of fork, by joblib and dask on some Pythons
def test_models_and_controllers_go_to_workers():
    controllers = [robust.shaping.pid(gain, 4.0) for gain in (0.2, 0.4)] + [0.5]
    here = [peak(K) for K in controllers]
    with ProcessPoolExecutor(2) as pool:
        assert list(pool.map(peak, controllers)) == here
        report = next(iter(pool.map(partial(robust.check, MODEL), [K])))
    same(report, robust.check(MODEL, K))


@pytest.mark.attack
@pytest.mark.filterwarnings(
    "ignore::DeprecationWarning"
)  # of fork, by joblib and dask on some Pythons
def test_workers_of_joblib_and_dask_take_them_too():
    import dask
    import joblib

    controllers = [robust.shaping.pid(gain, 4.0) for gain in (0.2, 0.4)] + [0.5]
    here = [peak(K) for K in controllers]
    assert joblib.Parallel(n_jobs=2)(joblib.delayed(peak)(K) for K in controllers) == here
    assert (
        list(
            dask.compute(
                *map(dask.delayed(peak), controllers), scheduler="processes", num_workers=2
            )
        )
        == here
    )
