"""``UncertaintyModel``: a nominal plant and the set of plants around it, for any number of
channels.

One input and one output: a disc around G at every frequency, and its parts.

    form                    set of plants, |Delta| <= 1      radius from a disc r about G on the lines
    multiplicative          G (1 + w Delta)                  r / |G|
    additive                G + w Delta                      r
    inverse-multiplicative  G / (1 + w Delta)                r / (|G| - r)
    inverse-additive        G / (1 + w G Delta)              r / (|G| (|G| - r))
    coprime                 (N + Delta_N)/(M + Delta_M)      r / sqrt((1 + |G|^2)(1 + (|G| - r)^2)), G and r scaled

Several channels, with W_l and W_r diagonal or full:

    form                    set of plants, gain of every Delta at most one     blocks
    elements                G_ji + w_ji Delta_ji                               n_y n_u numbers
    additive                G + W_l Delta W_r                                  one full n_y by n_u
    input                   G (I + W_l Delta W_r)                              one full n_u by n_u, for a square G
    output                  (I + W_l Delta W_r) G                              one full n_y by n_y, for a square G
    inverse-additive        G (I + W_l Delta W_r G)^-1                         one full n_u by n_y, for a square G
    inverse-input           G (I + W_l Delta W_r)^-1                           one full n_u by n_u, for a square G
    inverse-output          (I + W_l Delta W_r)^-1 G                           one full n_y by n_y, for a square G

              +---- W_r <--+
              |            |                additive: d is added to y
              v  z         | u              input:    d is added to u, behind where z is read
            Delta          |
              | d          |
              +--> W_l --> (+) with G

(SP 7.4 and 8.2.3.) A set for several channels never has one scalar radius, because entries of
different size would make it ten times too large. "elements" is the smaller set if one channel is
critical. A full block is the smaller one if all channels are critical, if outputs move together,
and from 4 by 4 on. Choose the form before you see the verdict; trying two is a multiple test.

A disc from the spread of a measured FRF is *statistical*: it contains the FRF of another
realisation with a stated probability. The perturbation that caused the spread is nonlinear, and no
theorem turns the disc into stability. "LTI" and "operator" are claims about the perturbation that
only the user can make.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from typing import TypeGuard

import control
import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    data_warning,
    format_count,
    keep_warnings,
    random_generator,
    require_choice,
    require_integer,
    require_known,
    require_probability,
    require_real_array,
    short_form,
)
from nlfrf._base.values import ArrayField, freeze_array, value
from robust._base.states import Outcome
from robust._base.types import AnySystem, Controller, SystemField, Weight
from robust._base.warnings import DesignWarning
from robust.lti.connections import lower_lft, require_shape, weighted_plant
from robust.lti.lti import (
    SAMPLING_TOLERANCE,
    common_sampling_time,
    is_clockless,
    is_stable,
    require_sampling_time,
    timebase,
)
from robust.lti.realisation import (
    frequency_response,
    multivariable,
    repeat_over_channels,
    rightmost_pole,
    state_space,
)
from robust.models.fit.doubts import checked_weight
from robust.models.fit.nominal_fit import NominalFit, sampling_time_of, single_nominal
from robust.models.fit.weights import cover_sampled
from robust.models.sets.centre import Centre, centre_of
from robust.models.sets.delta import (
    BlockDelta,
    Delta,
    EntryDeltas,
    matrix_delta,
    scalar_delta,
    side_gains,
)
from robust.models.sets.forms import (
    ADDITIVE,
    DEFAULT_FORM,
    ELEMENTS,
    FORMS,
    INPUT,
    MATRIX_FORMS,
    PERTURBATIONS,
    RECORD_FORMS,
    reduce_to_one_channel,
)
from robust.models.sets.interconnection import Block, UncertainSystem
from robust.models.sets.membership import Deviation
from robust.models.sets.perturbations import random_delta
from robust.models.sets.radius import Extrapolation, checked_slope, fit_covering_weight
from robust.models.sets.records import (
    PARTS,
    JointProbability,
    Origin,
    RecordSummary,
    format_probability,
)

_SET_TOLERANCE = 1e-6  # relative excess over the radius that still counts as inside
_NEXT_TO_POLE = 1e-9  # relative step away from a line on which plant and nominal are infinite
_MAX_TRIALS = (
    20  # draws for each plant that is wanted: rounding may take a realisation out of its set
)


@value(kw_only=False)
class UncertaintyModel:
    """A nominal plant, a radius around it on the measured lines, and weights that cover the radius
    everywhere.

    For one input and one output the arrays are over frequency, and the field `weight` contains the
    weight. For several channels the fields `left` and `right` contain the weights, and `radius` has
    one row for each weight.

    Fields
    ------
    nominal : control.StateSpace or control.FrequencyResponseData
        Nominal plant with its delay inside: z^-d in discrete time, a Padé approximation otherwise.
        With an FRF as nominal (one channel only) the model is known on the lines of this FRF only.
    weight : control.StateSpace or None
        Stable and proper; |weight| >= radius on every line. None for several channels.
    form : str
        "multiplicative", "additive", "inverse-multiplicative", "inverse-additive" or "coprime"; for
        several channels "elements", "additive", "input", "output", "inverse-additive",
        "inverse-input" or "inverse-output".
    omega : (W,) ndarray
        Frequencies of the radius [rad/s].
    radius : (W,) or (n, W) ndarray
        Radius that the weights cover: relative to |G|, or in the unit of G for an additive form.
        Rows of `left` come before rows of `right`. Default, for weights of your own: |weight|.
    confidence : float
        Probability that the set contains, on one line, the FRF of another realisation (random draw
        of the phases of the excitation); nan if no probability is claimed. For several channels
        another realisation is another set of experiments.
    perturbation : str
        "LTI": Delta is any stable linear time-invariant system of gain at most one. "statistical":
        the discs contain measured FRFs with the stated confidence. "operator": Delta is any causal
        operator of gain at most one; it may be nonlinear.
    simultaneous : bool
        Whether the confidence holds for all lines together.
    budget : dict of (W,) or (n, W) ndarray
        Parts whose sum is the radius, by name; empty if they are not known, as for full blocks.

        - "noise", "odd", "even": noise, and distortion by odd and by even nonlinearities. These
          parts have one common statistical radius, which is divided in proportion to their
          variances.
        - "misfit": difference between the FRF and the nominal.
        - "level": change of the plant with the level of the excitation.
        - "systematic": systematic errors.
    origin : Origin
        Source of the set, assumption outside the measured band, unit, and the delay that the
        nominal contains.
    scaling : tuple of control.StateSpace
        W1 and W2 of the coprime form, which shape the plant: W2 G W1. Each is 1 by default. Empty
        for other forms.
    joint : JointProbability or None
        Estimated probability that the set contains all lines of an FRF together; the smallest one
        if the set is from several levels. None for a set that was not made from records.
    records : tuple of RecordSummary
        Summary of each record: lines, FRF and scatter, which `validate` uses, and the level (rms of
        input and output), which `predict_level` uses.
    left, right : tuple of control.StateSpace
        Stable weights W_l at the output and W_r at the input of Delta (G + W_l Delta W_r, for
        example), for several channels: one weight for each channel, or one square matrix each. For
        a matrix the rows of `radius` are the gains of the rows of W_l or of the columns of W_r. For
        the form "elements" `right` contains the n_y n_u weights, column by column of G, and `left`
        is empty.
    inputs, outputs : tuple of str
        Names of the channels.
    alternative_form : UncertaintyModel, optional
        The set of the same plant in another form, for several channels, at the same confidence c.
        Both sets contain the plant with a probability of at least 2 c - 1, so `check` may take the
        better of the two verdicts. No other function uses the alternative.
    warnings : tuple of str
        Texts of each `nlfrf.DataWarning` and `DesignWarning` about the records, the nominal and the
        weight.

    Notes
    -----
    A set that is made with `left` and `right` around a nominal with one input and one output is
    converted to the equivalent form for one channel.

    Raises
    ------
    ValueError
        Weights that are unstable, do not cover their radius or do not fit the form; arrays that do
        not fit each other; sampling times that differ; a form or class that does not exist.

    References
    ----------
    SP 7.4 and 8.2 (representing uncertainty), 8.6 (robust stability of full and structured blocks).

    Examples
    --------
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> model.contains(1.1 * G), model.contains(1.3 * G)
    (True, False)

    Two inputs and two outputs:

    >>> G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> w = control.ss([], [], [], [[0.2]])
    >>> omega = np.array([1.0, 2.0])
    >>> model = UncertaintyModel(
    ...     nominal=G, form="additive", left=(w, w), right=(w, w), omega=omega, radius=np.full((4, 2), 0.2),
    ...     confidence=0.95)
    >>> K = control.ss([], [], [], 2 * np.eye(2))
    >>> round(float(np.linalg.norm(model.loop(K).loop(0j), 2)), 6)           # 0.2 |K S(0)| 0.2 = 0.04 2/3
    0.026667
    """

    nominal: AnySystem
    weight: SystemField = None
    form: str = ""
    omega: ArrayField = None
    radius: ArrayField = None
    confidence: float = float("nan")
    perturbation: str = "statistical"
    simultaneous: bool = False
    budget: Mapping[str, np.ndarray] = field(default_factory=dict)
    origin: Origin = Origin()
    scaling: tuple[SystemField, ...] = ()
    joint: JointProbability | None = None
    records: tuple[RecordSummary, ...] = ()
    left: tuple[control.StateSpace, ...] = ()
    right: tuple[control.StateSpace, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    alternative_form: UncertaintyModel | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self._take_sides()
        held = self.__dict__
        held["scaling"] = self.delta.scaling
        require_choice("perturbation", self.perturbation, PERTURBATIONS)
        if not np.isnan(self.confidence):
            require_probability("confidence", self.confidence)
        if self.omega is None:
            raise ValueError("omega must be the frequencies of the set [rad/s], got None")
        held["omega"] = omega = require_real_array("omega", self.omega, ndim=1)
        if np.any(np.diff(omega) <= 0) or not omega.size or omega[0] <= 0:
            raise ValueError("omega must be positive and increasing")
        self._check_alternative()
        self._check_radius()
        held["inputs"], held["outputs"] = (
            tuple(given) or known
            for given, known in zip(
                (self.inputs, self.outputs), self.delta.signal_names(self.nominal), strict=True
            )
        )

    @cached_property
    def centre(self) -> Centre:
        """The nominal, with what a set can do around a system or around an FRF."""
        return centre_of(self.nominal)

    @cached_property
    def delta(self) -> Delta:
        """The perturbation with its weights."""
        if self.is_single:
            return scalar_delta(self.nominal, self.form, self.weight, self.scaling)
        return matrix_delta(self.nominal, self.form, self.left, self.right, self.scaling)

    @property
    def dt(self) -> float:
        """Sampling time [s] of the nominal; 0 for continuous time and for an FRF."""
        return self.centre.dt

    @classmethod
    @keep_warnings
    def from_radius(
        cls,
        nominal: NominalFit | AnySystem | float,
        omega: ArrayLike,
        radius: ArrayLike,
        *,
        form: str = DEFAULT_FORM,
        order: int | None = None,
        below: str | float = "flat",
        above: str | float = 20.0,
        perturbation: str = "statistical",
    ) -> UncertaintyModel:
        """Return the set for a radius of your own, with a weight that is fitted to cover it.

        Parameters
        ----------
        nominal : NominalFit, control system, control.FrequencyResponseData or float
            Nominal model with one channel.
        omega : (W,) array_like
            Frequencies of the radius [rad/s], increasing.
        radius : (W,) array_like
            Radius relative to |G|, or in the unit of G for an additive form.
        form : str
            "multiplicative", "additive", "inverse-multiplicative" or "inverse-additive".
        order : int, optional
            Order of the weight. By default it is raised, up to 12, as long as one more state lowers
            the mean of |weight|/radius by 0.1 dB.
        below, above : "flat" or float
            Assumption about the radius below the first and above the last frequency, as in
            `uncertainty`.
        perturbation : str
            Class of Delta. With "LTI" or "operator" you claim that the plant is in the set.

        Returns
        -------
        UncertaintyModel
            Without a confidence.

        Raises
        ------
        ValueError
            Arrays that do not fit each other, the coprime form (which depends on units), or an
            order that is too low.

        References
        ----------
        SP 7.4.

        Examples
        --------
        >>> omega = np.geomspace(0.1, 100, 60)
        >>> model = UncertaintyModel.from_radius(control.tf([2.0], [0.2, 1]), omega, 0.1 + 0.02 * omega, order=2)
        >>> model.form, model.weight.nstates, bool(np.isnan(model.confidence))
        ('multiplicative', 2, True)
        """
        if FORMS[require_choice("form", form, tuple(FORMS))].depends_on_units:
            raise ValueError(
                f"form must not depend on the units of u and y for a radius of your own, got {form}"
            )
        rules = Extrapolation(
            below=checked_slope("below", below), above=checked_slope("above", above)
        )
        if order is not None:
            order = require_integer("order", order, least=0)
        omega = require_real_array("omega", omega, ndim=1)
        radius = require_real_array("radius", radius, ndim=1)
        if (
            omega.shape != radius.shape
            or not np.all(radius > 0)
            or not np.all(np.diff(omega, prepend=0.0) > 0)
        ):
            raise ValueError(
                "radius must be positive, one value for each omega, and omega positive and"
                " increasing"
            )
        plant, delay = single_nominal(nominal)
        weight = fit_covering_weight(
            omega, radius, order=order, rules=rules, dt=sampling_time_of(plant)
        )
        return cls(
            nominal=plant,
            weight=checked_weight(weight, omega, radius, order=order),
            form=form,
            omega=omega,
            radius=radius,
            perturbation=perturbation,
            origin=Origin(source="a radius that was given", extrapolation=str(rules), delay=delay),
        )

    def _take_sides(self) -> None:
        """Turn `left` and `right` into systems, or into the equivalent weight of a plant with one
        channel.
        """
        held = self.__dict__
        if self.left or self.right:
            for name in ("left", "right"):
                held[name] = tuple(multivariable(name, weight) for weight in getattr(self, name))
            G = held["nominal"] = multivariable("nominal", self.nominal)
            if one := (G.ninputs, G.noutputs) == (1, 1) and reduce_to_one_channel(
                self.form, self.left, right=self.right, radius=self._given_radius()
            ):
                held.update(one, left=(), right=())
            return
        if count_channels(self.nominal) != (1, 1):
            raise ValueError(
                "left and right must be the weights for a plant with"
                f" {format_channels(self.nominal)}, got weight {short_form(self.weight)}:"
                f" {_own_weights_call(self.nominal, self.form)}"
            )
        held["nominal"] = single_nominal(self.nominal)[0]
        held["weight"] = state_space("weight", self.weight)

    def _given_radius(self) -> np.ndarray:
        """Return the radius that was given, else the gains of the sides."""
        if self.radius is not None:
            return np.asarray(self.radius)
        return side_gains(self.left, self.right, np.asarray(self.omega, dtype=float))

    def _check_alternative(self) -> None:
        """Refuse another form of the set at another confidence."""
        other = self.alternative_form
        if other is not None and other.confidence != self.confidence:
            raise ValueError(
                f"alternative_form must have confidence {self.confidence:g} as this set, got"
                f" {other.confidence:g}"
            )

    def _check_radius(self) -> None:
        """Refuse radii and parts that do not fit each other or the nominal, and weights that do not
        cover them.
        """
        omega, dt, gains = self.omega, self.dt, self.weight_gains(self.omega)
        shape = self.delta.radius_shape(omega.size)
        given = gains.reshape(shape) if self.radius is None else self.radius
        radius = require_real_array("radius", given, ndim=len(shape))
        if radius.shape != shape:
            raise ValueError(
                f"radius must have one value per frequency, the shape {shape}, got {radius.shape}"
            )
        if np.any(radius <= 0):
            where = omega[int(np.argmin(radius)) % omega.size]
            raise ValueError(f"radius must be positive, got {radius.min():g} at {where:g} rad/s")
        if dt and omega[-1] * dt > np.pi * (1 + 1e-9):
            raise ValueError(
                f"omega must not exceed the Nyquist frequency {np.pi / dt:g} rad/s, got"
                f" {omega[-1]:g}"
            )
        self._check_weights(gains / radius)
        self.__dict__["radius"] = radius
        require_known("budget", self.budget, PARTS)
        known = {
            name: freeze_array(np.asarray(part, dtype=float)) for name, part in self.budget.items()
        }
        for name, part in known.items():
            if part.shape != shape:
                raise ValueError(
                    f"budget must have one value per frequency in {name}, {shape}, got {part.shape}"
                )
        self.__dict__["budget"] = known

    def _check_weights(self, covers: np.ndarray) -> None:
        """Refuse weights that are unstable, have another sampling time than the nominal, or a (n,
        W) cover below one.
        """
        names = self.delta.weight_names
        for name, weight in zip(names, self.weights, strict=True):
            wanted = self.centre.clock_for(weight)
            if weight.nstates and timebase(weight) != wanted:
                raise ValueError(
                    f"{name} must have the sampling time of the nominal, {wanted:g} s, got"
                    f" {timebase(weight):g} s"
                )
            if not is_stable(weight):
                raise ValueError(
                    f"{name} must be stable, got a pole at {rightmost_pole(weight):.4g}"
                )
        rows_of = [
            name
            for name, weight in zip(names, self.weights, strict=True)
            for _ in range(weight.noutputs)
        ]
        for name, cover in zip(rows_of, covers, strict=True):
            if cover.min() < 1 - 1e-6:
                raise ValueError(
                    f"{name} must cover its radius, |weight| >= radius, got a ratio of"
                    f" {cover.min():g} at {self.omega[cover.argmin()]:g} rad/s"
                )

    def __str__(self) -> str:
        if np.isnan(self.confidence):
            percent = ""
        else:
            percent = f", {100 * self.confidence:g} % "
        if percent:
            percent += "for all lines together" if self.simultaneous else "per line"
        of, whole, size = self.delta.describe(self.omega, self.radius, self.origin.unit)
        if self.joint is not None:
            percent += f" (a whole {whole} {format_probability(self.joint.frf)})"
        other = self.alternative_form
        return (
            f"{self.form} uncertainty{of}, {self.perturbation}{percent}: nominal {self.centre.describe()}{size}; "
            f"{self.origin.extrapolation}"
            + self.describe_radius()
            + ("" if other is None else f", with a second set in the {other.form} form")
            + (
                f"; subject to {format_count(len(self.warnings), 'warning')}"
                if self.warnings
                else ""
            )
        )

    def radius_shares(self, k: int) -> list[tuple[float, str]]:
        """Return (share, name) of the parts of the radius on line k, largest first; [] if unknown.

        For one channel.
        """
        parts = {name: float(part[k]) for name, part in self.budget.items() if np.isfinite(part[k])}
        total = sum(parts.values())
        return sorted(
            ((part / total, name) for name, part in parts.items() if part > 0), reverse=True
        )

    def relative_radius(self) -> np.ndarray:
        """Return (W,) radius divided by |G|; nan for a form without a relative deviation."""
        return self.delta.relative_radius(self.radius, self.at(self.omega))

    def describe_radius(self) -> str:
        """Describe the largest radius below and above the crossover, with its parts."""
        relative, crossover = self.relative_radius(), self.origin.omega_c
        if np.isnan(crossover) or np.isnan(relative).any():
            return ""
        text = ""
        for side, here in (("below", self.omega <= crossover), ("above", self.omega > crossover)):
            if here.any():
                k = int(np.argmax(np.where(here, relative, -1.0)))
                made = ", ".join(
                    f"{name} {share:.0%}" for share, name in self.radius_shares(k) if share > 0.005
                )
                text += (
                    f"; {side} the crossover of {crossover / 2 / np.pi:.4g} Hz at most"
                    f" {relative[k]:.3g} of |G| at {self.omega[k] / 2 / np.pi:.4g} Hz"
                    + f" ({made})"
                    * bool(made)
                )
        return text

    @property
    def is_single(self) -> bool:
        """Return whether the set has one input and one output, and arrays without channel axes."""
        return not (self.left or self.right)

    @property
    def unit(self) -> str:
        """Unit of y over u, for one channel."""
        return self.origin.unit

    @property
    def n_outputs(self) -> int:
        """Number of outputs n_y."""
        return int(self.nominal.noutputs)

    @property
    def n_inputs(self) -> int:
        """Number of inputs n_u."""
        return int(self.nominal.ninputs)

    @property
    def weights(self) -> tuple[control.StateSpace, ...]:
        """All weights: `weight` for one channel, otherwise `left` followed by `right`."""
        return self.delta.weights

    @property
    def measured_only(self) -> bool:
        """Return whether the nominal is an FRF, which is known on its lines only."""
        return isinstance(self.nominal, control.FrequencyResponseData)

    @property
    def structure(self) -> list[tuple[int, int]]:
        """Blocks of Delta, as `robust.mu.upper` takes them."""
        return self.delta.structure

    def weight_gains(self, omega: np.ndarray) -> np.ndarray:
        """Return (n, W) gains of the rows of W_l, then of the columns of W_r; or |weight|."""
        return self.delta.gains(omega)

    @property
    def shaping(self) -> control.StateSpace:
        """Product W1 W2 of the coprime form; a unit gain for other forms."""
        return self.delta.shaping

    def at(self, omega: np.ndarray) -> np.ndarray:
        """Return (W,) or (n_y, n_u, W) complex response of the nominal."""
        return self.centre.response(omega).reshape(*self.delta.channels, omega.size)

    def distance(self, plant: AnySystem) -> np.ndarray:
        """Return (W,) size of the smallest Delta that changes the nominal into a plant.

        plant : control.FrequencyResponseData, compared at its own frequencies; or a system,
        compared at `omega`.
        """
        omega, G, nominal = self._responses(plant, self.omega)
        poles = ~np.isfinite(G + nominal).reshape(omega.size, -1).all(axis=1)
        if poles.any() and not isinstance(plant, control.FrequencyResponseData):
            # at an undamped pole of both, both are infinite; their distance is continuous there
            near = np.where(poles, (1 + _NEXT_TO_POLE) * omega, omega)
            omega, G, nominal = self._responses(plant, near)
        return self.normalized_distance(omega, G, nominal)

    def _responses(
        self, plant: AnySystem, omega: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return frequencies (W,), and (W, ...) responses of a plant and of the nominal; those of
        an FRF at its own frequencies.
        """
        omega, G = frequency_response(
            "plant",
            plant,
            omega,
            self.centre.clocks(self.weights),
            (self.n_outputs, self.n_inputs),
        )
        return omega, np.moveaxis(G, -1, 0), np.moveaxis(self.at(omega), -1, 0)

    def normalized_distance(
        self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray
    ) -> np.ndarray:
        """Return (..., W) size of the smallest Delta that changes `nominal` (W,) into G (..., W).

        For several channels G is (..., W, n_y, n_u) and nominal (W, n_y, n_u).
        """
        return self.delta.size(self.delta.smallest(omega, G, nominal))

    def is_within(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        """Return (..., W) whether `normalized_distance` is at most one."""
        return self.delta.is_within(self.delta.smallest(omega, G, nominal))

    def side_weights(self) -> tuple[control.StateSpace, control.StateSpace]:
        """Return W_l and W_r as systems, for several channels; "elements" has W_l = I."""
        return require_several_channels(self, "have two sides", "use weight").sides()

    def entry_radius(self, omega: np.ndarray) -> np.ndarray:
        """Return (n_y, n_u, W) the largest deviation of each entry from the nominal over the set.

        For an inverse form it is an upper bound, which is infinite where the set is unbounded.
        """
        delta = require_several_channels(self, "have entries", "use nominal and radius")
        return delta.entry_radius(self.nominal, omega)

    def contains(self, plant: AnySystem) -> bool:
        """Return whether the set contains an FRF (at its frequencies) or a system (at all
        frequencies).

        For a system True is proved, within 1e-6 of the radius, by two conditions. The system has as
        many poles (zeros in an inverse form) in the right half plane as the nominal. The smallest
        Delta has a gain of at most one at all frequencies, zero and infinity included. Without a
        proof, a system is compared on the lines only: always if the nominal is an FRF, otherwise
        with a warning.
        """
        distance = self.distance(plant)
        if not self.centre.is_provable(plant):
            return bool(np.all(distance <= 1 + _SET_TOLERANCE))
        plant = multivariable("plant", plant)
        if self.delta.counted_roots(plant) != self.delta.counted_roots(self.nominal):
            return False
        found = [deviation.is_within(1 + _SET_TOLERANCE) for deviation in self.deviations(plant)]
        if any(one.outcome is Outcome.UNDECIDED for one in found):
            reason = next(one.reason for one in found if one.outcome is Outcome.UNDECIDED)
            data_warning(
                f"plant was compared on {distance.size} lines only: {reason}", DesignWarning
            )
            return bool(np.all(distance <= 1 + _SET_TOLERANCE))
        return all(one.holds for one in found)

    def deviations(self, plant: control.StateSpace) -> list[Deviation]:
        """Return the deviation of a plant from the nominal, by entry of G for "elements"."""
        return self.delta.deviations(self.nominal, plant, self.omega)

    def perturbed(self, Delta: Controller) -> control.StateSpace:
        """Return the plant of the set for one perturbation Delta, for instance to simulate it.

        Delta : control.StateSpace from the inputs of the block to its outputs, or a real matrix;
        diagonal for "elements".
        """
        require_parametric(self, "to make plants of")
        return self.delta.perturbed(self.nominal, Delta)

    def sample(
        self, n: int, rng: np.random.Generator | int | None = None
    ) -> list[control.StateSpace | control.FrequencyResponseData]:
        """Return n random plants of the set, each with |Delta| = 1 at one frequency or more.

        The plants are FRFs if the nominal is an FRF.
        """
        plants: list[control.StateSpace | control.FrequencyResponseData] = []
        rng = random_generator("rng", rng)
        # neither a gain as weight nor a gain as nominal needs a sampling time
        dt = max(timebase(w) for w in self.weights) or self.dt
        for _ in range(_MAX_TRIALS * require_integer("n", n, least=0)):
            if len(plants) == n:
                break
            Delta = random_delta(rng, self.structure, band=(self.omega[0], self.omega[-1]), dt=dt)
            plant = self.centre.perturbed(self.delta, Delta, self.omega)
            if is_within_set(self, plant):
                plants.append(plant)
        if len(plants) < n:
            raise ValueError(
                f"model must have plants that can be realised, got {len(plants)} of {n} inside"
                " the set"
            )
        return plants

    def open_loop(self) -> control.StateSpace:
        """Return the system from (outputs of Delta, u) to (inputs of Delta, y)."""
        delta = require_several_channels(self, "have its perturbations pulled out", "use check")
        return delta.open_loop(self.nominal)

    def loop(self, K: Controller, *, w_P: Weight | None = None) -> UncertainSystem:
        """Return the loop u = K (r - y) with Delta as an external block, for several channels.

        `check_structure` and `robust.mu.upper` take this loop.

        w_P : control.StateSpace, optional
            Performance weight on r - y: one weight for all outputs, which may be continuous with a
            sampled loop, or a matrix.
        """
        P, K = self.open_loop(), multivariable("K", K)
        n_y, n_u, dt = self.n_outputs, self.n_inputs, timebase(self.nominal)
        require_shape(K, n_y, n_u)
        if not is_clockless(K) and abs(timebase(K) - dt) > SAMPLING_TOLERANCE * dt:
            raise ValueError(
                f"K must have the sampling time of the model, {dt:g} s, got {timebase(K):g} s. A"
                " model for a sampled controller starts from fit_nominal(frm, ..., dt=) or"
                " sampled(nominal, dt)."
            )
        n_z, n_d = P.noutputs - n_y, P.ninputs - n_u
        if dt and w_P is not None:
            demand = multivariable("w_P", w_P)
            continuous = (
                demand.nstates
                and not timebase(demand)
                and (demand.ninputs, demand.noutputs) == (1, 1)
            )
            if continuous:
                w_P = cover_sampled(demand, dt)
            else:
                w_P = demand
        if w_P is None:
            weights = []
        else:
            weights = [("e", repeat_over_channels("w_P", w_P, n_y))]
        for _, weight in weights:
            require_sampling_time(
                "w_P", weight, reference="the model", wanted=common_sampling_time(P)
            )
        N = lower_lft(weighted_plant(P, n_y, n_u=n_u, weights=weights, reference=bool(weights)), K)
        same = N.noutputs - n_z == n_y
        return UncertainSystem(
            N=N,
            blocks=self.blocks(n_z, n_d),
            inputs=tuple(f"r{j + 1}" for j in range(N.ninputs - n_d)),
            outputs=tuple(
                f"weighted {self.outputs[j] if same else j + 1}" for j in range(N.noutputs - n_z)
            ),
        )

    def blocks(self, n_z: int, n_d: int) -> dict[str, Block]:
        """Return the blocks of Delta by name, for several channels."""
        of = {"perturbation": self.perturbation}
        if self.form != ELEMENTS:
            return {
                self.form: Block([f"z{k}" for k in range(n_z)], [f"d{k}" for k in range(n_d)], **of)
            }
        pairs = [(out, name) for name in self.inputs for out in self.outputs]
        return {
            f"{out} by {name}": Block(f"z{k}", f"d{k}", **of) for k, (out, name) in enumerate(pairs)
        }


def count_channels(nominal: AnySystem) -> tuple[int, int]:
    """Return the numbers of outputs and inputs of a plant, a number or a matrix."""
    if isinstance(nominal, control.InputOutputSystem | control.FrequencyResponseData):
        return int(nominal.noutputs), int(nominal.ninputs)
    if np.ndim(nominal) <= 2:
        rows, columns = np.atleast_2d(nominal).shape
    else:
        rows, columns = 1, 1
    return rows, columns


def format_channels(nominal: AnySystem) -> str:
    """Return the outputs and inputs of a plant in words."""
    n_y, n_u = count_channels(nominal)
    return f"{format_count(n_y, 'output')} by {format_count(n_u, 'input')}"


def _own_weights_call(nominal: AnySystem, form: str) -> str:
    """Return the call that makes a set from weights of the user, for several channels."""
    n_y, n_u = count_channels(nominal)
    if form not in MATRIX_FORMS:
        form = INPUT if n_y == n_u else ADDITIVE
    left, right = {
        ELEMENTS: ("()", f"(w,) * {n_y * n_u}"),
        ADDITIVE: (f"(w,) * {n_y}", f"(1,) * {n_u}"),
    }.get(form, (f"(w,) * {n_u}", f"(1,) * {n_u}"))
    return f"UncertaintyModel(G, form={form!r}, left={left}, right={right}, omega=omega)"


def plant_of(name: str, given: object) -> control.StateSpace:
    """Return a plant with any number of channels, from a system or from a set by its nominal."""
    if isinstance(given, UncertaintyModel):
        return multivariable(name, given.nominal)
    return multivariable(name, given)


def has_several_channels(model: object) -> TypeGuard[UncertaintyModel]:
    """Return whether an object is an `UncertaintyModel` with several inputs or outputs."""
    return isinstance(model, UncertaintyModel) and not model.is_single


def require_several_channels(
    model: UncertaintyModel, purpose: str, instead: str
) -> EntryDeltas | BlockDelta:
    """Return the perturbation of a set with several channels; refuse a set with one, and name the
    alternative.
    """
    delta = model.delta
    if isinstance(delta, EntryDeltas | BlockDelta):
        return delta
    raise ValueError(
        f"model must have several channels to {purpose}, got one input and one output: {instead}"
    )


def require_record_form(model: UncertaintyModel, purpose: str) -> None:
    """Refuse a set that no record makes: another form, or weights that are matrices."""
    given = model.delta.form_with_weights
    if given not in RECORD_FORMS:
        raise ValueError(
            f"model must have the form {', '.join(RECORD_FORMS[:-1])} or {RECORD_FORMS[-1]} and one"
            f" weight a channel {purpose}, got {given}"
        )


def describe_no_set(thing: object) -> str:
    """Return the end of a refusal of an object that is no set; for an interconnection, name the
    call that takes it.
    """
    if not isinstance(thing, UncertainSystem):
        return short_form(thing)
    return (
        "an UncertainSystem: use check_structure(system), whose report contains the worst"
        " perturbation found; robust.mu.worst_gain(system.N, system.structure, omega) bounds the"
        " largest gain"
    )


def require_parametric(model: object, purpose: str) -> None:
    """Refuse an object that is no set, and a set that is known on its lines only."""
    if not isinstance(model, UncertaintyModel) or model.measured_only:
        raise ValueError(
            f"model must be an UncertaintyModel with a parametric nominal {purpose}, got"
            f" {describe_no_set(model)}"
        )


def require_one_channel(
    model: object, instead: str, purpose: str, *, parametric: bool = True
) -> None:
    """Refuse an object that is no set with one input and one output; for several channels, name the
    alternative.
    """
    if has_several_channels(model):
        raise ValueError(
            f"model must have one input and one output {purpose}, got {model.n_outputs} x"
            f" {model.n_inputs}: {instead}"
        )
    if parametric:
        require_parametric(model, purpose)
    elif not isinstance(model, UncertaintyModel):
        raise ValueError(
            f"model must be an UncertaintyModel {purpose}, got {describe_no_set(model)}"
        )


def is_within_set(
    model: UncertaintyModel, plant: control.StateSpace | control.FrequencyResponseData
) -> bool:
    """Return whether a plant, after the rounding of its realisation, still lies in the set that it
    was drawn from.

    It is compared on the lines, and beyond them for coprime factors, whose distance is bounded.
    """
    if not np.all(model.distance(plant) <= 1 + _SET_TOLERANCE):
        return False
    omega = model.centre.beyond(model.delta, model.omega)
    G, nominal = (
        np.moveaxis(one.response(omega).reshape(*model.delta.channels, omega.size), -1, 0)
        for one in (centre_of(plant), model.centre)
    )
    return bool(np.all(model.normalized_distance(omega, G, nominal) <= 1 + _SET_TOLERANCE))
