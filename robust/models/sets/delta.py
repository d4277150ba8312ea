"""The perturbation of a set with its weights: one number for a plant with one channel, one number
for each entry of a matrix, or one full block.

A set chooses one of the three where it is made. What differs between them is a method here. For all
of them `gains` and a radius have one row for each weight, and a plant is a system; responses of
the first are (..., W) and those of the others (..., W, n_y, n_u).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeAlias

import control
import numpy as np
from scipy.linalg import block_diag

from nlfrf._base.arguments import require_choice
from nlfrf._base.numbers import squared_modulus
from nlfrf._base.values import value
from robust._base.types import AnySystem, Weight
from robust.lti.connections import block_diagonal, in_series, upper_lft
from robust.lti.lti import (
    common_sampling_time,
    divide_right,
    replace_infinite,
    require_sampling_time,
    response,
    response_by_channel,
    signal_names,
)
from robust.lti.realisation import multivariable, reachable_entry, state_space
from robust.models.sets.coprime import invertible_scaling, require_below_one
from robust.models.sets.forms import (
    ADDITIVE,
    BLOCK_FORMS,
    ELEMENTS,
    FORMS,
    MATRIX_FORMS,
    Form,
    MatrixForm,
)
from robust.models.sets.membership import Deviation, block_deviation, coprime_deviation, right_roots
from robust.models.sets.perturbations import perturbed_plant

_ROUNDING_FACTOR = 1 + 1e-9  # a Delta of size one, with rounding

Systems: TypeAlias = tuple[control.StateSpace, ...]


def side_gains(left: Systems, right: Systems, omega: np.ndarray) -> np.ndarray:
    """Return (n, W) gains of the rows of the weights of W_l, then of the columns of those of W_r."""
    return np.concatenate(
        [
            np.linalg.norm(response_by_channel(weight, omega), axis=axis)
            for side, axis in ((left, 1), (right, 0))
            for weight in side
        ]
    )


class Delta(Protocol):
    """The perturbation of a set, with its weights."""

    @property
    def form(self) -> str:
        """Name of the form."""
        ...

    @property
    def form_with_weights(self) -> str:
        """Name of the form, followed by the kind of the weights unless there is one a channel."""
        ...

    @property
    def weights(self) -> Systems:
        """All weights."""
        ...

    @property
    def weight_names(self) -> list[str]:
        """Name of each weight in a message."""
        ...

    @property
    def scaling(self) -> Systems:
        """W1 and W2 of the coprime form; empty for other forms."""
        ...

    @property
    def structure(self) -> list[tuple[int, int]]:
        """Blocks of Delta, as `robust.mu.upper` takes them."""
        ...

    @property
    def shaping(self) -> control.StateSpace:
        """Product W1 W2 of the coprime form; a unit gain for other forms."""
        ...

    @property
    def channels(self) -> tuple[int, ...]:
        """Axes of a response that come before the one of the lines, as the set shows them."""
        ...

    def radius_shape(self, n_lines: int) -> tuple[int, ...]:
        """Return the shape of the radius, as the set shows it."""
        ...

    def signal_names(self, nominal: AnySystem) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the names of inputs and outputs that a set has if none were given."""
        ...

    def describe(self, omega: np.ndarray, radius: np.ndarray, unit: str) -> tuple[str, str, str]:
        """Describe the channels of the set, what one record of it is, and what follows the nominal.

        unit : that of the plant.
        """
        ...

    def gains(self, omega: np.ndarray) -> np.ndarray:
        """Return (n, W) gain of each row of W_l, then of each column of W_r."""
        ...

    def smallest(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        """Return the smallest Delta that changes `nominal` into G."""
        ...

    def size(self, Delta: np.ndarray) -> np.ndarray:
        """Return (..., W) the gain of Delta."""
        ...

    def is_within(self, Delta: np.ndarray) -> np.ndarray:
        """Return (..., W) whether the gain of Delta is at most one."""
        ...

    def counted_roots(self, plant: control.StateSpace) -> int:
        """Return the number of roots in the right half plane that all plants of the set share."""
        ...

    def deviations(
        self, G: control.StateSpace, plant: control.StateSpace, omega: np.ndarray
    ) -> list[Deviation]:
        """Return the deviation of a plant from a nominal, by block."""
        ...

    def beyond(self, omega: np.ndarray, dt: float) -> np.ndarray:
        """Return the frequencies outside the lines omega at which a drawn plant is compared."""
        ...

    def perturbed(self, G: control.StateSpace, Delta: object) -> control.StateSpace:
        """Return the plant of a perturbation."""
        ...

    def relative_radius(self, radius: np.ndarray, G: np.ndarray) -> np.ndarray:
        """Return (W,) the radius divided by |G|; nan for a form without a relative deviation."""
        ...


@value(copy=False)
class _ScalarDelta:
    """One number, for a plant with one channel."""

    form: str
    weight: control.StateSpace
    scaling: Systems

    @property
    def _row(self) -> Form:
        return FORMS[self.form]

    @property
    def form_with_weights(self) -> str:
        return self.form

    @property
    def weights(self) -> Systems:
        return (self.weight,)

    @property
    def weight_names(self) -> list[str]:
        return ["weight"]

    @property
    def structure(self) -> list[tuple[int, int]]:
        return [(1, 1)]

    @property
    def channels(self) -> tuple[int, ...]:
        return ()

    @property
    def shaping(self) -> control.StateSpace:
        if self.scaling:
            return in_series(*self.scaling)
        return state_space("shaping", 1.0)

    def radius_shape(self, n_lines: int) -> tuple[int, ...]:
        return (n_lines,)

    def signal_names(self, nominal: AnySystem) -> tuple[tuple[str, ...], tuple[str, ...]]:
        del nominal
        return ("u",), ("y",)

    def describe(self, omega: np.ndarray, radius: np.ndarray, unit: str) -> tuple[str, str, str]:
        k, f = int(np.argmax(radius)), omega / (2 * np.pi)
        largest = f"{radius[k]:.3g} {self._row.unit_of(unit)}".rstrip()
        size = (
            f", weight of order {self.weight.nstates}, radius {radius.min():.3g} to {largest} (at"
            f" {f[k]:.4g} Hz) over {f[0]:.4g} to {f[-1]:.4g} Hz"
        )
        return "", "FRF", size

    def gains(self, omega: np.ndarray) -> np.ndarray:
        return side_gains((), (self.weight,), omega)

    def smallest(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        if self._row.depends_on_units:  # at a pole, too, where G is infinite
            W = response(self.shaping, omega)
            G, nominal = W * replace_infinite(G), W * replace_infinite(nominal)
        # exact except for the phase of the weight
        return self._row.deviation(G, nominal) / np.abs(response(self.weight, omega))

    def size(self, Delta: np.ndarray) -> np.ndarray:
        return np.abs(Delta)

    def is_within(self, Delta: np.ndarray) -> np.ndarray:
        return np.abs(Delta) <= _ROUNDING_FACTOR

    @property
    def _block_row(self) -> MatrixForm | None:
        """Row of the form as a full block; None for coprime factors."""
        return next((row for row in BLOCK_FORMS.values() if row.one_channel == self.form), None)

    def counted_roots(self, plant: control.StateSpace) -> int:
        row = self._block_row
        # for coprime factors the number of roots is no condition
        if row is None:
            return 0
        return right_roots(plant, inverse=row.inverse)

    def deviations(
        self, G: control.StateSpace, plant: control.StateSpace, omega: np.ndarray
    ) -> list[Deviation]:
        row = self._block_row
        if row is None:
            return [coprime_deviation(G, plant, weight=self.weight, shaping=self.shaping)]
        one = state_space("weight", 1.0)
        return [block_deviation(row, G, plant, W_l=self.weight, W_r=one, omega=omega)]

    def beyond(self, omega: np.ndarray, dt: float) -> np.ndarray:
        if not self._row.depends_on_units:
            return omega[:0]
        # the distance of coprime factors is bounded at every frequency
        first, last = omega[[0, -1]]
        return np.geomspace(
            first / 100, min(100 * last, 0.999 * np.pi / dt) if dt else 100 * last, 200
        )

    def perturbed(self, G: control.StateSpace, Delta: object) -> control.StateSpace:
        return perturbed_plant(self.form, G, self.weight, state_space("Delta", Delta), self.shaping)

    def relative_radius(self, radius: np.ndarray, G: np.ndarray) -> np.ndarray:
        row = self._row
        if row.relative_weight is None or row.inverse:
            return np.full(len(radius), np.nan)
        return row.relative_weight(radius, np.abs(G))


@value(copy=False)
class _Ports:
    """How W_l Delta W_r is connected to a plant with several channels."""

    reads: np.ndarray  # from the signals of the plant to W_r
    acts: np.ndarray  # from W_l to the signals of the plant
    from_y: bool  # True if W_r reads outputs of the plant
    on_u: bool  # True if W_l acts on inputs of the plant
    inverse: bool  # True if W_r reads behind the place where W_l acts


@value(copy=False)
class _MatrixDelta:
    """The part that perturbations of a plant with several channels share."""

    form: str
    left: Systems
    right: Systems
    ports: _Ports
    n_outputs: int
    n_inputs: int
    dt: float

    @property
    def form_with_weights(self) -> str:
        return self.form

    @property
    def weights(self) -> Systems:
        return *self.left, *self.right

    @property
    def weight_names(self) -> list[str]:
        left, right = (
            [f"{side}[{k}]" for k in range(len(weights))]
            for side, weights in (("left", self.left), ("right", self.right))
        )
        return left + right

    @property
    def scaling(self) -> Systems:
        return ()

    @property
    def shaping(self) -> control.StateSpace:
        return state_space("shaping", 1.0)

    @property
    def channels(self) -> tuple[int, ...]:
        return self.n_outputs, self.n_inputs

    def radius_shape(self, n_lines: int) -> tuple[int, ...]:
        return sum(weight.noutputs for weight in self.weights), n_lines

    def signal_names(self, nominal: AnySystem) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return signal_names(nominal)

    def describe(self, omega: np.ndarray, radius: np.ndarray, unit: str) -> tuple[str, str, str]:
        del omega, radius, unit
        orders = [weight.nstates for weight in self.weights]
        rate = f" at {1 / self.dt:g} Hz" if self.dt else ""
        return (
            f" with {self.n_outputs} outputs and {self.n_inputs} inputs",
            "matrix",
            f"{rate}, weights of orders {min(orders)} to {max(orders)}",
        )

    def gains(self, omega: np.ndarray) -> np.ndarray:
        return side_gains(self.left, self.right, omega)

    def sides(self) -> tuple[control.StateSpace, control.StateSpace]:
        """Return W_l and W_r as systems; W_l = I where `left` is empty."""
        right = block_diagonal(list(self.right), self.dt)
        if self.left:
            return block_diagonal(list(self.left), self.dt), right
        return control.StateSpace([], [], [], np.eye(len(self.right)), self.dt), right

    def open_loop(self, G: control.StateSpace) -> control.StateSpace:
        """Return the system from (outputs of Delta, u) to (inputs of Delta, y)."""
        n_y, n_u, ports = self.n_outputs, self.n_inputs, self.ports
        W_l, W_r = self.sides()
        reads, acts, inverse = ports.reads, ports.acts, ports.inverse
        none = np.zeros(((n_y if ports.on_u else n_u), W_l.noutputs))
        # of d behind W_l into G, and onto y
        into, onto = (acts, none) if ports.on_u else (none, acts)
        # what W_r reads, from the states of G, d behind W_l and u; in an inverse form behind the
        # place where d acts
        if ports.from_y:
            of_states, of_u = reads @ G.C, reads @ G.D
            of_d = reads @ (G.D @ into + inverse * onto)
        else:
            of_states, of_u = np.zeros((len(reads), G.nstates)), reads @ np.eye(n_u)
            of_d = reads @ (inverse * into)
        A = block_diag(G.A, W_l.A, W_r.A)
        behind = slice(G.nstates, G.nstates + W_l.nstates)
        A[: G.nstates, behind] = G.B @ into @ W_l.C
        A[behind.stop :, : G.nstates], A[behind.stop :, behind] = (
            W_r.B @ of_states,
            W_r.B @ of_d @ W_l.C,
        )
        B = np.block(
            [
                [G.B @ into @ W_l.D, G.B],
                [W_l.B, np.zeros((W_l.nstates, n_u))],
                [W_r.B @ of_d @ W_l.D, W_r.B @ of_u],
            ]
        )
        C = np.block(
            [
                [W_r.D @ of_states, W_r.D @ of_d @ W_l.C, W_r.C],
                [G.C, (onto + G.D @ into) @ W_l.C, np.zeros((n_y, W_r.nstates))],
            ]
        )
        D = np.block([[W_r.D @ of_d @ W_l.D, W_r.D @ of_u], [(onto + G.D @ into) @ W_l.D, G.D]])
        return control.StateSpace(A, B, C, D, G.dt)

    def perturbed(self, G: control.StateSpace, Delta: object) -> control.StateSpace:
        P, D = self.open_loop(G), multivariable("Delta", Delta)
        require_sampling_time("Delta", D, reference="the model", wanted=common_sampling_time(P))
        n, m = D.ninputs, D.noutputs
        if (P.noutputs - self.n_outputs, P.ninputs - self.n_inputs) != (n, m):
            raise ValueError(
                f"Delta must have {P.noutputs - self.n_outputs} inputs and"
                f" {P.ninputs - self.n_inputs} outputs for the {self.form} form, got {n} and {m}"
            )
        return upper_lft(P, D)

    def beyond(self, omega: np.ndarray, dt: float) -> np.ndarray:
        del dt
        return omega[:0]

    def relative_radius(self, radius: np.ndarray, G: np.ndarray) -> np.ndarray:
        del G
        return np.full(radius.shape[-1], np.nan)


@value(copy=False)
class EntryDeltas(_MatrixDelta):
    """A number for each entry of the plant, column by column of G: "elements"."""

    @property
    def structure(self) -> list[tuple[int, int]]:
        return [(1, 1)] * (self.n_outputs * self.n_inputs)

    def radii(self, omega: np.ndarray) -> np.ndarray:
        """Return (n_y, n_u, W) the largest deviation of each entry."""
        return np.swapaxes(self.gains(omega).reshape(self.n_inputs, self.n_outputs, -1), 0, 1)

    def entry_radius(self, G: control.StateSpace, omega: np.ndarray) -> np.ndarray:
        del G
        return self.radii(omega)

    def smallest(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        return (G - nominal) / np.moveaxis(self.radii(omega), 2, 0)

    def size(self, Delta: np.ndarray) -> np.ndarray:
        return np.max(np.abs(Delta), axis=(-2, -1))

    def is_within(self, Delta: np.ndarray) -> np.ndarray:
        return np.all(squared_modulus(Delta) <= _ROUNDING_FACTOR**2, axis=(-2, -1))

    def counted_roots(self, plant: control.StateSpace) -> int:
        return right_roots(plant, inverse=False)

    def deviations(
        self, G: control.StateSpace, plant: control.StateSpace, omega: np.ndarray
    ) -> list[Deviation]:
        one = state_space("weight", 1.0)
        pairs = [(j, i) for i in range(self.n_inputs) for j in range(self.n_outputs)]
        return [
            block_deviation(
                BLOCK_FORMS[ADDITIVE],
                reachable_entry(G, j, i),
                reachable_entry(plant, j, i),
                W_l=weight,
                W_r=one,
                omega=omega,
            )
            for (j, i), weight in zip(pairs, self.right, strict=True)
        ]


@value(copy=False)
class BlockDelta(_MatrixDelta):
    """One full block between diagonal W_l and W_r."""

    @property
    def _row(self) -> MatrixForm:
        return BLOCK_FORMS[self.form]

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of inputs and outputs of Delta."""
        return sum(weight.noutputs for weight in self.right), sum(
            weight.ninputs for weight in self.left
        )

    @property
    def structure(self) -> list[tuple[int, int]]:
        return [self.shape]

    def entry_radius(self, G: control.StateSpace, omega: np.ndarray) -> np.ndarray:
        n_z, n_d = self.shape
        P = response_by_channel(self.open_loop(G), omega)
        around = np.linalg.norm(
            np.moveaxis(P[:n_z, :n_d], 2, 0), 2, axis=(1, 2)
        )  # Delta in a loop of its own
        amplified = np.divide(1.0, 1 - around, out=np.full(around.size, np.inf), where=around < 1)
        return (
            amplified
            * np.linalg.norm(P[n_z:, :n_d], axis=1)[:, None]
            * np.linalg.norm(P[:n_z, n_d:], axis=0)
        )

    def smallest(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        left, right = np.split(self.gains(omega).T, [len(self.left)], axis=1)
        return self._row.deviation(G, nominal) / left[:, :, None] / right[:, None, :]

    def size(self, Delta: np.ndarray) -> np.ndarray:
        return np.linalg.norm(Delta, 2, (-2, -1))

    def is_within(self, Delta: np.ndarray) -> np.ndarray:
        total = np.add.reduce(squared_modulus(Delta), axis=(-2, -1))
        held = total <= _ROUNDING_FACTOR**2
        # the norm of Frobenius is at most the root of the rank above the gain
        close = ~held & (total <= _ROUNDING_FACTOR**2 * min(Delta.shape[-2:]))
        held[close] = np.linalg.norm(Delta[close], 2, (-2, -1)) <= _ROUNDING_FACTOR
        return held

    def counted_roots(self, plant: control.StateSpace) -> int:
        return right_roots(plant, inverse=self._row.inverse)

    def deviations(
        self, G: control.StateSpace, plant: control.StateSpace, omega: np.ndarray
    ) -> list[Deviation]:
        W_l, W_r = self.sides()
        return [block_deviation(self._row, G, plant, W_l=W_l, W_r=W_r, omega=omega)]


@value(copy=False)
class _FullyWeightedDelta(BlockDelta):
    """One full block between W_l and W_r of which one or both are full matrices."""

    @property
    def form_with_weights(self) -> str:
        return f"{self.form} with weights that are matrices"

    def smallest(self, omega: np.ndarray, G: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        W_l, W_r = (np.moveaxis(response_by_channel(side, omega), 2, 0) for side in self.sides())
        return np.linalg.solve(W_l, divide_right(self._row.deviation(G, nominal), W_r))


def scalar_delta(
    nominal: control.StateSpace | control.FrequencyResponseData,
    form: str,
    weight: control.StateSpace,
    scaling: Sequence[Weight | None],
) -> _ScalarDelta:
    """Return the perturbation of a plant with one channel, or refuse form, weight or scaling."""
    row = FORMS[require_choice("form", form, tuple(FORMS))]
    if row.depends_on_units:
        require_below_one(weight)
        W1, W2 = scaling or (None, None)
        shaped = tuple(invertible_scaling(name, W, nominal) for name, W in (("W1", W1), ("W2", W2)))
    else:
        _refuse_scaling(form, scaling)
        shaped = ()
    return _ScalarDelta(form=form, weight=weight, scaling=shaped)


def matrix_delta(
    nominal: control.StateSpace,
    form: str,
    left: Systems,
    right: Systems,
    scaling: Sequence[Weight | None],
) -> EntryDeltas | BlockDelta:
    """Return the perturbation of a plant with several channels; refuse another number of weights
    than the form has.
    """
    require_choice("form", form, MATRIX_FORMS)
    _refuse_scaling(form, scaling)
    n_y, n_u = nominal.noutputs, nominal.ninputs
    each = {"left": left, "right": right}
    counts = [sum(weight.noutputs for weight in side) for side in each.values()]
    known = {
        "form": form,
        "left": left,
        "right": right,
        "n_outputs": n_y,
        "n_inputs": n_u,
        "dt": nominal.dt,
    }
    kind: type[EntryDeltas | BlockDelta]
    if form == ELEMENTS:
        wanted, kind = [0, n_y * n_u], EntryDeltas
        # column i of G after the other: read u_i, act on y_j
        ports = _Ports(
            reads=np.repeat(np.eye(n_u), n_y, axis=0),
            acts=np.tile(np.eye(n_y), n_u),
            from_y=False,
            on_u=False,
            inverse=False,
        )
    else:
        row, size = BLOCK_FORMS[form], {"u": n_u, "y": n_y}
        wanted = [size[row.acts], size[row.reads]]
        if row.needs_square_plant and n_y != n_u:
            raise ValueError(
                f"form must be elements or additive for a plant that is not square, got {n_y}"
                f" by {n_u}"
            )
        full = any(weight.noutputs > 1 for weight in (*left, *right))
        kind = _FullyWeightedDelta if full else BlockDelta
        ports = _Ports(
            reads=np.eye(counts[1]),
            acts=(-1.0 if row.inverse else 1.0) * np.eye(counts[0]),
            from_y=row.reads == "y",
            on_u=row.acts == "u",
            inverse=row.inverse,
        )
    odd = next(
        (n for n, side in each.items() for weight in side if weight.noutputs != weight.ninputs),
        None,
    )
    if odd or counts != wanted or (form == ELEMENTS and len(right) != wanted[1]):
        raise ValueError(
            f"left and right must hold {wanted[0]} and {wanted[1]} weights for the {form} form, "
            + (f"got {odd} that is not square" if odd else f"got {counts[0]} and {counts[1]}")
        )
    return kind(**known, ports=ports)


def _refuse_scaling(form: str, scaling: Sequence[Weight | None]) -> None:
    if scaling:
        raise ValueError(
            f"W1 and W2 must be left out except for the coprime form, got scaling with {form}"
        )
