"""Bounds that are printed, against a search by another method: how many it exceeds, and how far
above it they lie.

python -m benchmarks.bounds                # 500 of each: families, FRFs beside systems, sets of two channels
python -m benchmarks.bounds 40 --kind sets # some

The search evaluates responses on grids that are dense around every pole and zero, and far beyond
all of them.
"""

from __future__ import annotations

import argparse
import time
import warnings

import control
import numpy as np

import robust
from robust.lti.lti import poles, response_by_channel, zeros

FORMS = ("additive", "input", "output", "inverse-input", "inverse-output")


def mixed_channels(
    rng: np.random.Generator, w: np.ndarray, z: np.ndarray, mix: np.ndarray
) -> control.StateSpace:
    """diag(g1, g2) mix, g = (s^2 + 2 z w s + w^2)/((s + 1)(s + 8)^2): light zeros, in random
    coordinates.
    """
    den = np.polymul([1, 1], np.polymul([1, 8], [1, 8]))
    G = control.append(
        *(control.ss(control.tf([1, 2 * b * a, a * a], den)) for a, b in zip(w, z, strict=True))
    )
    T = np.linalg.qr(rng.normal(size=G.A.shape))[0]
    return control.ss(T.T @ G.A @ T, T.T @ G.B @ mix, G.C @ T, G.D)


def draw_family(rng: np.random.Generator) -> tuple[list[control.StateSpace], control.StateSpace]:
    """Draw members around a nominal: other gains, light zeros that move by a part of their width to
    ten times it.
    """
    w, z = rng.uniform(0.5, 6, 2), 10 ** rng.uniform(-4, -0.3, 2)
    mix = np.eye(2) + rng.uniform(-0.4, 0.4, (2, 2))
    members = []
    for _ in range(rng.integers(2, 5)):
        moved = 1 + z * 10 ** rng.uniform(-2, 1, 2) * rng.choice([-1, 1], 2)
        gains = 1 + rng.uniform(-0.2, 0.2, 2)
        members.append(
            mixed_channels(
                rng, w * np.clip(moved, 0.7, 1.4), z * rng.uniform(0.8, 1.25, 2), mix * gains
            )
        )
    return members, mixed_channels(rng, w, z, mix)


def dense(systems: list[control.StateSpace]) -> np.ndarray:
    """Return frequencies [rad/s] around every pole and zero, and far beyond all of them."""
    s = np.concatenate([f(system) for system in systems for f in (poles, zeros) if system.nstates])
    s = s[np.isfinite(s) & (np.abs(s) > 1e-6) & (np.abs(s) < 1e6)]
    near = np.abs(s.imag)[:, None] + np.abs(s.real)[:, None] * np.linspace(-5, 5, 101)
    omega = np.concatenate([near.ravel(), np.geomspace(1e-6, 1e6, 2000)])
    return np.unique(omega[omega > 0])


def on_lines(system: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return (W, n_y, n_u) response."""
    return np.moveaxis(response_by_channel(system, omega), 2, 0)


def try_family(rng: np.random.Generator) -> tuple[float, float] | None:
    """Return the largest Delta that the search finds (at most 1 is claimed) and the bound 1; None
    where refused.
    """
    members, nominal = draw_family(rng)
    form, weights = str(rng.choice(FORMS)), str(rng.choice(["diagonal", "diagonal", "full"]))
    try:
        model = robust.uncertainty_of_plants(
            members, nominal, form=form, weights=weights, perturbation="LTI"
        )
    except ValueError as error:
        print(f"refused, {form}, {weights}: {error}", flush=True)
        return None
    found = 0.0
    for member in members:
        omega = dense([member, nominal, *model.weights])
        found = max(
            found,
            model.normalized_distance(
                omega, on_lines(member, omega), on_lines(nominal, omega)
            ).max(),
        )
    return found, 1.0 + 1e-6


def try_mixed(rng: np.random.Generator) -> tuple[float, float] | None:
    """Return the same of one channel, of an FRF and a system with a light mode or zero between its
    lines.
    """
    lag, w = control.tf([1], [1, 1]), np.geomspace(0.1, 100, int(rng.integers(20, 60)))
    at = 10 ** rng.uniform(-0.5, 1.5)
    zeta = 10 ** rng.uniform(-4, -0.5)
    size = 10 ** rng.uniform(-3, -1)
    member = lag * (1 + control.tf([size * at, 0], [1, 2 * zeta * at, at**2]))
    form = str(rng.choice(["multiplicative", "additive", "inverse-multiplicative"]))
    frf = control.frd(rng.uniform(0.8, 1.2) * lag(1j * w), w)
    try:
        model = robust.uncertainty_of_plants([frf, member], lag, form=form, perturbation="LTI")
    except ValueError as error:
        print(f"refused, {form}, damping {zeta:.2g}: {error}", flush=True)
        return None
    omega = dense([control.ss(member), *model.weights])
    far = model.normalized_distance(omega, member(1j * omega), lag(1j * omega))
    return max(far.max(), model.distance(frf).max()), 1.0 + 1e-6


def draw_set(rng: np.random.Generator) -> tuple[robust.UncertaintyModel, control.StateSpace]:
    """Draw a set of two channels with a light mode, on 100 to 5000 lines, and a controller that
    leaves it light.
    """
    zeta, w, n = 10 ** rng.uniform(-4, -1), 10 ** rng.uniform(-1, 2), int(10 ** rng.uniform(2, 3.7))
    mode = control.ss(control.tf([w**2], [1, 2 * zeta * w, w**2]))
    mix = np.eye(2) + rng.uniform(-0.2, 0.2, (2, 2))
    G = control.append(mode, control.ss(control.tf([1], [1, 1])))
    G = control.ss(G.A, G.B @ mix, G.C, G.D)
    size = 10 ** rng.uniform(-3, -1)
    form = str(rng.choice(["input", "output", "elements", "additive"]))
    left = () if form == "elements" else (size, size)
    right = (size,) * 4 if form == "elements" else (1, 1)
    omega = np.geomspace(1e-2, 1e3, n)
    model = robust.UncertaintyModel(
        G, form=form, left=left, right=right, omega=omega, perturbation="LTI"
    )
    return model, control.ss(
        [], [], [], np.diag([-2 * zeta * rng.uniform(0, 0.9), rng.uniform(0.1, 2)]) @ mix.T
    )


def try_set(rng: np.random.Generator) -> tuple[float, float] | None:
    """Return the largest |S| that plants of a set reach and the bound of `check`; None where one is
    unstable.
    """
    model, K = draw_set(rng)
    report = robust.check(model, K)
    if not np.isfinite(report.margins.S_worst) or report.margins.rs < 1:
        return None
    found, none = 0.0, np.zeros(model.structure[0] if model.form != "elements" else (4, 4))
    for plant in (model.perturbed(none), robust.worst_case(model, K).plant):
        omega = dense([plant, (plant * K).feedback(np.eye(2))])
        S = np.linalg.inv(np.eye(2) + on_lines(plant, omega) @ K.D)
        found = max(found, np.linalg.norm(S, 2, axis=(1, 2)).max())
    return found, report.margins.S_worst


KINDS = {"families": try_family, "mixed": try_mixed, "sets": try_set}


def print_count(kind: str, rows: list[tuple[float, float] | None], seconds: float) -> None:
    """Print how many bounds were exceeded so far, and how far above the search they lie."""
    known = np.array([row for row in rows if row is not None]).reshape(-1, 2)
    ratio = known[:, 1] / known[:, 0] if len(known) else np.array([np.nan])
    print(
        f"{kind}: {len(known)} of {len(rows)} with a bound, "
        f"{int(np.sum(ratio < 1 - 1e-6))} exceeded; bound over what was found: "
        f"median {np.median(ratio):.4g}, worst {ratio.max():.4g}; {seconds:.2g} s each",
        flush=True,
    )


def main() -> None:
    """Draw, count and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("n", nargs="?", type=int, default=500)
    options.add_argument("--kind", choices=KINDS, nargs="*", default=list(KINDS))
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    warnings.simplefilter("ignore")
    for kind in given.kind:
        rows, start = [], time.process_time()
        for k in range(given.n):
            rows.append(KINDS[kind](np.random.default_rng([given.seed, k])))
            if rows[-1] is not None and rows[-1][0] > rows[-1][1] * (1 + 1e-6):
                print(
                    f"{kind}, draw {k}: {rows[-1][0]:.6g} was found above the bound"
                    f" {rows[-1][1]:.6g}",
                    flush=True,
                )
            if (k + 1) % 25 == 0 or k + 1 == given.n:
                print_count(kind, rows, (time.process_time() - start) / (k + 1))


if __name__ == "__main__":
    main()
