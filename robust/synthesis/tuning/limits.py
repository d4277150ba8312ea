"""Limits on closed-loop channels: what is asked of a design, and the gain over frequency that each of them bounds."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import require_kind, require_positive, require_real_array, short_form
from nlfrf._base.values import value
from robust.lti.lti import is_clockless, response, timebase
from robust.lti.realisation import rightmost_pole, state_space
from robust.lti.stability import is_stable
from robust.synthesis.tuning.blocks import signal_names

__all__ = ["Channel", "Limit", "gain_slopes", "largest_over_discs", "require_limits"]

#: 1 - |N11|^2 from which on the worst case is carried on as a hyperbola, so that a start outside has a slope.
NEAR_ONE = 1e-6
#: A second singular value this close to the largest is a peak of its own.
SECOND_VALUE_RATIO = 0.9


@value(kw_only=False)
class Limit:
    """The largest gain allowed from some signals to others: weight(omega) sigma(omega) <= bound(omega).

    Fields
    ------
    inputs, outputs : str or list of str
        Signals. Inputs act where a system, plant or block reads a signal of that name; an output is the sum of all
        that drive it. The gain is the largest singular value over all of them.
    bound : float, control system or callable
        Largest gain allowed [unit of outputs over inputs]: a number, |bound(j omega)|, or a function of omega (W,) in
        rad/s. In `soft` the scale: the largest ratio of a gain to its bound is made as small as can be.
    band : (float, float), optional
        Lowest and highest frequency looked at [rad/s]; all when not given.
    weight : float, control system or callable
        What the gain is multiplied by, as `bound`. A system must be stable.
    worst : bool
        The limit of every plant of the set, not of the nominal one: plants that are a Bla or an UncertaintyModel.

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

    inputs: Any
    outputs: Any
    bound: Any = 1.0
    band: Any = None
    weight: Any = 1.0
    worst: bool = False

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs"):
            object.__setattr__(self, name, signal_names(name, getattr(self, name)))
        require_kind("worst", self.worst, bool)
        for name in ("bound", "weight"):
            object.__setattr__(self, name, magnitude(name, getattr(self, name)))
        if self.band is not None:
            if not isinstance(self.band, tuple | list) or len(self.band) != 2:
                raise ValueError(f"band must be (lowest, highest) [rad/s], got {short_form(self.band)}")
            low, high = (float(edge) for edge in require_real_array("band", np.array(self.band), ndim=1))
            if not 0 <= low < high:
                raise ValueError(f"band must run from zero or more up to a higher frequency, got {low:g} to {high:g}")
            object.__setattr__(self, "band", (low, high))

    def __str__(self) -> str:
        return f"{', '.join(self.inputs)} -> {', '.join(self.outputs)}" + " at worst" * self.worst

    @property
    def is_constant(self) -> bool:
        """Return whether bound and weight are numbers."""
        return isinstance(self.bound, float) and isinstance(self.weight, float)

    def weighting(self, dt: float) -> control.StateSpace | None:
        """Return the weight over the bound as a system on the time base of the loop; None where it is not one."""
        if not isinstance(self.bound, float):
            return None
        if isinstance(self.weight, float):
            return control.StateSpace([], [], [], [[self.weight / self.bound]], dt)
        W = self.weight
        if not isinstance(W, control.StateSpace) or (timebase(W) != dt and not is_clockless(W)):
            return None
        return control.StateSpace(W.A, W.B, W.C / self.bound, W.D / self.bound, dt)

    def factor(self, omega: np.ndarray) -> np.ndarray:
        """Return (W,) weight over bound at true frequencies [rad/s]."""
        if self.is_constant:
            return np.full(np.size(omega), self.weight / self.bound)
        return evaluate_magnitude("weight", self.weight, omega) / evaluate_magnitude("bound", self.bound, omega)


def magnitude(name: str, given: Any) -> Any:
    """Return a number, a stable system with one input and output, or a callable; or a refusal."""
    if isinstance(given, control.StateSpace | control.TransferFunction):
        system = state_space(name, given)
        if not is_stable(system):
            raise ValueError(f"{name} must be stable, got a pole at {rightmost_pole(system):.4g}")
        return system
    return given if callable(given) else require_positive(name, given)


def evaluate_magnitude(name: str, given: Any, omega: np.ndarray) -> np.ndarray:
    """Return (W,) a magnitude over frequency, positive and finite or a refusal."""
    if isinstance(given, float):
        return np.full(np.size(omega), given)
    if isinstance(given, control.StateSpace):
        step = timebase(given)
        return np.abs(response(given, np.minimum(omega, np.pi / step) if step else np.minimum(omega, 1e12)))
    found = np.broadcast_to(np.abs(np.asarray(given(omega))), np.shape(omega)).astype(float)
    bad = ~(np.isfinite(found) & (found > 0 if name == "bound" else found >= 0))
    if bad.any():
        k = int(np.argmax(bad))
        raise ValueError(
            f"{name} must be positive and finite at every frequency, got {found[k]:g} at {omega[k]:g} rad/s"
        )
    return found


def require_limits(name: str, given: Any) -> list[Limit]:
    """Check limits as a list, or a refusal."""
    limits = [given] if isinstance(given, Limit) else given
    if not isinstance(limits, tuple | list) or not all(isinstance(one, Limit) for one in limits):
        raise ValueError(f"{name} must hold robust.tuning.Limit values, as a list, got {short_form(given)}")
    return list(limits)


# ---- The gain that a limit bounds, and its slope, from the responses H of a closed loop.


@value(copy=False)
class Channel:
    """A limit on the loop of one plant: which rows and columns of H it reads.

    Fields
    ------
    limit : Limit
    index : int
        Its number, hard limits first.
    hard : bool
    rows, columns : (.,) ndarray of int
    perturbation : (int, int, int) or None
        Of a worst case: row of the plant input, columns of disturbances at plant input and output.
    """

    limit: Limit
    index: int
    hard: bool
    rows: np.ndarray
    columns: np.ndarray
    perturbation: tuple[int, int, int] | None

    def gain(self, H: np.ndarray, discs: tuple[np.ndarray, np.ndarray] | None, *, smooth: bool = True) -> np.ndarray:
        """Return the unweighted gain (W,) of the channel from responses H (W, outputs, inputs) and discs a, g."""
        nominal = H[:, self.rows[:, None], self.columns]
        if self.perturbation is None:
            return largest_singular_values(nominal)
        assert discs is not None
        N11, N12, N21 = self.perturbation_loop(H, *discs)
        return largest_over_discs(nominal, N21, N12, N11, smooth=smooth)

    def perturbation_loop(
        self, H: np.ndarray, a: np.ndarray, g: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return N11, N12, N21 of the loop with Delta pulled out of (G + g Delta)/(1 + a Delta).

        Delta reads the plant input u; -a Delta u is added there, g Delta u to the plant output.
        """
        assert self.perturbation is not None
        u, at_input, at_output = self.perturbation
        N11 = g * H[:, u, at_output] - a * H[:, u, at_input]
        N12 = H[:, u, self.columns]
        N21 = g[:, None] * H[:, self.rows, at_output] - a[:, None] * H[:, self.rows, at_input]
        return N11, N12, N21


def largest_singular_values(H: np.ndarray) -> np.ndarray:
    """Return (W,) of (W, m, n)."""
    if 1 in H.shape[1:]:
        return np.sqrt((np.abs(H) ** 2).sum(axis=(1, 2)))
    return np.linalg.svd(H, compute_uv=False)[:, 0]


def distance_to_one(N11: np.ndarray, smooth: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return 1 - |N11|^2, below NEAR_ONE a positive hyperbola where smooth, and its slope over |N11|^2."""
    slack = 1 - np.abs(N11) ** 2
    if not smooth:
        return slack, -np.ones(slack.shape)
    away = np.maximum(2 - slack / NEAR_ONE, 1.0)
    return np.where(slack > NEAR_ONE, slack, NEAR_ONE / away), -1 / away**2


def largest_over_discs(
    N22: np.ndarray, N21: np.ndarray, N12: np.ndarray, N11: np.ndarray, *, smooth: bool = False
) -> np.ndarray:
    """Return (W,) largest gain of N22 + N21 Delta N12/(1 - N11 Delta) over |Delta| <= 1; inf where |N11| >= 1.

    The channel fills a disc with centre N22 + N21 N12 conj(N11)/(1 - |N11|^2) and radius |N21 N12|/(1 - |N11|^2). With
    several inputs or outputs centre plus radius is an upper bound. `smooth` carries it on where |N11| >= 1.
    """
    slack, _ = distance_to_one(N11, smooth)
    product = N21[:, :, None] * N12[:, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = N22 + product * (np.conj(N11) / slack)[:, None, None]
        edge = np.linalg.norm(N21, axis=1) * np.linalg.norm(N12, axis=1) / slack
    if smooth:
        return largest_singular_values(centre) + edge
    inside = (slack > 0) & np.isfinite(centre).all(axis=(1, 2))
    centre[~inside] = 0.0
    return np.where(inside, largest_singular_values(centre) + edge, np.inf)


def gain_slopes(
    channel: Channel, H: np.ndarray, discs: tuple[complex, complex] | None
) -> list[tuple[float, np.ndarray]]:
    """Return gains at one frequency and their adjoints Q, d gain = Re tr(Q* dH); two where they are close."""
    nominal = H[channel.rows[:, None], channel.columns]
    if channel.perturbation is None:
        found = []
        for sigma, u, v in leading_singular_vectors(nominal):
            Q = np.zeros(H.shape, complex)
            np.add.at(Q, (channel.rows[:, None], channel.columns), np.outer(u, v.conj()))
            found.append((sigma, Q))
        return found
    assert discs is not None
    return [worst_case_slope(channel, H, *discs)]


def leading_singular_vectors(H: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return the largest singular value with its vectors, and the second where it comes close."""
    U, sigma, V = np.linalg.svd(H, full_matrices=False)
    return [
        (float(s), U[:, k], V[k].conj()) for k, s in enumerate(sigma[:2]) if k == 0 or s > SECOND_VALUE_RATIO * sigma[0]
    ]


def worst_case_slope(channel: Channel, H: np.ndarray, a: complex, g: complex) -> tuple[float, np.ndarray]:
    """Return the smooth worst case and its adjoint.

    With q = |N11|^2, D(q) and p = N21 N12: centre c = N22 + p conj(N11)/D and edge |N21| |N12|/D, term by term.
    """
    assert channel.perturbation is not None
    u_row, at_input, at_output = channel.perturbation
    rows, columns = channel.rows, channel.columns
    (N11,), (N12,), (N21,) = channel.perturbation_loop(H[None], np.array([a]), np.array([g]))
    (slack,), (slope,) = distance_to_one(np.array([N11]), smooth=True)
    inverse = 1 / slack
    centre = H[rows[:, None], columns] + np.outer(N21, N12) * np.conj(N11) * inverse
    U, sigma, V = np.linalg.svd(centre, full_matrices=False)
    u, v = U[:, 0], V[0].conj()
    n21, n12 = float(np.linalg.norm(N21)), float(np.linalg.norm(N12))
    edge = n21 * n12 * inverse
    left, right = u.conj() @ N21, N12 @ v  # u* p v = left right
    # adjoints of N22, N21, N12, N11: d value = Re sum conj(adjoint) d(entry)
    of_nominal = np.outer(u, v.conj())
    of_N21 = u * np.conj(right * np.conj(N11) * inverse)
    of_N12 = np.conj(left * np.conj(N11) * inverse) * v.conj()
    of_N11 = left * right * inverse  # from d conj(N11): Re(left right inverse conj(dN11))
    if n21 and n12:
        of_N21 = of_N21 + N21 / n21 * n12 * inverse
        of_N12 = of_N12 + N12 / n12 * n21 * inverse
    # D moves by D'(q) 2 Re(conj(N11) dN11)
    by_slack = -((left * right * np.conj(N11)).real + n21 * n12) * inverse**2
    of_N11 = of_N11 + by_slack * slope * 2 * N11
    Q = np.zeros(H.shape, complex)
    np.add.at(Q, (rows[:, None], columns), of_nominal)
    np.add.at(Q, (np.full(columns.size, u_row), columns), of_N12)
    np.add.at(Q, (rows, np.full(rows.size, at_output)), np.conj(g) * of_N21)
    np.add.at(Q, (rows, np.full(rows.size, at_input)), -np.conj(a) * of_N21)
    Q[u_row, at_output] += np.conj(g) * of_N11
    Q[u_row, at_input] -= np.conj(a) * of_N11
    return float(sigma[0]) + edge, Q
