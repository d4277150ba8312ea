"""Standard deviations of the numbers of a fitted machine.

The residual contains noise and model errors. Each standard deviation is the larger of two: one from
the noise, and one from a jackknife over blocks of neighbouring lines, whose model errors are
correlated.
"""

from __future__ import annotations

import numpy as np

from robust.friction.reading.balance import (
    LOAD,
    Candidate,
    Motion,
    as_real,
    pack,
    residual_of,
    slopes_of,
    unpack,
)

_BLOCK = 8  # lines of a block whose residuals may be correlated
#: Relative error of every force along a motion that is known at samples only. Five records of the
#: linear motor without encoder and with small steps left 0.002 to 0.01 % of the force. They were
#: off by 1.2 % of the damping, which is 0.01 % of the Coulomb friction over the velocity, by 0.02 %
#: of the Coulomb friction and by 0.01 % of Fs.
FORCE_ERROR = 1e-4
#: Least share of a block in its own fit residual; smaller ones are rounding.
_LEAST_SHARE = 1e-6


def covariances_of(
    levels: list[Motion], stds: list[np.ndarray], candidate: Candidate
) -> tuple[np.ndarray, np.ndarray]:
    """Return two covariances of the packed parameters: by a jackknife over blocks of neighbouring
    lines, and by noise.

    The jackknife is the sandwich of White (1980) over blocks, with the residual of each block
    divided by the share that the fit leaves of it (MacKinnon and White 1985). It covers model
    errors, which are correlated in neighbouring lines. But two thirds of the information on a
    break-away displacement may come from one block, whose residual is small by chance. So the
    second covariance assumes noise with the variance of the residual, and the larger one counts
    (Angrist and Pischke 2009, 8.1).
    """
    pairs = list(zip(levels, stds, strict=True))
    slopes = [slopes_of(level, candidate) / std[..., np.newaxis] for level, std in pairs]
    residuals = [residual_of(level, candidate) / std for level, std in pairs]
    table = as_real(slopes)
    size = np.linalg.norm(table, axis=0)
    size[size == 0] = 1.0
    bread = np.linalg.pinv((table / size).T @ (table / size), rcond=1e-13)
    scores, power = [], 0.0
    for slope, residual in zip(slopes, residuals, strict=True):
        blocks = max(2, int(np.ceil(slope.shape[1] / _BLOCK)))
        for lines in np.array_split(np.arange(slope.shape[1]), blocks):
            part, left = as_real([slope[:, lines]]) / size, as_real([residual[:, lines]])
            power += float(left @ left)
            shares, axes = np.linalg.eigh(part @ bread @ part.T)
            scores.append(part.T @ axes @ (axes.T @ left / np.maximum(1 - shares, _LEAST_SHARE)))
    together, outer = np.array(scores), np.outer(size, size)
    jackknife = (1 - 1 / len(scores)) * bread @ (together.T @ together) @ bread
    n, p = table.shape
    return jackknife / outer, power / max(1, n - p) * bread / outer


def derived_numbers(x: np.ndarray, like: Candidate) -> dict[str, float]:
    """Return the reported numbers from the packed parameters; with a load those of both masses, and
    of the load.
    """
    one = unpack(x, like)
    numbers = one.numbers
    K0, Fs = float(one.stiffness.sum()), float(one.stiffness @ one.breakaway)
    found = {
        "mass": numbers["mass"],
        "damping": numbers["damping"],
        "stiffness": numbers.get("stiffness", 0.0),
        "delay": numbers["delay"],
        "lag": float(np.sqrt(max(0.0, numbers.get("lag_squared", 0.0)))),
        "softening": numbers.get("softening", 0.0),
        "K0": K0,
        "Fs": Fs,
        "coulomb": Fs / one.stiction,
        "stiction": one.stiction,
    }
    if not like.terms.load:
        return found
    mass, coupling, coupling_damping = (float(np.exp(numbers[name])) for name in LOAD[:3])
    k2, D2 = np.asarray(one.load_stiffness), np.asarray(one.load_breakaway)
    stiction = 1 + float(np.exp(numbers["load_log_excess"]))
    of_load = {
        "load_mass": mass,
        "coupling": coupling,
        "coupling_damping": coupling_damping,
        "load_K0": float(k2.sum()),
        "load_Fs": float(k2 @ D2),
        "load_coulomb": float(k2 @ D2) / stiction,
    }
    found["mass"] += mass
    found["damping"] += numbers["load_damping"]
    for name in ("K0", "Fs", "coulomb"):
        found[name] += of_load[f"load_{name}"]
    if found["coulomb"]:
        found["stiction"] = found["Fs"] / found["coulomb"]
    return found | of_load


def deviations(
    levels: list[Motion], stds: list[np.ndarray], candidate: Candidate
) -> dict[str, float]:
    """Return the standard deviation of each derived number, the larger of those from the two
    covariances.
    """
    x, covariances = pack(candidate), covariances_of(levels, stds, candidate)
    steps = 1e-6 * np.maximum(np.abs(x), 1e-6)
    gradients = {name: np.zeros(x.size) for name in derived_numbers(x, candidate)}
    for i, step in enumerate(steps):
        moved = np.zeros(x.size)
        moved[i] = step
        up, down = derived_numbers(x + moved, candidate), derived_numbers(x - moved, candidate)
        for name, gradient in gradients.items():
            gradient[i] = (up[name] - down[name]) / (2 * step)
    return {
        name: float(np.sqrt(max(0.0, *(g @ covariance @ g for covariance in covariances))))
        for name, g in gradients.items()
    }


def mode_term(motion: Motion, numbers: dict[str, float], lag_squared: float = 0.0) -> float:
    """Return the size of the term w^4 at the highest line, relative to that of the mass: of a mode
    above, or a lag.
    """
    top = float(motion.omega[-1]) ** 2
    return top * max(0.0, numbers["softening"] / numbers["mass"], lag_squared / 2)


def mode_error(motion: Motion, numbers: dict[str, float], lag_squared: float = 0.0) -> float:
    """Return the relative error of the mass if the first term of a mode replaces the mode.

    It is a sixth of that term: the presets with a load were up to 0.8 % off at a term of 4 %
    (benchmarks/read_machine.py).
    """
    return mode_term(motion, numbers, lag_squared) / 6
