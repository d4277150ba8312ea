"""The loop as it will run: plant, controller, hold, delay on one time base."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import require_nonnegative
from nlfrf._base.values import value
from robust._base.states import Stability
from robust.analysis.aliases import Aliases, Point, aliases_of, at_points, fold_down
from robust.analysis.curves import Curves, Peaks, loop_curves
from robust.lti.connections import closed_loop, in_series
from robust.lti.grids import find_peak, loop_grid, refine_peaks
from robust.lti.lti import sampling_times_differ, timebase
from robust.lti.realisation import stable_weight, state_space
from robust.lti.sampling import delay_samples, delayed, sampled
from robust.lti.stability import StabilityResult, delay_pole_count, poles_with_rounding
from robust.models.sets.forms import FORMS
from robust.models.sets.model import UncertaintyModel
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.closed_loops import poles_of_closed_loop
from robust.proofs.exact.stability import decide_loop_stability
from robust.proofs.search.intervals import poles_are_uncertain, trusted_responder
from robust.proofs.search.stability import MAX_EXACT_STATES, is_near_boundary

__all__ = ["Loop", "assemble", "find_peaks", "in_loop", "nominal_instability", "sensitivity", "stable_with"]

DELAY_ORDER = 8
MOST_STATES = 600  # of a plant with its delay line


@value
class Loop:
    """A loop ready to be judged.

    Fields
    ------
    G, K : control.StateSpace
        Plant as the controller sees it (hold and delay inside) and controller, on the time base dt.
    dt : float
        Sampling time of the loop [s], 0 for continuous.
    form : str
        Form of the uncertainty.
    weight : control.StateSpace
        Its weight, on its own time base.
    w_P : control.StateSpace or None
        Performance weight, on its own time base.
    pade_delay : float
        Delay [s] that G holds as a Padé approximation made here (continuous loops only).
    unsampled : control.StateSpace or None
        The continuous nominal that G was sampled from.
    short, shift : control.StateSpace, float
        G without its delay (its whole samples where sampled), and that [s]: what its response is computed from, so that
        curves and margins are those of the delay itself.
    shaping : control.StateSpace
        What the plant is scaled by where the form depends on its units; the gain one elsewhere.
    given, delay : control.StateSpace, float
        The plant before hold and delay, and that delay [s]: what exact arithmetic takes.
    perturbation : str
        Class of the set: "LTI", "statistical" or "operator".
    """

    G: control.StateSpace
    K: control.StateSpace
    dt: float
    form: str
    weight: control.StateSpace
    w_P: Any
    pade_delay: float
    unsampled: Any
    short: control.StateSpace
    shift: float
    shaping: control.StateSpace
    given: control.StateSpace
    delay: float
    perturbation: str

    @property
    def top(self) -> float:
        """Highest frequency that means anything [rad/s]."""
        return np.pi / self.dt if self.dt else np.inf

    def with_plant(self, G: control.StateSpace) -> Loop:
        """The same loop around another plant, as the controller sees it."""
        return replace(self, G=G, short=G, shift=0.0, given=G, delay=0.0, unsampled=None)

    def behind_delay(self, plant: control.StateSpace, delay: float) -> control.StateSpace:
        """A plant on the time base of the loop behind its delay [s]."""
        return delayed(plant, delay, order=DELAY_ORDER)

    def closed(self, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> control.StateSpace:
        """A closed-loop transfer function of the nominal loop."""
        return control.StateSpace(*closed_loop(self.G, self.K, outputs, inputs), self.dt)

    @cached_property
    def responses(self) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
        """The responses of its parts, each made ready once."""
        parts = {"G": self.short, "K": self.K, "w": self.weight, "w_P": self.w_P, "W": self.shaping}
        return {name: trusted_responder(part) for name, part in parts.items() if part is not None}

    @cached_property
    def nominal(self) -> control.StateSpace:
        """The closed loop from r to e, by whose poles it is judged."""
        return self.closed(("e",), ("r",))

    @cached_property
    def poles(self) -> tuple[np.ndarray, np.ndarray]:
        """The poles of the nominal loop, hidden modes included, and how far rounding may have moved each."""
        return poles_with_rounding(self.nominal)

    @cached_property
    def modes(self) -> np.ndarray:
        """Poles of the nominal loop, in many digits where rounding may have moved one by as much as it is damped.

        Around these a grid is made dense: a light mode that is looked for beside where it is, is not seen.
        """
        poles, moved = self.poles
        if poles.size > MAX_EXACT_STATES or not poles_are_uncertain(poles, moved, bool(self.dt)):
            return poles
        seen = control.StateSpace(self.G.A, self.G.B, -self.G.C, -self.G.D, self.dt)
        precise = poles_of_closed_loop(to_matrices(seen), to_matrices(self.K))
        return poles if precise is None else precise

    def plant(self, omega: np.ndarray) -> np.ndarray:
        """(W,) response of G."""
        G = self.responses["G"](omega)
        with np.errstate(invalid="ignore"):  # infinite at a pole on the axis, whatever the phase
            return np.where(np.isinf(G), np.inf, G * np.exp(-1j * omega * self.shift))

    def curves(self, omega: Any) -> Curves:
        """What the loop does at the frequencies omega [rad/s], from the responses of its parts."""
        omega = np.atleast_1d(omega)
        of = self.responses
        w_P = None if self.w_P is None else of["w_P"](omega)
        G, K, w = self.plant(omega), of["K"](omega), of["w"](omega)
        # the set is one about the plant without its delay, which stands with the controller
        W = of["W"](omega) * np.exp(1j * omega * self.shift) if FORMS[self.form].scaled else None
        found = loop_curves(self.form, omega, G, K, w, w_P, W)
        if self.aliases is None:
            return found
        folded = fold_down(self.at_points(found), w_P)
        return replace(found, folded_rs=folded.rs, folded_worst=folded.S_worst, folded_growth=folded.growth)

    @cached_property
    def aliases(self) -> Aliases | None:
        """The aliases of a set of continuous plants under a sampled controller; None of any other loop."""
        if self.unsampled is None:
            return None
        return aliases_of(self.form, self.unsampled, self.weight, self.perturbation, self.dt, self.delay)

    def at_points(self, curves: Curves) -> Point:
        """The loop with every alias at the frequencies of its curves."""
        assert self.aliases is not None
        return at_points(self.aliases, curves.omega, curves.S, curves.K_S, curves.G)

    def grid(self, lines: np.ndarray) -> np.ndarray:
        """Frequencies [rad/s] dense enough to look at: the lines, a log grid, every resonance of the loop."""
        parts = [system for system in (self.G, self.K, self.weight, self.w_P) if system is not None]
        folded = np.zeros(0) if self.aliases is None else self.aliases.folded_modes
        return loop_grid(lines, self.modes, parts, self.dt, self.shift, folded)

    def peak(self, curve: Any, omega: np.ndarray, band: tuple[float, float]) -> tuple[float, float]:
        """Largest value of a curve of this loop and where (`systems.grids.highest`)."""
        return find_peak(curve, omega, band, self.top)


def assemble(model: UncertaintyModel, K: Any, w_P: Any, delay: float) -> Loop:
    """Put plant and controller on one time base, or refuse what does not fit together."""
    K = state_space("K", K)
    delay = require_nonnegative("delay", delay)
    G = model.nominal
    dt_G, dt_K = timebase(G), timebase(K)
    dt = dt_G or dt_K
    if G.nstates + K.nstates + (delay / dt if dt else 0) > MOST_STATES:
        raise ValueError(
            f"delay must leave at most {MOST_STATES} states in the loop, got {delay:g} s"
            + (f" of {dt:g} s each sample" if dt else "")
            + f" around {G.nstates + K.nstates} states. A slower sampling time has a shorter delay line."
        )
    pade_delay, unsampled = 0.0, None
    if dt_G:
        if sampling_times_differ(K, G):
            raise ValueError(
                f"K must have the sampling time of the nominal model, {dt_G:g} s, "
                + (f"got {dt_K:g} s" if dt_K else "got a continuous controller")
            )
        dt = dt_G
        short, shift = G, delay_samples("delay", delay, dt) * dt
        G = delayed(G, shift, order=0)
    elif dt_K:
        if FORMS[model.form].scaled:
            raise ValueError(
                f"K must have the sampling time of the nominal model for the {model.form} form, whose set is not that "
                f"of the sampled plant, got {dt_K:g} s on a continuous one. Take sampled(nominal, dt) as the nominal"
            )
        dt, unsampled = dt_K, G
        shift = np.floor(delay / dt + 1e-9) * dt
        short, G = sampled(G, dt, max(delay - shift, 0.0)), sampled(G, dt, delay)
    else:
        dt, pade_delay = 0.0, delay
        short, shift = G, delay
        G = delayed(G, delay, order=DELAY_ORDER)
    K = control.StateSpace(K.A, K.B, K.C, K.D, dt)
    if w_P is not None:
        w_P = stable_weight("w_P", w_P, dt)
    loop = Loop(
        G=G,
        K=K,
        dt=dt,
        form=model.form,
        weight=model.weight,
        w_P=w_P,
        pade_delay=pade_delay,
        unsampled=unsampled,
        short=short,
        shift=float(shift),
        shaping=model.shaping,
        given=model.nominal,
        delay=delay,
        perturbation=model.perturbation,
    )
    _ = loop.nominal  # refuses a loop without a solution
    return loop


def nominal_instability(loop: Loop) -> StabilityResult:
    """Whether every pole of the nominal loop, hidden modes included, is strictly stable.

    Floating point decides far from the boundary, exact arithmetic beside it, unless the loop is too large.
    """
    apparent = apparently(loop)
    if not is_near_boundary(loop.nominal, loop.poles):
        return apparent
    if loop.given.nstates + loop.K.nstates + (loop.delay / loop.dt if loop.dt else 0) > MAX_EXACT_STATES:
        return apparent
    exact = decide_loop_stability(to_matrices(loop.given), to_matrices(loop.K), delay=loop.delay)
    if exact.holds:
        return StabilityResult(state=Stability.STABLE)
    if not exact.violated or apparent.unstable:
        return apparent
    return replace(apparent, state=Stability.UNSTABLE, of_loop=True, at_boundary=True)


def apparently(loop: Loop) -> StabilityResult:
    """Whether every pole of the loop is stable beyond rounding, one is unstable, or rounding leaves it open.

    A delay in a continuous loop is taken as it is, not by its approximation.
    """
    waiting = loop.pade_delay > 0
    poles, moved = (loop.with_plant(loop.short) if waiting else loop).poles
    excess = np.abs(poles) - 1 if loop.dt else poles.real
    unstable = excess > moved
    if unstable.any() and not waiting:
        return StabilityResult(state=Stability.UNSTABLE, pole=complex(poles[int(np.argmax(excess))]), of_loop=True)
    if np.any(excess[~unstable] >= -moved[~unstable]):
        worst = int(np.argmax(np.where(unstable, -np.inf, excess + moved)))
        pole = complex(poles[worst])
        return StabilityResult(state=Stability.UNDECIDED, pole=pole, of_loop=True, without_delay=waiting)
    if not waiting:
        return StabilityResult(state=Stability.STABLE)
    total = unstable.sum() + delay_pole_count(in_series(loop.K, loop.short), loop.pade_delay)
    if np.isnan(total):
        return StabilityResult(state=Stability.UNDECIDED, of_loop=True)
    if not total:
        return StabilityResult(state=Stability.STABLE)
    return StabilityResult(state=Stability.UNSTABLE, of_loop=True, n_unstable=float(total))


def find_peaks(loop: Loop, curves: Curves, band: tuple[float, float]) -> Peaks:
    """The largest values of the curves over all frequencies: from those on a grid, refined."""
    names = ["rs", "half_disk", *([] if loop.w_P is None else ["np_"])]

    def stacked(of: Curves, names: list[str]) -> np.ndarray:
        return np.array([getattr(of, name) for name in names])

    def along(names: list[str]) -> list[tuple[float, float]]:
        return refine_peaks(lambda at: stacked(loop.curves(at), names), curves.omega, stacked(curves, names), band)

    rs, half_disk, *performance = along(names)
    margin_rp = (np.nan, np.nan)
    if performance:
        peak, where = performance[0]
        margin_rp = (0.0, where)
        if peak < 1:  # the largest factor on the uncertainty with |w_P| max |S_p| <= 1
            largest, where = along(["limit"])[0]
            margin_rp = (1 / largest if largest > 0 else np.inf, where)
    return Peaks(rs=rs, margin_rp=margin_rp, half_disk=half_disk)


def in_loop(plant: control.StateSpace, loop: Loop, delay: float) -> control.StateSpace:
    """A plant as the controller of the loop sees it."""
    if loop.dt and not timebase(plant):
        return sampled(plant, loop.dt, delay)
    return loop.behind_delay(plant, delay)


def sensitivity(plant: control.StateSpace, seen: control.StateSpace, loop: Loop, omega: np.ndarray) -> np.ndarray:
    """(W,) S with another plant; in a continuous loop behind the delay itself, not its approximation."""
    around = replace(loop.with_plant(plant), shift=loop.pade_delay) if loop.pade_delay else loop.with_plant(seen)
    return around.curves(omega).S


def stable_with(plant: control.StateSpace, seen: control.StateSpace, loop: Loop) -> bool:
    """Whether the loop is stable with another plant, `seen` as its controller sees it."""
    other = replace(loop, G=seen, short=plant if loop.pade_delay else seen, given=plant)
    return nominal_instability(other).stable
