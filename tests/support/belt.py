"""A belt stage, simulated, and the file that its logger writes: semicolons and decimal commas."""

from functools import cache

import numpy as np

import nlfrf

FS, PERIOD = 1000.0, 4000
NAMES = ("Zeit [s]", "Kraft [N]", "Position [mm]")


@cache
def run(n_periods=3):
    """Force [N] and position of the motor [mm] of two masses on a belt, the second with Coulomb
    friction.
    """
    ms = nlfrf.multisine(
        "random-odd", fs=FS, n_samples=PERIOD, f_min=0.5, f_max=100, rms=1.0, rng=3
    )
    force = np.tile(ms.u[0], n_periods + 1)
    k, c, step = 8e3, 6.0, 1 / FS / 4
    x1 = v1 = x2 = v2 = 0.0
    position = np.empty(force.size)
    for i, u in enumerate(force.tolist()):
        position[i] = x1
        for _ in range(4):
            belt = k * (x1 - x2) + c * (v1 - v2)
            friction = 0.2 * v2 / (abs(v2) + 1e-3)
            v1 += step * (u - belt - 3 * v1 - 1e3 * x1) / 0.5
            v2 += step * (belt - 4 * v2 - friction)
            x1, x2 = x1 + step * v1, x2 + step * v2
    position = 1e3 * position[PERIOD:]
    noise = 1e-3 * position.std() * np.random.default_rng(1).standard_normal(position.size)
    return force[PERIOD:], position + noise


def write_log(path, lost=(), names=NAMES, n_periods=3, time=True):
    """What the logger wrote, without some rows."""
    u, y = run(n_periods)
    rows = np.delete(np.arange(u.size), list(lost))
    columns = [*([rows / FS] if time else []), u[rows], y[rows]]
    lines = [";".join(names if time else names[1:])]
    lines += [
        ";".join(f"{x:.6f}".replace(".", ",") for x in row) for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
