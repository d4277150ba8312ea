"""Reference, disturbance and noise of a loop as a user names them, and the spectrum that each of them has.

what the user writes                 spectrum
SineSignal, Multisine, periodic      lines: power of each sinusoid
NoiseSignal, a shaping filter        density: power per rad/s
StepSignal, a record from rest       none: a transient, which is simulated
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control
import numpy as np

from nlfrf import Multisine
from nlfrf.shared.arguments import nonnegative, positive, real, real_array
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.systems.lti import SAME_CLOCK, poles, refuse_other_clock, response, timebase
from robust.systems.realisation import state_space
from robust.systems.stability import stable

__all__ = [
    "Density",
    "Lines",
    "LoopSignals",
    "NoiseSignal",
    "SampledSignal",
    "SineSignal",
    "Spectrum",
    "StepSignal",
    "Transient",
    "find_spectrum",
]


@value(kw_only=False)
class SineSignal:
    """A sinusoid in a loop.

    Fields
    ------
    amplitude : float
        Its peak, in the unit of the signal.
    omega : float
        Its frequency [rad/s].

    Raises
    ------
    ValueError
        An amplitude below zero, a frequency that is not positive.

    References
    ----------
    SP 2.1 (frequency response).

    Examples
    --------
    >>> SineSignal(0.5, 20.0).amplitude
    0.5
    """

    amplitude: float
    omega: float

    def __post_init__(self) -> None:
        nonnegative("amplitude", self.amplitude)
        positive("omega", self.omega)


@value(kw_only=False)
class NoiseSignal:
    """Noise in a loop, of constant power density between two frequencies and none elsewhere.

    Fields
    ------
    rms : float
        Its root mean square, in the unit of the signal.
    omega_min, omega_max : float
        Its band [rad/s]; without omega_max up to the Nyquist frequency of a sampled loop.

    Raises
    ------
    ValueError
        An rms below zero, a band that is empty.

    References
    ----------
    K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 4.

    Examples
    --------
    >>> NoiseSignal(0.1, omega_max=600.0).omega_min
    0.0
    """

    rms: float
    omega_min: float = 0.0
    omega_max: float = float("nan")

    def __post_init__(self) -> None:
        nonnegative("rms", self.rms)
        nonnegative("omega_min", self.omega_min)
        if not np.isnan(real_or_nan("omega_max", self.omega_max)) and self.omega_max <= self.omega_min:
            raise ValueError(f"omega_max must lie above omega_min, {self.omega_min:g} rad/s, got {self.omega_max:g}")


@value(kw_only=False)
class StepSignal:
    """A step in a loop at rest.

    Fields
    ------
    height : float
        In the unit of the signal.

    Raises
    ------
    ValueError
        A height that is not one finite real number.

    References
    ----------
    SP 2.4.1.

    Examples
    --------
    >>> StepSignal(1e-3).height
    0.001
    """

    height: float

    def __post_init__(self) -> None:
        real("height", self.height)


@value(kw_only=False)
class SampledSignal:
    """Samples of a signal in a loop, as they were measured or planned.

    Fields
    ------
    samples : (n,) ndarray
        In the unit of the signal.
    fs : float
        Sampling frequency [Hz]; that of the controller where it is sampled.
    periodic : bool
        True: the samples are one period of a signal that goes on for ever. False: the loop is at rest before them.

    Raises
    ------
    ValueError
        Samples that are not finite real numbers, or fewer than two of them.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3.

    Examples
    --------
    >>> SampledSignal(np.sin(np.arange(100) * 0.1), fs=1000).periodic
    False
    """

    samples: np.ndarray
    fs: float
    periodic: bool = False

    def __post_init__(self) -> None:
        if real_array("samples", self.samples, ndim=1).size < 2:
            raise ValueError(f"samples must be at least two, got {self.samples.size}")
        positive("fs", self.fs)


#: What can be named as a signal, for messages.
KINDS = (
    "a SineSignal, NoiseSignal, StepSignal, SampledSignal, nlfrf.Multisine, or a stable system that shapes white noise"
)


@value
class LoopSignals:
    """What acts on a loop u = K (r - y - n), y = G (u + d): each of them or none.

    Fields
    ------
    reference, disturbance, noise : signal or None
        r and n in the unit of y, d in the unit of u at the plant input. Each is a `SineSignal`, `NoiseSignal`,
        `StepSignal`, `SampledSignal`, an `nlfrf.Multisine` that repeats, or a control system that shapes white noise:
        of variance one per sample where it is sampled, of intensity one (two-sided density) where it is continuous.

    Raises
    ------
    ValueError
        No signal at all, or something that is none; a filter that is not stable.

    References
    ----------
    SP 2.2.1 (the loop), K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 4 (shaping filters).

    Examples
    --------
    >>> signals = LoopSignals(reference=StepSignal(1e-3), noise=NoiseSignal(1e-7))
    >>> sorted(signals.named())
    ['noise', 'reference']
    """

    reference: Any = None
    disturbance: Any = None
    noise: Any = None

    def __post_init__(self) -> None:
        if not self.named():
            raise ValueError("reference, disturbance or noise must be given, got none of them")
        for name, signal in self.named().items():
            if isinstance(signal, (SineSignal, NoiseSignal, StepSignal, SampledSignal)):
                continue
            if isinstance(signal, Multisine):
                continue
            if not isinstance(signal, (control.StateSpace, control.TransferFunction)):
                raise ValueError(f"{name} must be {KINDS}, got {shown(signal)}")
            shaping = state_space(name, signal)
            if not stable(shaping):
                raise ValueError(
                    f"{name} must be shaped by a stable system, got poles {poles(shaping)}: its noise has no finite "
                    "rms. Use a slow pole in place of an integrator."
                )
            object.__setattr__(self, name, shaping)

    def named(self) -> dict[str, Any]:
        """Those that are there, by name."""
        every = {"reference": self.reference, "disturbance": self.disturbance, "noise": self.noise}
        return {name: signal for name, signal in every.items() if signal is not None}


@value
class Lines:
    """A periodic signal without its mean: frequencies [rad/s] and power (rms^2) of its sinusoids."""

    omega: np.ndarray
    power: np.ndarray


@value
class Density:
    """A stationary random signal: power per rad/s over the frequencies from low to high [rad/s].

    Fields
    ------
    of : callable
        Frequencies (W,) -> density (W,).
    low, high : float
        Where it is not zero; high may be infinite.
    places : (n,) ndarray
        Frequencies where it bends.
    direct : float
        The density that it keeps at infinite frequency.
    """

    of: Callable[[np.ndarray], np.ndarray]
    low: float
    high: float
    places: np.ndarray
    direct: float


@value
class Transient:
    """A signal that meets the loop at rest: a step of the given height, or samples at fs [Hz]."""

    height: float = float("nan")
    samples: Any = None
    fs: float = float("nan")


Spectrum = Lines | Density | Transient


def find_spectrum(name: str, signal: Any, dt: float) -> Spectrum:
    """The spectrum of a signal in a loop of sampling time dt (0: continuous), or a refusal where it has none there."""
    if isinstance(signal, StepSignal):
        return Transient(height=float(signal.height))
    if isinstance(signal, SampledSignal):
        if dt and abs(signal.fs * dt - 1) > SAME_CLOCK:
            raise ValueError(
                f"{name} must have the sampling frequency of the controller, {1 / dt:g} Hz, got {signal.fs:g} Hz. "
                "Resample it, with a filter where it holds more than half of that"
            )
        return periodic_lines(signal) if signal.periodic else Transient(samples=signal.samples, fs=float(signal.fs))
    if isinstance(signal, SineSignal):
        return below_nyquist(
            name, Lines(omega=np.array([signal.omega]), power=np.array([signal.amplitude * signal.amplitude / 2])), dt
        )
    if isinstance(signal, Multisine):
        return below_nyquist(name, Lines(omega=2 * np.pi * signal.f, power=signal.amplitude**2 / 2), dt)
    if isinstance(signal, NoiseSignal):
        return band_density(name, signal, dt)
    return shaped_density(name, signal, dt)


def periodic_lines(signal: SampledSignal) -> Lines:
    """The sinusoids of one period of samples; at the Nyquist frequency one sample tells the whole power."""
    n = signal.samples.size
    power = 2 * np.abs(np.fft.rfft(signal.samples) / n) ** 2
    if n % 2 == 0:
        power[-1] /= 2
    return Lines(omega=2 * np.pi * signal.fs / n * np.arange(1, power.size), power=power[1:])


def below_nyquist(name: str, lines: Lines, dt: float) -> Lines:
    """The lines, or a refusal where a sampled loop would see them as others."""
    if dt and lines.omega.max() * dt > np.pi:
        raise ValueError(
            f"{name} must lie below the Nyquist frequency of the controller, {np.pi / dt:g} rad/s, got a line at "
            f"{lines.omega.max():g} rad/s: it would come back as a lower one"
        )
    return lines


def band_density(name: str, signal: NoiseSignal, dt: float) -> Density:
    """Constant power density over a band."""
    high = signal.omega_max
    if np.isnan(high):
        if not dt:
            raise ValueError(
                f"{name} must end at a frequency (omega_max) in a continuous loop, got none: its rms is infinite"
            )
        high = np.pi / dt
    if dt and max(high * dt, signal.omega_min * dt * (1 + 1e-6)) > np.pi * (1 + 1e-9):
        raise ValueError(
            f"{name} must lie below the Nyquist frequency of the controller, {np.pi / dt:g} rad/s, got a band up to "
            f"{max(high, signal.omega_min):g} rad/s"
        )
    density = signal.rms * signal.rms / (high - signal.omega_min)
    return Density(
        of=lambda omega: np.full(np.shape(omega), density),
        low=signal.omega_min,
        high=high,
        places=np.zeros(0),
        direct=0.0,
    )


def shaped_density(name: str, shaping: control.StateSpace, dt: float) -> Density:
    """White noise through a filter: T |F|^2 / pi up to Nyquist where sampled, |F|^2 / pi where continuous."""
    refuse_other_clock(name, shaping, "the loop", dt)
    scale = (dt or 1.0) / np.pi
    roots = poles(shaping)
    places = np.abs(np.log(roots[roots != 0].astype(complex))) / dt if timebase(shaping) else np.abs(roots)
    return Density(
        of=lambda omega: scale * np.abs(response(shaping, omega)) ** 2,
        low=0.0,
        high=np.pi / dt if dt else np.inf,
        places=places,
        direct=float(scale * shaping.D[0, 0] ** 2),
    )


def real_or_nan(name: str, number: Any) -> float:
    """A real number, or nan for one that was not given."""
    return float("nan") if isinstance(number, float) and np.isnan(number) else real(name, number)
