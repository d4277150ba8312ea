"""``MatrixUncertainty``: a nominal of several inputs and outputs, and what a measured `Bla` leaves open about it.

    form       set, gain of every Delta at most one              blocks
    elements   G_ji + w_ji Delta_ji                              n_y n_u numbers
    additive   G + W_l Delta W_r                                 one full n_y by n_u
    input      G (I + W_l Delta W_r)                             one full n_u by n_u, for a square G

with diagonal W_l, W_r. Never one scalar radius: it would cost a factor of ten where entries differ in size. "elements"
serves where one channel is critical, a full block where all are, where outputs move together, and from 4 by 4 on. The
form has to be chosen before looking at what comes out: who tries two has tested twice.

              +---- W_r <--+
              |            |                additive: d is added to y
              v  z         | u              input:    d is added to u, behind where z is read
            Delta          |
              | d          |
              +--> W_l --> (+) with G
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy.linalg import block_diag

from nlfrf._base.arguments import require_choice, require_real_array
from nlfrf._base.numbers import squared_modulus
from nlfrf._base.values import value
from robust.lti.connections import block_diagonal, lower_lft, require_shape, weighted_plant
from robust.lti.lti import (
    SAMPLING_TOLERANCE,
    common_sampling_time,
    is_clockless,
    require_sampling_time,
    response_by_channel,
    signal_names,
    timebase,
)
from robust.lti.realisation import multivariable, repeat_over_channels
from robust.lti.stability import is_stable
from robust.models.fit.weights import cover_sampled
from robust.models.sets.evidence import MatrixEvidence
from robust.models.sets.forms import ADDITIVE, ELEMENTS, INPUT, MATRIX_FORMS, PERTURBATIONS
from robust.models.sets.interconnection import Block, UncertainSystem
from robust.models.sets.joint import told

__all__ = ["MatrixUncertainty"]


ROUNDED = 1 + 1e-9  # a Delta of size one, but for rounding


@value
class MatrixUncertainty:
    """A set of plants of several inputs and outputs around a nominal, as wide as a measured `Bla` asks for.

    Fields
    ------
    nominal : control.StateSpace
        Nominal plant, n_y outputs by n_u inputs, with its delay inside.
    form : str
        "elements", "additive" or "input", see the head of this room.
    left, right : tuple of control.StateSpace
        Stable weights, one a channel: W_l and W_r. Of "elements" the n_y n_u weights stand in `right`, columns of G one
        after the other, and `left` is empty.
    omega : (W,) ndarray
        Measured frequencies [rad/s].
    radius : (n, W) ndarray
        What the weights cover, those of `left` before those of `right`.
    confidence : float
        Probability with which a line of another set lies in the set; `joint` is that of all lines together.
    simultaneous : bool
        Whether it holds for all lines together.
    perturbation : str
        "statistical", "LTI" or "operator", as for `UncertaintyModel`.
    inputs, outputs : tuple of str
        Names of the channels.
    extrapolation, source : str
        In words.
    joint, joint_bla : float
        Estimated probability that a whole matrix lies in the set, all its lines together: that of another set of
        experiments, and the BLA; nan where the set was not made of a record.
    measured : tuple of MatrixEvidence
        What it remembers of the records that it was made of, for `validate`.
    other : MatrixUncertainty, optional
        The same plant in another form, at the same confidence c. Both hold it with a probability of at least
        2 c - 1, so that `check` may take the better of two verdicts. This set alone is what anything else works on.

    Raises
    ------
    ValueError
        Weights that are unstable, do not cover their radius or do not fit the form, sampling times that differ.

    References
    ----------
    SP 8.2 (representing uncertainty), 8.6 (robust stability of full and structured blocks).

    Examples
    --------
    >>> G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> w = control.ss([], [], [], [[0.2]])
    >>> omega = np.array([1.0, 2.0])
    >>> model = MatrixUncertainty(
    ...     nominal=G, form="additive", left=(w, w), right=(w, w), omega=omega, radius=np.full((4, 2), 0.2),
    ...     confidence=0.95)
    >>> K = control.ss([], [], [], 2 * np.eye(2))
    >>> round(float(np.linalg.norm(model.loop(K).loop(0j), 2)), 6)           # 0.2 |K S(0)| 0.2 = 0.04 2/3
    0.026667
    """

    nominal: control.StateSpace
    form: str
    left: tuple[control.StateSpace, ...]
    right: tuple[control.StateSpace, ...]
    omega: np.ndarray
    radius: np.ndarray
    confidence: float
    simultaneous: bool = False
    perturbation: str = "statistical"
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    extrapolation: str = "not stated"
    source: str = "not stated"
    joint: float = float("nan")
    joint_bla: float = float("nan")
    measured: tuple[MatrixEvidence, ...] = ()
    other: MatrixUncertainty | None = None

    def __post_init__(self) -> None:
        require_choice("form", self.form, MATRIX_FORMS)
        require_choice("perturbation", self.perturbation, PERTURBATIONS)
        G = multivariable("nominal", self.nominal)
        object.__setattr__(self, "nominal", G)
        n_y, n_u = G.noutputs, G.ninputs
        wanted = {ELEMENTS: (0, n_y * n_u), ADDITIVE: (n_y, n_u), INPUT: (n_u, n_u)}[self.form]
        if (len(self.left), len(self.right)) != wanted:
            raise ValueError(
                f"left and right must hold {wanted[0]} and {wanted[1]} weights for the {self.form} form, "
                f"got {len(self.left)} and {len(self.right)}"
            )
        if self.form == INPUT and n_y != n_u:
            raise ValueError(f"form must be elements or additive for a plant that is not square, got {n_y} by {n_u}")
        omega, radius = (
            require_real_array("omega", self.omega, ndim=1),
            require_real_array("radius", self.radius, ndim=2),
        )
        object.__setattr__(self, "omega", omega)
        object.__setattr__(self, "radius", radius)
        if self.radius.shape != (sum(wanted), self.omega.size):
            raise ValueError(f"radius must have shape {(sum(wanted), self.omega.size)}, got {self.radius.shape}")
        for k, weight in enumerate((*self.left, *self.right)):
            if not is_stable(weight):
                raise ValueError(f"weights must be stable, got an unstable one in place {k}")
            if weight.nstates and timebase(weight) != timebase(G):
                raise ValueError(f"weights must have the sampling time of the nominal, {timebase(G):g} s")
            cover = np.abs(gain_of(weight, self.omega)) / self.radius[k]
            if cover.min() < 1 - 1e-6:
                raise ValueError(f"weights must cover their radius, got a ratio of {cover.min():g} in place {k}")
        for name, known in zip(("inputs", "outputs"), signal_names(G), strict=True):
            object.__setattr__(self, name, tuple(getattr(self, name)) or known)
        if self.other is not None and self.other.confidence != self.confidence:
            raise ValueError(
                f"other must have confidence {self.confidence:g} as this set, got {self.other.confidence:g}"
            )

    @property
    def n_outputs(self) -> int:
        """Outputs n_y."""
        return self.nominal.noutputs

    @property
    def n_inputs(self) -> int:
        """Inputs n_u."""
        return self.nominal.ninputs

    @property
    def structure(self) -> list[tuple[int, int]]:
        """The blocks of Delta, as `mu_upper` takes them."""
        if self.form == ELEMENTS:
            return [(1, 1)] * (self.n_outputs * self.n_inputs)
        return [(len(self.right), len(self.left))]

    def __str__(self) -> str:
        """One line."""
        dt = timebase(self.nominal)
        orders = [weight.nstates for weight in (*self.left, *self.right)]
        lines = "for all lines together" if self.simultaneous else "per line"
        lines += "" if np.isnan(self.joint) else f" (a whole matrix {told(self.joint)})"
        beside = "" if self.other is None else f", beside it a set of the form {self.other.form}"
        return (
            f"{self.form} uncertainty of {self.n_outputs} outputs by {self.n_inputs} inputs, {self.perturbation}, "
            f"{100 * self.confidence:g} % {lines}: nominal "
            f"{self.nominal.nstates} states{f' at {1 / dt:g} Hz' if dt else ''}, weights of orders "
            f"{min(orders)} to {max(orders)}; {self.extrapolation}{beside}"
        )

    def distances(self, omega: np.ndarray, deviation: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        """(..., W) size of the smallest Delta that adds a deviation (..., W, n_y, n_u) to the nominal (W, n_y, n_u)."""
        delta = self.perturbation_of(omega, deviation, nominal)
        return np.max(np.abs(delta), axis=(-2, -1)) if self.form == ELEMENTS else np.linalg.norm(delta, 2, (-2, -1))

    def holds(self, omega: np.ndarray, deviation: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        """(..., W) whether that size is at most one; without singular values where the Frobenius norm decides."""
        delta = self.perturbation_of(omega, deviation, nominal)
        if self.form == ELEMENTS:
            return np.all(squared_modulus(delta) <= ROUNDED**2, axis=(-2, -1))
        total = np.add.reduce(squared_modulus(delta), axis=(-2, -1))
        held = total <= ROUNDED**2
        close = ~held & (total <= ROUNDED**2 * min(delta.shape[-2:]))
        held[close] = np.linalg.norm(delta[close], 2, (-2, -1)) <= ROUNDED
        return held

    def perturbation_of(self, omega: np.ndarray, deviation: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        """(..., W, rows, columns) that smallest Delta; of "elements" each number in its place."""
        right = np.array([gain_of(weight, omega) for weight in self.right])
        if self.form == ELEMENTS:
            return deviation / np.abs(right).reshape(self.n_inputs, self.n_outputs, -1).transpose(2, 1, 0)
        left = np.array([gain_of(weight, omega) for weight in self.left])
        if self.form == INPUT:
            deviation = np.linalg.solve(nominal, deviation)
        return deviation / left.T[:, :, None] / right.T[:, None, :]

    def reach(self, omega: np.ndarray) -> np.ndarray:
        """(n_y, n_u, W) how far the set lets each entry of the plant go from that of the nominal, exactly."""
        right = np.array([np.abs(gain_of(weight, omega)) for weight in self.right])
        if self.form == ELEMENTS:
            return np.swapaxes(right.reshape(self.n_inputs, self.n_outputs, -1), 0, 1)
        left = np.array([np.abs(gain_of(weight, omega)) for weight in self.left])
        if self.form == INPUT:  # row j of G W_l Delta W_r
            left = np.sqrt(np.einsum("jkw,kw->jw", np.abs(response_by_channel(self.nominal, omega)) ** 2, left**2))
        return left[:, None] * right

    def open_loop(self) -> control.StateSpace:
        """From (what Delta drives, u) to (what Delta reads, y)."""
        G, dt = self.nominal, self.nominal.dt
        n_y, n_u = self.n_outputs, self.n_inputs
        if self.form == ELEMENTS:  # column i of G after the other: read u_i, act on y_j
            reads, acts = np.repeat(np.eye(n_u), n_y, axis=0), np.tile(np.eye(n_y), n_u)
            W_l: control.StateSpace = control.StateSpace([], [], [], np.eye(n_y * n_u), dt)
        else:
            reads, W_l = np.eye(n_u), block_diagonal(list(self.left), dt)
            acts = np.eye(n_y) if self.form == ADDITIVE else np.eye(n_u)
        W_r = block_diagonal(list(self.right), dt)
        m = W_l.ninputs
        into = acts if self.form == INPUT else np.zeros((n_u, acts.shape[1]))  # of d behind W_l into G
        onto = np.zeros((n_y, acts.shape[1])) if self.form == INPUT else acts
        A = block_diag(G.A, W_l.A, W_r.A)
        A[: G.nstates, G.nstates : G.nstates + W_l.nstates] = G.B @ into @ W_l.C
        B = np.block(
            [
                [G.B @ into @ W_l.D, G.B],
                [W_l.B, np.zeros((W_l.nstates, n_u))],
                [np.zeros((W_r.nstates, m)), W_r.B @ reads],
            ]
        )
        C = np.block(
            [
                [np.zeros((W_r.noutputs, G.nstates + W_l.nstates)), W_r.C],
                [G.C, (onto + G.D @ into) @ W_l.C, np.zeros((n_y, W_r.nstates))],
            ]
        )
        D = np.block([[np.zeros((W_r.noutputs, m)), W_r.D @ reads], [(onto + G.D @ into) @ W_l.D, G.D]])
        return control.StateSpace(A, B, C, D, dt)

    def perturbed(self, Delta: Any) -> control.StateSpace:
        """The plant of the set that belongs to a perturbation, by itself: to replay the worst one.

        Delta : control.StateSpace from what it reads to what it drives, or a real matrix; of "elements" diagonal.
        """
        P, Delta = self.open_loop(), multivariable("Delta", Delta)
        require_sampling_time("Delta", Delta, "the model", common_sampling_time(P))
        n, m = Delta.ninputs, Delta.noutputs
        if (P.noutputs - self.n_outputs, P.ninputs - self.n_inputs) != (n, m):
            raise ValueError(
                f"Delta must have {P.noutputs - self.n_outputs} inputs and {P.ninputs - self.n_inputs} outputs for the "
                f"{self.form} form, got {n} and {m}"
            )
        rows, columns = np.r_[n : P.noutputs, :n], np.r_[m : P.ninputs, :m]
        turned = control.StateSpace(P.A, P.B[:, columns], P.C[rows], P.D[np.ix_(rows, columns)], P.dt)
        return lower_lft(turned, Delta)

    def loop(self, K: Any, *, w_P: Any = None) -> UncertainSystem:
        """The loop u = K (r - y) with the perturbations pulled out, for `check_structure`, `mu_upper`, `dk_iteration`.

        w_P : control.StateSpace, optional
            Performance weight on r - y: one for all outputs alike, which may be continuous over a sampled loop, or a
            matrix that takes them all.
        """
        K = multivariable("K", K)
        n_y, n_u, dt = self.n_outputs, self.n_inputs, timebase(self.nominal)
        require_shape(K, n_y, n_u)
        if not is_clockless(K) and abs(timebase(K) - dt) > SAMPLING_TOLERANCE * dt:
            raise ValueError(
                f"K must have the sampling time of the model, {dt:g} s, got {timebase(K):g} s. A model for a sampled "
                "controller starts from fit_nominal(frm, ..., dt=) or sampled(nominal, dt)."
            )
        P = self.open_loop()
        n_z, n_d = P.noutputs - n_y, P.ninputs - n_u
        if dt and w_P is not None:
            w_P = multivariable("w_P", w_P)
            if w_P.nstates and not timebase(w_P) and (w_P.ninputs, w_P.noutputs) == (1, 1):
                w_P = cover_sampled(w_P, dt)
        weights = [] if w_P is None else [("e", repeat_over_channels("w_P", w_P, n_y))]
        for _, weight in weights:
            require_sampling_time("w_P", weight, "the model", common_sampling_time(P))
        N = lower_lft(weighted_plant(P, n_y, n_u, weights, reference=bool(weights)), K)
        same = N.noutputs - n_z == n_y
        return UncertainSystem(
            N=N,
            blocks=self.blocks(n_z, n_d),
            inputs=tuple(f"r{j + 1}" for j in range(N.ninputs - n_d)),
            outputs=tuple(f"weighted {self.outputs[j] if same else j + 1}" for j in range(N.noutputs - n_z)),
        )

    def blocks(self, n_z: int, n_d: int) -> dict[str, Block]:
        """The perturbations by name."""
        of = {"perturbation": self.perturbation}
        if self.form != ELEMENTS:
            return {self.form: Block([f"z{k}" for k in range(n_z)], [f"d{k}" for k in range(n_d)], **of)}
        pairs = [(out, name) for name in self.inputs for out in self.outputs]
        return {f"{out} by {name}": Block(f"z{k}", f"d{k}", **of) for k, (out, name) in enumerate(pairs)}


def gain_of(weight: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """(W,) response of a weight of one input and output."""
    dt = timebase(weight)
    return np.asarray(weight(np.exp(1j * omega * dt) if dt else 1j * omega, squeeze=True)) * np.ones(omega.size)
