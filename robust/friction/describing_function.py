"""What a loop around a machine with friction will do, amplitude by amplitude: a prediction, never a proof."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.linalg import expm

import nlfrf
from nlfrf import Bla
from nlfrf._base.arguments import require_real_array, short_form
from nlfrf._base.values import value
from robust._base.types import Controller
from robust.friction.passivity import MeasuredImpedances, measured_impedances
from robust.friction.plant import (
    FrictionLoop,
    FrictionPlant,
    friction_loop,
    loop_frequencies,
    mobility,
    require_one_port,
)
from robust.lti.lti import poles
from robust.lti.realisation import state_space

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: A friction law as `nlfrf.rig.run` takes it.
Law: TypeAlias = (
    "nlfrf.friction.Coulomb | nlfrf.friction.LuGre | nlfrf.friction.Leuven | nlfrf.friction.GeneralizedMaxwellSlip"
    " | nlfrf.friction.Dahl | nlfrf.friction.VaryingSliders | nlfrf.friction.OwnFriction"
)


# ---- A friction law at an amplitude as a spring and a damper: what it answers to a sine.

POINTS, PERIODS = 256, 3  # of a sine that friction is driven by
MAX_STEPS_PER_SAMPLE = 4096  # integration steps a point


def describing_function(friction: Law, amplitude: float, omega: float) -> complex:
    """k_eq + j w c_eq [N/m] of a law at an amplitude [m] and a frequency [rad/s].

    >>> from nlfrf.friction import VaryingSliders
    >>> stop = VaryingSliders(stiffness=[64e3], strength=[1.0])           # an elastic-plastic element
    >>> N = describing_function(stop, 2e-5, 300.0)
    >>> bool(abs(N / (53644.66 + 13926.06j) - 1) < 1e-3)
    True
    """
    # half a point off, so that no sample falls on a reversal: the force there is one or the other, which would turn
    # a friction that only slides by pi/POINTS, 1.2 % of it into a spring
    phase = 2 * np.pi / POINTS * (np.arange(PERIODS * POINTS) + 0.5)
    fs = omega * POINTS / (2 * np.pi)
    steps = 4
    while True:
        try:
            motion = nlfrf.rig.run(friction, amplitude * omega * np.cos(phase), fs=fs, oversampling=steps)
            break
        except ValueError:  # steps too long for the law; what else is wrong is so at the finest too
            if steps >= MAX_STEPS_PER_SAMPLE:
                raise
            steps *= 4
    last = slice(-POINTS, None)
    turn = np.exp(-1j * phase[last])
    force = motion.friction[last] - getattr(friction, "sigma2", 0.0) * motion.drive[last]
    return complex((turn @ force) / (turn @ motion.x[last]))


#: Where a law is looked at unless told otherwise: from a nanometre to a metre, ten to a decade [m].
AMPLITUDES = np.geomspace(1e-9, 1.0, 91)
MAX_LEVEL_RATIO = 1e4  # times the largest level: as far as levels are followed
MAX_DECAY_RATIO = 0.2  # of the frequency: how fast the envelope of a disturbed motion falls
ROUNDS, SAME = 6, 1e-3  # of the frequency at an amplitude, until it moves by less than that
POLE_ROUNDING = 1e-14  # of the fastest pole
SLIDING_TOLERANCE = (
    0.01  # of a friction that only slides: spring over damper, and how far its force still grows with log a
)
NOT_CLAIMED = "Predicted from one sine at a time, not proved: laws, levels and bursts of other kinds are not in it."
NO_HUNTING = "K integrates: stick-slip between long rests (hunting) is not seen by it."


@value
class QuasiLinear:
    """A loop whose friction is a spring and a damper that depend on the amplitude: how it moves. Never a proof.

    Fields
    ------
    amplitude : float
        From which the motion grows, at the friction port [m]: zero where it does from rest, infinite where it never
        does.
    kick : float
        The velocity that goes with it, amplitude times omega [m/s].
    omega : float
        At which it then swings [rad/s].
    cycles : (C,) ndarray
        Amplitudes of motions that go on, and come back after a disturbance [m].
    outcome : str
        What becomes of the loop after the burst, in the words of `nlfrf.rig.Trajectory.outcome`: "settled", "limit
        cycle" or "ran away"; empty without a burst.
    amplitudes, stiffnesses, dampings : (A,) ndarray
        k_eq [N/m] and c_eq [Ns/m] of the friction at each amplitude [m].
    growths, frequencies : (A,) ndarray
        Growth rate [1/s] of the loop at each, and where it swings [rad/s]; one that the friction holds is taken without
        its damper.
    boundary_omega, boundary : (W,) ndarray
        Frequencies [rad/s], and the k_eq + j w c_eq [N/m] with which the loop would swing for ever at each: -1/P.
    not_claimed : str
        What is not in it.

    References
    ----------
    A. Gelb, W. Vander Velde, *Multiple-Input Describing Functions and Nonlinear System Design*, McGraw-Hill, 1968.

    Examples
    --------
    >>> import control
    >>> import nlfrf
    >>> from robust.friction import quasi_linear
    >>> from robust import friction_plant
    >>> K = control.ss([[1.0]], [[1.0]], [[400.0]], [[0.0]], 1e-3)          # integral action alone
    >>> found = quasi_linear(nlfrf.paper_rig().friction, friction_plant(1.0, 80e3, 0.4), K)
    >>> bool(0.2 < found.kick < 0.5), "not proved" in str(found)
    (True, True)
    """

    amplitude: float
    kick: float
    omega: float
    cycles: np.ndarray
    outcome: str
    amplitudes: np.ndarray
    stiffnesses: np.ndarray
    dampings: np.ndarray
    growths: np.ndarray
    frequencies: np.ndarray
    boundary_omega: np.ndarray
    boundary: np.ndarray
    not_claimed: str

    def __str__(self) -> str:
        if np.isinf(self.amplitude):
            text = "comes to rest from every amplitude looked at"
        elif self.amplitude == 0:
            text = "does not come to rest: small motions grow"
        else:
            text = f"comes to rest below {self.amplitude:.3g} m, grows beyond: a kick of {self.kick:.3g} m/s"
        if self.cycles.size:
            text += "; goes on at " + ", ".join(f"{a:.3g} m" for a in self.cycles)
        after = f"\nAfter the burst: {self.outcome}." if self.outcome else ""
        return f"Predicted: {text}.{after}\n{self.not_claimed}"


def quasi_linear(
    friction: Law | list[Bla] | tuple[Bla, ...],
    machine: FrictionPlant,
    K: Controller,
    *,
    delay: float = 0.0,
    burst: ArrayLike | None = None,
    amplitudes: ArrayLike | None = None,
) -> QuasiLinear:
    """Predict from which amplitude and kick a loop around friction grows, and what becomes of it after a burst.

    Parameters
    ----------
    friction : law of nlfrf.friction, or sequence of nlfrf.Bla
        The friction; or BLAs from force [N] to measured position [m] at several levels, which tell its spring and
        damper at their amplitudes.
    machine : FrictionPlant
        The linear part, with the viscous part of the friction.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y).
    delay : float
        From sampling to the force changing [s].
    burst : (n,) ndarray, optional
        Force on the machine at each sample [N]; then it is left alone. Only with a sampled controller.
    amplitudes : (A,) ndarray, optional
        Of the motion at the friction port [m], rising: 1 nm to 1 m for a law, around those measured for levels.

    Returns
    -------
    QuasiLinear

    Raises
    ------
    ValueError
        No sliding machine, no law and no BLA, amplitudes that do not rise, a burst with a continuous controller.

    References
    ----------
    A. Gelb, W. Vander Velde, *Multiple-Input Describing Functions and Nonlinear System Design*, McGraw-Hill, 1968.

    Examples
    --------
    >>> import nlfrf
    >>> from robust import friction_plant
    >>> found = quasi_linear(nlfrf.paper_rig().friction, friction_plant(1.0, 80e3, 0.4), 1e3)
    >>> found.amplitude, found.outcome                             # a spring more, and nothing else
    (inf, '')
    """
    if not isinstance(machine, FrictionPlant):
        raise ValueError(f"machine must be a friction_plant, got {short_form(machine)}")
    require_one_port(machine)
    K = state_space("K", K)
    loop = friction_loop(machine, K, delay)
    levels = measured_impedances(friction, machine) if isinstance(friction, (list, tuple)) else None
    a = amplitude_grid(amplitudes, levels)
    stiffness, damping, pole, swings = equivalent_impedances(loop, friction, levels=levels, a=a)
    growth = pole.real
    rises = np.flatnonzero((growth[:-1] <= 0) & (growth[1:] > 0))
    falls = np.flatnonzero((growth[:-1] > 0) & (growth[1:] <= 0))
    first, omega = np.inf, np.nan
    if growth[0] > 0:
        first, omega = 0.0, float(pole[0].imag)
    elif rises.size:
        pair = slice(rises[0], rises[0] + 2)
        first, omega = (
            zero_growth_amplitude(a, growth, int(rises[0])),
            float(np.interp(0, growth[pair], pole.imag[pair])),
        )
    cycles = np.array([zero_growth_amplitude(a, growth, int(i)) for i in falls])
    outcome = (
        ""
        if burst is None
        else final_amplitude(amplitude_after_burst(loop, machine, burst=burst, at=(a, stiffness, damping)), a, growth)
    )
    grid = loop_frequencies(loop)
    integrates = np.any(np.abs(poles(K) - (1 if loop.T else 0)) < 1e-9)
    return QuasiLinear(
        amplitude=first,
        kick=first * omega if 0 < first < np.inf else first,
        omega=omega,
        cycles=cycles,
        outcome=outcome,
        amplitudes=a,
        stiffnesses=stiffness,
        dampings=damping,
        growths=growth,
        frequencies=swings,
        boundary_omega=grid,
        boundary=1j * grid / mobility(loop, grid),
        not_claimed=f"{NOT_CLAIMED} {NO_HUNTING}" if integrates else NOT_CLAIMED,
    )


def amplitude_grid(amplitudes: ArrayLike | None, levels: MeasuredImpedances | None) -> np.ndarray:
    """Return the amplitudes [m] at which the loop is evaluated."""
    if amplitudes is None:
        if levels is None:
            return AMPLITUDES
        low, high = levels.amplitude[0] / 10, levels.amplitude[-1] * MAX_LEVEL_RATIO
        return np.geomspace(low, high, int(10 * np.log10(high / low)) + 1)
    a = require_real_array("amplitudes", amplitudes, ndim=1)
    if a.size < 2 or not (a[0] > 0 and np.all(np.diff(a) > 0)):
        raise ValueError(f"amplitudes must be at least two, positive and rising [m], got {a.size}")
    return a


def equivalent_impedances(
    loop: FrictionLoop, friction: Law | list[Bla] | tuple[Bla, ...], *, levels: MeasuredImpedances | None, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return k_eq, c_eq, the real part of the least damped loop pole and its frequency [rad/s] at each amplitude."""
    if levels is not None:
        stiffness, damping = levels.at(a)
        both = list(zip(stiffness, damping, strict=True))
        pole = np.array([least_damped_pole(loop, k, c) for k, c in both])
        return stiffness, damping, pole, np.array([oscillation_frequency(loop, k, c) for k, c in both])
    assert not isinstance(friction, list | tuple)
    N, pole, omega = np.zeros(a.size, complex), np.zeros(a.size, complex), np.zeros(a.size)
    start, slides = oscillation_frequency(loop, 0.0, 0.0), False
    for i in range(a.size):
        omega[i] = omega[i - 1] if i else start
        if slides:
            N[i] = 1j * N[i - 1].imag * a[i - 1] / a[i]
        for _ in range(ROUNDS):  # the frequency at which the friction is driven is that of the loop with it
            if not slides:
                N[i] = describing_function(friction, float(a[i]), float(omega[i]))
            pole[i] = least_damped_pole(loop, N[i].real, N[i].imag / omega[i])
            swings = oscillation_frequency(loop, N[i].real, N[i].imag / omega[i])
            if abs(swings / omega[i] - 1) < SAME:
                break
            omega[i] = swings
        slides = slides or (i > 0 and only_slides(N.real, N.imag, a=a, i=i))
    return N.real, N.imag / omega, pole, omega


def only_slides(stiffness: np.ndarray, reaction: np.ndarray, *, a: np.ndarray, i: int) -> bool:
    """Return whether the friction force no longer grows from an amplitude to the next, so that all elements slide."""
    grows = reaction[i] * a[i] / max(reaction[i - 1] * a[i - 1], 1e-300) - 1
    return bool(
        abs(stiffness[i]) < SLIDING_TOLERANCE * reaction[i] and abs(grows) < SLIDING_TOLERANCE * np.log(a[i] / a[i - 1])
    )


def least_damped_pole(loop: FrictionLoop, stiffness: float, damping: float) -> complex:
    """Return the least damped pole with a spring and a damper at the port, in the upper half of the s-plane."""
    found = np.linalg.eigvals(loop.period(stiffness, damping))
    if loop.T:
        found = np.log(found[np.abs(found) > 1e-12].astype(complex)) / loop.T
    # a friction that holds leaves a slow pole that is below the rounding of the fast one, of either sign
    found = found[(found.imag >= 0) & (np.abs(found) > POLE_ROUNDING * np.abs(found).max())]
    return complex(found[np.argmax(found.real / np.maximum(np.abs(found), 1e-9))])


def oscillation_frequency(loop: FrictionLoop, stiffness: float, damping: float) -> float:
    """Return the frequency [rad/s] at which the loop oscillates with a spring and a damper at the port.

    A loop that does not swing with both is taken with the spring alone: a friction that holds it does so at the
    frequency at which it would swing, and the slow pole that creeps back has no amplitude of its own.
    """
    top = np.pi / loop.T if loop.T else np.inf
    for pole in (least_damped_pole(loop, stiffness, damping), least_damped_pole(loop, stiffness, 0.0)):
        if pole.imag > 1e-3 * abs(pole):
            break
    return float(np.clip(pole.imag if pole.imag > 1e-3 * abs(pole) else abs(pole), 1e-2, top))


def zero_growth_amplitude(a: np.ndarray, growth: np.ndarray, i: int) -> float:
    """Return the amplitude between a[i] and a[i + 1] of zero growth, linear in 1/a as for sliding friction."""
    share = growth[i] / (growth[i] - growth[i + 1])
    return float(1 / ((1 - share) / a[i] + share / a[i + 1]))


def amplitude_after_burst(
    loop: FrictionLoop, machine: FrictionPlant, *, burst: ArrayLike, at: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> float:
    """Return the amplitude [m] at the end of a burst; spring and damper follow the envelope sample by sample."""
    forces = require_real_array("burst", burst, ndim=1)
    if not loop.T:
        raise ValueError("burst must be left out with a continuous controller, got one. Sample it first")
    a, stiffness, damping = at
    n = loop.F.shape[0]
    push = np.concatenate([machine.B_force, np.zeros(n - machine.B_force.size)])
    steps: dict[int, tuple[np.ndarray, np.ndarray, float]] = {}
    xi, envelope = np.zeros(n), a[0]
    for force in forces:
        i = min(int(np.searchsorted(a, envelope)), a.size - 1)
        if i not in steps:
            steps[i] = (
                *step_with_impedance(loop, stiffness[i], damping=damping[i], push=push),
                oscillation_frequency(loop, stiffness[i], damping[i]),
            )
        xi = steps[i][0] @ xi + steps[i][1] * force
        omega = steps[i][2]
        envelope = max(
            np.hypot(loop.x @ xi, (loop.v @ xi) / omega), envelope * np.exp(-MAX_DECAY_RATIO * omega * loop.T), a[0]
        )
        if envelope >= a[-1]:
            break
    return float(envelope)


def step_with_impedance(
    loop: FrictionLoop, stiffness: float, *, damping: float, push: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state map of one sample with a spring and a damper at the port, and the effect of a held force."""
    n = push.size
    block = np.zeros((n + 1, n + 1))
    block[:n, :n] = loop.F + np.outer(loop.B, stiffness * loop.x + damping * loop.v)
    block[:n, n] = push
    total, added = np.eye(n), np.zeros(n)
    for span, jump in zip(loop.spans, loop.jumps, strict=True):
        both = expm(span * block)
        total, added = both[:n, :n] @ jump @ total, both[:n, :n] @ jump @ added + both[:n, n]
    return total, added


def final_amplitude(envelope: float, a: np.ndarray, growth: np.ndarray) -> str:
    """Return the amplitude a free motion tends to: the next one of zero growth, upwards or downwards."""
    i = min(int(np.searchsorted(a, envelope)), a.size - 1)
    if growth[i] > 0:
        return "limit cycle" if np.any(growth[i:] <= 0) else "ran away"
    return "limit cycle" if np.any(growth[:i] > 0) else "settled"
