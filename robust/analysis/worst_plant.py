"""The worst plant of a set, and the smallest destabilising perturbation, as systems to simulate.

The worst perturbation is a complex number or matrix at one frequency (SP 7.6.3, 8.10.3). A
first-order all-pass can have any phase at this frequency, and has gain one at all frequencies. So
the set contains the plant with this all-pass as perturbation.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_real, short_form
from nlfrf._base.values import value
from robust._base.types import Controller, LinearSystem, Weight
from robust._base.warnings import DesignWarning
from robust.analysis.aliases import worst_alias_phases
from robust.analysis.loop import (
    Loop,
    assemble_loop,
    decide_nominal_stability,
    is_stable_with,
    perturbed_sensitivity,
    plant_in_loop,
)
from robust.analysis.loop_of_channels import performance_loop, set_gain
from robust.analysis.loop_proofs import has_worst_gain_below
from robust.analysis.sampled_set import set_on_controller_time_base
from robust.analysis.step import StepResponse, step_of_plant
from robust.lti.connections import block_diagonal, in_series, upper_lft, worst_perturbation
from robust.lti.grids import structure_grid
from robust.lti.lti import response, response_by_channel, timebase
from robust.models.sets.forms import ELEMENTS, FORMS
from robust.models.sets.interconnection import UncertainSystem
from robust.models.sets.model import (
    UncertaintyModel,
    has_several_channels,
    is_within_set,
    require_parametric,
)
from robust.models.sets.perturbations import perturbed_plant, with_phase, with_phases
from robust.mu.both_bounds import worst_gain
from robust.mu.perturbations import lower
from robust.mu.scalings import refine_grid
from robust.proofs.search.stability import decide_stability

_LEVEL_MARGIN = 1e-4  # relative distance of the proved level from the largest gain for one channel


@value
class WorstCase:
    """The largest sensitivity over a set, and a plant of the set that attains it.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    gain : (W,) ndarray
        Largest |S_p| over the set (|w_P S_p| with w_P); inf if the loop with a plant of the set has
        a pole on the stability boundary. For several channels: upper bound of the largest singular
        value, computed by mu.
    omega_worst : float
        Frequency [rad/s] of the largest gain, or at which a perturbation destabilises the loop.
    plant : control.StateSpace
        A plant of the set that attains the largest gain at omega_worst. For a continuous nominal it
        is continuous, also if K is sampled. For several channels it is the worst plant found, whose
        gain may be lower than the bound; it is sampled if K is sampled.
    delta : complex, or (n_out, n_in) complex ndarray
        The perturbation of this plant at omega_worst; for several channels a matrix with one row
        for each output of Delta and one column for each of its inputs. Its modulus (largest
        singular value) is below one if a perturbation below one destabilises the loop.
    achieved : float
        |S_p| (or |w_P S_p|, or its largest singular value) of the loop with `plant` at omega_worst,
        recomputed.
    stable : bool
        Whether the loop with `plant` is stable.
    n_lines : int
        0 if the largest value of `gain` is proved, within 0.1 %, to be the largest at all
        frequencies; otherwise the number of frequencies checked.

    References
    ----------
    SP 7.6.3.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> worst = worst_case(model, 2.0)
    >>> worst.stable, bool(abs(worst.achieved - worst.gain.max()) < 1e-3)
    (True, True)
    >>> print(worst)
    largest gain over the set at most 1.01; the plant, of 2 states, has 1.01 at 2.876 Hz
    """

    omega: np.ndarray
    gain: np.ndarray
    omega_worst: float
    plant: control.StateSpace
    delta: complex | np.ndarray
    achieved: float
    stable: bool
    n_lines: int = 0

    def __str__(self) -> str:
        at = format_hertz(self.omega_worst)
        size = float(np.linalg.norm(np.atleast_2d(self.delta), 2))
        if not self.stable:
            plant = f"a plant of the set, of {self.plant.nstates} states and |Delta| {size:.3g},"
            return f"{plant} makes the loop unstable at {at}"
        plant = f"the plant, of {self.plant.nstates} states, has {self.achieved:.4g} at {at}"
        where = f" on {self.n_lines} frequencies" * (self.n_lines > 0)
        return f"largest gain over the set at most {np.max(self.gain):.4g}{where}; {plant}"


def worst_case(
    model: UncertaintyModel, K: Controller, w_P: Weight | None = None, *, delay: float = 0.0
) -> WorstCase:
    """Find the plant of a set with the largest sensitivity.

    Use this to simulate the worst machine that a verdict covers; the field `plant` contains it as a
    system.

    Parameters
    ----------
    model : UncertaintyModel
        The set, with a parametric nominal and any number of channels.
    K : control.StateSpace, TransferFunction or float
        Controller, continuous or discrete, negative feedback.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight on S. Default: 1.
    delay : float
        Computation delay [s]. For several channels it must be 0, with the delay in the nominal,
        unless the nominal is continuous and K is sampled.

    Returns
    -------
    WorstCase

    Raises
    ------
    ValueError
        A nominal loop that is not stable, parts that do not fit each other.

    References
    ----------
    SP 7.6.3 (worst-case plants), 8.10.3.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> at, radius = np.array([1.0, 2.0]), np.array([0.1, 0.2])
    >>> model = UncertaintyModel(control.tf([1], [1, 1]), control.tf([0.2], [1]), "multiplicative", at, radius)
    >>> worst = worst_case(model, 2.0)
    >>> bool(np.all(model.distance(worst.plant) <= 1 + 1e-9))             # a plant of the set
    True
    """
    require_parametric(model, "to make plants of")
    if not model.is_single:
        return _worst_case_matrix(model, K, w_P=w_P, delay=delay)
    loop = assemble_loop(model, K, w_P=w_P, delay=delay)
    nominal = decide_nominal_stability(loop)
    if not nominal.stable:
        raise ValueError(
            "K must stabilise the nominal plant, because a worst case exists only then, got a"
            f" loop that is {nominal}"
        )
    omega = loop.grid(model.omega)
    band = (float(model.omega[0]), float(model.omega[-1]))
    peak_b, where = loop.peak(lambda points: loop.curves(points).rs, omega, band)
    if peak_b < 1:
        where = loop.peak(lambda points: loop.curves(points).worst_performance, omega, band)[1]
    there = loop.curves(where)
    phased = _phases_of_aliases(loop, where)
    if peak_b >= 1:
        delta = complex(-1 / there.b[0])
    else:
        delta = complex(worst_perturbation(there.a, there.b)[0])
    delta *= np.exp(1j * where * _perturbation_lead(loop, delay)) / max(1.0, abs(delta))
    turn = FORMS[model.form].phase_offset(
        in_series(model.nominal, model.shaping), model.weight, where
    )
    # the perturbation is relative to the phase of the weight
    Delta = with_phase(where, delta / turn, timebase(model.nominal) or timebase(model.weight))
    if phased is not None:  # each alias with a considerable part has its own phase
        delta = np.exp(1j * phased[1][0]) / max(1.0, peak_b)
        Delta = with_phases(*phased) * abs(delta)
    plant = perturbed_plant(model.form, model.nominal, model.weight, Delta, model.shaping)
    if FORMS[model.form].depends_on_units and not is_within_set(
        model, plant
    ):  # only these forms need factors; the perturbation of the others is exact
        raise ValueError(
            "model must have a worst plant that floating point can represent, got a plant that"
            " rounding moves outside the set"
        )
    seen = plant_in_loop(plant, loop, delay)
    at, omega = np.array([where]), np.unique(np.append(omega, where))
    S = perturbed_sensitivity(plant, seen, loop, at)
    achieved = np.abs(S if loop.w_P is None else S * response(loop.w_P, at))[0]
    gain = loop.curves(omega).worst_performance
    level = float(gain.max()) * (1 + _LEVEL_MARGIN)
    proved = np.isinf(level) or has_worst_gain_below(loop, level)
    return WorstCase(
        omega=omega,
        gain=np.where(omega == omega[gain.argmax()], level, gain) if proved else gain,
        omega_worst=where,
        plant=plant,
        delta=delta,
        achieved=float(achieved),
        # the perturbation was made to put a pole on the boundary; rounding must not turn that into
        # "stable"
        stable=peak_b < 1 and is_stable_with(plant, seen, loop),
        n_lines=0 if proved else omega.size,
    )


def step_response(
    plant: LinearSystem | UncertaintyModel,
    K: Controller,
    *,
    delay: float = 0.0,
    duration: float | None = None,
    reference: int = 0,
) -> StepResponse:
    """Simulate a reference step of the loop u = K (r - y), for a plant or for a set.

    Use this to see overshoot, rise time, settling time and the plant input during the step.

    Parameters
    ----------
    plant : control.StateSpace, TransferFunction or UncertaintyModel
        One plant; or a set. For a set the response is that of the nominal, and the field `worst`
        contains the response with the plant of largest |S| (`worst_case`).
    K : control.StateSpace, TransferFunction or float
        Controller. A sampled K acts on a continuous plant through its hold; the response is exact
        at the sampling instants. The delay of a continuous loop is a Padé approximation of order 8.
    delay : float
        Computation delay [s].
    duration : float, optional
        Duration of the simulation [s]. Default: until y has settled.
    reference : int
        For several outputs: index (from 0) of the output whose reference steps. Overshoot, rise
        time and settling time are those of this output.

    Returns
    -------
    StepResponse

    Raises
    ------
    ValueError
        A loop that is not stable, a negative delay, parts that do not fit each other.

    Warns
    -----
    DesignWarning
        A plant of the set makes the loop unstable; the result is then that of the nominal alone.

    References
    ----------
    SP 2.4.1.

    Examples
    --------
    >>> step = step_response(control.tf([1], [1, 0.6, 1]), control.tf([0], [1]) + 1)     # zeta 0.3/sqrt(2), omega^2 2
    >>> zeta = 0.3 / np.sqrt(2)
    >>> bool(abs(step.overshoot - np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))) < 1e-3)
    True
    """
    if not isinstance(plant, UncertaintyModel):
        return step_of_plant(plant, K, delay=delay, duration=duration, reference=reference)
    worst = worst_case(plant, K, delay=delay)
    step = step_of_plant(plant.nominal, K, delay=delay, duration=duration, reference=reference)
    if not worst.stable:
        warnings.warn(
            f"a plant of the set makes the loop unstable, at {format_hertz(worst.omega_worst)}:"
            " the step response contains the nominal plant only",
            DesignWarning,
            stacklevel=2,
        )
        return step
    # a worst plant that was sampled for the controller includes the delay
    left = delay if timebase(worst.plant) == timebase(plant.nominal) else 0.0
    return replace(
        step,
        worst=step_of_plant(worst.plant, K, delay=left, duration=duration, reference=reference),
    )


def _phases_of_aliases(loop: Loop, omega: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return frequencies and phases of the worst Delta at omega [rad/s]; None if aliases do not
    contribute.

    In an inverse form the worst plant is that of the frequency itself.
    """
    if loop.aliases is None or loop.aliases.inverse:
        return None
    found = worst_alias_phases(loop.with_aliases(loop.curves(omega)))
    if found[0].size > 1:
        return found
    return None


def _perturbation_lead(loop: Loop, delay: float) -> float:
    """Return the time [s] by which Delta of the plant leads Delta of `Curves`, which acts after
    delay and hold.
    """
    lag = delay + (loop.dt / 2 if loop.continuous_plant is not None else 0.0)
    return FORMS[loop.form].delay_order * lag


# ---- The smallest perturbation found that breaks a loop with several inputs and outputs, as a
# stable system.
#
# At one frequency the lower bound of mu gives a matrix that makes the loop singular: an input and
# an output direction, or one number a block. A first-order all-pass has any phase at one frequency
# and the same gain at all of them, so a vector of all-passes carries each direction, and the
# perturbation is no larger at any other frequency.

_BAND_EDGE_RATIO = 1e-4  # relative to the lowest frequency, or to the distance from Nyquist
_N_PEAKS = 3  # frequencies at which the worst perturbation is searched


def _worst_case_matrix(
    model: UncertaintyModel, K: Controller, *, w_P: Weight | None, delay: float
) -> WorstCase:
    """Find the worst case for several channels: the bound by mu, and the worst perturbation found
    at its peaks.
    """
    model, _ = set_on_controller_time_base(model, K, delay)
    system = performance_loop(model, K, w_P)
    largest = set_gain(system.N, system.structure)
    omega, gain = largest.omega, largest.gain
    try:
        broken = breaking_perturbation(model, K)
    except ValueError:  # nothing breaks the loop
        broken = None
    if broken is not None and broken.size <= 1:
        where, Delta, stable = broken.omega, _scale_system(broken.Delta, broken.size), False
    else:
        dt = timebase(model.nominal)
        found = []
        peaks = np.unique(np.clip(omega[np.argsort(-gain)[:_N_PEAKS]], *_phase_band(omega, dt)))
        deltas = worst_gain(system.N, system.structure, peaks).delta
        for k, at in enumerate(peaks):
            one = _interpolate_perturbation(
                deltas[:, :, k], float(at), dt, full=model.form != ELEMENTS
            )
            found.append((_performance_gain(system, one, float(at)), float(at), one))
        _, where, Delta = max(found, key=lambda one: one[0])
        stable = decide_stability(upper_lft(system.N, Delta)).stable
    return WorstCase(
        omega=omega,
        gain=gain,
        omega_worst=where,
        plant=model.perturbed(Delta),
        delta=response_by_channel(Delta, np.array([where]))[:, :, 0],
        achieved=_performance_gain(system, Delta, where),
        stable=stable,
        n_lines=largest.n_lines,
    )


def _performance_gain(system: UncertainSystem, Delta: control.StateSpace, omega: float) -> float:
    """Return the largest singular value from inputs to outputs with a perturbation."""
    return float(
        np.linalg.norm(
            response_by_channel(upper_lft(system.N, Delta), np.array([omega]))[:, :, 0], 2
        )
    )


def _scale_system(Delta: control.StateSpace, size: float) -> control.StateSpace:
    return control.StateSpace(Delta.A, Delta.B, size * Delta.C, size * Delta.D, Delta.dt)


def _phase_band(omega: np.ndarray, dt: float) -> tuple[float, float]:
    """Return the frequencies [rad/s] between which an all-pass can have any phase: above zero and
    below Nyquist.
    """
    return _BAND_EDGE_RATIO * float(omega[omega > 0].min()), (
        np.pi / dt * (1 - _BAND_EDGE_RATIO) if dt else np.inf
    )


@value
class _BreakingPerturbation:
    """A perturbation that puts a pole of the loop on the stability boundary (SP 8.8)."""

    size: float  # gain of the perturbation: it lies in the set if below one
    omega: float  # frequency at which the loop becomes singular [rad/s]
    Delta: control.StateSpace  # the perturbation over its size: gain one at every frequency
    model: UncertaintyModel  # the set

    def plant(self, factor: float = 1.0) -> control.StateSpace:
        """Return the plant with `factor` times the smallest breaking perturbation: at 0.99 stable,
        at 1.01 not.
        """
        return self.model.perturbed(
            _scale_system(self.Delta, require_real("factor", factor) * self.size)
        )


def breaking_perturbation(model: UncertaintyModel, K: Controller) -> _BreakingPerturbation:
    """Find a smallest destabilising perturbation of a loop u = K (r - y) with several channels.

    Use this to simulate the failure of a loop, or to test how sharp the margin is. The loop is
    stable with the plant `plant(0.99)` of the result, and unstable with `plant(1.01)`. For one
    channel use `worst_case`.

    Parameters
    ----------
    model : UncertaintyModel
        The set.
    K : control.StateSpace
        Controller, negative feedback.

    Returns
    -------
    BreakingPerturbation
        Its fields are `size`, the gain of the perturbation (below one: the set contains it);
        `omega` [rad/s], the frequency at which the loop becomes singular; and `Delta`, the
        perturbation divided by its size. `plant(factor)` returns the plant with factor times the
        perturbation.

    Raises
    ------
    ValueError
        A model with one channel, a nominal loop that is not stable, a K that does not fit the
        model, or a loop that no perturbation destabilises.

    References
    ----------
    SP 8.8; Packard & Doyle 1993.

    Examples
    --------
    >>> G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> w = control.ss([], [], [], [[0.5]])
    >>> omega = np.array([1.0])
    >>> model = UncertaintyModel(
    ...     nominal=G, form="elements", left=(), right=(w,) * 4, omega=omega, radius=np.full((4, 1), 0.5),
    ...     confidence=0.95)
    >>> K = control.ss([], [], [], np.eye(2))
    >>> round(breaking_perturbation(model, K).size, 3)   # all four at once: 1 + 2 * 0.5 d = 0
    1.0
    """
    if not has_several_channels(model):
        raise ValueError(
            f"model must have several channels, got {short_form(model)}: use worst_case for one"
            " channel"
        )
    system = model.loop(K)
    nominal = decide_stability(system.N)
    if not nominal.stable:
        raise ValueError(f"K must stabilise the nominal plant, got a loop that is {nominal}")
    N = system.loop
    omega, mu = refine_grid(N, system.structure, omega=structure_grid(N))
    dt = timebase(N)
    # at zero and at Nyquist N is real and an all-pass has no phase: use frequencies just beside
    # them
    some = np.unique(np.clip(omega[np.argsort(-mu)[:6]], *_phase_band(omega, dt)))
    found = lower(response_by_channel(N, some), system.structure, n_starts=3)
    k = int(found.value.argmax())
    if not found.value[k] > 0:
        raise ValueError(
            "K must not be zero, because no perturbation destabilises the loop then, got a"
            " zero controller"
        )
    assert found.delta is not None  # a lower bound comes with its perturbation
    delta = found.delta[:, :, k] * found.value[k]  # gain one
    return _BreakingPerturbation(
        size=float(1 / found.value[k]),
        omega=float(some[k]),
        Delta=_interpolate_perturbation(delta, float(some[k]), dt, full=model.form != ELEMENTS),
        model=model,
    )


def _interpolate_perturbation(
    delta: np.ndarray, omega: float, dt: float, *, full: bool
) -> control.StateSpace:
    """Return a stable real system of gain one that equals `delta` (drives, reads) at omega: rank
    one, or diagonal.
    """
    if not full:
        return _all_passes(np.diag(delta), omega, dt)
    U, sizes, Vh = np.linalg.svd(delta)
    into, out = Vh[0] * sizes[0], U[:, 0]
    add = control.StateSpace([], [], [], np.ones((1, into.size)), dt)
    spread = control.StateSpace([], [], [], np.ones((out.size, 1)), dt)
    return in_series(
        _all_passes(into, omega, dt),
        add,
        spread,
        _all_passes(out, omega, dt),
        dt=dt,
    )


def _all_passes(numbers: np.ndarray, omega: float, dt: float) -> control.StateSpace:
    """Return parallel first-order all-passes that equal these complex numbers at omega."""
    return block_diagonal([with_phase(omega, complex(number), dt) for number in numbers], dt)
