"""Mass, stiffness, damping and virgin curve of a machine with friction, from BLAs at several levels all at once.

A candidate machine is simulated with the multisines that were played, and its FRF is held against the measured one at
every line of every level. Nothing is linearised, and distortion is no noise here: the candidate distorts alike.

The family of virgin curves is one of Maxwell slip without stiction,

    dF/dz = K0 (1 - F/Fs)^p,    p = 0: elastic up to Fs and then slipping;  p = 1: exponential,

in `N_ELEMENTS` elements. What is read holds given this family: stiff elements of tiny strength slip below every level.

Start values come from statistical linearisation. The force of an element in a motion of amplitude A has the fundamental
N(A) A. A Gaussian motion of rms s has Rayleigh distributed amplitudes, and its best linear gain is

    E[F X*] / E[X X*] = E[A^2 N(A)] / E[A^2],

weights A^2. (With weights 1 the damping of Coulomb friction is twice too large; with these it is the known
sqrt(2/pi) Fs / s.)
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import nlfrf
from nlfrf._base.arguments import require_integer, require_positive
from nlfrf._base.values import value
from robust.friction.levels import fit_level, one_mass_reaction

__all__ = [
    "N_ELEMENTS",
    "FrictionFit",
    "elements_of_curve",
    "fit_friction",
    "gaussian_gain",
    "sinusoidal_gain",
]

#: Elements of a virgin curve. With 12 the misfit of a level doubles and the damping of a free mass is 20 % off. With 30
#: mass, stiffness and break-away force are within 2 % and damping within 10 % of a curve of 100 elements; the standard
#: deviations are those of the fit alone and do not hold this error of the model.
N_ELEMENTS = 30
#: Error of the candidate relative to |G| on every line: steps of the integrator, calibration of the sensors.
MODEL_ERROR = 0.005
#: Step of the derivatives, relative to each parameter; elements that slip or not make the FRF rough on a finer scale.
STEP = 0.01
#: Standard deviation, relative to a parameter, from which the levels leave it open.
OPEN = 0.2
#: Share of Fs that the largest motion must reach for Fs to be seen, and of K0 that must stick at the smallest for K0:
#: beyond, a virgin curve of the family is extrapolated, with standard deviations that mean nothing.
REACHED, STUCK = 0.95, 0.5
#: Exponents p of the family.
EXPONENTS = (0.0, 3.0)


@value
class FrictionFit:
    """What all levels say together, given the family of virgin curves.

    Fields
    ------
    mass, stiffness, damping : float
        m [kg], k [N/m] of a spring to ground (zero for a free machine), c [Ns/m].
    K0, Fs, exponent : float
        Presliding stiffness [N/m], strength [N] and exponent p of the virgin curve.
    mass_std, stiffness_std, damping_std, K0_std, Fs_std : float
        Their standard deviations; infinite where the levels do not tell.
    misfit : (L,) ndarray
        Mean squared misfit of each level over the variance of its lines, the highest level first.
    left_open : tuple of str
        Names of the parameters that the levels leave open.
    """

    mass: float
    stiffness: float
    damping: float
    K0: float
    Fs: float
    exponent: float
    mass_std: float
    stiffness_std: float
    damping_std: float
    K0_std: float
    Fs_std: float
    misfit: np.ndarray
    left_open: tuple[str, ...]


def elements_of_curve(
    K0: float, Fs: float, exponent: float, n_elements: int = N_ELEMENTS
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness [N/m] and strength [N] of the elements of a virgin curve, which add up to K0 nearly and to Fs.

    The curve is cut at forces that lie closer near rest, where K0 is seen. Each chord has the slope of its middle.
    """
    forces = (np.arange(n_elements + 1) / n_elements) ** 1.5
    slope = K0 * (1 - (forces[1:] + forces[:-1]) / 2) ** exponent
    breaks = np.cumsum(Fs * np.diff(forces) / slope)  # where the elements slip one after the other
    stiffness = slope - np.append(slope[1:], 0.0)
    kept = stiffness > 1e-12 * K0
    return stiffness[kept], (stiffness * breaks)[kept]


def sinusoidal_gain(stiffness: np.ndarray, strength: np.ndarray, amplitude: Any) -> np.ndarray:
    """(A,) complex describing function of Maxwell elements for a sine of amplitude A (Gelb & Vander Velde, 1968)."""
    A = np.asarray(amplitude, dtype=float)[..., np.newaxis]
    ratio = np.minimum(strength / stiffness / A, 1.0)
    theta = np.arccos(1 - 2 * ratio)  # of the way back over which an element sticks
    real = stiffness / np.pi * (theta - np.sin(theta) * np.cos(theta))
    imag = 4 * stiffness / np.pi * ratio * (1 - ratio)
    return np.asarray((real + 1j * imag).sum(axis=-1))


def gaussian_gain(stiffness: np.ndarray, strength: np.ndarray, rms: float) -> complex:
    """Best linear gain of Maxwell elements for a narrow-band Gaussian motion: E[A^2 N(A)] / E[A^2]."""
    # with A^2 = 2 s^2 q, the weights A^2 times the Rayleigh density are those of Gauss and Laguerre for q e^-q
    q = np.geomspace(1e-6, 60.0, 2000)
    weight = q * np.exp(-q) * np.gradient(q)
    gain = sinusoidal_gain(stiffness, strength, require_positive("rms", rms) * np.sqrt(2 * q))
    return complex(weight @ gain / weight.sum())


def fit_friction(
    blas: Sequence[Any],
    multisines: Sequence[Any],
    *,
    free: bool = False,
    n_discard: int = 4,
    oversampling: int = 1,
    hold: str = "band-limited",
) -> FrictionFit:
    """Fit one mass with a friction of the family to BLAs at several levels.

    Parameters
    ----------
    blas : sequence of Bla
        From force [N] to position [m], of one mass at rest, in open loop.
    multisines : sequence of Multisine
        What was played at each of them, the same realisations.
    free : bool
        Whether there is no spring to ground.
    n_discard, oversampling, hold
        How a candidate is simulated, as in `nlfrf.simulate`.

    Returns
    -------
    FrictionFit

    Raises
    ------
    ValueError
        Fewer than three levels; multisines that are not those of the BLAs.
    """
    blas, multisines = list(blas), list(multisines)
    require_integer("n_discard", n_discard, least=1)
    if len(blas) < 3:
        raise ValueError(f"blas must hold at least three levels, from sticking to sliding, got {len(blas)}")
    if len(multisines) != len(blas):
        raise ValueError(f"multisines must be one for each of the {len(blas)} blas, got {len(multisines)}")
    for bla, ms in zip(blas, multisines, strict=True):
        if bla.omega.size != ms.f.size or not np.allclose(bla.omega, 2 * np.pi * ms.f, rtol=1e-6):
            raise ValueError("multisines must excite the lines of the blas, got other frequencies")
    order = np.argsort([-ms.rms for ms in multisines])
    blas, multisines = [blas[i] for i in order], [multisines[i] for i in order]
    std = [np.sqrt(bla.var_noise + (MODEL_ERROR * np.abs(bla.G)) ** 2) for bla in blas]
    start = start_values(blas, multisines, free=free)

    def residual(x: np.ndarray) -> np.ndarray:
        machine = machine_of(x, free=free)
        parts = []
        for bla, ms, one in zip(blas, multisines, std, strict=True):
            record = quiet_simulate(machine, ms, n_discard=n_discard, oversampling=oversampling, hold=hold)
            u, y = (np.fft.rfft(signal[:, -1])[:, ms.lines.excited] for signal in (record.u, record.y))
            off = ((y / u).mean(axis=0) - bla.G) / one
            parts.append(np.concatenate([off.real, off.imag]))
        return np.concatenate(parts)

    def slopes(x: np.ndarray) -> np.ndarray:
        steps = STEP * np.eye(x.size)
        return np.column_stack([(residual(x + step) - residual(x - step)) / (2 * STEP) for step in steps])

    low, high = np.full(start.size, -np.inf), np.full(start.size, np.inf)
    low[-1], high[-1] = EXPONENTS
    found = least_squares(residual, start, jac=slopes, bounds=(low, high), ftol=1e-3, xtol=1e-4, max_nfev=40)
    swings = []
    for ms in (multisines[0], multisines[-1]):
        machine = machine_of(found.x, free=free)
        record = quiet_simulate(machine, ms, n_discard=n_discard, oversampling=oversampling, hold=hold)
        swings.append(float(np.ptp(record.y, axis=-1).max()))
    return result_of(found, [2 * bla.omega.size for bla in blas], swings, free=free)


def machine_of(x: np.ndarray, *, free: bool) -> Any:
    """The candidate: parameters are logarithms, but for the exponent, which comes last."""
    numbers = np.exp(x[:-1])
    m, c, K0, Fs = numbers[:4]
    stiffness, strength = elements_of_curve(K0, Fs, float(x[-1]))
    sliders = nlfrf.friction.VaryingSliders(stiffness=stiffness, strength=strength)
    return nlfrf.Rig(float(m), 0.0 if free else float(numbers[4]), sliders, float(c))


def quiet_simulate(machine: Any, ms: Any, *, oversampling: int, **options: Any) -> Any:
    """Simulate a candidate, with the steps that it needs; what is said of a bad one concerns nobody."""
    options["oversampling"] = max(oversampling, int(np.ceil(1 / (ms.fs * machine.stable_step))))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        return nlfrf.simulate(machine, ms, **options)


def start_values(blas: list[Any], multisines: list[Any], *, free: bool) -> np.ndarray:
    """Where the search begins: mass and stiffnesses of the fits of 1/G, strength and exponent by linearisation."""
    fits = [fit_level(bla, one_mass_reaction(bla)) for bla in blas]
    masses, weights = np.array([fit.mass for fit in fits]), 1 / np.array([fit.mass_std for fit in fits]) ** 2
    mass = float(masses @ weights / weights.sum())
    if not mass > 0:
        raise ValueError(
            f"blas must be from force to position, got a mass of {mass:.3g} kg: the output falls when the input rises. "
            "Turn the sign of the sensor"
        )
    stiffness = np.array([fit.stiffness for fit in fits])
    spring = 0.0 if free else max(fits[0].slow, 0.01 * stiffness[-1])
    K0 = stiffness[-1] - spring
    if not K0 > 0:
        raise ValueError(
            f"blas must span from sticking to sliding, got {stiffness[-1]:.4g} N/m at the lowest level and "
            f"{spring:.4g} N/m at the highest. Measure at lower and higher levels"
        )
    motion = [
        float(np.linalg.norm(np.abs(bla.G) * ms.amplitude) / np.sqrt(2))
        for bla, ms in zip(blas, multisines, strict=True)
    ]
    best = min(
        (
            (
                sum(
                    (gaussian_gain(*elements_of_curve(K0, Fs, p), rms).real / K0 - (one - spring) / K0) ** 2
                    for rms, one in zip(motion, stiffness, strict=True)
                ),
                float(Fs),
                p,
            )
            for Fs in np.geomspace(K0 * min(motion) / 3, 30 * K0 * max(motion), 40)
            for p in (0.5, 1.0)
        ),
        key=lambda one: one[0],
    )
    damping = max(fits[-1].damping, 1e-3 * np.sqrt(K0 * mass))
    numbers = [mass, damping, K0, best[1]] + ([] if free else [spring])
    return np.append(np.log(numbers), best[2])


def result_of(found: Any, sizes: list[int], swings: list[float], *, free: bool) -> FrictionFit:
    """The parameters with standard deviations, and the misfit of each level.

    swings: the whole way of the motion [m] at the highest and at the lowest level.
    """
    ends = np.cumsum(sizes)
    misfit = np.array([float(np.mean(part**2)) for part in np.split(found.fun, ends[:-1])])
    spread = max(1.0, 2 * found.cost / max(1, found.fun.size - found.x.size))
    information = found.jac.T @ found.jac
    # a direction that no level sees gets a huge variance, not none
    faint = 1e-12 * np.trace(information) * np.eye(found.x.size)
    relative = np.sqrt(spread * np.diag(np.linalg.inv(information + faint)))
    names = ["mass", "damping", "K0", "Fs"] + ([] if free else ["stiffness"])
    numbers = dict(zip(names, np.exp(found.x[:-1]).tolist(), strict=True))
    stds = {name: numbers[name] * float(std) for name, std in zip(names, relative[:-1], strict=True)}
    stiffness, strength = elements_of_curve(numbers["K0"], numbers["Fs"], float(found.x[-1]))
    # over a way s between two turns, an element slips where it is stretched by s/2 from the middle of its loop
    if np.minimum(stiffness * swings[0] / 2, strength).sum() < REACHED * strength.sum():
        stds["Fs"] = np.inf
    if stiffness[stiffness * swings[1] / 2 < strength].sum() < STUCK * stiffness.sum():
        stds["K0"] = np.inf
    return FrictionFit(
        **numbers,
        exponent=float(found.x[-1]),
        **({"stiffness": 0.0} if free else {}),
        mass_std=stds["mass"],
        stiffness_std=stds.get("stiffness", 0.0),
        damping_std=stds["damping"],
        K0_std=stds["K0"],
        Fs_std=stds["Fs"],
        misfit=misfit,
        left_open=tuple(name for name in names if stds[name] > OPEN * numbers[name]),
    )
