"""The balance of forces of a machine with friction along measured motions, for a candidate machine.

The motion of every level is measured. The force of a Maxwell element along a known motion is known
up to its stiffness, so no candidate is simulated. At every line the balance of forces

    E U = (k - m w^2 + j c w) Y + sum_i k_i F_i,      E = exp(-j w tau) / (1 + j w T)

is linear in m, c, k and the stiffnesses k_i. F_i is the spectrum, with all harmonics, of the force
along the measured motion of an element of unit stiffness that breaks away at D_i. The break-away
displacements, the stiction, the Stribeck velocity, the delay tau and the lag T come from
Gauss-Newton steps. Excited and detection lines count equally.

Distortion is not noise here: along the measured motion the elements distort as the friction of the
machine did, so no average over realisations is needed.

A load behind the motor adds its reaction N on the right, as one more element. The motion of the
motor is measured, so the load is a mass m2 with its own elements, moved through a spring k and a
damper c,

    N = k (y - y2) + c (y' - y2') = m2 y2'' + c2 y2' + F2(y2),

and the second period of a simulation from rest is N, except for a decayed transient (see
`reaction_of_load`).

The loop may be open or closed: U is the commanded force, whatever commands it. The regressors
contain noise of the position. Therefore lines are weighted by their residual, and the motion is
shrunk according to the difference between periods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.fft import next_fast_len

import nlfrf
from nlfrf._base.values import ArrayField, value
from robust.friction.reading.numbers import NumbersRead
from robust.lti.sampling import hold_correction

#: Steps of the motion per sample of the record, because the motion reverses and slips between
#: samples: for the search of elements, for the search of other minima around the first, and for the
#: final numbers.
COARSE, MEDIUM, FINE = 2, 4, 8
#: Largest number of these in a cycle of the highest line: more change neither the end of the search
#: nor the numbers.
STEPS_PER_CYCLE = 13.5
#: Factor on the noise variance by which the power of a motion is shrunk.
SHRINKAGE = 2.0
_WINDOW = 31  # lines of a window for the smoothing of a variance
#: Model error relative to the rms of the force on the lines of a level; a floor of every weight.
MODEL_ERROR = 0.002


@value
class Motion:
    """Measurement at one level: force and position on the lines, and the motion in time.

    Fields
    ------
    omega : (W,) ndarray
        Lines [rad/s].
    U, Y : (M, W) complex ndarray
        Force, corrected for its hold, and position.
    noise : (M, W) ndarray
        Variance of Y due to noise.
    excited : (W,) ndarray of bool
        True for excited lines.
    x, v : (M, n) ndarray
        One period of the motion [m], [m/s].
    fs : float
        Sampling frequency of x and v [Hz].
    lines : (W,) int ndarray
        Numbers of the lines.
    centred : bool
        True if the elements start in the middle of the swing, and not at the start of the period
        (see `with_branches`).
    """

    omega: np.ndarray
    U: np.ndarray
    Y: np.ndarray
    noise: np.ndarray
    excited: np.ndarray
    x: np.ndarray
    v: np.ndarray
    fs: float
    lines: np.ndarray
    centred: bool = False

    @property
    def force(self) -> float:
        """Rms of the force on the lines [N]."""
        return float(np.sqrt((np.abs(self.U) ** 2).sum(axis=1).mean() / 2))

    @property
    def half_swing(self) -> float:
        """Half of the distance between the outermost turning points [m]."""
        return float(np.ptp(self.x, axis=1).max() / 2)


#: Parameters of a load: mass, spring and damper between motor and load, viscous friction, excess of
#: stiction and velocity of Stribeck.
LOAD = (
    "log_load_mass",
    "log_coupling",
    "log_coupling_damping",
    "load_damping",
    "load_log_excess",
    "load_log_vs",
)

#: Numbers of two masses that are known from motion. They are held in the first steps, because the
#: weights of a start are wrong: with all numbers free at once two axes of eleven ended with a load
#: 10 % too light.
KNOWN_IN_MOTION = ("mass", "delay", *LOAD[:3])


@value
class Terms:
    """Terms of the balance besides mass, damping and elements: spring, softening (w^4), lag,
    stiction, load.
    """

    spring: bool
    softening: bool = False
    lag: bool = False
    stiction: bool = False
    load: bool = False

    @property
    def linear(self) -> tuple[str, ...]:
        """Names of the terms that are linear in the motion."""
        return ("mass", "damping", *["stiffness"] * self.spring, *["softening"] * self.softening)

    @property
    def nonlinear(self) -> tuple[str, ...]:
        """Names of the other terms, without the elements."""
        stiction = ["log_excess", "log_vs"] * self.stiction
        return ("delay", *["lag_squared"] * self.lag, *stiction, *(LOAD if self.load else ()))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, without the elements."""
        return (*self.linear, *self.nonlinear)


@value
class Candidate:
    """A machine: numbers of the terms by name, and stiffness and break-away displacement of its
    elements.

    With a load, `mass`, `damping`, `stiffness` and `breakaway` are those of the motor,
    `load_stiffness` and `load_breakaway` those of the elements of the load.
    """

    terms: Terms
    numbers: dict[str, float]
    stiffness: np.ndarray
    breakaway: np.ndarray
    load_stiffness: ArrayField = ()
    load_breakaway: ArrayField = ()

    @property
    def stiction(self) -> float:
        """Largest over smallest force of a slider."""
        if self.terms.stiction:
            return 1 + float(np.exp(self.numbers["log_excess"]))
        return 1.0

    @property
    def vs(self) -> float:
        """Stribeck velocity [m/s]."""
        if self.terms.stiction:
            return float(np.exp(self.numbers["log_vs"]))
        return np.inf

    @property
    def load_sliders(self) -> nlfrf.friction.VaryingSliders | None:
        """Friction of the load as a law; None without elements at the load."""
        if not np.size(self.load_stiffness):
            return None
        k, D = np.asarray(self.load_stiffness), np.asarray(self.load_breakaway)
        excess, vs = (
            float(np.exp(self.numbers[name])) for name in ("load_log_excess", "load_log_vs")
        )
        return nlfrf.friction.VaryingSliders(
            stiffness=k, strength=k * D, stiction=1 + excess, vs=vs
        )

    @property
    def all_elements(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and break-away displacement of all elements, at motor and load."""
        return np.append(self.stiffness, self.load_stiffness), np.append(
            self.breakaway, self.load_breakaway
        )


def motion_of_record(
    record: nlfrf.Record, upsampling: float, shrinkage: float = SHRINKAGE, per_cycle: float = np.inf
) -> Motion:
    """Return the mean period of a record: spectra on the lines of the band, and the motion between
    the samples.

    per_cycle : largest number of steps in a cycle of the highest line, for a record with more
    samples in it.
    """
    u, y = np.asarray(record.u), np.asarray(record.y)
    M, P, N = u.shape
    f0 = record.fs / N
    U, Y = (2 / N * np.fft.rfft(one, axis=-1) for one in (u, y))
    mean = Y.mean(axis=1)
    noise = np.zeros(mean.shape)
    if P > 1:
        spread = (np.abs(Y - mean[:, np.newaxis]) ** 2).sum(axis=1) / (P - 1) / P
        noise = np.stack([smoothed(one) for one in spread])
    gain = np.clip(
        1 - shrinkage * noise / np.maximum(np.abs(mean) ** 2, np.finfo(float).tiny), 0.0, 1.0
    )
    shrunk = mean * gain
    shrunk[:, 0] = 0.0  # the elements do not depend on the mean position
    shrunk[:, -1] = 0.0
    excited = np.asarray(record.lines.excited)
    n = next_fast_len(
        int(min(upsampling * N, max(per_cycle * excited[-1], 2 * excited[-1] + 2))), real=True
    )
    padded = np.zeros((M, n // 2 + 1), dtype=complex)
    held = min(shrunk.shape[1], padded.shape[1])
    padded[:, :held] = shrunk[:, :held] * n / 2
    grid = 2j * np.pi * f0 * np.arange(padded.shape[1])
    lines = np.arange(excited[0], excited[-1] + 1)
    if np.all(excited % 2 == 1):  # even lines contain noise alone
        lines = lines[lines % 2 == 1]
    omega = 2 * np.pi * f0 * lines
    hold = hold_correction(omega, record.hold, fs=record.fs, dt=0.0)
    return Motion(
        omega=omega,
        U=U.mean(axis=1)[:, lines] / hold,
        Y=mean[:, lines],
        noise=noise[:, lines],
        excited=np.isin(lines, excited),
        x=np.fft.irfft(padded, n=n, axis=-1),
        v=np.fft.irfft(grid * padded, n=n, axis=-1),
        fs=f0 * n,
        lines=lines,
    )


def smoothed(values: np.ndarray) -> np.ndarray:
    half = min(_WINDOW // 2, values.size - 1)
    return np.convolve(
        np.pad(values, half, mode="reflect"), np.full(2 * half + 1, 1 / (2 * half + 1)), "valid"
    )


def element_spectra(
    motion: Motion, breakaway: np.ndarray, *, stiction: float, vs: float
) -> np.ndarray:
    """Return (E, M, W) spectra, as peak amplitudes, of E elements of unit stiffness along M
    motions, on W lines.

    Each motion is run twice; the second run is the steady state. `breakaway` (E,) are
    displacements.
    """
    if not breakaway.size:
        return np.zeros((0, *motion.U.shape), dtype=complex)
    sliders = nlfrf.friction.VaryingSliders(
        stiffness=np.ones(breakaway.size), strength=breakaway, stiction=stiction, vs=vs
    )
    n = motion.x.shape[1]
    found = np.empty((breakaway.size, *motion.U.shape), dtype=complex)
    for m, (x, v) in enumerate(zip(motion.x, motion.v, strict=True)):
        if motion.centred:
            first = [(x.max() + x.min()) / 2]
        else:
            first = []
        path, speed = np.concatenate([first, x, x]), np.concatenate([np.zeros(len(first)), v, v])
        forces = nlfrf.friction.element_forces(sliders, path, speed, fs=motion.fs)
        found[:, m] = 2 / n * np.fft.rfft(forces[:, -n:], axis=-1)[:, motion.lines]
    return found


def reaction_of_load(motion: Motion, candidate: Candidate) -> np.ndarray:
    """Return (M, W) reaction force of the load on the motion of the motor; zero without a load.

    A load without elements, whose friction slides, is linear. Otherwise it starts from rest, and
    its second period is taken. The transient of the first period has then decayed at least by
    exp(-c/(2 m2) T), which is 1e-3 or less on the presets of `nlfrf.servo_axis`.
    """
    if candidate.terms.load:
        return _follow_load(motion, candidate)[0]
    return np.zeros(motion.U.shape, dtype=complex)


def _follow_load(motion: Motion, candidate: Candidate, *, slopes: bool = False) -> np.ndarray:
    """Return (1, M, W) force of the load; with slopes (1 + p, M, W), with derivatives by `LOAD` and
    by its elements.
    """
    numbers, sliders = candidate.numbers, candidate.load_sliders
    mass, k, c = (float(np.exp(numbers[name])) for name in LOAD[:3])
    if sliders is None:
        s, none = 1j * motion.omega, np.zeros(motion.omega.size)
        link, inertia = k + s * c, s * numbers["load_damping"] + s**2 * mass
        by_link, by_inertia = (inertia / (link + inertia)) ** 2, (link / (link + inertia)) ** 2
        found = [
            link * inertia / (link + inertia),
            s**2 * mass * by_inertia,
            k * by_link,
            s * c * by_link,
        ]
        return np.stack([*found, s * by_inertia, none, none])[:, np.newaxis] * motion.Y
    forces = [
        nlfrf.friction.load_forces(
            sliders,
            x,
            v,
            mass=mass,
            stiffness=k,
            damping=c,
            viscous=numbers["load_damping"],
            fs=motion.fs,
            slopes=slopes,
        )
        for x, v in zip(motion.x, motion.v, strict=True)
    ]
    return np.stack(
        [2 / motion.x.shape[1] * np.fft.rfft(one)[:, motion.lines] for one in forces], axis=1
    )


def force_of_motion(machine: NumbersRead, omega: np.ndarray, damping: float) -> np.ndarray:
    """Return (W,) force over motor position without friction [N/m], with the viscous friction at
    the motor.
    """
    s, load = 1j * omega, machine.load_mass
    found = s * damping + s**2 * (machine.mass - load)
    if load:
        link = machine.coupling + s * machine.coupling_damping
        found = found + link * s**2 * load / (link + s**2 * load)
    return np.asarray(found)


def linear_columns(motion: Motion, terms: Terms) -> list[np.ndarray]:
    """Return (M, W) column of each linear term of the motion."""
    omega, Y = motion.omega, motion.Y
    columns = {
        "mass": -(omega**2) * Y,
        "damping": 1j * omega * Y,
        "stiffness": Y,
        "softening": -(omega**4) * Y,
    }
    return [columns[name] for name in terms.linear]


def actuated_force(motion: Motion, numbers: dict[str, float]) -> np.ndarray:
    """Return (M, W) force after its delay and lag."""
    s = 1j * motion.omega
    lag = np.sqrt(max(0.0, numbers.get("lag_squared", 0.0)))
    # the delay includes the lag: the two are hard to separate, and their sum is well determined
    return np.asarray(motion.U * np.exp(-s * (numbers["delay"] - lag)) / (1 + s * lag))


def pack(candidate: Candidate) -> np.ndarray:
    """Return the parameters as one vector, with the logarithms of the elements."""
    numbers = [candidate.numbers[name] for name in candidate.terms.names]
    elements = (
        candidate.stiffness,
        candidate.breakaway,
        candidate.load_stiffness,
        candidate.load_breakaway,
    )
    return np.concatenate([numbers, *(np.log(one) for one in elements)])


def unpack(x: np.ndarray, like: Candidate) -> Candidate:
    """Return the candidate of a vector, with the terms and the number of elements of another
    candidate.
    """
    names, n = like.terms.names, like.stiffness.size
    elements = np.exp(x[len(names) :])
    return replace(
        like,
        numbers=dict(zip(names, x[: len(names)].tolist(), strict=True)),
        stiffness=elements[:n],
        breakaway=elements[n : 2 * n],
        load_stiffness=elements[2 * n :][: np.size(like.load_stiffness)],
        load_breakaway=elements[2 * n :][np.size(like.load_stiffness) :],
    )


def spectra_of(motion: Motion, candidate: Candidate) -> np.ndarray:
    """Return (E, M, W) spectra of the elements of a candidate at the motor, of unit stiffness."""
    return element_spectra(
        motion, candidate.breakaway, stiction=candidate.stiction, vs=candidate.vs
    )


def residual_of(
    motion: Motion, candidate: Candidate, spectra: np.ndarray | None = None
) -> np.ndarray:
    """Return (M, W) the force that the candidate does not explain; `spectra` are its `spectra_of`,
    if known.
    """
    left = actuated_force(motion, candidate.numbers)
    for name, column in zip(
        candidate.terms.linear, linear_columns(motion, candidate.terms), strict=True
    ):
        left = left - candidate.numbers[name] * column
    if spectra is None:
        spectra = spectra_of(motion, candidate)
    return np.asarray(
        left
        - np.tensordot(candidate.stiffness, spectra, axes=1)
        - reaction_of_load(motion, candidate)
    )


#: Relative steps of the derivatives. A break-away displacement is determined to 1e-3 and better:
#: with steps of 2 %, ten standard deviations, the fit stopped up to 10 in -2 log likelihood above
#: its minimum (linear motor preset). From 2e-3 to 5e-4 its results are equal.
STEP = 2e-3


def slopes_of(
    motion: Motion, candidate: Candidate, spectra: np.ndarray | None = None
) -> np.ndarray:
    """Return (M, W, p) derivatives of the residual by the parameters; `spectra` are its
    `spectra_of`, if known.
    """
    omega, terms, numbers, D = motion.omega, candidate.terms, candidate.numbers, candidate.breakaway
    columns = [-one for one in linear_columns(motion, terms)]
    force = actuated_force(motion, numbers)
    columns.append(-1j * omega * force)
    if terms.lag:
        columns.append(-(omega**2) / 2 * force)  # to first order in T^2
    if spectra is None:
        base = spectra_of(motion, candidate)
    else:
        base = spectra
    if terms.stiction:
        ahead = np.exp(STEP)
        for stiction, vs in (
            (1 + (candidate.stiction - 1) * ahead, candidate.vs),
            (candidate.stiction, candidate.vs * ahead),
        ):
            moved = element_spectra(motion, D, stiction=stiction, vs=vs)
            columns.append(-np.tensordot(candidate.stiffness, moved - base, axes=1) / STEP)
    if terms.load:
        of_load = list(-_follow_load(motion, candidate, slopes=True)[1:])
    else:
        of_load = []
    columns += of_load[: len(LOAD)]
    wider = element_spectra(motion, D * np.exp(STEP), stiction=candidate.stiction, vs=candidate.vs)
    narrower = element_spectra(
        motion, D * np.exp(-STEP), stiction=candidate.stiction, vs=candidate.vs
    )
    weight = candidate.stiffness[:, np.newaxis, np.newaxis]
    columns += [
        *(-weight * base),
        *(-weight * (wider - narrower) / (2 * STEP)),
        *of_load[len(LOAD) :],
    ]
    return np.stack(columns, axis=-1)


def as_real(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Return real and imaginary parts of several levels as one array; a third axis is kept."""
    flat = [part.reshape(-1, *part.shape[2:]) for part in parts]
    stacked = np.concatenate(flat)
    return np.concatenate([stacked.real, stacked.imag])
