"""The model as a script for python-control: it runs without this package, and its numbers are those
of the model.
"""

import json
import subprocess
import sys

import control
import numpy as np
import pytest

from robust import UncertaintyModel
from robust.io import export_python
from tests.support.forms import DEVIATION
from tests.support.responses import response, response_by_channel

OMEGA = np.geomspace(0.1, 20, 30)
SINGLE = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive", "coprime")
SEVERAL = (
    "elements",
    "additive",
    "input",
    "output",
    "inverse-additive",
    "inverse-input",
    "inverse-output",
)
K_ONE, K_TWO = 0.7, [[0.5, 0.1], [-0.2, 0.4]]

#: Runs scripts where neither package can be imported, and prints their numbers.
RUNNER = """
import json, runpy, sys
sys.modules["nlfrf"] = sys.modules["robust"] = None
import numpy as np
found = {}
for path, omega, K, Delta in json.loads(sys.argv[1]):
    s = runpy.run_path(path)
    z = np.exp(1j * np.array(omega) * s["DT"]) if s["DT"] else 1j * np.array(omega)
    drawn = [s["plant"](np.array(Delta))] + [s["plant"](s["draw"](np.random.default_rng(k))) for k in range(3)]
    H = np.array([[np.atleast_2d(one(point)) for point in z] for one in drawn])
    found[path] = {"re": H.real.tolist(), "im": H.imag.tolist(), "rs": s["rs"](K, omega).tolist()}
    found[path]["stable"] = s["try_loop"](K, 20)
print(json.dumps(found))
"""
CASES = [
    *((form, False, dt) for form in SINGLE for dt in (0.0, 0.05)),
    *((form, True, dt) for form in SEVERAL for dt in (0.0, 0.05)),
]


def model_of(form, *, dt, several):
    """Return a set of one channel or of two by two."""
    if several:
        G = control.ss(
            [[-1.0, 0.2], [0.0, -2.0]], np.eye(2), [[1.0, 0.3], [0.1, 1.0]], 0.1 * np.eye(2)
        )
    else:
        G = control.ss(control.tf([1.0, 3.0], [1, 0.4, 4.0]))
    w = control.ss(control.tf([0.1, 0.15], [1, 3.0]))
    if dt:
        G, w = (control.sample_system(system, dt, "tustin") for system in (G, w))
    omega = OMEGA
    if not several:
        radius = 0.99 * np.abs(np.squeeze(w(np.exp(1j * omega * dt) if dt else 1j * omega)))
        return UncertaintyModel(G, w, form, omega, radius)
    sides = (
        {"left": (), "right": (w,) * 4} if form == "elements" else {"left": (w, w), "right": (w, w)}
    )
    return UncertaintyModel(nominal=G, form=form, omega=omega, **sides)


def delta_of(form, several):
    """Return a perturbation of gain one at most."""
    if form == "elements":
        return np.diag([0.9, -0.8, 0.7, 1.0])
    if several:
        return np.array([[0.6, 0.8], [-0.8, 0.6]])
    return np.array([[0.6], [-0.8]]) if form == "coprime" else np.array([[-0.9]])


def fragile():
    """Return a set whose loop with K = 40 has a measure above one."""
    G = control.ss(control.tf([1.0], [1, 1, 0.0]))
    return UncertaintyModel(G, 0.9, "multiplicative", OMEGA, np.full(OMEGA.size, 0.9))


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Path of each script -> its numbers, all from one process."""
    folder = tmp_path_factory.mktemp("scripts")
    jobs = []
    for k, (form, several, dt) in enumerate(CASES):
        export_python(model_of(form, dt=dt, several=several), folder / f"{k}.py")
        K = K_TWO if several else [[K_ONE]]
        jobs.append([str(folder / f"{k}.py"), OMEGA.tolist(), K, delta_of(form, several).tolist()])
    export_python(fragile(), folder / "fragile.py")
    jobs.append([str(folder / "fragile.py"), OMEGA.tolist(), [[40.0]], [[0.5]]])
    words = [sys.executable, "-W", "error", "-c", RUNNER, json.dumps(jobs)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {
        path.removeprefix(f"{folder}/"): numbers
        for path, numbers in json.loads(done.stdout).items()
    }


@pytest.mark.parametrize("case", range(len(CASES)), ids=[f"{f} {s} {dt}" for f, s, dt in CASES])
def test_the_script_has_the_numbers_of_the_model(case, found):
    form, several, dt = CASES[case]
    model = model_of(form, dt=dt, several=several)
    numbers = found[f"{case}.py"]
    Delta = delta_of(form, several)
    plants = np.array(numbers["re"]) + 1j * np.array(numbers["im"])
    nominal = np.moveaxis(response_by_channel(model.nominal, OMEGA), 2, 0)
    if form != "coprime":  # its Delta there is one number of another place
        wanted = response_by_channel(
            model.perturbed(Delta if several else float(Delta[0, 0])), OMEGA
        )
        assert np.allclose(plants[0], np.moveaxis(wanted, 2, 0), rtol=1e-9, atol=1e-12)
    for G in plants:
        away = model.normalized_distance(
            OMEGA, *((G, nominal) if several else (G[:, 0, 0], nominal[:, 0, 0]))
        )
        assert 0.3 < away.max() <= 1 + 1e-6
    assert numbers["stable"] == 20
    if several:
        M = np.moveaxis(response_by_channel(model.loop(np.array(K_TWO)).loop, OMEGA), 2, 0)
        assert np.allclose(numbers["rs"], np.linalg.norm(M, 2, axis=(1, 2)), rtol=1e-8)
    else:
        W, w = (response(system, OMEGA) for system in (model.shaping, model.weight))
        G = W * response(model.nominal, OMEGA)
        distance = DEVIATION[form](-W / K_ONE, G)  # of the plant that breaks the loop
        assert np.allclose(numbers["rs"], np.abs(w) / distance, rtol=1e-8)


def test_it_finds_the_plant_that_is_unstable(found):
    """A loop whose measure is above one: some of the random plants break it."""
    assert max(found["fragile.py"]["rs"]) > 1
    assert found["fragile.py"]["stable"] < 20


def test_its_own_main_runs(tmp_path):
    export_python(model_of("multiplicative", dt=0.0, several=False), tmp_path / "plant.py")
    done = subprocess.run(
        [sys.executable, str(tmp_path / "plant.py")], capture_output=True, text=True, check=True
    )
    assert "100 of 100 closed loops are stable" in done.stdout


def test_refusals(tmp_path):
    model = model_of("additive", dt=0.0, several=False)
    with pytest.raises(ValueError, match=r"path must end in \.py, got"):
        export_python(model, tmp_path / "plant.txt")
    frf = control.frd(np.ones(30, complex), OMEGA)
    measured = UncertaintyModel(frf, 0.2, "additive", OMEGA, np.full(30, 0.2))
    with pytest.raises(
        ValueError,
        match="model must be an UncertaintyModel with a parametric nominal to be written as a",
    ):
        export_python(measured, tmp_path / "plant.py")
    assert not list(tmp_path.iterdir())
