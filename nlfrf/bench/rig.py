"""A mass on a spring with friction: force in, position out.

    m x'' + c x' + k x + friction(x') = force

`Rig` is the machine; `run` takes it from rest through any force. `nlfrf.simulate` runs multisines.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from nlfrf.friction import kernel_data as packing
from nlfrf.friction.hysteresis import warn_lost
from nlfrf.friction.integration import integrate
from nlfrf.friction.laws import Friction, Leuven, packed_law
from nlfrf.shared.arguments import DataWarning, integer, nonnegative, one_of, positive, real_array
from nlfrf.shared.values import value

__all__ = [
    "Motion",
    "Rig",
    "advance",
    "at_rest",
    "drive",
    "paper_rig",
    "refuse_long_step",
    "run",
    "some_samples",
    "step_refusal",
    "warn_coarse",
]


#: |h lambda| on the negative real axis up to which the fourth-order Runge-Kutta step is stable.
REAL_LIMIT = 2.785
#: Relative error at the resonance of the stuck rig above which a step is called coarse.
COARSE = 0.01


@value(kw_only=False)
class Rig:
    """A mass on a spring, with viscous damping and friction between mass and ground.

    Parameters
    ----------
    mass : float
        [kg].
    stiffness : float
        Of the spring to ground [N/m]; zero for a free mass.
    friction : Coulomb, Dahl, LuGre, Leuven or GeneralizedMaxwellSlip
        The friction law.
    damping : float
        Viscous damping beside the friction law's own [Ns/m].

    Raises
    ------
    ValueError
        A mass that is not positive, a negative stiffness or damping, a friction that is no law.

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements", section 2: the experiment.

    Examples
    --------
    >>> from nlfrf.friction.laws import LuGre
    >>> rig = Rig(1.0, 80e3, LuGre(sigma0=64e3, sigma1=13, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01))
    >>> bool(rig.stable_step > 1 / 4096)
    True
    """

    mass: float
    stiffness: float
    friction: Friction
    damping: float = 0.0

    def __post_init__(self) -> None:
        positive("mass", self.mass)
        nonnegative("stiffness", self.stiffness)
        nonnegative("damping", self.damping)
        packed_law(self.friction)

    @property
    def stable_step(self) -> float:
        """Longest integration step [s] that is stable without sliding; sliding may ask for a shorter one."""
        law, _ = packed_law(self.friction)
        limits = []
        # stuck, just after a reversal (dz/dt = 2 v), and sliding
        for gain in (1.0, 2.0, 0.0):
            stiffness = self.stiffness + gain * law.curve.K0
            damping = self.damping + gain * law.sigma1 + law.sigma2
            poles = np.roots([self.mass, damping, stiffness])
            limits += [longest_step(complex(pole)) for pole in poles]
        if law.form == packing.GMS:  # how fast a slipping element is drawn to the Stribeck curve
            limits.append(REAL_LIMIT * law.Fc / law.n)
        return min(limits)


def paper_rig() -> Rig:
    """The rig of the paper: 1 kg on 80 kN/m with Leuven friction, resonances near 59 Hz and 45 Hz.

    Returns
    -------
    Rig

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements": its table of parameters.

    Examples
    --------
    >>> round(float(np.sqrt(paper_rig().stiffness / paper_rig().mass) / (2 * np.pi)), 2)
    45.02
    """
    return Rig(mass=1.0, stiffness=80e3, friction=Leuven())


@value
class Motion:
    """What a run gave, sample by sample.

    Fields
    ------
    t : (n,) ndarray
        Time [s].
    drive : (n,) ndarray
        Force on the mass [N], or velocity of a prescribed motion [m/s].
    x, v, z : (n,) ndarray
        Position [m], velocity [m/s], and deflection of the friction [m].
    friction : (n,) ndarray
        Friction force [N].

    Examples
    --------
    >>> from nlfrf import paper_rig, run
    >>> motion = run(paper_rig(), np.zeros(4), fs=1000)
    >>> motion.t.tolist(), motion.x.tolist()
    ([0.0, 0.001, 0.002, 0.003], [0.0, 0.0, 0.0, 0.0])
    """

    t: np.ndarray
    drive: np.ndarray
    x: np.ndarray
    v: np.ndarray
    z: np.ndarray
    friction: np.ndarray


def run(rig: Rig, force: Any, *, fs: float, oversampling: int = 1, hold: str = "linear") -> Motion:
    """Run the rig from rest through any force, periodic or not.

    Parameters
    ----------
    rig : Rig
        The machine.
    force : (n,) ndarray
        Force on the mass [N].
    fs : float
        Sampling frequency [Hz].
    oversampling : int
        Integration steps per sample.
    hold : str
        The force between samples: "linear", or "zoh" (held).

    Returns
    -------
    Motion

    Raises
    ------
    ValueError
        A step too long to be stable, with the oversampling that would do; no sample.

    Examples
    --------
    A force below the static friction moves the mass by a few micrometres and does not set it free.

    >>> motion = run(paper_rig(), np.full(4000, 0.5), fs=4000.0)
    >>> bool(2e-6 < motion.x[-1] < 8e-6)
    True
    """
    samples = some_samples("force", force)
    fs = positive("fs", fs)
    oversampling = integer("oversampling", oversampling, least=1)
    one_of("hold", hold, ("linear", "zoh"))

    def attempt(steps: int) -> tuple[np.ndarray | None, packing.Memory]:
        memory = at_rest(rig)
        return advance(rig, memory, between_samples(samples, steps, hold), 1 / (fs * steps), steps), memory

    refuse_long_step(rig, fs, oversampling)
    warn_coarse(rig, fs, oversampling)
    out, memory = attempt(oversampling)
    if out is None:
        raise step_refusal(fs, oversampling, lambda steps: attempt(steps)[0] is not None)
    warn_lost(memory.state[packing.LOST])
    return motion(samples, out, fs)


def drive(friction: Friction, v: Any, *, fs: float, oversampling: int = 1) -> Motion:
    """Friction force for a prescribed motion, from rest: to draw hysteresis loops and Stribeck curves.

    Parameters
    ----------
    friction : Coulomb, Dahl, LuGre, Leuven or GeneralizedMaxwellSlip
        The friction law.
    v : (n,) ndarray
        Velocity [m/s], straight between samples.
    fs : float
        Sampling frequency [Hz].
    oversampling : int
        Integration steps per sample.

    Returns
    -------
    Motion
        With the velocity as its drive.

    Raises
    ------
    ValueError
        As in `run`.

    Examples
    --------
    At constant velocity the friction settles on the Stribeck curve, with the viscous part on top.

    >>> motion = drive(Leuven(), np.full(2000, 0.01), fs=10e3)
    >>> round(float(motion.friction[-1]), 4)
    0.8144
    """
    velocity = some_samples("v", v)
    fs = positive("fs", fs)
    oversampling = integer("oversampling", oversampling, least=1)
    law, grid = packed_law(friction)
    body = packing.Body(True, 1.0, 0.0, 0.0)

    def attempt(steps: int) -> tuple[np.ndarray | None, packing.Memory]:
        memory = packing.at_rest(law.curve, grid)
        samples = between_samples(velocity, steps, "linear")
        return integrate(body, law, grid, memory, samples, 1 / (fs * steps), steps), memory

    out, memory = attempt(oversampling)
    if out is None:
        raise step_refusal(fs, oversampling, lambda steps: attempt(steps)[0] is not None)
    warn_lost(memory.state[packing.LOST])
    return motion(velocity, out, fs)


def some_samples(name: str, signal: Any) -> np.ndarray:
    """The signal as an array of at least one sample."""
    samples = real_array(name, signal, ndim=1)
    if samples.size == 0:
        raise ValueError(f"{name} must hold at least one sample, got none")
    return samples


def motion(drive: np.ndarray, out: np.ndarray, fs: float) -> Motion:
    """What the integrator gave, as a value."""
    x, v, z, friction = out.T
    return Motion(t=np.arange(drive.size) / fs, drive=drive, x=x, v=v, z=z, friction=friction)


def at_rest(rig: Rig) -> packing.Memory:
    """The memory of a rig that has never moved."""
    law, grid = packed_law(rig.friction)
    return packing.at_rest(law.curve, grid)


def advance(rig: Rig, memory: packing.Memory, drive: np.ndarray, h: float, substeps: int) -> np.ndarray | None:
    """Integrate the rig over the (n, 3) force at begin, middle and end of each step, moving `memory` on."""
    law, grid = packed_law(rig.friction)
    body = packing.Body(False, float(rig.mass), float(rig.stiffness), float(rig.damping))
    return integrate(body, law, grid, memory, drive, h, substeps)


def between_samples(samples: np.ndarray, oversampling: int, hold: str) -> np.ndarray:
    """(n * oversampling, 3) force at the begin, middle and end of each step; the last sample is held."""
    step = np.arange(oversampling)[:, np.newaxis]
    fraction = (step + np.array([0.0, 0.5, 1.0])) / oversampling if hold == "linear" else np.zeros((oversampling, 3))
    rise = np.diff(samples, append=samples[-1])
    return (samples[:, np.newaxis, np.newaxis] + rise[:, np.newaxis, np.newaxis] * fraction).reshape(-1, 3)


def longest_step(pole: complex) -> float:
    """Longest step [s] with which the Runge-Kutta method keeps a mode with this pole from growing."""
    if abs(pole) == 0 or pole.real > 0:
        return np.inf
    direction = pole / abs(pole)

    def growth(length: float) -> float:
        q = length * direction
        return abs(1 + q + q**2 / 2 + q**3 / 6 + q**4 / 24)

    low, high = 0.0, 4.0  # along every ray into the left half plane growth passes 1 once before 4
    for _ in range(25):
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) <= 1 + 1e-12 else (low, middle)
    return low / abs(pole)


def refuse_long_step(rig: Rig, fs: float, oversampling: int) -> None:
    """Refuse a step with which the rig is unstable even before it slides."""
    longest = rig.stable_step
    if 1 / (fs * oversampling) > longest:
        raise ValueError(
            f"oversampling must be at least {int(np.ceil(1 / (fs * longest)))} for a stable integration step "
            f"of at most {longest:.3g} s at fs = {fs:g} Hz, got {oversampling}"
        )


def step_refusal(fs: float, oversampling: int, stable: Callable[[int], bool]) -> ValueError:
    """The refusal of a step that turned out too long in sliding, with one that was tried and would do."""
    enough, finer = "more than", oversampling
    for finer in (oversampling * 2**i for i in range(1, 10)):
        if stable(finer):
            enough = "about"
            break
    return ValueError(
        f"oversampling must be {enough} {finer} for a stable integration step in sliding "
        f"({1 / (fs * finer):.3g} s at fs = {fs:g} Hz), got {oversampling}"
    )


def warn_coarse(rig: Rig, fs: float, oversampling: int) -> None:
    """Warn where the step moves the pole of the stuck rig by more than 1 % of its damping: the resonance is wrong."""
    law, _ = packed_law(rig.friction)
    poles = np.roots([rig.mass, rig.damping + law.sigma1 + law.sigma2, rig.stiffness + law.curve.K0])
    pole = poles[np.argmax(np.abs(poles.imag))]
    if pole.imag == 0 or pole.real == 0:
        return
    # a Runge-Kutta step of fourth order is off by (h p)^5 / 120
    shift = np.abs(pole / pole.real) * (np.abs(pole) / (fs * oversampling)) ** 4 / 120
    if shift > COARSE:
        enough = int(np.ceil(oversampling * (shift / COARSE) ** 0.25))
        warnings.warn(
            f"the integration step is coarse: the resonance of the stuck rig comes out wrong by {100 * shift:.2g} %. "
            f"Take an oversampling of {enough}, or state the accuracy",
            DataWarning,
            stacklevel=3,
        )
