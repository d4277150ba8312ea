"""``UncertaintyModel``: a nominal and a disc around it at every frequency, with what the disc is made of and means.

    form                    set of plants, |Delta| <= 1      radius from a disc r about G on the lines
    multiplicative          G (1 + w Delta)                  r / |G|
    additive                G + w Delta                      r
    inverse-multiplicative  G / (1 + w Delta)                r / (|G| - r)
    inverse-additive        G / (1 + w G Delta)              r / (|G| (|G| - r))
    coprime                 (N + Delta_N)/(M + Delta_M)      r / sqrt((1 + |G|^2)(1 + (|G| - r)^2)), G and r scaled

(SP 7.4 and 8.2.3.) A disc from the spread of a measured FRF is *statistical*: it says where the FRF of another
realisation lies, with a probability; the perturbation that caused it is a nonlinear one, and no theorem turns that
into stability. "LTI" and "operator" are claims about the perturbation that only the user can make.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    random_generator,
    require_choice,
    require_probability,
    require_real,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust.lti.connections import in_series
from robust.lti.lti import replace_infinite, response, timebase
from robust.lti.realisation import frequency_response, rightmost_pole, state_space
from robust.lti.stability import is_stable
from robust.models.fit.nominal import as_matrices, behind_hold, of_own_fit, suspected
from robust.models.fit.weights import fit_weight
from robust.models.sets.coprime import as_shaping, refuse_everything
from robust.models.sets.evidence import Evidence
from robust.models.sets.forms import ELEMENTS, FORMS, PERTURBATIONS, RELATIVE
from robust.models.sets.joint import known_jointly, told
from robust.models.sets.matrix_model import MatrixUncertainty
from robust.models.sets.matrix_radius import matrix_uncertainty
from robust.models.sets.perturbations import random_plants
from robust.models.sets.radius import (
    PARTS,
    as_nominal,
    family,
    frf_at,
    measured_as,
    of_form,
    own_set,
    scaled_by,
    total_of,
    worded,
)

__all__ = ["UncertaintyModel", "require_one_channel", "uncertainty"]


@value(kw_only=False)
class UncertaintyModel:
    """A nominal model, a radius around it on the measured lines, and a weight that covers the radius everywhere.

    Fields
    ------
    nominal : control.StateSpace or control.FrequencyResponseData
        Nominal plant with its delay inside: z^-d in discrete time, a Padé approximation otherwise.
    weight : control.StateSpace
        Stable and proper; |weight| >= radius on every line.
    form : str
        "multiplicative", "additive", "inverse-multiplicative", "inverse-additive" or "coprime".
    omega : (W,) ndarray
        Frequencies of the radius [rad/s].
    radius : (W,) ndarray
        What the weight covers, in the unit of the form.
    confidence : float
        Probability with which a line of another realisation lies in its disc; nan where none is claimed.
    perturbation : str
        "LTI": Delta is any stable linear time-invariant system of gain at most one. "statistical": the discs
        hold measured FRFs with the stated confidence. "operator": Delta is any causal operator, nonlinear
        included, of gain at most one.
    simultaneous : bool
        Whether the confidence holds for all lines together.
    radius_noise, radius_odd, radius_even, radius_misfit, radius_level, radius_systematic : (W,) ndarray
        The budget: parts that add up to the radius; nan where unknown. The three statistical parts share their
        common radius in proportion to their variances. Level: how much of it only appears because the plant
        changes with the level.
    delay : float
        The part of the nominal that is a delay [s], for information; it is inside `nominal` already.
    extrapolation : str
        In words, what was assumed outside the measured band.
    source : str
        In words, what was measured.
    hold, fs, unit : of the record: hold of its input, as `Bla.hold`; sampling frequency [Hz]; unit of y over u.
    W1, W2 : control.StateSpace
        Scaling of the plant at its input and output, W2 G W1, of the coprime form (1 when not given); None of others.
    joint, joint_bla : float
        Estimated probability that a whole FRF lies in the set, all its lines together: that of another realisation, and
        the BLA. Of several levels the least; nan where the set was not made of a record.
    evidence : tuple of Evidence
        What is remembered of each record: its lines, FRF and scatter for `validate`, its level for `predict_level`.

    Raises
    ------
    ValueError
        A weight that is unstable or does not cover the radius, arrays that do not fit each other, sampling times that
        differ, a form or class that does not exist.

    References
    ----------
    SP 7.4 and 8.2.3.

    Examples
    --------
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> model.contains(1.1 * G), model.contains(1.3 * G)
    (True, False)
    """

    nominal: Any
    weight: Any
    form: str
    omega: np.ndarray
    radius: np.ndarray
    confidence: float = float("nan")
    perturbation: str = "statistical"
    simultaneous: bool = False
    radius_noise: Any = None
    radius_odd: Any = None
    radius_even: Any = None
    radius_misfit: Any = None
    radius_level: Any = None
    radius_systematic: Any = None
    delay: float = 0.0
    extrapolation: str = "not stated"
    source: str = "not stated"
    hold: str = "unknown"
    fs: float = float("nan")
    unit: str = ""
    W1: Any = None
    W2: Any = None
    joint: float = float("nan")
    joint_bla: float = float("nan")
    evidence: tuple[Evidence, ...] = ()

    def __post_init__(self) -> None:
        require_choice("form", self.form, tuple(FORMS))
        require_choice("perturbation", self.perturbation, PERTURBATIONS)
        omega, radius = (
            require_real_array("omega", self.omega, ndim=1),
            require_real_array("radius", self.radius, ndim=1),
        )
        if omega.shape != radius.shape or omega.size == 0:
            raise ValueError(f"radius must have one value per frequency ({omega.size}), got {radius.size}")
        if np.any(np.diff(omega) <= 0) or omega[0] <= 0:
            raise ValueError("omega must be positive and increasing")
        if np.any(radius <= 0):
            raise ValueError(f"radius must be positive, got {radius.min():g} at {omega[radius.argmin()]:g} rad/s")
        if not np.isnan(self.confidence):
            require_probability("confidence", self.confidence)
        nominal, weight = self.nominal, state_space("weight", self.weight)
        if not isinstance(nominal, control.FrequencyResponseData):
            nominal = state_space("nominal", nominal)
            if weight.nstates and timebase(weight) != timebase(nominal):
                raise ValueError(
                    f"weight must have the sampling time of the nominal, {timebase(nominal):g} s, "
                    f"got {timebase(weight):g} s"
                )
            dt = timebase(nominal)
            if dt and omega[-1] * dt > np.pi * (1 + 1e-9):
                raise ValueError(f"omega must not exceed the Nyquist frequency {np.pi / dt:g} rad/s, got {omega[-1]:g}")
        if not is_stable(weight):
            raise ValueError(f"weight must be stable, got a pole at {rightmost_pole(weight):.4g}")
        cover = np.abs(response(weight, omega)) / radius
        if cover.min() < 1 - 1e-6:
            raise ValueError(
                f"weight must cover the radius, |weight| >= radius, got a ratio of {cover.min():g} "
                f"at {omega[cover.argmin()]:g} rad/s"
            )
        object.__setattr__(self, "nominal", nominal)
        object.__setattr__(self, "weight", weight)
        for name in ("W1", "W2"):
            if FORMS[self.form].scaled:
                object.__setattr__(self, name, as_shaping(name, getattr(self, name), nominal))
            elif getattr(self, name) is not None:
                raise ValueError(f"{name} must be left out but for the coprime form, got one with {self.form}")
        if FORMS[self.form].scaled:
            refuse_everything(weight)
        for name in PARTS:
            part = getattr(self, f"radius_{name}")
            part = np.full(omega.size, np.nan) if part is None else np.asarray(part, dtype=float).copy()
            if part.shape != omega.shape:
                raise ValueError(f"radius_{name} must have one value per frequency ({omega.size}), got {part.size}")
            part.flags.writeable = False
            object.__setattr__(self, f"radius_{name}", part)

    def __str__(self) -> str:
        kind = "an FRF" if self.measured_only else f"{self.nominal.nstates} states"
        percent = "" if np.isnan(self.confidence) else f", {100 * self.confidence:g} % "
        if percent:
            percent += "for all lines together" if self.simultaneous else "per line"
        if not np.isnan(self.joint):
            percent += f" (a whole FRF {told(self.joint)})"
        k, unit = int(np.argmax(self.radius)), FORMS[self.form].unit_of(self.unit).split()
        return (
            f"{self.form} uncertainty, {self.perturbation}{percent}: nominal {kind}, weight of order "
            f"{self.weight.nstates}, radius {self.radius.min():.3g} to {' '.join([f'{self.radius[k]:.3g}', *unit])} "
            f"(at {self.omega[k] / 2 / np.pi:.4g} Hz) over {self.omega[0] / 2 / np.pi:.4g} to "
            f"{self.omega[-1] / 2 / np.pi:.4g} Hz; {self.extrapolation}"
        )

    @property
    def measured_only(self) -> bool:
        """Whether the nominal is an FRF: nothing can be said between and outside its lines."""
        return isinstance(self.nominal, control.FrequencyResponseData)

    @property
    def shaping(self) -> control.StateSpace:
        """W1 W2 as one system; the gain one where the form needs no scaling."""
        return in_series(self.W1, self.W2) if FORMS[self.form].scaled else state_space("shaping", 1.0)

    def budget(self) -> dict[str, np.ndarray]:
        """Name of each known part of the radius -> (W,) its share there."""
        parts = {name: getattr(self, f"radius_{name}") for name in PARTS}
        return {name: part for name, part in parts.items() if np.isfinite(part).any()}

    def distance(self, plant: Any) -> np.ndarray:
        """(.,) smallest |Delta| that turns the nominal into the given FRF, at its own frequencies.

        plant : control.FrequencyResponseData, or a system, which is then taken at `omega`.
        """
        clocks = (self.nominal,) if self.measured_only else (self.nominal, self.weight)
        omega, G = frequency_response("plant", plant, self.omega, clocks)
        return self.deviations(omega, G, self.at(omega)) / np.abs(response(self.weight, omega))

    def deviations(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        """(..., W) smallest |weight Delta| that turns responses (W,) of a nominal into responses (..., W)."""
        if FORMS[self.form].scaled:  # at a pole too: it is as far from zero as a plant can be
            W = response(self.shaping, omega)
            G, nominal = W * replace_infinite(G), W * replace_infinite(nominal)
        return np.abs(FORMS[self.form].deviation(G, nominal))

    def at(self, omega: np.ndarray) -> np.ndarray:
        """(.,) complex response of the nominal."""
        return frf_at(self.nominal, omega) if self.measured_only else response(self.nominal, omega)

    def contains(self, plant: Any) -> bool:
        """Whether an FRF (or a system, looked at on the lines) lies in the set at every one of its frequencies."""
        return bool(np.all(self.distance(plant) <= 1 + 1e-9))

    def sample(self, n: int, rng: np.random.Generator | int | None = None) -> list[Any]:
        """n plants of the set, each with |Delta| = 1 somewhere or everywhere; FRFs where the nominal is one."""
        return random_plants(self, n, random_generator("rng", rng))


@overload
def uncertainty(
    bla: Bla | Sequence[Bla],
    nominal: Any,
    *,
    form: str = ...,
    order: int = ...,
    confidence: float = ...,
    simultaneous: bool = ...,
    even: bool = ...,
    systematic: float | None = ...,
    below: str | float = ...,
    above: str | float = ...,
    perturbation: str = ...,
) -> MatrixUncertainty: ...


@overload
def uncertainty(
    bla: Bla | Sequence[Any],
    nominal: Any,
    *,
    form: str = ...,
    order: int = ...,
    confidence: float = ...,
    simultaneous: bool = ...,
    even: bool = ...,
    systematic: float | None = ...,
    below: str | float = ...,
    above: str | float = ...,
    perturbation: str = ...,
    W1: Any = ...,
    W2: Any = ...,
) -> UncertaintyModel: ...


def uncertainty(
    bla: Bla | Sequence[Any],
    nominal: Any,
    *,
    form: str = RELATIVE,
    order: int = 4,
    confidence: float = 0.95,
    simultaneous: bool = False,
    even: bool = True,
    systematic: float | None = None,
    below: str | float = "flat",
    above: str | float = 20.0,
    perturbation: str = "statistical",
    W1: Any = None,
    W2: Any = None,
) -> UncertaintyModel | MatrixUncertainty:
    """Turn a measured BLA with its levels into a set of plants around a nominal model.

    On each line the disc about the nominal holds the FRF of a new realisation with the stated confidence: radius =
    misfit of the nominal + sqrt(F_p (variance of G + variance of one realisation + even level)). The raw residual
    of a line contains scatter already, so the misfit is what is left of it after the variance is taken off. For a
    fitted nominal this errs on the wide side: the fit averages the variance of G that is counted here.

    Parameters
    ----------
    bla : nlfrf.Bla or list of them
        What was measured; several levels, offsets or days make a plant family, with the largest radius of all. Or
        Of several channels, one or a list, the set is a `MatrixUncertainty`. An FRF from elsewhere is a Bla by
        `nlfrf.bla_from_frf`, or by the `std` that `fit_nominal` was given with it. Or a radius of your own: arrays
        (omega, radius), in rad/s and the unit of the form, or a list of plants (FRFs, systems) that the set has to
        hold.
    nominal : NominalFit, control system or control.FrequencyResponseData
        The model in the middle, continuous or discrete. An FRF gives a model that is known on its lines only.
    form : str
        "multiplicative", "additive", "inverse-multiplicative", "inverse-additive" or "coprime". Of several
        channels "elements" (when not given), "additive" or "input", chosen before looking; or "auto": the first two, at
        a price of 10 %.
    order : int
        Order of the weight, or of each of them.
    confidence : float
        Probability per line (or for all lines together when `simultaneous`).
    simultaneous : bool
        False: about one line in twenty of another record lies outside its disc at 95 %; `joint` tells of whole ones.
        True widens the radius by a factor of 1.8 to 2.1 and is seldom worth it (see the guide on bounds).
    even : bool
        Add the even distortion level: in closed loop the machine sees signals that are not odd.
    systematic : float, optional
        Decibels above the odd level added to the radius for the systematic part (8 in the paper); None leaves it out.
    below, above : "flat" or float
        What is assumed outside the measured band: the radius stays flat, or rises away from the band with that
        many dB per decade, over two decades, flat beyond.
    perturbation : str
        The class; "LTI" and "operator" are claims of the user about the plant.
    W1, W2 : control.StateSpace, TransferFunction or float, optional
        Scaling W2 G W1 of the plant for the coprime form, as for `ncfsyn`; when not given, unit gain in mid band.

    Returns
    -------
    UncertaintyModel, or MatrixUncertainty of several channels

    Raises
    ------
    ValueError
        A form or class that does not exist, an inverse form where the radius reaches |G|, an order too low.

    References
    ----------
    SP 7.4 and 8.2.3; Pintelon & Schoukens, 2nd ed., 4.3.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> model = uncertainty(nlfrf.identify(record), control.tf([2.3], [1]), order=0, above="flat")
    >>> model.form, model.perturbation, bool(np.all(model.radius < 0.35))
    ('multiplicative', 'statistical', True)
    """
    asked: dict[str, Any] = {"order": order, "simultaneous": bool(simultaneous), "perturbation": perturbation}
    bla = of_own_fit(bla, nominal)
    if frms := as_matrices(bla):
        asked |= {"form": ELEMENTS if form == RELATIVE else form, "confidence": confidence, "even": even}
        return matrix_uncertainty(frms, nominal, below=below, above=above, **asked)
    many: list[Any] = list(bla) if isinstance(bla, Sequence) else [bla]
    row, p = FORMS[require_choice("form", form, tuple(FORMS))], require_probability("confidence", confidence)
    nominal, delay, dt = as_nominal(nominal)
    if own := own_set(bla, nominal, row, (below, above), dt, asked | {"systematic": systematic}):
        return UncertaintyModel(nominal=nominal, form=form, delay=delay, **own)
    recorded = many
    if not isinstance(nominal, control.FrequencyResponseData):
        many = [behind_hold(b, dt) for b in many]
    systematic = None if systematic is None else require_real("systematic", systematic)
    omega, discs = family(many, nominal, p, simultaneous, even, systematic)
    if dt:
        inside = omega * dt < np.pi * (1 - 1e-9)
        omega, discs = omega[inside], {name: part[inside] for name, part in discs.items()}
    absolute = total_of(discs)
    W1, W2, below, above = scaled_by(row, nominal, omega, (W1, W2), (below, above))
    factor, *covered = of_form(row, omega, absolute, nominal, (W1, W2), below, above, dt)
    made = UncertaintyModel(
        nominal=nominal,
        weight=suspected(fit_weight(*covered, order=order, dt=dt).W, omega, absolute * factor),
        form=form,
        omega=omega,
        radius=absolute * factor,
        confidence=p,
        perturbation=perturbation,
        simultaneous=bool(simultaneous),
        **{f"radius_{name}": part * factor for name, part in discs.items()},
        delay=delay,
        extrapolation=f"below the band {worded(below)}, above it {worded(above)}",
        source="; ".join(measured_as(b) for b in many),
        hold=many[0].hold if len({b.hold for b in many}) == 1 else "unknown",
        fs=min(b.fs for b in many),
        unit=many[0].unit,
        W1=W1,
        W2=W2,
    )
    return known_jointly(made, many, recorded)


def require_one_channel(model: Any, instead: str, purpose: str, *, parametric: bool = True) -> None:
    """Refuse what is no set of one input and one output, and for several channels name what to take instead."""
    if isinstance(model, MatrixUncertainty):
        raise ValueError(
            f"model must be of one input and one output {purpose}, got {model.n_outputs} x {model.n_inputs}: {instead}"
        )
    if not isinstance(model, UncertaintyModel) or (parametric and model.measured_only):
        kind = "an UncertaintyModel with a parametric nominal" if parametric else "an UncertaintyModel"
        raise ValueError(f"model must be {kind} {purpose}, got {short_form(model)}")
