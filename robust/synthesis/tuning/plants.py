"""Plants in front of the blocks: systems with hold and delay, or FRFs on their lines, each with the
discs around it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NoReturn, TypeAlias

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import as_list, format_hertz, require_integer, short_form
from nlfrf._base.values import ArrayField, value
from robust._base.types import AnySystem, SystemField
from robust.analysis.loop import Loop, assemble_loop
from robust.analysis.sampled_set import sampled_set
from robust.friction.plant import FrictionPlant
from robust.lti.connections import block_diagonal
from robust.lti.low_frequency import Reading, radius_below, read_below
from robust.lti.lti import (
    one_sampling_time,
    poles,
    response,
    response_by_channel,
    timebase,
    to_s_plane,
)
from robust.lti.realisation import multivariable
from robust.lti.sampling import delay_samples, delayed, sampled
from robust.models.lpv import LpvModel, require_points, to_theta
from robust.models.sets.forms import ELEMENTS, FORMS, INPUT, plant_numerator
from robust.models.sets.measured import PlantLines, lines_of, warn_of_unknown_hold
from robust.models.sets.model import (
    UncertaintyModel,
    count_channels,
    plant_of,
    require_record_form,
)
from robust.synthesis.blocks import Names, signal_names
from robust.synthesis.tuning.worst import ONE_DISC, Blocks, Perturbation

#: A plant in the arguments of a user.
PlantModel: TypeAlias = "AnySystem | UncertaintyModel | Bla"
#: Stands for an infinite radius: its square is still a number.
_UNBOUNDED_GAIN = 1e30


@value(kw_only=False)
class Plants:
    """The plant of a design by `tune`, or several plants, for instance with different loads.

    Fields
    ------
    models : control system, UncertaintyModel, nlfrf.Bla, FrequencyResponseData, LpvModel, or a list
        Each plant has to meet every limit. An FRF is known on its lines only. For an
        UncertaintyModel a limit refers to the nominal, or to the whole set if `worst` is set in the
        limit. An LpvModel is replaced by its plants at the operating points, each with the weight
        of the model.
    inputs, outputs : str or list of str
        Names of the signals, in the order of the channels.
    n_unstable : int
        Number of unstable poles of plants that are FRFs.
    at : (N,) array_like, optional
        Operating points of the plants, increasing, for blocks with scheduled numbers. For an
        `LpvModel` the default is its own points; other points must have the same ends.
    over, unit : str
        Name and unit of the operating point; those of an `LpvModel` by default.

    Raises
    ------
    ValueError
        A value that is not a plant, signals that do not fit its channels, an FRF that is not
        finite, operating points that do not fit the plants.

    References
    ----------
    Apkarian, Gahinet & Buhr, *Multi-model, multi-objective tuning of fixed-structure controllers*,
    European Control Conference 2014.

    Examples
    --------
    >>> levels = [control.tf([k], [1, 1]) for k in (1.0, 2.0)]
    >>> len(Plants(levels, inputs="u", outputs="y").models)
    2
    """

    models: SystemField
    inputs: Names
    outputs: Names
    n_unstable: int = 0
    at: ArrayField = None
    over: str = "operating point"
    unit: str = ""

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs"):
            object.__setattr__(self, name, signal_names(name, getattr(self, name)))
        object.__setattr__(
            self, "n_unstable", require_integer("n_unstable", self.n_unstable, least=0)
        )
        lpv, at = self.models if isinstance(self.models, LpvModel) else None, self.at
        if lpv is not None and at is None:
            at = lpv.points
        models = tuple(as_list(self.models))
        if at is not None:
            if lpv is not None:
                count = np.size(at)
            else:
                count = len(models)
            at, _ = require_points(at, count, None, "plant")
        if lpv is not None:
            if not np.array_equal(at[[0, -1]], lpv.points[[0, -1]]):
                raise ValueError(
                    f"at must begin and end with the range of the model, {lpv.describe_range()}, got"
                    f" {at[0]:g} to {at[-1]:g}"
                )
            models = tuple(_local_model(lpv, point) for point in at)
            object.__setattr__(self, "over", lpv.over)
            object.__setattr__(self, "unit", lpv.unit)
        object.__setattr__(self, "at", at)
        if not models:
            raise ValueError("models must hold at least one plant, got an empty list")
        for k, model in enumerate(models):
            self.check_channels(f"models[{k}]", model)
        object.__setattr__(self, "models", models)

    @property
    def thetas(self) -> np.ndarray:
        """(N,) operating points scaled to [-1, 1]; zeros without operating points."""
        if self.at is None:
            return np.zeros(len(self.models))
        return to_theta(self.at, self.at)

    def describe(self, index: int) -> str:
        """Return the name of a plant in messages: its operating point, or its index.

        >>> carts = [control.tf([k], [1, 1]) for k in (1.0, 2.0)]
        >>> Plants(carts, inputs="u", outputs="y", at=[0, 0.3], over="position", unit="m").describe(1)
        'plant at position = 0.3 m'
        >>> Plants(carts, inputs="u", outputs="y").describe(1)
        'plant 1'
        """
        if self.at is None or index >= len(self.at):  # behind them: the machines of friction limits
            return f"plant {index}"
        return f"plant at {self.over} = {self.at[index]:g} {self.unit}".rstrip()

    def check_channels(self, name: str, model: PlantModel) -> None:
        """Refuse a value that is not a plant, or one with other channels."""
        lines = lines_of(model)
        if lines is None:
            shape = count_channels(plant_of(name, model))
        else:
            shape = lines.G.shape[:2]
            if not np.isfinite(lines.G).all():
                raise ValueError(
                    f"{name} must be finite on every line, got nan or infinite numbers. Leave"
                    " them out"
                )
        if shape != (len(self.outputs), len(self.inputs)):
            raise ValueError(
                f"{name} must have the {len(self.outputs)} outputs and {len(self.inputs)} inputs"
                f" that are named, got {shape[0]} and {shape[1]}"
            )


def _local_model(plant: LpvModel, point: float) -> PlantModel:
    """Return the plant at an operating point; with a weight for one channel its set, on the time base
    of the weight.
    """
    G, weight = plant.at(point), plant.weight
    if weight is None or (G.ninputs, G.noutputs) != (1, 1):
        return G
    if timebase(weight) and not plant.dt:
        G = sampled(G, timebase(weight))
    size = np.abs(to_s_plane(poles(G), timebase(G)))
    if size.any():
        size = size[size > 0]
    else:
        size = np.ones(1)
    top = min(10 * size.max(), 0.99 * np.pi / (timebase(G) or 1e-99))
    return UncertaintyModel(
        nominal=G,
        weight=weight,
        form=plant.form,
        omega=np.geomspace(min(0.1 * size.min(), top / 2), top, 100),
        perturbation="operator",
    )


@value(copy=False)
class ModelledPlant:
    """A plant that is known at every frequency, in front of the blocks."""

    system: control.StateSpace  # system, hold and delay included
    name: str = ""  # for messages
    theta: float = 0.0  # operating point
    lines: np.ndarray  # (.,) frequencies [rad/s] for the grid
    # True frequencies (W,) [rad/s] -> ports of the perturbation of the set
    perturbation: Callable[[np.ndarray], Perturbation] | None = None
    blocks: Blocks = ONE_DISC  # the blocks of the perturbation
    # nominal and weights of the set; the perturbation has their poles and zeros
    set_systems: tuple[control.StateSpace, ...] = ()


@value(copy=False)
class MeasuredPlant:
    """An FRF in front of the blocks.

    Fields
    ------
    omega : (W,) ndarray
        Lines [rad/s]; for one channel also frequencies below the first, with its likeliest
        continuation.
    G : (n_y, n_u, W) complex ndarray
        FRF, hold and delay included.
    perturbation : Perturbation or None
        Ports of the perturbation of the set, on the lines.
    n_unstable : int
    readings : tuple of Reading
        Possible continuations below its first line; for several channels those of the determinant.
    first : float
        First measured line [rad/s].
    theta : float
        Operating point.
    name : str
        Name for messages.
    """

    omega: np.ndarray
    G: np.ndarray
    perturbation: Perturbation | None
    n_unstable: int
    readings: tuple[Reading, ...]
    first: float
    blocks: Blocks = ONE_DISC
    theta: float = 0.0
    name: str = ""

    @property
    def on_lines(self) -> np.ndarray:
        """Return (W,) True for measured lines."""
        return np.asarray(self.omega >= self.first)


def see_plants(
    plants: Plants, dt: float, *, delay: float, worst: bool
) -> list[ModelledPlant | MeasuredPlant]:
    """Return every plant behind hold and delay, with its set if a limit needs it."""
    return [
        replace(
            _see_plant(f"models[{k}]", model, plants=plants, dt=dt, delay=delay, worst=worst),
            theta=theta,
            name=plants.describe(k),
        )
        for k, (model, theta) in enumerate(zip(plants.models, plants.thetas, strict=True))
    ]


def _see_plant(
    name: str, model: PlantModel, *, plants: Plants, dt: float, delay: float, worst: bool
) -> ModelledPlant | MeasuredPlant:
    """Return one plant behind hold and delay."""
    lines = lines_of(model)
    if lines is not None:
        if worst and np.isnan(lines.w).all():
            _refuse_plant_alone(name, model)
        return _see_measured(
            name, lines, n_unstable=plants.n_unstable, dt=dt, delay=delay, worst=worst
        )
    if not isinstance(model, UncertaintyModel):
        if worst:
            _refuse_plant_alone(name, model)
        G = _behind_hold_and_delay(name, multivariable(name, model), dt=dt, delay=delay)
        return ModelledPlant(system=G, lines=np.zeros(0))
    if model.is_single:
        return _see_single_set(name, model, dt=dt, delay=delay, worst=worst)
    return _see_matrix_set(name, model, dt=dt, delay=delay, worst=worst)


def _see_matrix_set(
    name: str, model: UncertaintyModel, *, dt: float, delay: float, worst: bool
) -> ModelledPlant:
    """Return a set for several channels behind hold and delay."""
    if worst and dt and not model.dt:
        warn_of_unknown_hold(model, dt)
        model, delay = sampled_set(model, dt, delay).model, 0.0
    seen = ModelledPlant(
        system=_behind_hold_and_delay(name, model.nominal, dt=dt, delay=delay), lines=model.omega
    )
    if not worst:
        return seen
    return replace(
        seen,
        perturbation=_perturbation_of_matrices(model),
        blocks=tuple(model.structure),
        set_systems=model.weights,
    )


def _see_single_set(
    name: str, model: UncertaintyModel, *, dt: float, delay: float, worst: bool
) -> ModelledPlant:
    """Return a set for one channel behind hold and delay."""
    loop = assemble_loop(model, control.StateSpace([], [], [], [[0.0]], dt), w_P=None, delay=delay)
    if loop.dt:
        warn_of_unknown_hold(model, loop.dt)
    if loop.aliases is not None and loop.aliases.inverse and worst:
        raise ValueError(
            f"{name} must have a sampled nominal for worst=True in the {model.form} form in a"
            " sampled loop, got a continuous one. Use sampled(nominal, dt), or another form"
        )
    if worst:
        perturbation = _perturbation_of_disc(loop)
    else:
        perturbation = None
    if (
        perturbation is not None
        and not is_bounded(perturbation(np.array([0.1 / dt if dt else 1.0])))[0]
    ):
        raise ValueError(
            f"{name} must have a weight that falls with frequency for worst=True in a sampled loop,"
            " got a set with an unbounded sum of aliases. Use sampled(nominal, dt) as the nominal,"
            " or a weight with a roll-off"
        )
    systems = (loop.weight, loop.shaping, model.nominal) if worst else ()
    return ModelledPlant(
        system=loop.G, lines=model.omega, perturbation=perturbation, set_systems=systems
    )


def _behind_hold_and_delay(
    name: str, G: control.StateSpace, *, dt: float, delay: float
) -> control.StateSpace:
    """Return a system on the time base of the design."""
    step = timebase(G)
    if step and dt and abs(step / dt - 1) > 1e-9:
        raise ValueError(f"dt must be the sampling time of {name}, {step:g} s, got {dt:g} s")
    if step and not dt:
        raise ValueError(
            f"dt must be given for {name}, which is sampled at {step:g} s, got a continuous design"
        )
    if step:
        return delayed(G, delay_samples("delay", delay, step) * step)
    if dt:
        return sampled(G, dt, delay)
    return delayed(G, delay)


def see_machine(
    machine: FrictionPlant, plants: Plants, *, index: int, dt: float, delay: float
) -> ModelledPlant:
    """Return the machine of a friction limit behind hold and delay, from force to measured
    position.
    """
    if (len(plants.inputs), len(plants.outputs)) != (1, 1):
        raise ValueError(
            "hard must hold friction limits for a plant with one input and one output only, got"
            f" one with {len(plants.inputs)} and {len(plants.outputs)}"
        )
    delay += machine.delay
    if delay and not dt:
        raise ValueError(
            f"dt must be given for a friction limit with a delay, got a delay of {delay:g} s"
            " without dt"
        )
    G = control.StateSpace(machine.A, machine.B_force[:, None], machine.C_measured[None], 0)
    return ModelledPlant(
        system=sampled(G, dt, delay) if dt else G, name=plants.describe(index), lines=np.zeros(0)
    )


def _refuse_plant_alone(name: str, model: object) -> NoReturn:
    """Refuse a plant without a set around it, for a worst case."""
    raise ValueError(
        "worst must be False unless every plant is an UncertaintyModel, or a Bla with one input"
        f" and output, got {name} = {short_form(model)}. Make a set of it by uncertainty()"
    )


def _perturbation_of_disc(loop: Loop) -> Callable[[np.ndarray], Perturbation]:
    """Return the set for one channel as in `check`: a sampled loop with a continuous set includes
    all aliases.
    """
    row = FORMS[loop.form]

    def at(omega: np.ndarray) -> Perturbation:
        omega = np.minimum(
            np.asarray(omega, dtype=float), loop.omega_max * (1 - 1e-12) if loop.dt else 1e12
        )
        G = loop.plant_response(omega)
        if loop.aliases is not None:
            radius = loop.aliases.sampled_radius(
                np.maximum(omega, 1e-9 / loop.dt), G
            )  # at zero hold and alias are 0/0
            return _disc_around(
                np.zeros(omega.size), np.where(np.isfinite(radius), radius, _UNBOUNDED_GAIN)
            )
        W = np.ones(omega.size, complex)
        if row.depends_on_units:
            W = response(loop.shaping, omega) * np.exp(1j * omega * loop.plant_delay)
        return _disc_of_form(
            loop.form, response(loop.weight, omega), G=np.where(np.isfinite(G), G, 1e140), W=W
        )

    return at


def _disc_of_form(form: str, w: np.ndarray, *, G: np.ndarray, W: np.ndarray) -> Perturbation:
    """Return the disc (G + g Delta)/(1 + a Delta) of a form with weight w."""
    row, one = FORMS[form], np.ones_like(G)
    if row.depends_on_units:
        scaled = W * G
    else:
        scaled = G
    return _disc_around(
        np.asarray(row.a(w, scaled, one, one)), np.asarray(plant_numerator(form, w, G=G, W=W))
    )


def _disc_around(a: np.ndarray, g: np.ndarray) -> Perturbation:
    """Return the perturbation of (G + g Delta)/(1 + a Delta): it adds -a Delta u to the plant
    input, g Delta u to y.
    """
    return Perturbation(
        reads=np.ones((a.size, 1, 1), complex),
        drives=np.stack([-a, g], axis=1)[:, :, None].astype(complex),
    )


def is_bounded(perturbation: Perturbation) -> np.ndarray:
    """Return (W,) True where the set is bounded; at a pole on the axis its neighbours count
    instead.
    """
    return np.abs(perturbation.drives).max(axis=(1, 2)) < _UNBOUNDED_GAIN


def _perturbation_of_matrices(model: UncertaintyModel) -> Callable[[np.ndarray], Perturbation]:
    """Return the set of a model with several channels, in its own form."""
    require_record_form(
        model, "to tune a controller for its perturbations (dk_iteration takes every form)"
    )
    n_y, n_u, dt = model.n_outputs, model.n_inputs, timebase(model.nominal)
    # column after column of G, as in `UncertaintyModel.open_loop`
    elements = model.form == ELEMENTS
    if elements:
        reads = np.repeat(np.eye(n_u), n_y, axis=0)
        acts = np.tile(np.eye(n_y), n_u)
    else:
        reads = np.eye(n_u)
        acts = np.eye(len(model.left))
    left = _stacked(model.left or (control.StateSpace([], [], [], [[1.0]], dt),), dt)
    right = _stacked(model.right, dt)
    at_input = model.form == INPUT
    acts = np.vstack(
        [acts, np.zeros((n_y, n_u))] if at_input else [np.zeros((n_u, acts.shape[1])), acts]
    )

    def at(omega: np.ndarray) -> Perturbation:
        omega = np.minimum(np.asarray(omega, dtype=float), np.pi / dt * (1 - 1e-12) if dt else 1e12)
        w_l, w_r = (response_by_channel(weights, omega)[:, 0].T for weights in (left, right))
        return Perturbation(
            reads=w_r[:, :, None] * reads, drives=w_l[:, None] * acts, reads_before=at_input
        )

    return at


def _stacked(weights: Sequence[control.StateSpace], dt: float) -> control.StateSpace:
    """Return weights stacked behind one input: evaluated together they cost little more than
    one.
    """
    together = block_diagonal(list(weights), dt)
    ones = np.ones((len(weights), 1))
    return control.StateSpace(
        together.A,
        together.B @ ones,
        together.C,
        together.D @ ones,
        dt,
        remove_useless_states=False,
    )


def _see_measured(
    name: str, plant: PlantLines, *, n_unstable: int, dt: float, delay: float, worst: bool
) -> MeasuredPlant:
    """Return an FRF on its lines."""
    omega, G, form, W = plant.omega, plant.G, plant.form, plant.W
    w = np.nan_to_num(plant.w)  # nan: no set
    if not np.isfinite(G).all():
        raise ValueError(
            f"{name} must be finite on every line, got nan or infinite numbers. Leave them out"
        )
    order = np.argsort(omega)
    if dt and omega[order][-1] * dt >= np.pi:
        raise ValueError(
            f"dt must put Nyquist above the lines, up to {format_hertz(omega.max())}, got {dt:g} s"
        )
    omega, G = omega[order], G[:, :, order]
    seen = G * plant.hold_and_delay_factor(omega, dt=dt, delay=delay)
    if G.shape[:2] != (1, 1):
        square = G.shape[0] == G.shape[1]
        if square:
            readings = read_below(
                omega, np.linalg.det(np.moveaxis(seen, 2, 0)), n_unstable=n_unstable
            )
        else:
            readings = ()
        return MeasuredPlant(
            omega=omega,
            G=seen,
            perturbation=None,
            n_unstable=n_unstable,
            readings=readings,
            first=float(omega[0]),
        )
    ours, measured = seen[0, 0], G[0, 0]
    w, W = w[order], np.asarray(W)[order]
    radius = np.abs(plant_numerator(form, w, G=ours, W=W * measured / ours))
    readings = read_below(omega, ours, radius, n_unstable=n_unstable)
    low, n = readings[0], readings[0].omega.size
    ours = np.concatenate([low.G, ours])
    measured, W = (
        np.concatenate([np.full(n, part[0]), part]) for part in (measured / seen[0, 0], W)
    )
    if FORMS[form].vanishes_with_plant:
        size = np.ones(ours.size)
    else:
        size = np.abs(ours)
    w = np.concatenate([radius_below(omega, np.abs(w) / size[n:]) * size[:n], w])
    if worst:
        perturbation = _disc_of_form(form, w, G=ours, W=np.asarray(W * measured))
    else:
        perturbation = None
    return MeasuredPlant(
        omega=np.concatenate([low.omega, omega]),
        G=ours[None, None],
        perturbation=perturbation,
        n_unstable=n_unstable,
        readings=readings,
        first=float(omega[0]),
    )


def stated_sampling_time(plants: Sequence[PlantModel]) -> float:
    """Return the sampling time [s] of the plants; 0 if none has one."""
    return one_sampling_time(
        plant_of("plant", model).dt for model in plants if lines_of(model) is None
    )
