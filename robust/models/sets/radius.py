"""How large the disc about a nominal has to be on each measured line, and what that radius is made of."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import format_count, require_choice, require_nonnegative, require_real_array, short_form
from robust._base.channels import is_single
from robust.lti.grids import interpolate_frf
from robust.lti.lti import response, timebase
from robust.lti.realisation import frequency_response, state_space
from robust.lti.sampling import delayed
from robust.models.fit.nominal import NominalFit, suspected
from robust.models.fit.weights import fit_weight
from robust.models.sets.forms import Form

__all__ = [
    "PARTS",
    "as_nominal",
    "extrapolated",
    "family",
    "frf_at",
    "measured_as",
    "misfit",
    "nominal_response",
    "of_form",
    "own_set",
    "record_disc",
    "scaled_by",
    "slope",
    "spread_over",
    "total_of",
    "worded",
]


#: What a radius is made of.
PARTS = ("noise", "odd", "even", "misfit", "level", "systematic")
MISFIT_WINDOW = 9
DECADES_ABOVE = 2.0
PADE_ORDER = 4
#: Smallest radius of one's own over the largest: a plant that is the nominal on a line leaves none.
LEAST = 1e-6


def nominal_response(nominal: Any, omega: np.ndarray) -> np.ndarray:
    """(W,) response of the nominal; an FRF is interpolated in log magnitude and phase (it is met on its lines)."""
    if not isinstance(nominal, control.FrequencyResponseData):
        return response(nominal, omega)
    known, G = frequency_response("nominal", nominal, omega)
    if omega[0] < known[0] * (1 - 1e-6) or omega[-1] > known[-1] * (1 + 1e-6):
        raise ValueError("nominal must be an FRF over the whole band of bla, got one that is shorter")
    return interpolate_frf(omega, known, G)


def family(
    many: list[Bla], nominal: Any, p: float, simultaneous: bool, even: bool, systematic: float | None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Frequencies of all records together, and the parts of the largest absolute radius over the records."""
    omega = np.unique(np.concatenate([b.omega for b in many]))
    discs = [record_disc(b, nominal, p, simultaneous, even, systematic) for b in many]
    total = np.array([spread_over(omega, b.omega, total_of(disc)) for b, disc in zip(many, discs, strict=True)])
    worst = np.nanargmax(np.where(np.isnan(total), -np.inf, total), axis=0)
    parts = {}
    for name in PARTS:
        each = np.array([spread_over(omega, b.omega, disc[name]) for b, disc in zip(many, discs, strict=True)])
        parts[name] = np.take_along_axis(each, worst[None, :], axis=0)[0]
    # what the family as a whole misses is misfit; what one level misses beyond that is the level's doing
    together = np.nanmin([spread_over(omega, b.omega, d["misfit"]) for b, d in zip(many, discs, strict=True)], axis=0)
    if len(many) > 1:
        parts["level"] = np.maximum(parts["misfit"] - together, 0.0)
        parts["misfit"] = parts["misfit"] - parts["level"]
    return omega, parts


def total_of(parts: dict[str, np.ndarray]) -> np.ndarray:
    """The parts of a radius added up."""
    return np.sum(list(parts.values()), axis=0)


def record_disc(
    bla: Bla, nominal: Any, p: float, simultaneous: bool, even: bool, systematic: float | None
) -> dict[str, np.ndarray]:
    """Parts (F,) of the absolute radius about the nominal that one record asks for."""
    F = bla.f.size
    quantile = bla.f_quantile(p, simultaneous=simultaneous)
    noise = np.nan_to_num(bla.var_noise)
    # of a new realisation: the error of G itself, plus the scatter of one realisation, which M does not reduce
    scatter = bla.bound(p, of="realization", simultaneous=simultaneous) ** 2 / quantile
    shares = {
        "noise": np.minimum(noise, scatter),
        "odd": np.maximum(scatter - noise, 0.0),
        "even": np.nan_to_num(bla.var_even) if even else np.zeros(F),
    }
    variance = total_of(shares)
    radius = np.sqrt(quantile * variance)
    parts = {
        name: radius * np.divide(share, variance, out=np.zeros(F), where=variance > 0) for name, share in shares.items()
    }
    parts["misfit"] = misfit(bla, nominal_response(nominal, bla.omega))
    parts["level"] = np.zeros(F)
    parts["systematic"] = np.zeros(bla.f.size) if systematic is None else bla.systematic(systematic)
    total = total_of(parts)
    floor = np.maximum(1e-9 * np.abs(nominal_response(nominal, bla.omega)), np.finfo(float).tiny)
    parts["misfit"] = parts["misfit"] + np.maximum(floor - total, 0.0)  # a disc has a radius even without any scatter
    return parts


def misfit(bla: Bla, model: np.ndarray) -> np.ndarray:
    """(F,) what the model misses beyond scatter: windowed mean of |residual|^2 less the variance, as an amplitude.

    Relative to the model inside the window, or a resonance would spread over its neighbours. A line that sticks out
    of all scatter by itself counts by itself: a window would hide a narrow error.
    """
    square = np.abs(bla.G - model) ** 2
    var = bla.var_bound
    F = square.size
    half = min(MISFIT_WINDOW, F) // 2
    size = np.maximum(np.abs(model) ** 2, np.finfo(float).tiny)
    sums = np.concatenate([[0.0], np.cumsum((square - var) / size)])
    first = np.clip(np.arange(F) - half, 0, max(F - 2 * half - 1, 0))
    last = np.minimum(first + 2 * half + 1, F)
    around = size * (sums[last] - sums[first]) / (last - first)
    alone = np.where(square > bla.f_quantile(0.95, simultaneous=True) * var, square - var, 0.0)
    return np.sqrt(np.maximum(np.maximum(around, alone), 0.0))


def spread_over(omega: np.ndarray, lines: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values on other frequencies: the larger neighbour inside the band of the lines, nan outside it."""
    right = np.clip(np.searchsorted(lines, omega), 0, lines.size - 1)
    left = np.where(lines[right] == omega, right, np.maximum(right - 1, 0))
    out = np.maximum(values[left], values[right])
    out[(omega < lines[0]) | (omega > lines[-1])] = np.nan
    return out


def extrapolated(
    omega: np.ndarray, radius: np.ndarray, below: float, above: float, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """The radius continued outside the band by the rule of the user, for the weight to cover."""
    step = np.linspace(0, DECADES_ABOVE, 41)[1:]
    low, high = omega[0] * 10 ** -step[::-1], omega[-1] * 10**step
    if dt:
        nyquist = np.pi / dt * (1 - 1e-9)
        high = np.concatenate([high[high < nyquist], [nyquist]]) if omega[-1] < nyquist else high[:0]
    out = np.concatenate(
        [
            radius[0] * (omega[0] / low) ** (below / 20),
            radius,
            radius[-1] * (high / omega[-1]) ** (above / 20),
        ]
    )
    return np.concatenate([low, omega, high]), out


def of_form(
    form: Form,
    omega: np.ndarray,
    absolute: np.ndarray,
    nominal: Any,
    shaped_by: tuple[Any, Any],
    below: float,
    above: float,
    dt: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factor from an absolute radius to that of the form; frequencies and radii to be covered, outside the band too.

    For a form that depends on the units of the plant it is the relative radius that is continued, |G| being what it
    is there: its own has a limit.
    """
    if not form.scaled:
        factor = form.radius_factor(omega, absolute, np.abs(nominal_response(nominal, omega)))
        return factor, *extrapolated(omega, absolute * factor, below, above, dt)

    def sizes(omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # |G|, and |W1 W2| of what is given of them
        inside = omega  # an FRF stays what it is at its ends
        if isinstance(nominal, control.FrequencyResponseData):
            inside = np.clip(omega, np.min(nominal.omega), np.max(nominal.omega))
        scaling = [response(state_space("W1 and W2", W), omega) for W in shaped_by if W is not None]
        return np.abs(nominal_response(nominal, inside)), np.abs(np.prod([np.ones(omega.size), *scaling], axis=0))

    size, scale = sizes(omega)
    factor = scale * form.radius_factor(omega, absolute * scale, size * scale)
    wide, relative = extrapolated(omega, absolute / np.maximum(size, 1e-300), below, above, dt)
    size, scale = sizes(wide)
    there = relative * size * scale
    try:
        return factor, wide, there * form.radius_factor(wide, there, size * scale)
    except ValueError as error:
        raise ValueError(f"below and above must leave a radius outside the band too: {error}") from None


def scaled_by(
    form: Form, nominal: Any, omega: np.ndarray, shaped_by: tuple[Any, Any], rules: tuple[Any, Any]
) -> tuple[Any, Any, float, float]:
    """W1, W2 and the slopes below and above the band, as they are taken.

    Where the form needs a scaling and none is given: unit gain in mid band, so that the mean of |G| in decibels over
    log frequency is zero. Outside the lines of an FRF there is no plant that a radius could be relative to.
    """
    below, above = slope("below", rules[0]), slope("above", rules[1])
    if not form.scaled:
        return *shaped_by, below, above
    if isinstance(nominal, control.FrequencyResponseData):
        below = above = 0.0
    if shaped_by != (None, None):
        return *shaped_by, below, above
    size, log = np.log(np.abs(nominal_response(nominal, omega))), np.log(omega)
    middle = np.trapezoid(size, log) / (log[-1] - log[0]) if omega.size > 1 else size[0]
    return 1.0, float(np.exp(-middle)), below, above


def frf_at(nominal: control.FrequencyResponseData, omega: np.ndarray) -> np.ndarray:
    """(.,) response of a nominal that is known on its lines only, on some of them."""
    known = np.asarray(nominal.omega)
    place = np.clip(np.searchsorted(known, omega), 0, known.size - 1)
    place = np.where((place > 0) & (np.abs(known[place - 1] - omega) < np.abs(known[place] - omega)), place - 1, place)
    if np.any(np.abs(known[place] - omega) > 1e-6 * omega):
        raise ValueError("omega must consist of lines of the nominal FRF, got others: it is known on its lines only")
    return np.asarray(nominal.frdata[0, 0])[place]


def slope(name: str, rule: Any) -> float:
    """dB per decade away from the band."""
    return 0.0 if isinstance(rule, str) and require_choice(name, rule, ("flat",)) else require_nonnegative(name, rule)


def worded(rule: float) -> str:
    """The extrapolation rule in words."""
    return "flat" if rule == 0 else f"rising {rule:g} dB/decade over {DECADES_ABOVE:g} decades"


def as_nominal(nominal: Any) -> tuple[Any, float, float]:
    """The nominal with its delay inside, that delay and its sampling time [s]."""
    delay = nominal.delay if isinstance(nominal, NominalFit) else 0.0
    if isinstance(nominal, NominalFit):
        nominal = delayed(nominal.G, delay, order=PADE_ORDER)
    if isinstance(nominal, control.FrequencyResponseData):
        return nominal, delay, 0.0
    nominal = state_space("nominal", nominal)
    return nominal, delay, timebase(nominal)


def measured_as(bla: Bla) -> str:
    """A record in words."""
    lines = f"{bla.f.size} lines {bla.f[0]:g} to {bla.f[-1]:g} Hz"
    if bla.grid == "given":
        return f"an FRF that was given, {lines}, variance from its {bla.level_source}"
    return (
        f"{bla.grid} multisine, {lines}, {bla.n_realizations} realisations "
        f"x {bla.n_periods} periods, level from {bla.level_source}"
    )


def own_radius(given: Any, nominal: Any, form: Form) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Frequencies [rad/s], radius in the unit of the form, and its source in words; None where Blas were given.

    Two arrays are frequencies and radius as they are; FRFs or systems are plants that the set has to hold.
    """
    many = list(given) if isinstance(given, (list, tuple)) else [given]
    if many and all(map(is_single, many)):
        return None
    if not any(is_plant(part) or isinstance(part, np.ndarray) for part in many):
        raise ValueError(f"bla must be an nlfrf.Bla, a list of them, or a radius of your own, got {short_form(given)}")
    if form.scaled:
        raise ValueError(f"form must not depend on units where the radius is your own, got {form.name}")
    if isinstance(given, tuple) and len(many) == 2 and not any(is_plant(part) for part in many):
        omega, radius = require_real_array("omega", many[0], ndim=1), require_real_array("radius", many[1], ndim=1)
        if omega.shape != radius.shape or not np.all(radius > 0) or not np.all(np.diff(omega, prepend=0.0) > 0):
            raise ValueError("radius must be positive, one for each omega, and these positive and increasing")
        return omega, radius, "a radius that was given"
    if not all(is_plant(part) for part in many):
        raise ValueError("bla must be all plants (FRFs or systems), or (omega, radius), where the radius is your own")
    lines = plant_lines(many, nominal)
    each, differs = [], False
    for plant in many:
        omega, G = frequency_response("bla", plant, lines, (nominal, *many))
        centre = nominal_response(nominal, omega)
        differs |= bool(np.any(np.abs(G - centre) > 1e-12 * np.abs(centre)))
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(form.deviation(G, centre))
        if not np.isfinite(away).all():
            raise ValueError(
                f"bla must leave the radius finite, got a plant or nominal that vanishes: {form.name} form"
            )
        each.append(spread_over(lines, omega, away))
    radius = np.nanmax(each, axis=0)
    if not differs:
        raise ValueError("bla must hold a plant beside the nominal, got none that differs")
    return lines, np.maximum(radius, LEAST * radius.max()), f"{format_count(len(many), 'plant')} that were given"


def is_plant(part: Any) -> bool:
    """Whether it is an FRF or a system."""
    return isinstance(part, (control.FrequencyResponseData, control.StateSpace, control.TransferFunction))


def plant_lines(many: list[Any], nominal: Any) -> np.ndarray:
    """All frequencies [rad/s] of the FRFs among the plants, or of the nominal where it is one."""
    known = [plant for plant in [*many, nominal] if isinstance(plant, control.FrequencyResponseData)]
    if not known:
        raise ValueError("bla must hold an FRF, to say at which frequencies: control.frd(plant, omega)")
    return np.unique(np.concatenate([np.asarray(plant.omega, dtype=float) for plant in known]))


def own_set(
    given: Any, nominal: Any, form: Form, rules: tuple[Any, Any], dt: float, asked: dict[str, Any]
) -> dict[str, Any]:
    """The fields of a set with a radius of the user's own, its weight fitted, no confidence claimed; none of Blas."""
    found = own_radius(given, nominal, form)
    if found is None:
        return {}
    if asked["simultaneous"] or asked["systematic"] is not None:
        raise ValueError("simultaneous and systematic must be left out where the radius is your own: they are of a Bla")
    omega, radius, source = found
    below, above = slope("below", rules[0]), slope("above", rules[1])
    weight = fit_weight(*extrapolated(omega, radius, below, above, dt), order=asked["order"], dt=dt).W
    words = f"below the band {worded(below)}, above it {worded(above)}"
    return {
        "omega": omega,
        "radius": radius,
        "weight": suspected(weight, omega, radius),
        "perturbation": asked["perturbation"],
        "extrapolation": words,
        "source": source,
    }
