"""Predict at which level a loop moves the machine, and compare that with the levels at which it was measured.

    r --->(+)- e ->[ K ]--(+)--- u -->[ G ]--(+)--> y        from r and n:  u = K S r,  y = G K S r
          -^               ^d                 |              from d:        u = S d,    y = G S d
           +------------------------(+)<------+
                                     ^n

A best linear approximation holds at its level: a machine with friction that moves more slides more, one that moves
less sticks. u is the whole plant input, as in the record; y is the plant output, without the noise of its sensor.
Spectra go through the closed-loop gains of the nominal plant, and through the largest gain that any plant of the set
has at each frequency. That is an upper bound for every plant of the set: none need be the worst at all frequencies.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla, Multisine
from nlfrf._base.arguments import (
    require_kind,
    require_nonnegative,
    require_positive,
    require_real,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust._base.channels import is_single
from robust._base.types import Controller, LinearSystem
from robust.analysis.curves import Curves
from robust.analysis.loop import Loop, assemble_loop, decide_nominal_stability
from robust.analysis.performance import simulate_samples, simulate_step
from robust.lti.connections import worst_sensitivity
from robust.lti.lti import SAMPLING_TOLERANCE, poles, replace_infinite, require_sampling_time, response, timebase
from robust.lti.realisation import state_space
from robust.lti.stability import is_stable
from robust.models.sets.forms import plant_numerator
from robust.models.sets.model import UncertaintyModel, require_one_channel
from robust.models.sets.records import rms_levels

# ---- Reference, disturbance and noise of a loop as a user names them, and the spectrum that each of them has.
#
# what the user writes                 spectrum
# SineSignal, Multisine, periodic      lines: power of each sinusoid
# NoiseSignal, a shaping filter        density: power per rad/s
# StepSignal, a record from rest       none: a transient, which is simulated


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
        require_nonnegative("amplitude", self.amplitude)
        require_positive("omega", self.omega)


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
        require_nonnegative("rms", self.rms)
        require_nonnegative("omega_min", self.omega_min)
        if not np.isnan(require_real_or_nan("omega_max", self.omega_max)) and self.omega_max <= self.omega_min:
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
        require_real("height", self.height)


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
        if require_real_array("samples", self.samples, ndim=1).size < 2:
            raise ValueError(f"samples must be at least two, got {self.samples.size}")
        require_positive("fs", self.fs)


#: What can be named as a signal, for messages.
SIGNAL_KINDS = (
    "a SineSignal, NoiseSignal, StepSignal, SampledSignal, nlfrf.Multisine, or a stable system that shapes white noise"
)


Signal: TypeAlias = "SineSignal | NoiseSignal | StepSignal | SampledSignal | Multisine | LinearSystem"


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

    reference: Signal | None = None
    disturbance: Signal | None = None
    noise: Signal | None = None

    def __post_init__(self) -> None:
        if not self.named():
            raise ValueError("reference, disturbance or noise must be given, got none of them")
        for name, signal in self.named().items():
            if isinstance(signal, (SineSignal, NoiseSignal, StepSignal, SampledSignal)):
                continue
            if isinstance(signal, Multisine):
                continue
            if not isinstance(signal, (control.StateSpace, control.TransferFunction)):
                raise ValueError(f"{name} must be {SIGNAL_KINDS}, got {short_form(signal)}")
            shaping = state_space(name, signal)
            if not is_stable(shaping):
                raise ValueError(
                    f"{name} must be shaped by a stable system, got poles {poles(shaping)}: its noise has no finite "
                    "rms. Use a slow pole in place of an integrator."
                )
            object.__setattr__(self, name, shaping)

    def named(self) -> dict[str, Signal]:
        """Return those that are there, by name."""
        every = {"reference": self.reference, "disturbance": self.disturbance, "noise": self.noise}
        return {name: signal for name, signal in every.items() if signal is not None}


@value
class LineSpectrum:
    """Hold a periodic signal without its mean: frequencies [rad/s] and power (rms^2) of its sinusoids."""

    omega: np.ndarray
    power: np.ndarray


@value
class PowerDensity:
    """Hold a stationary random signal: power per rad/s over the frequencies from low to high [rad/s].

    Fields
    ------
    of : callable
        Frequencies (W,) -> density (W,).
    low, high : float
        The band outside which it is zero; high may be infinite.
    places : (n,) ndarray
        Its corner frequencies [rad/s].
    direct : float
        The density that it keeps at infinite frequency.
    """

    density: Callable[[np.ndarray], np.ndarray]
    low: float
    high: float
    corner_frequencies: np.ndarray
    density_at_infinity: float


@value
class Transient:
    """Hold a signal that acts on a loop at rest: a step of the given height, or samples at fs [Hz]."""

    height: float = float("nan")
    samples: np.ndarray | None = None
    fs: float = float("nan")


Spectrum = LineSpectrum | PowerDensity | Transient


def find_spectrum(name: str, signal: Signal, dt: float) -> Spectrum:
    """Return a signal of a loop of sampling time dt (0: continuous) as lines, as a power density, or as a transient.

    signal is a step, samples of one period, a sine, a multisine, noise in a band, or a shaping filter of white noise.
    """
    if isinstance(signal, StepSignal):
        return Transient(height=float(signal.height))
    if isinstance(signal, SampledSignal):
        if dt and abs(signal.fs * dt - 1) > SAMPLING_TOLERANCE:
            raise ValueError(
                f"{name} must have the sampling frequency of the controller, {1 / dt:g} Hz, got {signal.fs:g} Hz. "
                "Resample it, with a filter where it holds more than half of that"
            )
        return periodic_lines(signal) if signal.periodic else Transient(samples=signal.samples, fs=float(signal.fs))
    if isinstance(signal, SineSignal):
        return require_below_nyquist(
            name,
            LineSpectrum(omega=np.array([signal.omega]), power=np.array([signal.amplitude * signal.amplitude / 2])),
            dt,
        )
    if isinstance(signal, Multisine):
        return require_below_nyquist(name, LineSpectrum(omega=2 * np.pi * signal.f, power=signal.amplitude**2 / 2), dt)
    if isinstance(signal, NoiseSignal):
        return band_density(name, signal, dt)
    return shaped_density(name, signal, dt)


def periodic_lines(signal: SampledSignal) -> LineSpectrum:
    """Return the sinusoids of one period of samples; at the Nyquist frequency one sample tells the whole power."""
    n = signal.samples.size
    power = 2 * np.abs(np.fft.rfft(signal.samples) / n) ** 2
    if n % 2 == 0:
        power[-1] /= 2
    return LineSpectrum(omega=2 * np.pi * signal.fs / n * np.arange(1, power.size), power=power[1:])


def require_below_nyquist(name: str, lines: LineSpectrum, dt: float) -> LineSpectrum:
    """Return the lines, refused above the Nyquist frequency, where a sampled loop would see them at others."""
    if dt and lines.omega.max() * dt > np.pi:
        raise ValueError(
            f"{name} must lie below the Nyquist frequency of the controller, {np.pi / dt:g} rad/s, got a line at "
            f"{lines.omega.max():g} rad/s: it would come back as a lower one"
        )
    return lines


def band_density(name: str, signal: NoiseSignal, dt: float) -> PowerDensity:
    """Return the constant density of noise of a given rms over its band [rad/s]; an open end is Nyquist."""
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
    return PowerDensity(
        density=lambda omega: np.full(np.shape(omega), density),
        low=signal.omega_min,
        high=high,
        corner_frequencies=np.zeros(0),
        density_at_infinity=0.0,
    )


def shaped_density(name: str, shaping: control.StateSpace, dt: float) -> PowerDensity:
    """Return the density of filtered white noise: T |F|^2 / pi up to Nyquist where sampled, else |F|^2 / pi."""
    require_sampling_time(name, shaping, reference="the loop", wanted=dt)
    scale = (dt or 1.0) / np.pi
    roots = poles(shaping)
    places = np.abs(np.log(roots[roots != 0].astype(complex))) / dt if timebase(shaping) else np.abs(roots)
    return PowerDensity(
        density=lambda omega: scale * np.abs(response(shaping, omega)) ** 2,
        low=0.0,
        high=np.pi / dt if dt else np.inf,
        corner_frequencies=places,
        density_at_infinity=float(scale * shaping.D[0, 0] ** 2),
    )


def require_real_or_nan(name: str, number: object) -> float:
    """Return a real number, or nan for one that was not given."""
    return float("nan") if isinstance(number, float) and np.isnan(number) else require_real(name, number)


#: Factor by which a level may lie outside the measured ones and still count as one of them: one record has one
#: level. A convention: between 0.1 and 2.5 N a factor of 1.5 moves the resonance of the built-in rig by 1 to 6 %.
LEVEL_TOLERANCE = 1.5
#: A step as the sinusoid of the same swing: the friction of a swing is that of its amplitude (describing functions).
RMS_OF_SWING = 1 / np.sqrt(8)
#: Share of the power in the measured band from which on the report does not mention the rest.
MIN_SHARE_IN_BAND = 0.5
#: Relative accuracy of an integrated power, nodes of a panel, and how often a panel is halved.
INTEGRATION_TOLERANCE, PANEL_NODES, MAX_HALVINGS = 1e-7, 5, 40


class LevelState(enum.Enum):
    """Where a predicted rms lies against the measured ones, with a factor of 1.5 left to either side.

    Fields
    ------
    INSIDE, BELOW, ABOVE : among the levels measured, below all, above all.
    UNKNOWN : no level was measured, or the record did not keep it.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4: a BLA holds for one class
    of excitations.

    Examples
    --------
    >>> LevelState("above") is LevelState.ABOVE
    True
    """

    INSIDE = "inside"
    BELOW = "below"
    ABOVE = "above"
    UNKNOWN = "unknown"


@value
class SignalLevel:
    """What one signal of a loop does to the plant.

    Fields
    ------
    name : str
        "reference", "disturbance" or "noise".
    u, y : float
        Rms of the plant input and output by it, of the nominal loop [unit of u, unit of y]; means are left out. Of a
        step that of the sinusoid with the same swing, of a record from rest that over its duration.
    u_worst, y_worst : float
        Upper bound of these over the set; inf where the set holds an unstable loop, nan of a transient.
    u_in_band, y_in_band : float
        Share of that power in the measured band; nan of a transient.

    References
    ----------
    SP 2.2.1; K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 5.

    Examples
    --------
    >>> from robust.analysis import LoopSignals, NoiseSignal
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> level = predict_level(model, 1.0, LoopSignals(disturbance=NoiseSignal(1.0, omega_max=50.0)))
    >>> [one.name for one in level.signals]
    ['disturbance']
    """

    name: str
    u: float
    y: float
    u_worst: float = float("nan")
    y_worst: float = float("nan")
    u_in_band: float = float("nan")
    y_in_band: float = float("nan")


@value
class LoopLevel:
    """The level at which a loop moves the machine, against the levels at which it was measured.

    Fields
    ------
    signals : tuple of SignalLevel
        Each signal by itself.
    u, y : float
        Rms of all of them together at plant input and output [unit of u, unit of y], as if independent.
    u_worst, y_worst : float
        Upper bound of these over the set; inf where the set holds an unstable loop, nan with a transient.
    u_measured, y_measured : (2,) ndarray
        Lowest and highest rms of the records behind the set; nan where not known.
    u_state, y_state : LevelState
        Where u and y lie against these.
    unit : str
        Unit of the plant, y over u, where it is known.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4.

    Examples
    --------
    >>> from robust.analysis import LoopSignals, SineSignal
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> level = predict_level(model, 1.0, LoopSignals(reference=SineSignal(1.0, 1.0)))
    >>> round(2 * level.y**2, 6), level.y_state.value                        # |T|^2 = 1/(1 + 4)
    (0.2, 'unknown')
    """

    signals: tuple[SignalLevel, ...]
    u: float
    y: float
    u_worst: float
    y_worst: float
    u_measured: np.ndarray
    y_measured: np.ndarray
    u_state: LevelState
    y_state: LevelState
    unit: str = ""

    @property
    def inside(self) -> bool:
        """Return whether plant input and output both lie among the measured levels."""
        return self.u_state is LevelState.INSIDE and self.y_state is LevelState.INSIDE

    def share_in_band(self, name: str) -> float:
        """Return the share of the power of "u" or "y" in the measured band; nan with a transient, or without power."""
        power = np.array([getattr(one, name) ** 2 for one in self.signals])
        share = np.array([getattr(one, f"{name}_in_band") for one in self.signals])
        total = power.sum()
        return float(np.sum(power[power > 0] * share[power > 0]) / total) if total > 0 else float("nan")

    def __str__(self) -> str:
        top, _, bottom = self.unit.rpartition("/")
        parts = [describe_rms(self, name, unit.removeprefix("1")) for name, unit in (("u", bottom), ("y", top))]
        return f"{'; '.join(parts)}. {CONSEQUENCES[find_consequence(self.u_state, self.y_state)]}"


class Consequence(enum.Enum):
    """What the states of input and output mean together for the set."""

    HOLDS = enum.auto()
    LEAVES = enum.auto()
    DISAGREES = enum.auto()
    UNKNOWN = enum.auto()


CONSEQUENCES = {
    Consequence.HOLDS: "The set was measured at this level, not at those below it that the loop passes as it comes to "
    "rest.",
    Consequence.LEAVES: "The set was not measured at this level, and its verdict says nothing of the machine there. "
    "Measure there too, and give all levels to uncertainty.",
    Consequence.DISAGREES: "Input and output disagree, as the loop has another spectrum than the record had: the set "
    "was not measured at this level. Measure with the spectrum of the loop, or at levels that hold both.",
    Consequence.UNKNOWN: "The levels that were measured are not known, so nothing is said of them. Make the model "
    "anew from its records, or give them as bla.",
}


def find_consequence(u: LevelState, y: LevelState) -> Consequence:
    """Return what the states of input and output mean together."""
    if LevelState.UNKNOWN in (u, y):
        return Consequence.UNKNOWN
    if u is not y:
        return Consequence.DISAGREES
    return Consequence.HOLDS if u is LevelState.INSIDE else Consequence.LEAVES


def describe_rms(level: LoopLevel, name: str, unit: str) -> str:
    """Describe the level at one end of the plant: predicted, measured, and how far apart."""
    rms, worst, state = (getattr(level, f"{name}{part}") for part in ("", "_worst", "_state"))
    low, high = getattr(level, f"{name}_measured")
    text = f"{name} {' '.join([f'{rms:.3g}', *unit.split()])} rms"
    if np.isfinite(worst):
        text += f" (over the set at most {worst:.3g})"
    if state is not LevelState.UNKNOWN:
        measured = f"the measured {low:.3g}" + f" to {high:.3g}" * bool(high > low)
        times = rms / high if state is LevelState.ABOVE else low / rms if rms > 0 else np.inf
        far = "" if state is LevelState.INSIDE else f"{times:.3g} times "
        text += f", {far}{state.value} {measured}"
    share = level.share_in_band(name)
    if share < MIN_SHARE_IN_BAND:
        text += f", {100 * (1 - share):.0f} % of its power outside the measured band, where the plant is assumed"
    return text


def predict_level(
    model: UncertaintyModel,
    K: Controller,
    signals: LoopSignals,
    *,
    delay: float = 0.0,
    bla: Bla | Sequence[Bla] | None = None,
) -> LoopLevel:
    """Predict the rms at plant input and output in closed loop, and whether the machine was measured at that level.

    The prediction is that of the linear loop; its bound over the set leaves out what the set adds above the Nyquist
    frequency of a sampled loop. Where it leaves the measured levels the machine has another best linear
    approximation, and neither the prediction nor a verdict on the set holds there.

    Parameters
    ----------
    model : UncertaintyModel
        The plant, with a parametric nominal.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback u = K (r - y); a sampled one sees a continuous nominal behind its hold, and the
        rms is then that at the sampling instants.
    signals : LoopSignals
        What acts on the loop.
    delay : float
        Computation delay [s] on top of what the model contains.
    bla : nlfrf.Bla or list of them, optional
        Records whose levels count as measured; those that the model remembers when not given.

    Returns
    -------
    LoopLevel

    Raises
    ------
    ValueError
        A plant that is known on its lines only; a loop that is not stable, which has no level; signals that do not fit
        the loop: its sampling time, lines above its Nyquist frequency, white noise that reaches u or y unfiltered.

    References
    ----------
    SP 2.2.1 and 7.4; K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 5 (the power of filtered
    noise).

    Examples
    --------
    White noise of intensity one at the input of 1/(s + 1) under K = 1: y has the variance 1/(2 (1 + 1)).

    >>> from robust.analysis import LoopSignals
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> white = control.tf([100.0], [1, 100.0])                              # nearly white, and of finite power
    >>> level = predict_level(model, 1.0, LoopSignals(disturbance=white))
    >>> bool(abs(level.y**2 - 1 / 4 * 100 / 102) < 1e-6), bool(level.y < level.y_worst)
    (True, True)
    """
    require_one_channel_loop(model)
    require_kind("signals", signals, LoopSignals)
    loop = assemble_loop(model, K, w_P=None, delay=delay)
    nominal = decide_nominal_stability(loop)
    if not nominal.stable:
        raise ValueError(f"K must stabilise the nominal plant for its loop to have a level, got one that is {nominal}")
    band = (float(model.omega[0]), float(model.omega[-1]))
    found = tuple(
        signal_level(name, find_spectrum(name, signal, loop.dt), loop=loop, lines=model.omega, band=band)
        for name, signal in signals.named().items()
    )
    totals = {
        part: float(np.sqrt(sum(getattr(one, part) ** 2 for one in found))) for part in ("u", "y", "u_worst", "y_worst")
    }
    measured = measured_levels(model, bla)
    return LoopLevel(
        signals=found,
        **totals,
        u_measured=measured[0],
        y_measured=measured[1],
        u_state=find_state(totals["u"], *measured[0]),
        y_state=find_state(totals["y"], *measured[1]),
        unit=model.origin.unit,
    )


def require_one_channel_loop(model: object) -> None:
    """Refuse a plant whose loop has no response between lines, or more than one port."""
    require_one_channel(model, "simulate its loop (nlfrf.rig.run)", "for its level in a loop")


def measured_levels(model: UncertaintyModel, bla: Bla | Sequence[Bla] | None) -> np.ndarray:
    """Return the lowest and highest rms of u, and of y, (2, 2), over the records; nan where one is not known."""
    if bla is None:
        levels = [(one.rms_u, one.rms_y) for one in model.records]
    else:
        blas = [bla] if is_single(bla) else list(bla) if isinstance(bla, Sequence) else []
        if not blas or not all(map(is_single, blas)):
            raise ValueError(f"bla must be an nlfrf.Bla or a list of them, got {short_form(bla)}")
        levels = [rms_levels(one) for one in blas]
    if not levels:
        return np.full((2, 2), np.nan)
    return np.array([np.min(levels, axis=0), np.max(levels, axis=0)]).T


def find_state(rms: float, low: float, high: float) -> LevelState:
    """Return where a level lies against the lowest and the highest measured."""
    if np.isnan([rms, low, high]).any():
        return LevelState.UNKNOWN
    if rms > high * LEVEL_TOLERANCE:
        return LevelState.ABOVE
    return LevelState.BELOW if rms < low / LEVEL_TOLERANCE else LevelState.INSIDE


def signal_level(
    name: str, spectrum: Spectrum, *, loop: Loop, lines: np.ndarray, band: tuple[float, float]
) -> SignalLevel:
    """Return what one signal does to plant input and output."""
    if isinstance(spectrum, Transient):
        return SignalLevel(name=name, **transient_level(name, spectrum, loop))

    def gains(omega: np.ndarray) -> np.ndarray:
        """Return (4, W) squared gain to u and to y: of the nominal plant, and the largest over the set."""
        return squared_gains(loop.curves(omega), loop.form, name)

    if isinstance(spectrum, LineSpectrum):
        at = spectrum.omega if not loop.dt else np.minimum(spectrum.omega, np.pi / loop.dt * (1 - 1e-12))
        powers = spectrum.power * gains(at)
        total = powers.sum(axis=1)
        inside = powers[:, (spectrum.omega >= band[0]) & (spectrum.omega <= band[1])].sum(axis=1)
    else:
        total, inside = integrate_density(name, spectrum, gains=gains, loop=loop, lines=lines, band=band)
    with np.errstate(invalid="ignore"):
        share = np.where(total > 0, inside / total, np.nan)
    rms = np.sqrt(total)
    return SignalLevel(
        name=name,
        u=float(rms[0]),
        y=float(rms[1]),
        u_worst=float(rms[2]),
        y_worst=float(rms[3]),
        u_in_band=float(share[0]),
        y_in_band=float(share[1]),
    )


def squared_gains(curves: Curves, form: str, name: str) -> np.ndarray:
    """Return (4, W) |.|^2 from a signal to u and y, nominal and largest over the set, each at its own worst plant.

    With S_p = S (1 + a D)/(1 + b D) and G_p = (G + g D)/(1 + a D) it is G_p S_p = S (G + g D)/(1 + b D), which
    `worst_sensitivity` bounds exactly as it does S_p.
    """
    G, S, a, b = replace_infinite(curves.G), curves.S, curves.a, curves.b
    g = plant_numerator(form, curves.w, G=G, W=curves.W) / curves.W
    with np.errstate(all="ignore"):
        # where G is zero only the part of the set is left: S g D/(1 + b D)
        GS = np.where(G == 0, 0.0, G * S)
        worst_GS = np.where(
            G == 0,
            np.abs(S * g) / np.where(np.abs(b) < 1, 1 - np.abs(b), 0.0),
            worst_sensitivity(GS, g / np.where(G == 0, 1.0, G), b),
        )
    parts = np.array([np.abs(S), np.abs(GS), worst_sensitivity(S, a, b), worst_GS])
    if name != "disturbance":
        parts = parts * np.abs(replace_infinite(curves.K))
    return parts**2


def integrate_density(
    name: str,
    spectrum: PowerDensity,
    *,
    gains: Callable[[np.ndarray], np.ndarray],
    loop: Loop,
    lines: np.ndarray,
    band: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the powers (4,) of a density over all frequencies, and over the measured band."""
    require_finite_power(name, spectrum, loop)
    low, high = spectrum.low, spectrum.high
    grid = np.concatenate(
        [
            loop.grid(lines),
            spectrum.corner_frequencies,
            spectrum.corner_frequencies * 3,
            spectrum.corner_frequencies / 3,
            band,
        ]
    )
    grid = np.unique(grid[(grid > low) & (grid < high)])
    last = grid[-1] * 10 if grid.size else max(1.0, low * 10)
    edges = np.concatenate([[low], grid, [high if np.isfinite(high) else last]])

    def power(omega: np.ndarray) -> np.ndarray:
        return np.asarray(spectrum.density(omega) * gains(omega))

    def tail(x: np.ndarray) -> np.ndarray:
        """Return the rest up to infinity, with omega = last / x: what falls as 1/omega^2 is constant there."""
        return np.asarray(power(last / x) * last / x**2)

    panels = integrate_panels(power, edges)
    middle = (edges[1:] + edges[:-1]) / 2
    inside = panels[:, (middle > band[0]) & (middle < band[1])].sum(axis=1)
    rest = 0.0 if np.isfinite(high) else integrate_panels(tail, np.array([0.0, 0.5, 1.0])).sum(axis=1)
    return panels.sum(axis=1) + rest, inside


def require_finite_power(name: str, spectrum: PowerDensity, loop: Loop) -> None:
    """Refuse noise of infinite power at the plant: white in continuous time, with a direct path to u or y."""
    if np.isfinite(spectrum.high) or spectrum.density_at_infinity == 0:
        return
    direct = loop_to_plant_signals(loop, name).D[:, 0]
    if np.any(direct != 0):
        reached = " and ".join(one for one, part in zip("uy", direct, strict=True) if part != 0)
        raise ValueError(
            f"{name} must be shaped by a strictly proper system in this loop, got one with a direct term: white noise "
            f"reaches {reached} with infinite rms. Add a pole where the real noise ends"
        )


def integrate_panels(integrand: Callable[[np.ndarray], np.ndarray], edges: np.ndarray) -> np.ndarray:
    """Integrate functions (k, W) between edges, (k, panels), by Gauss-Legendre on panels, halved as needed."""
    nodes, weights = np.polynomial.legendre.leggauss(PANEL_NODES)

    def gauss(low: np.ndarray, high: np.ndarray) -> np.ndarray:
        half = (high - low) / 2
        at = ((high + low) / 2)[:, None] + half[:, None] * nodes
        values = integrand(at.ravel())
        return np.asarray((values.reshape(len(values), *at.shape) * weights).sum(axis=2) * half)

    low, high, owner = edges[:-1], edges[1:], np.arange(edges.size - 1)
    coarse = gauss(low, high)
    out = np.zeros_like(coarse)
    for _ in range(MAX_HALVINGS):
        middle = (low + high) / 2
        left, right = gauss(low, middle), gauss(middle, high)
        fine = left + right
        total = np.sum(out, axis=1) + np.sum(fine, axis=1)
        with np.errstate(invalid="ignore"):
            # an infinite bound stays infinite, however fine the panel
            wrong = np.abs(fine - coarse) > INTEGRATION_TOLERANCE * np.maximum(np.abs(fine), 1e-3 * total[:, None])
        again = (wrong & np.isfinite(fine)).any(axis=0)
        np.add.at(out.T, owner[~again], fine[:, ~again].T)
        if not again.any():
            return out
        low, high = np.r_[low[again], middle[again]], np.r_[middle[again], high[again]]
        coarse = np.hstack([left[:, again], right[:, again]])
        owner = np.r_[owner[again], owner[again]]
    np.add.at(out.T, owner, coarse.T)
    return out


def transient_level(name: str, spectrum: Transient, loop: Loop) -> dict[str, float]:
    """Return the rms of plant input and output of the nominal loop in a transient from rest."""
    system = loop_to_plant_signals(loop, name)
    if not is_stable(system):  # the approximation of a delay, in a loop that is stable with the delay itself
        return {"u": float("nan"), "y": float("nan")}
    if spectrum.samples is None:
        _, out = simulate_step(system)
        swing = np.maximum(out.max(axis=1), 0.0) - np.minimum(out.min(axis=1), 0.0)
        rms = np.abs(spectrum.height) * swing * RMS_OF_SWING
    else:
        rms = simulate_samples(system, spectrum.samples, spectrum.fs).std(axis=1)
    return {"u": float(rms[0]), "y": float(rms[1])}


def loop_to_plant_signals(loop: Loop, name: str) -> control.StateSpace:
    """Return the nominal loop from a signal to plant input and output; an rms does not depend on its sign."""
    if name != "disturbance":
        return loop.closed_loop(("u", "y"), ("r",))
    closed = loop.closed_loop(("u", "y"), ("p_in",))
    return control.StateSpace(closed.A, closed.B, closed.C, closed.D + np.array([[1.0], [0.0]]), closed.dt)
