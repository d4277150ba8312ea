"""The loop of plant, controller, hold and delay on one time base: stability, curves and peaks.

Curves are evaluated from the plant without its delay and the factor exp(-j omega delay). This is
exact, while a Padé approximation or a delay line would add its own modes. Poles are computed from
the state space that contains the delay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import control
import numpy as np

from nlfrf._base.arguments import require_nonnegative
from nlfrf._base.values import value
from robust._base.states import Stability
from robust._base.types import Controller, Weight
from robust.analysis.aliases import (
    AliasedLoop,
    Aliases,
    aliases_of_set,
    evaluate_aliases,
    fold_aliases,
)
from robust.analysis.classical import frequencies_of_crossings
from robust.analysis.curves import Curves, loop_curves
from robust.analysis.findings import Given, Margins
from robust.lti.connections import closed_loop, in_series
from robust.lti.grids import Peak, find_peak, loop_grid, refine_peaks
from robust.lti.lti import (
    is_constant,
    poles,
    sampling_times_differ,
    timebase,
    to_s_plane,
    zeros,
)
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

_CONTINUOUS_CONTROLLER = (
    "got a continuous controller: robust.lti.discretize(K, {0:g}), or robust design --sample-time"
    " {0:g}"
)
_MAX_STATES = 600  # for a plant with its delay line


@value
class Loop:
    """A set and a controller with one channel, closed on one time base."""

    model: UncertaintyModel  # the set, with a parametric nominal
    controller: control.StateSpace  # controller as given
    G: control.StateSpace  # plant with hold and delay
    K: control.StateSpace  # controller on the time base dt
    dt: float  # sampling time of the loop [s]; 0 for a continuous loop
    w_P: control.StateSpace | None  # performance weight, on its own time base
    pade_delay: (
        float  # delay [s] that G contains as a Padé approximation made here; continuous loops only
    )
    continuous_plant: control.StateSpace | None  # continuous nominal from which G was sampled
    # G without its delay (without the whole samples of it in a sampled loop), and that delay [s].
    # The response is computed from these two, so curves and margins are those of the exact delay.
    undelayed_plant: control.StateSpace
    plant_delay: float
    # plant before hold and delay, and that delay [s], for exact arithmetic
    given_plant: control.StateSpace
    delay: float

    @property
    def form(self) -> str:
        return self.model.form

    @property
    def weight(self) -> control.StateSpace:
        """Weight of the uncertainty, on its own time base."""
        return self.model.weight

    @property
    def shaping(self) -> control.StateSpace:
        """Scaling of the plant if the form depends on its units, else the gain one."""
        return self.model.shaping

    @property
    def band(self) -> tuple[float, float]:
        """First and last measured frequency [rad/s]."""
        return float(self.model.omega[0]), float(self.model.omega[-1])

    @property
    def given(self) -> Given:
        """Input of the check: class, demand, delay, band and unit."""
        return Given(
            perturbation=self.model.perturbation,
            demand=self.w_P,
            delay=float(self.delay),
            dt=self.dt,
            band=self.model.omega[[0, -1]],
            unit=self.model.origin.unit,
        )

    @property
    def omega_max(self) -> float:
        """Nyquist frequency [rad/s]; inf for a continuous loop."""
        if self.dt:
            return np.pi / self.dt
        return np.inf

    def with_plant(self, G: control.StateSpace) -> Loop:
        """Return the same loop around another plant, which includes hold and delay."""
        return replace(
            self,
            G=G,
            undelayed_plant=G,
            plant_delay=0.0,
            given_plant=G,
            delay=0.0,
            continuous_plant=None,
        )

    def closed_loop(self, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> control.StateSpace:
        """Return a closed-loop transfer function of the nominal loop."""
        return control.StateSpace(*closed_loop(self.G, self.K, outputs, inputs), self.dt)

    @cached_property
    def responders(self) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
        """Functions of omega that evaluate each part of the loop, by name."""
        parts = {
            "G": self.undelayed_plant,
            "K": self.K,
            "w": self.weight,
            "w_P": self.w_P,
            "W": self.shaping,
        }
        return {name: trusted_responder(part) for name, part in parts.items() if part is not None}

    @cached_property
    def sensitivity_loop(self) -> control.StateSpace:
        """Closed loop from r to e, whose poles decide stability."""
        return self.closed_loop(("e",), ("r",))

    @cached_property
    def poles(self) -> tuple[np.ndarray, np.ndarray]:
        """Poles of the nominal loop, hidden modes included, and a bound on the rounding of each."""
        return poles_with_rounding(self.sensitivity_loop)

    @cached_property
    def modes(self) -> np.ndarray:
        """Poles of the nominal loop, in many digits if rounding may exceed the damping of one.

        Grids are dense around these poles; a grid that misses a light mode by its width would miss
        its peak.
        """
        poles, moved = self.poles
        if poles.size > MAX_EXACT_STATES or not poles_are_uncertain(poles, moved, bool(self.dt)):
            return poles
        seen = control.StateSpace(self.G.A, self.G.B, -self.G.C, -self.G.D, self.dt)
        precise = poles_of_closed_loop(to_matrices(seen), to_matrices(self.K))
        if precise is None:
            return poles
        return precise

    def plant_response(self, omega: np.ndarray) -> np.ndarray:
        """Return the response (W,) of G, with its exact delay."""
        G = self.responders["G"](omega)
        with np.errstate(invalid="ignore"):  # infinite at a pole on the axis, whatever the phase
            return np.where(np.isinf(G), np.inf, G * np.exp(-1j * omega * self.plant_delay))

    def curves(self, omega: np.ndarray | float) -> Curves:
        """Compute the curves of the loop at the frequencies omega [rad/s]."""
        omega = np.atleast_1d(omega)
        of = self.responders
        if self.w_P is None:
            w_P = None
        else:
            w_P = of["w_P"](omega)
        G, K, w = self.plant_response(omega), of["K"](omega), of["w"](omega)
        # the set is around the plant without its delay; the delay counts to the controller
        if FORMS[self.form].depends_on_units:
            W = of["W"](omega) * np.exp(1j * omega * self.plant_delay)
        else:
            W = None
        found = loop_curves(self.form, omega, G=G, K=K, w=w, w_P=w_P, W=W)
        if self.aliases is None:
            return found
        rs, S_worst, margin = fold_aliases(self.with_aliases(found), w_P)
        return replace(
            found, folded_rs=rs, folded_S_worst=S_worst, folded_performance_margin=margin
        )

    @cached_property
    def aliases(self) -> Aliases | None:
        """Aliases of a continuous set with a sampled controller; None for any other loop."""
        if self.continuous_plant is None:
            return None
        return aliases_of_set(
            self.form,
            self.continuous_plant,
            weight=self.weight,
            perturbation=self.model.perturbation,
            dt=self.dt,
            delay=self.delay,
        )

    def with_aliases(self, curves: Curves) -> AliasedLoop:
        """Evaluate every alias at the frequencies of the curves."""
        assert self.aliases is not None
        return evaluate_aliases(
            self.aliases, curves.omega, S=curves.S, KS=curves.K_S, sampled=curves.G
        )

    @property
    def reason_against_system(self) -> str:
        """Reason why the loop is not a state space with a perturbation; empty if it is one."""
        if FORMS[self.form].depends_on_units:
            return f"no inequality is set up for the {self.form} form; exact arithmetic proves it"
        if self.continuous_plant is not None:
            return (
                "no inequality covers the aliases of a continuous plant; exact arithmetic proves"
                " them"
            )
        if self.pade_delay:
            return "the delay of a continuous loop is not a state space; exact arithmetic proves it"
        for name, weight in (("weight", self.weight), ("w_P", self.w_P)):
            if weight is not None and not is_constant(weight) and timebase(weight) != self.dt:
                return f"{name} is continuous in a sampled loop; exact arithmetic proves it"
        return ""

    @property
    def perturbation_loop(self) -> control.StateSpace:
        """Loop from (perturbation, r) to (input of the perturbation, w_P e), with weights; r and e
        only with w_P.

        The form weights b = w R S, so the factors of R give the channels.
        """
        factors = FORMS[self.form].rs_factors
        outputs, inputs = ["u" if "K" in factors else "y"], ["p_in" if "G" in factors else "p_out"]
        weights = [self.weight]
        if self.w_P is not None:
            outputs, inputs, weights = [*outputs, "e"], [*inputs, "r"], [*weights, self.w_P]
        N = self.closed_loop(tuple(outputs), tuple(inputs))
        joined = control.append(*(control.StateSpace(w.A, w.B, w.C, w.D, self.dt) for w in weights))
        return in_series(N, joined, dt=self.dt)

    def grid(self, lines: np.ndarray) -> np.ndarray:
        """Return a frequency grid [rad/s]: the lines, a log grid, every resonance of the loop."""
        parts = [system for system in (self.G, self.K, self.weight, self.w_P) if system is not None]
        if self.aliases is None:
            folded = np.zeros(0)
        else:
            folded = self.aliases.folded_modes
        return loop_grid(
            lines, self.modes, systems=parts, dt=self.dt, delay=self.plant_delay, folded=folded
        )

    def peak(
        self,
        curve: Callable[[np.ndarray], np.ndarray],
        omega: np.ndarray,
        band: tuple[float, float],
    ) -> Peak:
        """Find the largest value of a curve of this loop and its frequency (`find_peak`)."""
        return find_peak(curve, omega, band=band, top=self.omega_max)


def crossings_of(loop: Loop, curves: Curves) -> np.ndarray:
    """Return frequencies [rad/s] close to each side of every crossing of the nominal loop gain that
    a classical margin is read from, as `frequencies_of_crossings`.
    """
    roots = [to_s_plane(loop.modes, loop.dt)]
    for part in (loop.G, loop.K):
        roots.append(to_s_plane(np.concatenate([poles(part), zeros(part)]), loop.dt))
    return frequencies_of_crossings(
        lambda at: loop.plant_response(at) * loop.responders["K"](at),
        curves.omega,
        curves.loop_gain,
        roots=np.concatenate(roots),
    )


def assemble_loop(
    model: UncertaintyModel, K: Controller, *, w_P: Weight | None, delay: float
) -> Loop:
    """Put plant and controller on one time base; refuse parts that do not fit."""
    K = state_space("K", K)
    delay = require_nonnegative("delay", delay)
    G = model.nominal
    dt_G, dt_K = timebase(G), timebase(K)
    dt = dt_G or dt_K
    if G.nstates + K.nstates + (delay / dt if dt else 0) > _MAX_STATES:
        raise ValueError(
            f"delay must leave at most {_MAX_STATES} states in the loop, got {delay:g} s"
            + (f" with {dt:g} s each sample" if dt else "")
            + f" around {G.nstates + K.nstates} states. A longer sampling time needs fewer"
            " states for the delay."
        )
    pade_delay, unsampled = 0.0, None
    if dt_G:
        if sampling_times_differ(K, G):
            raise ValueError(
                f"K must have the sampling time of the nominal model, {dt_G:g} s, "
                + (f"got {dt_K:g} s" if dt_K else _CONTINUOUS_CONTROLLER.format(dt_G))
            )
        dt = dt_G
        short, shift = G, delay_samples("delay", delay, dt) * dt
        G = delayed(G, shift)
    elif dt_K:
        if FORMS[model.form].depends_on_units:
            raise ValueError(
                f"K must have the sampling time of the nominal model for the {model.form} form,"
                f" because sampling changes its set, got {dt_K:g} s and a continuous nominal."
                " Use sampled(nominal, dt) as the nominal"
            )
        # hold and delay become part of the plant, the part of the delay within a sample included
        dt, unsampled = dt_K, G
        shift = np.floor(delay / dt + 1e-9) * dt
        short, G = sampled(G, dt, max(delay - shift, 0.0)), sampled(G, dt, delay)
    else:
        dt, pade_delay = 0.0, delay
        short, shift = G, delay
        G = delayed(G, delay)
    given, K = K, control.StateSpace(K.A, K.B, K.C, K.D, dt)
    if w_P is not None:
        w_P = stable_weight("w_P", w_P, dt=dt)
    loop = Loop(
        model=model,
        controller=given,
        G=G,
        K=K,
        dt=dt,
        w_P=w_P,
        pade_delay=pade_delay,
        continuous_plant=unsampled,
        undelayed_plant=short,
        plant_delay=float(shift),
        given_plant=model.nominal,
        delay=delay,
    )
    _ = loop.sensitivity_loop  # refuses a loop without a solution
    return loop


def decide_nominal_stability(loop: Loop) -> StabilityResult:
    """Decide whether every pole of the nominal loop, hidden modes included, is strictly stable.

    Floating point decides far from the boundary, exact arithmetic near it, unless the loop is too
    large.
    """
    apparent = decide_in_floating_point(loop)
    if not is_near_boundary(loop.sensitivity_loop, loop.poles):
        return apparent
    if (
        loop.given_plant.nstates + loop.K.nstates + (loop.delay / loop.dt if loop.dt else 0)
        > MAX_EXACT_STATES
    ):
        return apparent
    exact = decide_loop_stability(
        to_matrices(loop.given_plant), to_matrices(loop.K), delay=loop.delay
    )
    if exact.holds:
        return StabilityResult(state=Stability.STABLE)
    if not exact.violated or apparent.unstable:
        return apparent
    return replace(apparent, state=Stability.UNSTABLE, of_loop=True, at_boundary=True)


def decide_in_floating_point(loop: Loop) -> StabilityResult:
    """Decide stability of the loop by its poles and their rounding: stable, unstable, or undecided.

    The decision is for the exact delay of a continuous loop, not for its approximation.
    """
    waiting = loop.pade_delay > 0
    poles, moved = (loop.with_plant(loop.undelayed_plant) if waiting else loop).poles
    if loop.dt:
        excess = np.abs(poles) - 1
    else:
        excess = poles.real
    unstable = excess > moved
    if unstable.any() and not waiting:
        return StabilityResult(
            state=Stability.UNSTABLE, pole=complex(poles[int(np.argmax(excess))]), of_loop=True
        )
    if np.any(excess[~unstable] >= -moved[~unstable]):
        worst = int(np.argmax(np.where(unstable, -np.inf, excess + moved)))
        pole = complex(poles[worst])
        return StabilityResult(
            state=Stability.UNDECIDED, pole=pole, of_loop=True, without_delay=waiting
        )
    if not waiting:
        return StabilityResult(state=Stability.STABLE)
    total = unstable.sum() + delay_pole_count(
        in_series(loop.K, loop.undelayed_plant), loop.pade_delay
    )
    if np.isnan(total):
        return StabilityResult(state=Stability.UNDECIDED, of_loop=True)
    if not total:
        return StabilityResult(state=Stability.STABLE)
    return StabilityResult(state=Stability.UNSTABLE, of_loop=True, n_unstable=float(total))


def find_margins(loop: Loop, curves: Curves, band: tuple[float, float]) -> Margins:
    """Find the margins over all frequencies: the largest values of the curves, refined."""
    names = ["rs", "half_disk", *([] if loop.w_P is None else ["np_"])]

    def stacked(of: Curves, names: list[str]) -> np.ndarray:
        return np.array([getattr(of, name) for name in names])

    def along(names: list[str]) -> list[Peak]:
        return refine_peaks(
            lambda at: stacked(loop.curves(at), names),
            curves.omega,
            values=stacked(curves, names),
            band=band,
        )

    rs, disk, *performance = along(names)
    rp = None
    for nominal in performance:
        if nominal.value < 1:  # the largest factor on the uncertainty with |w_P| max |S_p| <= 1
            rp = along(["inverse_performance_margin"])[0]
        else:
            rp = Peak(np.inf, nominal.omega)
    if rs.value < 1:
        S = along(["S_worst"])[0]
    else:
        S = Peak(np.inf, rs.omega)
    return Margins(peak_rs=rs, peak_rp=rp, peak_disk=disk, peak_S=S)


def plant_in_loop(plant: control.StateSpace, loop: Loop, delay: float) -> control.StateSpace:
    """Return a plant with the hold and delay of the loop: sampled, or with its delay."""
    if loop.dt and not timebase(plant):
        return sampled(plant, loop.dt, delay)
    return delayed(plant, delay)


def perturbed_sensitivity(
    plant: control.StateSpace, seen: control.StateSpace, loop: Loop, omega: np.ndarray
) -> np.ndarray:
    """Return S (W,) with another plant; in a continuous loop with the exact delay."""
    if loop.pade_delay:
        around = replace(loop.with_plant(plant), plant_delay=loop.pade_delay)
    else:
        around = loop.with_plant(seen)
    return around.curves(omega).S


def is_stable_with(plant: control.StateSpace, seen: control.StateSpace, loop: Loop) -> bool:
    """Return whether the loop is stable with another plant `seen`, with hold and delay."""
    other = replace(
        loop, G=seen, undelayed_plant=plant if loop.pade_delay else seen, given_plant=plant
    )
    return decide_nominal_stability(other).stable
