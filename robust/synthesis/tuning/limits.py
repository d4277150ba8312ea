"""Limits on closed-loop channels: the gain over frequency that each of them bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias, TypeVar

import control
import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    as_list,
    require_kind,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust._base.types import LinearSystem, SystemField
from robust.lti.connections import biproper_inverse, in_series
from robust.lti.lti import is_clockless, is_stable, response, timebase
from robust.lti.realisation import rightmost_pole, state_space
from robust.synthesis.blocks import Names, signal_names
from robust.synthesis.tuning.worst import (
    ONE_DISC,
    SECOND_VALUE_RATIO,
    Blocks,
    Perturbation,
    Scalings,
    disc_gain,
    disc_slope,
    fit_scalings,
    largest_gain,
    scaled_gain,
    scaled_slopes,
)

#: A gain over frequency, as given or as stored: a number, a system, a function of omega (W,)
#: [rad/s].
Magnitude: TypeAlias = "float | LinearSystem | Callable[[np.ndarray], ArrayLike]"
Asked = TypeVar("Asked")


@value(kw_only=False)
class Limit:
    """Limit on the gain between signals of a loop: weight(omega) sigma(omega) <= bound(omega).

    Fields
    ------
    inputs, outputs : str or list of str
        Names of signals. An input is added at every system, plant or block that has an input with
        this name. An output is the sum of all outputs with this name. sigma is the largest singular
        value from all inputs to all outputs.
    bound : float, control system or callable
        Largest gain allowed [unit of outputs over inputs]: a number, a system whose magnitude is
        the bound, or a function of omega (W,) in rad/s. In the list `soft` of `tune` the bound is a
        scale: the ratio of gain to bound is minimised.
    band : (float, float), optional
        Lowest and highest frequency of the limit [rad/s]; all by default.
    weight : float, control system or callable
        Factor on the gain, of the same types as `bound`. A system must be stable.
    worst : bool
        If True, the limit is for every plant of the set instead of the nominal. Each plant has to
        be an UncertaintyModel, or a Bla with one input and one output.

    Raises
    ------
    ValueError
        A bound that is not positive, a band without width, a weight that is not stable.

    References
    ----------
    SP 2.8 (closed-loop gains as specifications), 7.6 (worst case over a set).

    Examples
    --------
    >>> limit = Limit("d", "y", 3e-6, band=(0.0, 2.0))
    >>> str(limit)
    'd -> y'
    """

    inputs: Names
    outputs: Names
    bound: SystemField = 1.0
    band: Sequence[float] | None = None
    weight: SystemField = 1.0
    worst: bool = False

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs"):
            object.__setattr__(self, name, signal_names(name, getattr(self, name)))
        require_kind("worst", self.worst, bool)
        for name in ("bound", "weight"):
            object.__setattr__(self, name, _magnitude(name, getattr(self, name)))
        if self.band is not None:
            if not isinstance(self.band, tuple | list) or len(self.band) != 2:
                raise ValueError(
                    f"band must be (lowest, highest) [rad/s], got {short_form(self.band)}"
                )
            low, high = (
                float(edge) for edge in require_real_array("band", np.array(self.band), ndim=1)
            )
            if not 0 <= low < high:
                raise ValueError(
                    f"band must run from zero or more up to a higher frequency, got {low:g} to"
                    f" {high:g}"
                )
            object.__setattr__(self, "band", (low, high))

    def __str__(self) -> str:
        return f"{', '.join(self.inputs)} -> {', '.join(self.outputs)}" + " at worst" * self.worst

    @property
    def is_constant(self) -> bool:
        """Return True if bound and weight are numbers."""
        return isinstance(self.bound, float) and isinstance(self.weight, float)

    def weighting(self, dt: float) -> control.StateSpace | None:
        """Return weight over bound as a system with the sampling time of the loop; None if
        impossible.
        """
        found = []
        for part in (self.weight, self.bound):
            if isinstance(part, float):
                part = control.StateSpace([], [], [], [[part]], dt)
            if not isinstance(part, control.StateSpace) or (
                timebase(part) != dt and not is_clockless(part)
            ):
                return None
            found.append(
                control.StateSpace(part.A, part.B, part.C, part.D, dt, remove_useless_states=False)
            )
        W, bound = found
        if bound.D[0, 0]:
            return in_series(W, biproper_inverse(bound))
        return None

    @property
    def systems(self) -> tuple[control.StateSpace, ...]:
        """Return weight and bound if they are systems; their poles and zeros refine the grid."""
        return tuple(
            part for part in (self.weight, self.bound) if isinstance(part, control.StateSpace)
        )

    def factor(self, omega: np.ndarray) -> np.ndarray:
        """Return (W,) weight over bound at the frequencies omega [rad/s]."""
        if self.is_constant:
            return np.full(np.size(omega), self.weight / self.bound)
        return _evaluate_magnitude("weight", self.weight, omega) / _evaluate_magnitude(
            "bound", self.bound, omega
        )


def _magnitude(name: str, given: Magnitude) -> Magnitude:
    """Return a number, a stable system with one input and output, or a callable; refuse others."""
    if isinstance(given, control.StateSpace | control.TransferFunction):
        system = state_space(name, given)
        if not is_stable(system):
            raise ValueError(f"{name} must be stable, got a pole at {rightmost_pole(system):.4g}")
        return system
    if callable(given):
        return given
    return require_positive(name, given)


def _evaluate_magnitude(name: str, given: Magnitude, omega: np.ndarray) -> np.ndarray:
    """Return (W,) a magnitude over frequency; refuse one that is not positive and finite."""
    if isinstance(given, float):
        return np.full(np.size(omega), given)
    if isinstance(given, control.StateSpace):
        step = timebase(given)
        return np.abs(
            response(given, np.minimum(omega, np.pi / step) if step else np.minimum(omega, 1e12))
        )
    found = np.broadcast_to(np.abs(np.asarray(given(omega))), np.shape(omega)).astype(float)
    bad = ~(np.isfinite(found) & (found > 0 if name == "bound" else found >= 0))
    if bad.any():
        k = int(np.argmax(bad))
        raise ValueError(
            f"{name} must be positive and finite at every frequency, got {found[k]:g} at"
            f" {omega[k]:g} rad/s"
        )
    return found


def require_limits(name: str, given: Sequence[Asked], kinds: tuple[type, ...]) -> list[Asked]:
    """Return limits as a list; refuse others."""
    limits: list[Asked] = as_list(given)
    if not all(isinstance(one, kinds) for one in limits):
        raise ValueError(
            f"{name} must hold robust.tuning.Limit values, as a list, got {short_form(given)}"
        )
    return limits


# ---- The gain that a limit bounds, and its slope, from the responses H of a closed loop.


@value(copy=False)
class Channel:
    """A limit on the loop around one plant, with its rows and columns of H."""

    limit: Limit
    index: int  # number of the limit, hard limits first
    hard: bool
    # rows, columns: (.,)
    rows: np.ndarray
    columns: np.ndarray
    # (ndarray of int, ndarray of int) for a worst case: rows of the plant inputs, columns of
    # disturbances at plant inputs and outputs
    perturbation: tuple[np.ndarray, np.ndarray] | None
    blocks: Blocks = ONE_DISC  # for a worst case: the blocks of Delta

    @property
    def is_scaled(self) -> bool:
        """Return True if the worst case is a bound by scalings: in all cases but one scalar Delta,
        scalar channel.
        """
        return self.perturbation is not None and (
            self.blocks,
            self.rows.size,
            self.columns.size,
        ) != (ONE_DISC, 1, 1)

    @property
    def places(self) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Return the rows of H for the plant inputs and for the limit, and the columns."""
        assert self.perturbation is not None
        return (self.perturbation[0], self.rows), (self.perturbation[1], self.columns)

    def gain(
        self, H: np.ndarray, perturbation: Perturbation | None, d: np.ndarray | None
    ) -> np.ndarray:
        """Return the unweighted gain (W,) of the search: smooth, with scalings d (W, K) if the
        limit has them.
        """
        if self.perturbation is None:
            return _largest_singular_values(H[:, self.rows[:, None], self.columns])
        assert perturbation is not None
        N = perturbation.pull_out(H, *self.places)
        if d is None:
            return disc_gain(N, smooth=True)
        return scaled_gain(N, self.blocks, d)

    def exact_gain(self, H: np.ndarray, perturbation: Perturbation | None) -> np.ndarray:
        """Return the unweighted gain (W,) of the report, with the best scalings; inf if the set
        destabilises.
        """
        if self.perturbation is None:
            return self.gain(H, None, None)
        assert perturbation is not None
        N = perturbation.pull_out(H, *self.places)
        if self.is_scaled:
            return largest_gain(N, self.blocks)
        return disc_gain(N)

    def slopes(
        self, H: np.ndarray, perturbation: Perturbation | None, d: np.ndarray | None
    ) -> list[tuple[float, np.ndarray]]:
        """Return gains at one frequency and their adjoints Q, d gain = Re tr(Q* dH); two if they
        are close.
        """
        if self.perturbation is None:
            found = []
            for sigma, u, v in _leading_singular_vectors(H[self.rows[:, None], self.columns]):
                Q = np.zeros(H.shape, complex)
                np.add.at(Q, (self.rows[:, None], self.columns), np.outer(u, v.conj()))
                found.append((sigma, Q))
            return found
        assert perturbation is not None
        (N,) = perturbation.pull_out(H[None], *self.places)
        if d is None:
            gains = [disc_slope(N)]
        else:
            gains = scaled_slopes(N, self.blocks, d)
        return [(gain, perturbation.carry_back(Q, *self.places, H.shape)) for gain, Q in gains]

    def best_scalings(
        self, omega: np.ndarray, H: np.ndarray, perturbation: Perturbation, level: np.ndarray
    ) -> Scalings:
        """Return the scalings of least gain at increasing positive frequencies."""
        return fit_scalings(
            omega, perturbation.pull_out(H, *self.places), blocks=self.blocks, level=level
        )


def _largest_singular_values(H: np.ndarray) -> np.ndarray:
    """Return (W,) largest singular values of (W, m, n)."""
    if 1 in H.shape[1:]:
        return np.sqrt((np.abs(H) ** 2).sum(axis=(1, 2)))
    return np.linalg.svd(H, compute_uv=False)[:, 0]


def _leading_singular_vectors(H: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return the largest singular value with its vectors, and the second one if it is close."""
    U, sigma, V = np.linalg.svd(H, full_matrices=False)
    return [
        (float(s), U[:, k], V[k].conj())
        for k, s in enumerate(sigma[:2])
        if k == 0 or s > SECOND_VALUE_RATIO * sigma[0]
    ]
