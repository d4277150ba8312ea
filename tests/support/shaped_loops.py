"""Random loops for the shaping page: models of every form, sampled or not, controllers as it names
them.
"""

import json
import re

import control
import numpy as np

import robust
from tests.support.forms import UNSCALED
from tests.support.responses import response


def content_of(path):
    """What a page holds for its script."""
    page = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="content">(.*)</script>', page)[1])


def written_content(folder, model, **options):
    """What the page of a model holds for its script."""
    robust.shaping.write_shaping_page(folder / "content.html", model, **options)
    return content_of(folder / "content.html")


def shaped(state, K, dt):
    """The controller at the start, times gain and elements of a state of the page, as
    `robust.shaping` has them.
    """
    for element in state["elements"]:
        omega, kind = 2 * np.pi * element["f"], element["kind"]
        numbers = {key: element[key] for key in element if key not in ("kind", "f")}
        if kind == "integrator":
            part = robust.shaping.lag(omega, np.inf, dt=dt)
        elif kind == "lead":
            part = robust.shaping.lead(omega, np.radians(numbers["phase"]), dt=dt)
        elif kind == "notch":
            part = robust.shaping.notch(omega, **numbers, dt=dt)
        else:
            part = robust.shaping.low_pass(omega, **numbers, dt=dt)
        K = part * K
    return control.ss([], [], [], [[state["gain"]]], dt) * K


def random_loop(seed):
    """(model, w_P, K to begin with or None, dt, delay, state of the page)."""
    rng = np.random.default_rng(seed)
    f_c = 10 ** rng.uniform(-0.3, 0.7)
    omega_c = 2 * np.pi * f_c
    dt = float(rng.choice([0, 0, 1 / (omega_c * rng.uniform(3, 20))]))
    delay = dt * rng.uniform(0, 2.5) if dt else rng.uniform(0, 0.3) / omega_c
    model = random_model(rng, omega_c)
    w_P = robust.performance_weight(omega_c * rng.uniform(0.05, 0.5), M_S=2.5, A=1e-2)
    begin = robust.shaping.lead(omega_c, 0.5, dt=dt) if rng.random() < 0.3 else None
    state = {
        "gain": tidy(10 ** rng.uniform(-0.7, 0.3)),
        "elements": random_elements(rng, f_c, 0.4 / dt if dt else np.inf),
    }
    return model, w_P, begin, dt, float(rng.choice([0, delay])), state


def random_model(rng, omega_c):
    """A plant of gain one at omega_c, with modes, integrators and unstable poles, in a set of any
    form.
    """
    poles = []
    for size in 2 * np.pi * 10 ** rng.uniform(-0.5, 1.5, rng.integers(1, 6)):
        zeta = 10 ** rng.uniform(-2, 0)
        pair = size * (-zeta + 1j * np.sqrt(1 - zeta**2))
        poles += [pair, pair.conjugate()] if rng.random() < 0.5 else [-size]
    poles += [0.0] * (rng.random() < 0.25) + [10 ** rng.uniform(-0.5, 1.0)] * (rng.random() < 0.2)
    zeros = 2 * np.pi * 10 ** rng.uniform(-0.5, 2, rng.integers(0, max(1, len(poles) - 1)))
    G = control.ss(control.zpk(np.where(rng.random(zeros.size) < 0.8, -zeros, zeros), poles, 1.0))
    G = control.StateSpace(G.A, G.B, G.C / abs(G(1j * omega_c)), G.D / abs(G(1j * omega_c)), 0)
    form = UNSCALED[rng.integers(len(UNSCALED))]  # the page refuses forms that need a scaling
    omega = np.geomspace(omega_c / 30, omega_c * 30, 60)
    lift = control.tf(
        [1 / omega_c, 10 ** rng.uniform(-1.5, -0.3)], [1 / (omega_c * rng.uniform(2, 6)), 1]
    )
    w = control.ss(lift) if rng.random() < 0.8 else control.ss([], [], [], [[0.3]])
    size = np.median(np.abs(response(G, omega)))
    unit = {"additive": size, "inverse-additive": 1 / size}.get(form, 1.0)
    w = control.StateSpace(w.A, w.B, w.C * unit, w.D * unit, 0)
    return robust.UncertaintyModel(G, w, form, omega, 0.9 * np.abs(response(w, omega)))


def random_elements(rng, f_c, highest):
    """Elements as the page names them."""
    place = {
        "integrator": (-1.5, -0.2),
        "lead": (-0.3, 0.5),
        "notch": (0.0, 1.0),
        "roll-off": (0.3, 1.2),
    }
    numbers = {
        "integrator": {},
        "lead": {"phase": tidy(rng.uniform(10, 70))},
        "notch": {"depth": tidy(rng.uniform(0.05, 2)), "width": tidy(rng.uniform(0.1, 1))},
        "roll-off": {"order": int(rng.integers(1, 3)), "zeta": tidy(rng.uniform(0.3, 1))},
    }
    return [
        {"kind": kind, "f": tidy(min(highest, f_c * 10 ** rng.uniform(*place[kind])))}
        | numbers[kind]
        for kind in place
        if rng.random() < 0.5
    ]


def tidy(x):
    """Four digits, as the page has them."""
    return float(f"{x:.4g}")
