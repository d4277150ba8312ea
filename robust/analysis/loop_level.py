"""The level at which a loop moves the machine, compared with the levels at which the machine was
measured.

    r --->(+)- e ->[ K ]--(+)--- u -->[ G ]--(+)--> y        from r and n:  u = K S r,  y = G K S r
          -^               ^d                 |              from d:        u = S d,    y = G S d
           +------------------------(+)<------+
                                     ^n

A best linear approximation holds at its level: a machine with friction slides more at a larger
level, and sticks at a smaller level. u is the whole plant input, as in the record; y is the plant
output, without the noise of its sensor. Spectra are multiplied by the closed-loop gains of the
nominal plant, and by the largest gain of any plant of the set at each frequency. The largest gains
give an upper bound for every plant of the set, which no single plant may attain.
"""

from __future__ import annotations

import enum
import warnings
from collections.abc import Sequence
from math import hypot

import control
import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from nlfrf import Bla
from nlfrf._base.arguments import (
    as_list,
    require_kind,
    short_form,
)
from nlfrf._base.values import value
from robust._base.channels import is_single
from robust._base.types import Controller
from robust.analysis.curves import Curves
from robust.analysis.loop import Loop, assemble_loop, decide_nominal_stability
from robust.analysis.signals import LoopSignals, NoiseSignal, StepSignal
from robust.analysis.step import simulate_step
from robust.lti.connections import worst_sensitivity
from robust.lti.lti import is_stable, replace_infinite
from robust.lti.norms import continuous_image
from robust.models.sets.forms import plant_numerator
from robust.models.sets.model import UncertaintyModel, require_one_channel
from robust.models.sets.records import level_of_record

#: Factor by which a level may lie outside the measured ones and still count as one of them, because
#: one record has one level. A convention: between 0.1 and 2.5 N a factor of 1.5 moves the resonance
#: of the built-in rig by 1 to 6 %.
_LEVEL_TOLERANCE = 1.5
#: Rms of the sinusoid with the swing of a step: friction over a swing depends on its amplitude
#: (describing functions).
_RMS_OF_SWING = 1 / np.sqrt(8)
#: Share of the power in the measured band above which the report does not mention the rest.
_MIN_SHARE_IN_BAND = 0.5
#: Gauss-Legendre nodes of a panel, and panels between two frequencies of a grid that is dense
#: around every mode.
_PANEL_NODES, _PANELS = 7, 4
_WIDE = 200  # further frequencies, over nine decades below the upper end of a noise


class LevelState(enum.Enum):
    """Position of a predicted rms relative to the measured levels, with a tolerance of a factor
    1.5.

    Fields
    ------
    INSIDE, BELOW, ABOVE : among the measured levels, below all, above all.
    UNKNOWN : no level was measured, or the records do not contain the rms of this signal.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4: a BLA
    holds for one class of excitations.

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
class _NoiseExtent:
    """What is known of the effect of a noise beyond its rms in the nominal loop: its size over the
    set, and its share in the measured band.
    """

    u_worst: float  # upper bound of the rms of u over the set; inf with an unstable plant
    y_worst: float
    u_in_band: float  # share of the power of u in the measured band; nan without power
    y_in_band: float


@value
class _SignalLevel:
    """Effect of one signal of a loop on the plant; means are left out."""

    name: str  # "reference", "disturbance" or "noise"
    # rms of the plant input in the nominal loop [unit of u]; for a step: of the sinusoid with its
    # swing
    u: float
    y: float  # the same for the plant output [unit of y]
    noise: _NoiseExtent | None  # None for a step, whose transient has neither

    def beyond_rms(self, name: str) -> float:
        """Return a number of the noise by name; nan for a step."""
        if self.noise is None:
            return float("nan")
        return float(getattr(self.noise, name))


@value
class LoopLevel:
    """Predicted level (rms of plant input and output) in a loop, compared with the measured levels.

    Fields
    ------
    signals : tuple of SignalLevel
        Level caused by each signal alone: name, rms of u and y, and for a noise the bounds of both
        over the set and the shares of the power in the measured band.
    u, y : float
        Rms at plant input and output [unit of u, unit of y] caused by all signals together, which
        are assumed to be independent.
    u_worst, y_worst : float
        Upper bounds of the rms of u and y over the set; inf if a plant of the set makes the loop
        unstable, nan if a signal is a step.
    u_measured, y_measured : (2,) ndarray
        Lowest and highest rms of u and y in the records behind the set; nan if unknown.
    u_state, y_state : LevelState
        Position of the rms of u and y relative to the measured levels.
    unit : str
        Unit of the plant, y over u; empty if unknown.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.4.

    Examples
    --------
    >>> from robust.analysis import LoopSignals, StepSignal
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> level = predict_level(model, 1.0, LoopSignals(reference=StepSignal(1.0)))
    >>> round(level.y * 8**0.5, 3), level.y_state.value                      # y goes to K/(1 + K)
    (0.5, 'unknown')
    """

    signals: tuple[_SignalLevel, ...]
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
        """True if the rms of both plant input and output is among the measured levels."""
        return self.u_state is LevelState.INSIDE and self.y_state is LevelState.INSIDE

    def share_in_band(self, name: str) -> float:
        """Return the share of the power of "u" or "y" in the measured band; nan for a step or no
        power.
        """
        power = np.array([getattr(one, name) for one in self.signals])
        power = (power / max(power.max(), 1e-300)) ** 2
        share = np.array([one.beyond_rms(f"{name}_in_band") for one in self.signals])
        total = power.sum()
        if total > 0:
            return float(np.sum(power[power > 0] * share[power > 0]) / total)
        return float("nan")

    def __str__(self) -> str:
        top, _, bottom = self.unit.rpartition("/")
        parts = [
            _describe_rms(self, name, unit.removeprefix("1"))
            for name, unit in (("u", bottom), ("y", top))
        ]
        return f"{'; '.join(parts)}. {_describe_consequence(self.u_state, self.y_state)}"


_HOLDS = (
    "The set was measured at this level, but not at the lower levels that the loop passes as it"
    " comes to rest."
)
_LEAVES = (
    "The set was not measured at this level, so its verdict does not hold there. Measure at that"
    " level too, and give all levels to uncertainty."
)
_DISAGREES = (
    "Input and output disagree, because the loop has another spectrum than the record: the set was"
    " not measured at this level. Measure with the spectrum of the loop, or at levels that include"
    " both."
)
_NOT_KNOWN = (
    "The measured levels are unknown, so they are not compared. Make the model again from its"
    " records, or give the records as bla."
)


def _describe_consequence(u: LevelState, y: LevelState) -> str:
    """Describe the meaning of both states for the set."""
    if LevelState.UNKNOWN in (u, y):
        return _NOT_KNOWN
    if u is not y:
        return _DISAGREES
    if u is LevelState.INSIDE:
        return _HOLDS
    return _LEAVES


def _describe_rms(level: LoopLevel, name: str, unit: str) -> str:
    """Describe the level at one end of the plant: predicted, measured, and their ratio."""
    rms, worst, state = (getattr(level, f"{name}{part}") for part in ("", "_worst", "_state"))
    low, high = getattr(level, f"{name}_measured")
    text = f"{name} {' '.join([f'{rms:.3g}', *unit.split()])} rms"
    if np.isfinite(worst):
        text += f" (over the set at most {worst:.3g})"
    if state is not LevelState.UNKNOWN:
        measured = f"the measured {low:.3g}" + f" to {high:.3g}" * bool(high > low)
        if state is LevelState.ABOVE:
            times = rms / high
        elif rms > 0:
            times = low / rms
        else:
            times = np.inf
        if state is LevelState.INSIDE:
            far = ""
        else:
            far = f"{times:.3g} times "
        text += f", {far}{state.value} {measured}"
    share = level.share_in_band(name)
    if share < _MIN_SHARE_IN_BAND:
        text += (
            f", {100 * (1 - share):.0f} % of its power outside the measured band, where the plant"
            " is assumed"
        )
    return text


def predict_level(
    model: UncertaintyModel,
    K: Controller,
    signals: LoopSignals,
    *,
    delay: float = 0.0,
    bla: Bla | Sequence[Bla] | None = None,
) -> LoopLevel:
    """Predict the rms of plant input and output in a loop, and compare it with the measured levels.

    Use this before you trust a design for a machine with friction or another nonlinearity. Outside
    the measured levels the machine has another best linear approximation, so neither the prediction
    nor a verdict on the set holds there. The prediction is computed from the linear loop. In a
    sampled loop the largest rms over the set leaves out the aliases of the perturbation.

    Parameters
    ----------
    model : UncertaintyModel
        The plant, with a parametric nominal.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback u = K (r - y). A sampled K acts on a continuous nominal
        through a zero-order hold, and the rms is then that at the sampling instants.
    signals : LoopSignals
        Signals that act on the loop.
    delay : float
        Computation delay [s], in addition to the delay of the model.
    bla : nlfrf.Bla or list of them, optional
        Records whose levels count as measured. Default: the records of the model.

    Returns
    -------
    LoopLevel

    Raises
    ------
    ValueError
        A plant that is known on its lines only; a loop that is not stable; noise without an upper
        frequency in a continuous loop, or with one above the Nyquist frequency of a sampled loop.

    References
    ----------
    SP 2.2.1 and 7.4; K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 5
    (the power of filtered noise).

    Examples
    --------
    Noise with density one from 0 to 100 rad/s at the input of the plant 1/(s + 1), with K = 1. Here
    |G S|^2 = 1/(w^2 + 4).

    >>> from robust.analysis import LoopSignals, NoiseSignal
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> level = predict_level(model, 1.0, LoopSignals(disturbance=NoiseSignal(10.0, omega_max=100.0)))
    >>> bool(abs(level.y**2 - np.arctan(100 / 2) / 2) < 1e-6), bool(level.y < level.y_worst)
    (True, True)
    """
    require_one_channel_loop(model)
    require_kind("signals", signals, LoopSignals)
    loop = assemble_loop(model, K, w_P=None, delay=delay)
    nominal = decide_nominal_stability(loop)
    if not nominal.stable:
        raise ValueError(
            "K must stabilise the nominal plant, because only a stable loop has a level, got a"
            f" loop that is {nominal}"
        )
    found = tuple(
        (
            _step_level(name, signal, loop)
            if isinstance(signal, StepSignal)
            else _noise_level(name, signal, loop)
        )
        for name, signal in signals.named().items()
    )
    u, y = hypot(*(one.u for one in found)), hypot(*(one.y for one in found))
    u_worst, y_worst = (
        hypot(*(one.beyond_rms(part) for one in found)) for part in ("u_worst", "y_worst")
    )
    measured = _measured_levels(model, bla)
    return LoopLevel(
        signals=found,
        u=u,
        y=y,
        u_worst=u_worst,
        y_worst=y_worst,
        u_measured=measured[0],
        y_measured=measured[1],
        u_state=find_state(u, *measured[0]),
        y_state=find_state(y, *measured[1]),
        unit=model.origin.unit,
    )


def require_one_channel_loop(model: object) -> None:
    """Refuse a plant that is known on its lines only, and one with several channels."""
    require_one_channel(model, "simulate its loop (nlfrf.rig.run)", "for its level in a loop")


def _measured_levels(model: UncertaintyModel, bla: Bla | Sequence[Bla] | None) -> np.ndarray:
    """Return (2, 2) lowest and highest rms of u, and of y, over the records; nan if unknown."""
    if bla is None:
        levels = [one.level for one in model.records]
    else:
        blas = as_list(bla)
        if not blas or not all(map(is_single, blas)):
            raise ValueError(f"bla must be an nlfrf.Bla or a list of them, got {short_form(bla)}")
        levels = [level_of_record(one) for one in blas]
    known = [(level.rms_u, level.rms_y) for level in levels if level is not None]
    if not known or len(known) < len(levels):
        return np.full((2, 2), np.nan)
    return np.array([np.min(known, axis=0), np.max(known, axis=0)]).T


def find_state(rms: float, low: float, high: float) -> LevelState:
    """Return the position of a level relative to the lowest and the highest measured one."""
    if np.isnan([rms, low, high]).any():
        return LevelState.UNKNOWN
    if rms > high * _LEVEL_TOLERANCE:
        return LevelState.ABOVE
    if rms < low / _LEVEL_TOLERANCE:
        return LevelState.BELOW
    return LevelState.INSIDE


def _step_level(name: str, signal: StepSignal, loop: Loop) -> _SignalLevel:
    """Return the effect of a step on plant input and output of the nominal loop, as the sinusoid
    with its swing.
    """
    system, rms = _loop_to_plant_signals(loop, name), np.full(2, np.nan)
    if is_stable(
        system
    ):  # else the approximation of the delay is unstable, though the loop itself is stable
        _, out = simulate_step(system)
        swing = np.maximum(out.max(axis=1), 0.0) - np.minimum(out.min(axis=1), 0.0)
        rms = np.abs(float(signal.height)) * swing * _RMS_OF_SWING
    return _SignalLevel(name=name, u=float(rms[0]), y=float(rms[1]), noise=None)


def _noise_level(name: str, signal: NoiseSignal, loop: Loop) -> _SignalLevel:
    """Return the rms that noise in a band causes at plant input and output."""
    low, high = _noise_band(name, signal, loop.dt)
    grid = np.concatenate(
        [loop.grid(loop.model.omega), loop.band, np.geomspace(1e-9 * high, high, _WIDE)]
    )
    grid = np.concatenate([[low], np.unique(grid[(grid > low) & (grid < high)]), [high]])
    edges = np.interp(
        np.arange(_PANELS * (grid.size - 1) + 1) / _PANELS, np.arange(grid.size), grid
    )
    nodes, weights = np.polynomial.legendre.leggauss(_PANEL_NODES)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    at = middle[:, None] + half[:, None] * nodes
    found = _squared_gains(loop.curves(at.ravel()), loop.form, name).reshape(4, *at.shape)
    panels = (found * weights).sum(axis=2) * half / (high - low)
    total = panels.sum(axis=1)
    inside = panels[:, (middle > loop.band[0]) & (middle < loop.band[1])].sum(axis=1)
    with np.errstate(invalid="ignore"):
        share = np.where(total > 0, inside / total, np.nan)
    u, y, u_worst, y_worst = (float(signal.rms) * np.sqrt(total)).tolist()
    return _SignalLevel(
        name=name,
        u=u,
        y=y,
        noise=_NoiseExtent(
            u_worst=u_worst,
            y_worst=y_worst,
            u_in_band=float(share[0]),
            y_in_band=float(share[1]),
        ),
    )


def _noise_band(name: str, signal: NoiseSignal, dt: float) -> tuple[float, float]:
    """Return the band [rad/s] of a noise in a loop; an open end becomes Nyquist, an end above
    Nyquist is refused.
    """
    high = float(signal.omega_max)
    if np.isinf(high):
        if not dt:
            raise ValueError(
                f"{name} must have a highest frequency (omega_max) in a continuous loop,"
                " because its rms is infinite otherwise, got none"
            )
        high = np.pi / dt
    if dt and max(high * dt, signal.omega_min * dt * (1 + 1e-6)) > np.pi * (1 + 1e-9):
        raise ValueError(
            f"{name} must lie below the Nyquist frequency of the controller, {np.pi / dt:g} rad/s,"
            f" got a band up to {max(high, signal.omega_min):g} rad/s"
        )
    return float(signal.omega_min), high


def _squared_gains(curves: Curves, form: str, name: str) -> np.ndarray:
    """Return (4, W) |.|^2 from a signal to u and y, nominal and largest over the set, each at its
    own worst plant.

    S_p = S (1 + a D)/(1 + b D) and G_p = (G + g D)/(1 + a D) give G_p S_p = S (G + g D)/(1 + b D),
    which `worst_sensitivity` bounds exactly, like S_p.
    """
    G, S, a, b = replace_infinite(curves.G), curves.S, curves.a, curves.b
    g = plant_numerator(form, curves.w, G=G, W=curves.W) / curves.W
    with np.errstate(all="ignore"):
        # at a zero of G only the term of the set remains: S g D/(1 + b D)
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


def encoder_noise(loop: Loop) -> float:
    """Return the rms of u over the step of an encoder that rounds y [unit of u over y]; nan for a
    continuous loop and for a loop near the stability boundary.

    While y moves over many steps, rounding is white noise of rms step / sqrt(12) (Widrow & Kollár,
    *Quantization Noise*, 2008), filtered by K S. The Gramian of a sampled loop is that of its
    bilinear image.
    """
    if not loop.dt:
        return float("nan")
    system = loop.closed_loop(("u",), ("r",))
    A, B, *_ = continuous_image(system)
    if A.size and not np.linalg.eigvals(A).real.max() < 0:
        return float("nan")  # no steady state within rounding
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", RuntimeWarning
        )  # a pole near the stability boundary: X is large
        if A.size:
            X = solve_continuous_lyapunov(A, -B @ B.T)
        else:
            X = np.zeros((0, 0))
    power = float((system.C @ X @ system.C.T + system.D @ system.D.T)[0, 0])
    if not power >= 0:
        return float("nan")  # near the boundary rounding is larger than the Gramian
    return float(np.sqrt(power / 12))


def describe_encoder_noise(gain: float, unit: str) -> str:
    """Describe the rms of u over the step of an encoder; unit of the plant, y over u.

    Empty if unknown.

    >>> describe_encoder_noise(4.0e4, "m/N")
    'a step of 1 um adds 0.04 N rms to u, while y moves over many steps'
    """
    if not np.isfinite(gain):
        return ""
    top, _, bottom = unit.rpartition("/")
    if top in ("m", "rad"):
        size, step = 1e-6, f"u{top}"
    else:
        size, step = 1.0, top if top not in ("", "1") else "unit of y"
    rms = " ".join([f"{gain * size:.3g}", *bottom.split()]).removesuffix(" 1")
    return f"a step of 1 {step} adds {rms} rms to u, while y moves over many steps"


def _loop_to_plant_signals(loop: Loop, name: str) -> control.StateSpace:
    """Return the nominal loop from a signal to plant input and output, up to a sign, which an rms
    does not contain.
    """
    if name != "disturbance":
        return loop.closed_loop(("u", "y"), ("r",))
    closed = loop.closed_loop(("u", "y"), ("p_in",))
    return control.StateSpace(
        closed.A, closed.B, closed.C, closed.D + np.array([[1.0], [0.0]]), closed.dt
    )
