"""What the levels of an experiment tell of a machine with friction: its linear part, and how stiff it sticks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import real
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.friction_proof.classes import AnyFriction, any_maxwell_slip
from robust.friction_proof.flexible import read_around
from robust.sliding.machine import SlidingMachine, sliding_machine

__all__ = ["FrictionClass", "friction_class"]

AROUND = (0.3, 2.0)  # of the resonance: the lines that are fitted
AGREE = 0.10  # of the two lowest levels, so that the friction sticks in both
FEWEST_LINES = 8
SUPPORT = "The levels support this class, they do not prove it: friction that creeps below break-away looks the same."


@value
class FrictionClass:
    """A linear part and a class of friction, read from measured levels: an assumption, with what it was read from.

    Fields
    ------
    machine : SlidingMachine
        Mass and stiffness at the highest level, without damping.
    friction : AnyFriction
        Maxwell slip with the stiffness that is lost from the lowest level to the highest, and a margin.
    evidence : str
        What it was read from, and what the data cannot show.
    mass, stiffness : (L,) ndarray
        Fitted at each level, the highest first [kg], [N/m].
    damping : (L,) ndarray
        The same [Ns/m]; most of it is the friction's.
    mass_std, stiffness_std : float
        Standard deviation of mass [kg] and stiffness [N/m] at the highest level, from what the fit leaves.
    machines : tuple of SlidingMachine
        The same machine with each damping that is to be proved: without any, and as it was fitted around a nominal.
        With a nominal `mass` is what a force at the friction port feels, `stiffness` and `damping` are what the
        friction adds to the nominal at each level; mass_std is nan.

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements" (resonance against level).

    Examples
    --------
    >>> import nlfrf
    >>> grid = dict(fs=4096, n_samples=16384, f_min=1.25, f_max=250, rng=1)
    >>> rig = nlfrf.paper_rig()
    >>> blas = [nlfrf.identify(nlfrf.simulate(rig, nlfrf.multisine("special-odd", rms=rms, **grid), n_periods=2))
    ...         for rms in (0.1, 0.25, 2.5)]
    >>> found = friction_class(blas)                        # the rig has 1 kg, 80 kN/m and 64 kN/m
    >>> bool(abs(found.mass[0] - 1) < 0.1), bool(abs(found.stiffness[0] / 80e3 - 1) < 0.05)
    (True, True)
    >>> bool(64e3 < found.friction.K0 < 80e3)
    True
    """

    machine: SlidingMachine
    friction: AnyFriction
    evidence: str
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    mass_std: float
    stiffness_std: float
    machines: tuple[SlidingMachine, ...] = ()

    def __str__(self) -> str:
        return self.evidence


def friction_class(
    blas: Sequence[Bla], *, nominal: Any = None, stiction: float = 1.5, margin: float = 1.25
) -> FrictionClass:
    """Machine and presliding stiffness from BLAs at three levels or more, for `prove_friction`.

    At each level 1/G = k - m w^2 + j c w is fitted around the resonance, weighted by |G|. The highest level gives the
    machine, the stiffness that is lost from the lowest to it the class, times a margin. The damping is left at zero.

    A flexible machine needs a `nominal`, fitted at the highest level: what it leaves of the other levels is the
    friction. It is proved without damping and with that of the fit (`FrictionClass.machines`).

    Parameters
    ----------
    blas : sequence of Bla
        From force [N] to position [m], of one machine, at levels from sticking to sliding; without a nominal one
        resonance.
    nominal : NominalFit, control.StateSpace or SlidingMachine, optional
        From force to position where friction acts, at least two poles more than zeros (``fit_nominal(blas[-1],
        n_poles=4, n_zeros=2)``); or a machine with a friction port of its own.
    stiction : float
        Largest over smallest force of a slider: no frequency response shows it.
    margin : float
        Times the presliding stiffness that was read.

    Returns
    -------
    FrictionClass

    Raises
    ------
    ValueError
        Fewer than three levels; the two lowest not within 10 % in stiffness, so that neither shows it all; levels that
        all have the same stiffness; no resonance in the band.

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements".

    Examples
    --------
    >>> friction_class([])
    Traceback (most recent call last):
        ...
    ValueError: blas must hold at least three levels, from sticking to sliding, got 0
    """
    blas = list(blas) if isinstance(blas, Iterable) else blas
    if not isinstance(blas, list) or not all(isinstance(bla, Bla) for bla in blas):
        raise ValueError(f"blas must be a list of BLAs from nlfrf.identify, got {shown(blas)}")
    if len(blas) < 3:
        raise ValueError(f"blas must hold at least three levels, from sticking to sliding, got {len(blas)}")
    if real("margin", margin) < 1:
        raise ValueError(f"margin must be at least 1, got {margin:g}")
    return one_mass(blas, stiction, margin) if nominal is None else around(blas, nominal, stiction, margin)


def one_mass(blas: list[Bla], stiction: float, margin: float) -> FrictionClass:
    """A mass on a spring, fitted at every level."""
    fits = sorted((resonance(bla) for bla in blas), key=lambda fit: fit[0][0])
    (k, m, c), stds = np.array([fit[0] for fit in fits]).T, fits[0][1]
    if k[-1] / k[-2] - 1 > AGREE:
        raise ValueError(
            f"blas must reach so low that the stiffness no longer rises: it is {k[-2] / 1e3:.4g} and "
            f"{k[-1] / 1e3:.4g} kN/m at the two lowest levels, more than 10 % apart. Measure at a lower level"
        )
    lost = k[-1] - k[0]
    if not lost > 3 * stds[0]:
        raise ValueError(
            f"blas must span from sticking to sliding, got stiffnesses from {k[0] / 1e3:.4g} to {k[-1] / 1e3:.4g} kN/m"
        )
    friction = any_maxwell_slip(margin * lost, stiction)
    machine = sliding_machine(float(m[0]), float(k[0]))
    return FrictionClass(
        machine=machine,
        friction=friction,
        evidence=told(k, m, stds, margin, friction),
        mass=m,
        stiffness=k,
        damping=c,
        mass_std=stds[1],
        stiffness_std=stds[0],
        machines=(machine,),
    )


def around(blas: list[Bla], nominal: Any, stiction: float, margin: float) -> FrictionClass:
    """What a nominal at the highest level leaves of the others."""
    machines, levels, words = read_around(blas, nominal)
    order = np.argsort(levels.stiffness)
    k, c = levels.stiffness[order], levels.damping[order]
    lost = k[-1] - max(k[0], 0.0)
    friction = any_maxwell_slip(margin * lost, stiction)
    mass = 1 / float(machines[-1].velocity @ machines[-1].B_port)
    evidence = (
        f"Assumed, read from {k.size} levels around {words}; K0 = {friction.K0 / 1e3:.4g} kN/m, {margin:g} times what "
        f"the friction adds at the lowest level ({k[-1] / 1e3:.4g} kN/m) beyond the highest ({k[0] / 1e3:.3g} kN/m); "
        f"stiction {stiction:g}, which no level shows. {SUPPORT}"
    )
    return FrictionClass(
        machine=machines[0],
        friction=friction,
        evidence=evidence,
        mass=np.full(k.size, mass),
        stiffness=k,
        damping=c,
        mass_std=np.nan,
        stiffness_std=levels.stiffness_std,
        machines=machines,
    )


def resonance(bla: Bla) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """(k, m, c) of one level, and the standard deviations of k and m by what the fit leaves."""
    peak = int(np.argmax(np.abs(bla.G)))
    chosen = (bla.omega > AROUND[0] * bla.omega[peak]) & (bla.omega < AROUND[1] * bla.omega[peak])
    if np.count_nonzero(chosen) < FEWEST_LINES or peak in (0, bla.G.size - 1):
        raise ValueError(
            f"blas must have a resonance with at least {FEWEST_LINES} lines around it, got a largest |G| at "
            f"{bla.f[peak]:.4g} Hz of a band from {bla.f[0]:.4g} to {bla.f[-1]:.4g} Hz"
        )
    omega, G = bla.omega[chosen], bla.G[chosen]
    table = np.column_stack([G, -(omega**2) * G, 1j * omega * G])  # G (k - m w^2 + j c w) = 1
    table, wanted = np.vstack([table.real, table.imag]), np.concatenate([np.ones(G.size), np.zeros(G.size)])
    unit = np.linalg.norm(table, axis=0)
    found = np.linalg.lstsq(table / unit, wanted, rcond=None)[0]
    left = np.linalg.norm(wanted - table / unit @ found) / np.sqrt(wanted.size - 3)
    std = left * np.sqrt(np.diag(np.linalg.inv((table / unit).T @ (table / unit)))) / unit
    k, m, c = found / unit
    if not (k > 0 and m > 0):
        raise ValueError(f"blas must be from force to position, got a mass of {m:.3g} kg and {k:.3g} N/m")
    return (float(k), float(m), float(c)), (float(std[0]), float(std[1]))


def told(k: np.ndarray, m: np.ndarray, stds: tuple[float, float], margin: float, friction: AnyFriction) -> str:
    """What was read, what is assumed, what the data cannot show."""
    fell = f"k still fell by {100 * (k[1] / k[0] - 1):.2g} % to it"
    return (
        f"Assumed, read from {k.size} levels: m = {m[0]:.4g} +- {stds[1]:.1g} kg, k = {k[0] / 1e3:.4g} +- "
        f"{stds[0] / 1e3:.1g} kN/m at the highest level ({fell}), c = 0; K0 = {friction.K0 / 1e3:.4g} kN/m, "
        f"{margin:g} times the stiffness lost from the lowest level ({k[-1] / 1e3:.4g} kN/m) to it; stiction "
        f"{friction.stiction:g}, which no level shows. {SUPPORT}"
    )
