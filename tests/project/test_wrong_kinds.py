"""Whatever is handed to a public name that is made for something else is refused by the name of its
parameter.
"""

import inspect
import warnings
from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf import plot as measured_pictures
from nlfrf.records.screened import screen_streams
from robust import plot as loop_pictures

MODULES = (nlfrf, robust, measured_pictures, loop_pictures)
SLOW = {"scan_orders", "level_study", "progress_bar"}
FLAGS = {
    "certify",
    "closed",
    "even",
    "limits",
    "resample",
    "simultaneous",
    "stable",
}  # true or false, whatever they are
IGNORED = {"subject", "time_cap", "solver", "n_unstable", "rank", "progress"}  # in some cases only
#: Parameters that no sound value is made of here: results of functions that have a test of their
#: own.
RESULTS = {
    "reference",
    "n_u",
    "n_y",
    "limit",
    "found",
    "bounds",
    "family",
    "gains",
    "scan",
    "prediction",
    "step",
}
RESULTS |= {"validation", "design", "loops", "read", "cases", "learning"}


@pytest.fixture(scope="module")
def things():
    """A sound value for every parameter that some function cannot do without, and values of several
    inputs.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rig = nlfrf.paper_rig()
        ms = nlfrf.multisine(fs=1024, n_samples=1024, f_min=2, f_max=100, rms=0.5, rng=2)
        record = nlfrf.simulate(rig, ms, n_periods=2)
        bla = nlfrf.identify(record)
        nominal = robust.fit_nominal(bla, n_poles=2)
        model = robust.uncertainty(bla, nominal)
        K, G = control.tf([1.0], [1, 0.1]), nominal.G
        report = robust.check(model, K)
        several = nlfrf.multisine(
            "random-odd", fs=256, n_samples=256, f_min=2, f_max=100, n_inputs=2, rng=1
        )
        u = np.repeat(several.u[:, :, None], 2, axis=2)
        multi = nlfrf.Record(u=u, y=u[::-1] + 0.1 * u**3, fs=256, lines=several.lines)
        frm = nlfrf.identify(multi)
    sound = {
        "K": K,
        "rng": 1,
        "path": "out.npz",
        "record": record,
        "bla": bla,
        "model": model,
        "nominal": nominal,
    }
    sound |= {
        "plant": model,
        "rig": rig,
        "fs": 512.0,
        "r": np.zeros(10),
        "dt": 1 / 512,
        "rms": 1.0,
        "ms": ms,
        "G": G,
    }
    sound |= {
        "G1": G,
        "G2": G,
        "w_P": robust.performance_weight(1.0),
        "structure": "PI",
        "order": 1,
        "n_poles": 2,
    }
    sound |= {
        "report": report,
        "controllers": [K],
        "u": record.u.ravel(),
        "y": record.y.ravel(),
        "f_min": 2,
    }
    sound |= {
        "f_max": 100,
        "n_samples": 512,
        "omega": np.array([1.0, 2.0]),
        "system": G,
        "level": 1.0,
        "fit": nominal,
    }
    sound |= {
        "force": np.zeros(10),
        "blas": [bla] * 3,
        "omega_B": 1.0,
        "omega_c": 1.0,
        "radius": np.array([1.0, 2.0]),
    }
    sound |= {
        "N": np.zeros((1, 1, 3)),
        "blocks": [(1, 1)],
        "N_ss": G,
        "systems": [G],
        "plants": [robust.frd(bla)],
        "L": G,
        "P": G,
        "n_meas": 1,
    }
    sound |= {
        "n_con": 1,
        "frm": frm,
        "friction": robust.friction.Bounded(1.0),
        "mass": 1.0,
        "stiffness": 1e4,
        "K0": 1e5,
    }
    sound |= {"machine": robust.friction_plant(1.0, 1e4, 10.0), "records": [record], "delay": 0.01}
    sound |= {
        "v": np.zeros(10),
        "omega_bc": 10.0,
        "content": model,
        "gain": 2.0,
        "phase": 30.0,
        "kp": 1.0,
        "Fs": 1.0,
    }
    sound |= {
        "signals": robust.analysis.LoopSignals(
            disturbance=robust.analysis.NoiseSignal(0.1, omega_max=10.0)
        )
    }
    sound |= {
        "K_inner": K,
        "K_outer": K,
        "opinion": nlfrf.second_opinion(record),
        "f": np.array([1.0, 2.0]),
    }
    axis = nlfrf.servo_axis("linear motor")
    screened = screen_streams([record.u.ravel()], ["u"], n_inputs=1, fs=1024.0, period=1024.0)
    sound |= {
        "thing": model,
        "screened": screened,
        "labels": ["low", "middle", "high"],
        "preset": "belt",
        "errors": np.ones(3),
        "rate": 1.0,
        "axis": replace(axis, drive=replace(axis.drive, fs=1024, kp=30.0, kv=20.0)),
    }
    return sound, (object(), None, [object()], "nothing.here", several, multi, frm, nominal, record)


def required(function):
    parameters = inspect.signature(function).parameters.values()
    return [
        p.name
        for p in parameters
        if p.default is p.empty and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
    ]


def functions(chosen):
    """Every public function whose required parameters are of a kind."""
    every = [(module, name, getattr(module, name)) for module in MODULES for name in module.__all__]
    return [
        pytest.param(function, id=f"{module.__name__}.{name}")
        for module, name, function in every
        if callable(function)
        and not inspect.isclass(function)
        and name not in SLOW
        and chosen(required(function))
    ]


def said(function, arguments):
    """What it says of them: nothing where it takes them, the refusal, or the fault."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            function(**arguments)
        except (ValueError, FileNotFoundError) as refusal:
            return str(refusal)
        except Exception as fault:  # whatever it is, it is one
            return f"FAULT {type(fault).__name__}: {fault}"
    return ""


@pytest.mark.parametrize("function", functions(bool))
def test_what_is_made_for_something_else_is_refused(function, things, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sound, others = things
    names = required(function)
    rest = {name: sound.get(name, 1.0) for name in names[1:]}
    for other in others:
        told = said(function, {names[0]: other, **rest})
        assert not told.startswith("FAULT"), f"{names[0]}={other!r:.60}: {told}"
        assert "\n" not in told


@pytest.mark.parametrize("function", functions(RESULTS.isdisjoint))
def test_any_parameter_that_is_nothing_known_is_refused(function, things, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sound, _ = things
    names = required(function)
    for parameter in inspect.signature(function).parameters:
        if parameter in FLAGS | IGNORED | {"ax", "label"}:
            continue
        told = said(function, {**{name: sound[name] for name in names}, parameter: object()})
        assert told, f"{parameter}: an object was taken for one"
        assert not told.startswith("FAULT"), f"{parameter}: {told}"
