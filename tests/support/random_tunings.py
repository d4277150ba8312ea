"""Random structures, plants and limits for `tune`, by a seed; and a dense look at what it
returns.
"""

import control
import numpy as np

import robust
from robust import tuning
from tests.support.responses import response_by_channel

STRUCTURES = ("pid", "cascade", "lead", "state space", "matrix", "feedforward")


def random_plant(rng, dt, *, outputs=1):
    """A plant with lags or an integrator and a mode or two, of speed about one, from force to
    `outputs` signals.
    """
    p = rng.uniform(0.2, 2.0)
    G = control.tf([1.0], [1.0, 0.0 if rng.random() < 0.2 else p]) * rng.choice([0.5, 1.0, 3.0])
    for _ in range(rng.integers(0, 3)):
        w, zeta = 10 ** rng.uniform(-0.3, 1.2), 10 ** rng.uniform(-2, -0.3)
        G = G * control.tf([w * w], [1, 2 * zeta * w, w * w])
    G = control.ss(G)
    C = np.vstack([G.C, rng.normal(size=(outputs - 1, G.nstates))])
    G = control.StateSpace(G.A, G.B, C, np.zeros((outputs, 1)), 0)
    return robust.sampled(G, dt) if dt and rng.random() < 0.5 else G


def random_model(rng, dt):
    """A nominal with a set around it, in any form that goes with its clock."""
    G = random_plant(rng, dt)
    clock = G.dt or 0
    forms = ["multiplicative"] + (["additive", "inverse-multiplicative"] if clock or not dt else [])
    omega = np.geomspace(0.01, min(50.0, 0.9 * np.pi / dt if dt else 50.0), 80)
    size = 10 ** rng.uniform(-2, -0.7)
    weight = control.StateSpace([], [], [], [[size]], clock)
    return robust.UncertaintyModel(
        G, weight, forms[rng.integers(len(forms))], omega, np.full(80, size * 0.9)
    )


def matrix_set(form, dt):
    """Three lags coupled to two inputs and outputs, with a set of this form of gain 0.05 to 0.3
    around them.
    """
    B, C = [[1.0, 0.3], [0.2, 2.0], [0.5, -0.2]], [[1.0, 0.0, 0.4], [0.3, 1.0, 0.0]]
    G = control.ss(-np.diag([1.0, 2.0, 0.5]), B, C, np.zeros((2, 2)))
    omega = np.geomspace(0.05, 20, 60)
    sizes = [0.3, 0.45, 0.6, 0.75] if form == "elements" else [0.8, 0.6, 0.3, 0.45]
    weights = [control.ss(control.tf([size, 0.2 * size], [1, 4.0])) for size in sizes]
    if dt:
        G = robust.sampled(G, dt)
        weights = [control.ss([], [], [], [[0.3 * size]], dt) for size in sizes]
    n = 0 if form == "elements" else 2
    radius = 0.9 * np.array(
        [np.abs(w(np.exp(1j * omega * dt) if dt else 1j * omega)) for w in weights]
    )
    return robust.UncertaintyModel(
        nominal=G,
        form=form,
        left=tuple(weights[:n]),
        right=tuple(weights[n:]),
        omega=omega,
        radius=radius,
    )


def random_blocks(rng, structure):
    """(parts, blocks, signals of the plant) of a structure."""
    error = control.summing_junction(["r", "-y"], "e")
    force = control.summing_junction(["u", "d"], "f")
    k = 10 ** rng.uniform(-1.5, 0)
    if structure == "pid":
        return (
            [error, force],
            {
                "K": tuning.Pid(
                    kp=k, ki=k * 0.3, kd=k * 0.1, filter_time=0.1, reads="e", drives="u_c"
                ),
                "notch": tuning.Notch(omega=5.0, reads="u_c", drives="u"),
            },
            "y",
        )
    if structure == "cascade":
        inner = control.summing_junction(["v_ref", "-v"], "e_v")
        return (
            [error, inner, force],
            {
                "K_x": tuning.Pid(kp=k, reads="e", drives="v_ref"),
                "K_v": tuning.Pid(kp=k, ki=k * 0.2, reads="e_v", drives="u"),
            },
            ["y", "v"],
        )
    if structure == "lead":
        return (
            [error, force],
            {
                "K": tuning.Gain(K=k, reads="e", drives="e_1"),
                "lead": tuning.Lead(omega=3.0, reads="e_1", drives="e_2"),
                "filter": tuning.LowPass(omega=20.0, reads="e_2", drives="u"),
            },
            "y",
        )
    if structure == "state space":
        return [error, force], {"K": tuning.StateSpace(n_states=2, reads="e", drives="u")}, "y"
    if structure == "matrix":
        return (
            [error, force],
            {"K": tuning.Gain(K=[[k, -k]], reads=["e", "v"], drives="u")},
            ["y", "v"],
        )
    return (
        [error, control.summing_junction(["u_b", "u_f", "d"], "f")],
        {
            "K": tuning.Pid(kp=k, ki=k, reads="e", drives="u_b"),
            "F": tuning.Pid(kp=k, kd=k * 0.1, filter_time=0.2, reads="r", drives="u_f"),
        },
        "y",
    )


def random_limits(rng, structure, *, worst):
    """(hard, soft) on channels of the loop."""
    hard = [tuning.Limit("d", "f", rng.uniform(1.3, 2.5), worst=bool(worst and rng.random() < 0.6))]
    if rng.random() < 0.6:
        hard.append(
            tuning.Limit("r", "y", rng.uniform(1.2, 2.0), worst=bool(worst and rng.random() < 0.4))
        )
    if rng.random() < 0.4:
        shape = [control.tf([1, 1], [0.1, 10]), lambda omega: 1 / (1 + omega)][rng.integers(2)]
        hard.append(
            tuning.Limit(
                "r", "f" if structure != "matrix" else "u", 10 ** rng.uniform(0, 2), weight=shape
            )
        )
    soft = [
        tuning.Limit(
            "d", "y", 1.0, band=None if rng.random() < 0.4 else (0.0, rng.uniform(0.1, 2.0))
        )
    ]
    if rng.random() < 0.4:
        soft.append(tuning.Limit(["r", "d"], ["e", "f"], 2.0))
    return hard, soft


def random_tuning(rng, **options):
    """Arguments of `tune`: a random structure with plants and limits."""
    dt = 0.0 if rng.random() < 0.5 else 10 ** rng.uniform(-2.5, -1)
    structure = STRUCTURES[rng.integers(len(STRUCTURES))]
    parts, blocks, outputs = random_blocks(rng, structure)
    n_outputs = 1 if isinstance(outputs, str) else len(outputs)
    worst = n_outputs == 1 and rng.random() < 0.4
    models = [
        random_model(rng, dt) if worst else random_plant(rng, dt, outputs=n_outputs)
        for _ in range(rng.integers(1, 3))
    ]
    hard, soft = random_limits(rng, structure, worst=worst)
    parts = [
        control.ss([], [], [], part.D, dt, inputs=part.input_labels, outputs=part.output_labels)
        for part in parts
    ]
    return {
        "system": parts,
        "plant": tuning.Plants(models, inputs="f", outputs=outputs),
        "blocks": blocks,
        "hard": hard,
        "soft": soft,
        "dt": dt,
        "delay": float(dt * rng.integers(0, 3)) if dt else float(rng.choice([0.0, 0.05])),
        "rng": int(rng.integers(1000)),
        **options,
    }


def true_loop(design, plant, inputs, outputs):
    """The loop of one plant by python-control's own interconnection, from the controllers as
    systems.
    """
    parts = [*design.system]
    for block in design.blocks.values():
        parts.append(block.system(design.dt))
    model = design.plant.models[plant]
    G = control.ss(getattr(model, "nominal", model))
    if design.dt and not G.dt:
        G = robust.sampled(G, design.dt, design.delay)
    elif design.delay and design.dt:
        z = control.tf([1], [1, *[0] * round(design.delay / design.dt)], design.dt)
        G = control.ss(G) * control.ss(z)
    elif design.delay:
        num, den = control.pade(design.delay, 8)
        G = G * control.ss(control.tf(num, den))
    names = {"inputs": list(design.plant.inputs), "outputs": list(design.plant.outputs)}
    parts.append(control.ss(G.A, G.B, G.C, G.D, design.dt, remove_useless_states=False, **names))
    return joined_as_control(parts, list(inputs), list(outputs), design.dt)


def joined_as_control(parts, inputs, outputs, dt):
    """Named systems joined by a big matrix equation, written apart from what `tune` does."""
    n_in = [label for part in parts for label in part.input_labels]
    n_out = [label for part in parts for label in part.output_labels]
    G = control.append(*parts)
    A, B, C, D = G.A, G.B, G.C, G.D
    S = np.array([[a == b for b in n_out] for a in n_in], float)
    E = np.array([[a == b for b in inputs] for a in n_in], float)
    R = np.array([[a == b for b in n_out] for a in outputs], float)
    X = np.linalg.inv(np.eye(len(n_out)) - D @ S)  # outputs = X (C x + D E w)
    return control.ss(
        A + B @ S @ X @ C,
        B @ (E + S @ X @ D @ E),
        R @ X @ C,
        R @ X @ D @ E,
        dt,
        remove_useless_states=False,
    )


def dense_frequencies(poles, dt, band):
    """(W,) frequencies [rad/s] around every pole and over all decades, in a band, its ends among
    them.
    """
    s = np.log(np.where(np.abs(poles) < 1e-12, 1e-12, poles).astype(complex)) / dt if dt else poles
    size = np.abs(s)[np.abs(s) > 1e-9]
    top = np.pi / dt if dt else np.inf
    wide = np.geomspace(size.min() / 100, min(size.max() * 100, top), 3000)
    near = s.imag[:, None] + np.abs(s.real)[:, None] * np.linspace(-4, 4, 61)
    low, high = band or (0.0, np.inf)
    omega = np.concatenate([wide, near.ravel(), [0.0, low, high, top]])
    return np.unique(omega[(omega >= low) & (omega <= min(high, top)) & np.isfinite(omega)])


def violation(design):
    """What is wrong with a design: "unstable", "violated", a ratio that is too small, or "" where
    nothing is.
    """
    if not design.limits:
        return ""
    for one in design.limits:
        loop = true_loop(design, one.plant, one.limit.inputs, one.limit.outputs)
        poles = loop.poles()
        outside = np.abs(poles) > 1 + 1e-9 if design.dt else poles.real > 1e-9
        if np.any(outside):
            return "unstable" if design.met else ""
        if one.limit.worst:
            continue
        omega = dense_frequencies(poles, design.dt, one.limit.band)
        H = response_by_channel(loop, omega)
        gains = np.linalg.svd(np.moveaxis(H, 2, 0), compute_uv=False)[:, 0] * one.limit.factor(
            omega
        )
        if gains.max() > one.ratio * (1 + 1e-6) + 1e-12:
            return f"a ratio of {gains.max():.8g}, said to be {one.ratio:.8g}"
        if design.met and one.hard and gains.max() > 1 + 1e-9:
            return "violated"
    return ""


def worst_distance(design):
    """How far the largest |S| at worst, as said, is from that of `check` on the controller; 0
    without such a limit.
    """
    away = 0.0
    for one in design.limits:
        if (
            one.limit.worst
            and one.limit.inputs == ("d",)
            and one.limit.outputs == ("f",)
            and np.isfinite(one.ratio)
        ):
            model, K = design.plant.models[one.plant], design.controller("y", "f")
            w_P = 1 / (one.limit.bound * one.ratio)
            report = robust.check(model, K, w_P=w_P, delay=design.delay, certify=False)
            if report.nominally_stable:
                away = max(away, abs(float(np.max(report.curves.rp)) - 1))
    return away
