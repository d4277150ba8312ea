"""Starts of the search for a motor and a load with friction on both.

Each step uses the level that determines its parameters. At levels at which friction slides, motor
and load are linear except for Coulomb friction, and the antiresonance is that of the load on its
spring. At levels at which friction sticks, it is a spring at each mass, which shifts the
antiresonance. The forces of the friction at motor and load remain; they are tried on a grid.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.optimize import nnls

from nlfrf._base.values import value
from robust.friction.reading.balance import (
    Candidate,
    Motion,
    Terms,
    actuated_force,
    as_real,
    element_spectra,
    linear_columns,
    residual_of,
)
from robust.friction.reading.numbers import NumbersRead

#: Grid: antiresonances in the band, relative dampings, delays (in steps of half a radian at the
#: highest line), and Coulomb elements from a share of the swing to half of it. All are starts:
#: Gauss-Newton steps follow.
_N_MODES, _DAMPINGS, _N_DELAYS, _COULOMB = 30, (0.02, 0.08), 8, (1 / 30, 1 / 2, 4)
#: Stiffnesses of the friction of the load that are tried, relative to that of the coupling.
_STIFFNESSES = np.geomspace(1e-3, 10, 60)
#: Strengths that are tried on each mass, from twice the lowest force to the highest; number of
#: pairs that are kept.
_N_STRENGTHS, _N_PAIRS = 6, 4
#: Relative break-away displacements of the elements of a start; all have equal strength.
_SPREAD = np.array([0.4, 1.0, 2.5])
#: Excess of the stiction at each mass in a start, and Stribeck velocity over the rms velocity of
#: the highest level. With too little stiction at the motor the joint preset ended with Fs 16 % low;
#: with a velocity of 0.1 it ended in a minimum with three times the velocity of the axis. So the
#: largest stiction is also tried at a lower velocity, third.
_EXCESSES, _VELOCITIES, _LOW_VELOCITY = (0.05, 0.35), (0.1, 0.5), 0.02


@value
class _LinearLoad:
    """Motor, load and coupling of a level whose friction slides, a delay, and the viscous friction
    of both.
    """

    motor: float
    load: float
    coupling: float
    coupling_damping: float
    damping: float
    spring: float
    delay: float

    @property
    def numbers(self) -> dict[str, float]:
        """Numbers of a candidate whose friction slides; its stiction has no effect."""
        return {
            "mass": self.motor,
            "damping": self.damping / 2,
            "delay": self.delay,
            "lag_squared": 0.0,
            "log_load_mass": float(np.log(self.load)),
            "log_coupling": float(np.log(self.coupling)),
            "log_coupling_damping": float(np.log(self.coupling_damping)),
            "load_damping": self.damping / 2,
            "load_log_excess": 0.0,
            "load_log_vs": 0.0,
        }

    def reaction(self, omega: np.ndarray, stiffness: float) -> np.ndarray:
        """Return (W,) force over displacement of the load behind its coupling, with its friction as
        a spring.
        """
        link = self.coupling + 1j * omega * self.coupling_damping
        inertia = stiffness - self.load * omega**2
        return np.asarray(link * inertia / (link + inertia))


def linear_load(sliding: NumbersRead) -> _LinearLoad:
    """Return motor and load of a fit in motion."""
    return _LinearLoad(
        motor=sliding.mass - sliding.load_mass,
        load=sliding.load_mass,
        coupling=sliding.coupling,
        coupling_damping=max(sliding.coupling_damping, np.finfo(float).tiny),
        damping=max(0.0, sliding.damping),
        spring=0.0,
        delay=sliding.delay,
    )


def start_with_load(
    levels: list[Motion], *, spring: bool, machine: _LinearLoad | None = None
) -> list[Candidate]:
    """Return starting candidates for two masses, the likeliest first; the levels begin with the
    highest.

    machine : estimate in motion; if it is None, it is fitted to the highest level.
    """
    if machine is None:
        machine = fit_sliding_level(
            levels[0], levels[0].half_swing * np.geomspace(*_COULOMB), spring=spring
        )
    stiffness = _fit_sticking_level(levels[-1], machine)
    scales = [float(np.sqrt((np.abs(level.U) ** 2).mean())) for level in levels]
    fastest = float(np.std(levels[0].v))

    def offset(candidate: Candidate) -> float:
        parts = [
            residual_of(level, candidate) / scale
            for level, scale in zip(levels, scales, strict=True)
        ]
        return sum(float((np.abs(part) ** 2).mean()) for part in parts)

    def tried(
        pair: tuple[float, float], excess: tuple[float, float], velocity: float
    ) -> tuple[float, Candidate]:
        candidate = _candidate_of(
            machine, stiffness, strength=pair, excess=excess, vs=velocity * fastest, spring=spring
        )
        return offset(candidate), candidate

    strengths = np.geomspace(2 * levels[-1].force, levels[0].force, _N_STRENGTHS).tolist()
    middle = float(np.sqrt(np.prod(_EXCESSES)))
    pairs = sorted(
        product(strengths, strengths),
        key=lambda pair: tried(pair, (middle, middle), _VELOCITIES[-1])[0],
    )[:_N_PAIRS]
    found = [
        min(
            (tried(pair, excess, velocity) for pair in pairs for velocity in _VELOCITIES),
            key=lambda one: one[0],
        )
        for excess in product(_EXCESSES, _EXCESSES)
    ]
    slow = min(
        (tried(pair, (_EXCESSES[1], _EXCESSES[1]), _LOW_VELOCITY) for pair in pairs),
        key=lambda one: one[0],
    )
    first = [candidate for _, candidate in sorted(found, key=lambda one: one[0])]
    return [*first[:2], slow[1], *first[2:]]


def fit_sliding_level(level: Motion, breakaway: np.ndarray, *, spring: bool) -> _LinearLoad:
    """Fit motor, load and coupling to a level that slides, by nonnegative least squares on a grid
    of modes.

    The friction of the load acts on the motor through the response H of the load to the motion of
    the motor.

    breakaway : (E,) break-away displacements of the elements that are tried at each mass [m]; none
    for an axis that slides in one direction.
    """
    omega, n = level.omega, level.x.shape[1]
    scale = float(np.sqrt((np.abs(level.U) ** 2).mean()))
    at_motor = element_spectra(level, breakaway, stiction=1.0, vs=np.inf)
    grid = 2 * np.pi * level.fs / n * np.arange(n // 2 + 1)
    X = np.fft.rfft(level.x)
    signed = linear_columns(level, Terms(spring=spring))[1:]
    best: tuple[float, _LinearLoad] | None = None
    for mode, damping in product(
        np.geomspace(min(3 * omega[0], omega[-1]), omega[-1], _N_MODES), _DAMPINGS
    ):

        def response(w: np.ndarray, mode: float = mode, damping: float = damping) -> np.ndarray:
            link = mode**2 + 2j * damping * mode * w
            return np.asarray(link / (link - w**2))

        behind = response(grid) * X
        moved = replace(level, x=np.fft.irfft(behind, n), v=np.fft.irfft(1j * grid * behind, n))
        at_load = element_spectra(moved, breakaway, stiction=1.0, vs=np.inf) * response(omega)
        inertia = -(omega**2) * level.Y
        columns = [
            inertia,
            inertia * response(omega),
            *(sign * one for one in signed for sign in (1, -1)),
        ]
        table = as_real([np.stack([*columns, *at_motor, *at_load], axis=-1) / scale])
        size = np.linalg.norm(table, axis=0)
        Q, R = np.linalg.qr(table / size)
        for delay in np.arange(_N_DELAYS) / 2 / omega[-1]:
            target = as_real([actuated_force(level, {"delay": delay}) / scale])
            inside = Q.T @ target
            found, left = nnls(R, inside)
            off = float(target @ target - inside @ inside + left**2)
            if best is None or off < best[0]:
                values = found / size
                motor, load = (max(values[i], 1e-3 * values[:2].sum()) for i in (0, 1))
                best = (
                    off,
                    _LinearLoad(
                        motor=motor,
                        load=load,
                        coupling=load * mode**2,
                        coupling_damping=2 * damping * mode * load,
                        damping=max(0.0, values[2] - values[3]),
                        spring=values[4] - values[5] if spring else 0.0,
                        delay=delay,
                    ),
                )
    assert best is not None
    return best[1]


def _fit_sticking_level(level: Motion, machine: _LinearLoad) -> tuple[float, float]:
    """Return the stiffness of the friction at motor and load [N/m] from a level that sticks."""
    omega, Y = level.omega, level.Y
    seen = level.noise.mean(axis=0) < 0.1 * (np.abs(Y) ** 2).mean(axis=0)
    if not seen.any():
        seen = np.ones(omega.size, dtype=bool)
    force = (
        actuated_force(level, {"delay": machine.delay})
        + (machine.motor * omega**2 - machine.spring) * Y
    )
    best: tuple[float, float, float] | None = None
    for at_load in _STIFFNESSES * machine.coupling:
        left = force - machine.reaction(omega, at_load) * Y
        fitted = float((Y.conj() * left)[:, seen].real.sum() / (np.abs(Y[:, seen]) ** 2).sum())
        at_motor = max(fitted, 1e-3 * machine.coupling)
        off = float((np.abs(left - at_motor * Y)[:, seen] ** 2).sum())
        if best is None or off < best[0]:
            best = off, at_motor, float(at_load)
    assert best is not None
    return best[1:]


def _candidate_of(
    machine: _LinearLoad,
    stiffness: tuple[float, float],
    *,
    strength: tuple[float, float],
    excess: tuple[float, float],
    vs: float,
    spring: bool,
) -> Candidate:
    """Return a candidate with elements of these stiffnesses and strengths and this stiction, at
    motor and load.
    """
    numbers = machine.numbers | {
        **({"stiffness": machine.spring} if spring else {}),
        "log_excess": float(np.log(excess[0])),
        "log_vs": float(np.log(vs)),
        "load_log_excess": float(np.log(excess[1])),
        "load_log_vs": float(np.log(vs)),
    }
    elements = []
    for k, force in zip(stiffness, strength, strict=True):
        breakaway = _SPREAD * force * (1 / _SPREAD).mean() / k
        elements += [force / _SPREAD.size / breakaway, breakaway]
    return Candidate(
        terms=Terms(spring=spring, lag=True, stiction=True, load=True),
        numbers=numbers,
        stiffness=elements[0],
        breakaway=elements[1],
        load_stiffness=elements[2],
        load_breakaway=elements[3],
    )
