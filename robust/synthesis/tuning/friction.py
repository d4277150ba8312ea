"""A limit that keeps the proof of `prove_friction`, as a condition on the mobility at the friction.

With the friction f at its port, the mobility M = v/f of the closed loop there, and multipliers mu
>= 0 of filters a,

    q = Re(C M) - L < 0,   C = mu_0 + sum mu_j (1 - a_j/(rho (a_j - s))),   L = sum mu_j a_j w^2/(rho K0 (a_j^2 + w^2))

at every frequency is the first test of the proof (`robust.friction.proof.multipliers`). The
controller enters M only through the sensitivity S = 1/(1 + G_d K). With the displacements x at the
port and y at the sensor, by the friction f and the force u, and with hold and delay e in front of
the force,

    M = -s ((x_f - p) + p S),      p = e x_u y_f/G_d,

where G_d is the sampled plant. The ratio of the limit is

    1 + q/(|C M| + L),

between zero and two, and below one if q is negative. Like the scalings of a worst case, the
multipliers are kept over a round of the search, and computed again by their linear program between
the rounds.
"""

from __future__ import annotations

from typing import ClassVar

import control
import numpy as np

from nlfrf._base.arguments import require_real
from nlfrf._base.values import value
from robust.friction.classes.maxwell_slip import MaxwellSlip
from robust.friction.plant import FrictionPlant
from robust.friction.proof.multipliers import (
    filter_rates,
    maxwell_slip_multipliers,
    multiplier_terms,
)
from robust.friction.reading.assumed_class import MachineWithFriction, machines_of
from robust.lti.lti import evaluate_transfer, response
from robust.lti.sampling import hold_response

#: Number of lines of the linear program, as in `prove_friction`; the lowest over the highest, and
#: over the slowest pole or filter; the highest over Nyquist.
_N_LINES, _LOWEST, _SLOWEST, _BELOW_NYQUIST = 450, 1e-5, 0.1, 0.999


@value(kw_only=False)
class FrictionLimit:
    """Hard limit for `tune` that allows a proof of rest with every friction of a class.

    Use it in `hard`, and prove the tuned controller with `prove_friction`. Each machine becomes a
    further plant, for which no other limit applies. Its loop without friction has to be stable. Its
    mobility at the friction port has to satisfy the dissipation inequality of the class at every
    frequency, with the margin.

    Fields
    ------
    machine : FrictionPlant or MachineWithFriction
        The machine without its friction, from `friction_plant`; or a `MachineWithFriction`, which
        contains machines and friction.
    friction : MaxwellSlip, optional
        Class of friction. Not given with a MachineWithFriction.
    margin : float
        Distance below one that the ratio of the limit must keep. For 1 kg on 80 kN/m with a PID,
        the tuned loops with margins of 0, 0.001 and 0.01 were all proved.

    Raises
    ------
    ValueError
        A value that is not a machine, a class other than MaxwellSlip, or a margin that is not in
        [0, 1).

    References
    ----------
    A. Rantzer, *Friction analysis based on integral quadratic constraints*, Int. J. Robust
    Nonlinear Control 11, 2001.

    Examples
    --------
    >>> from robust.friction import MaxwellSlip
    >>> from robust import friction_plant
    >>> str(FrictionLimit(friction_plant(1.0, 80e3), MaxwellSlip(64e3)))
    'comes to rest with friction up to 64 kN/m'
    """

    machine: FrictionPlant | MachineWithFriction
    friction: MaxwellSlip | None = None
    margin: float = 0.01

    band: ClassVar[None] = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction", machines_of(self.machine, self.friction)[1])
        margin = require_real("margin", self.margin)
        if not 0 <= margin < 1:
            raise ValueError(f"margin must lie between 0 and 1, got {margin:g}")

    def __str__(self) -> str:
        assert self.friction is not None
        return (
            f"comes to rest with friction up to {self.friction.K0 / 1e3:.4g}"
            f" {self.friction.units.stiffness}"
        )

    @property
    def machines(self) -> tuple[FrictionPlant, ...]:
        """Return the machines of the limit."""
        if isinstance(self.machine, MachineWithFriction):
            return self.machine.machines
        return (self.machine,)

    def weighting(self, dt: float) -> None:
        """Return None, because the ratio is not the gain of a system."""

    def factor(self, omega: np.ndarray) -> np.ndarray:
        """Return (W,) one divided by the bound of the ratio."""
        return np.full(np.size(omega), 1 / (1 - self.margin))


@value(copy=False)
class Multipliers:
    """Weights of the filters: rates a (J,) [rad/s] and mu (1 + J,), that of the friction itself
    first.

    lowest, highest : frequencies of the test [rad/s]; below them every term is proportional to the
    frequency squared.
    """

    rates: np.ndarray
    mu: np.ndarray
    lowest: float
    highest: float


@value(copy=False)
class FrictionChannel:
    """A friction limit on the loop around one machine."""

    limit: FrictionLimit
    index: int
    machine: FrictionPlant
    place: tuple[
        int, int
    ]  # row of the measured position and column of a disturbance of it, in the responses H
    plant: control.StateSpace  # G_d, from force to measured position
    # dt, delay: sampling time and delay of the whole loop [s]
    dt: float
    delay: float
    hard = True
    perturbation = None
    is_scaled = True

    @property
    def rows(self) -> np.ndarray:
        return np.array([self.place[0]])

    @property
    def columns(self) -> np.ndarray:
        return np.array([self.place[1]])

    def lines(self, poles: np.ndarray) -> np.ndarray:
        """Return (W,) true frequencies [rad/s] for the multipliers: logarithmic and linear, up to
        Nyquist.

        They begin at a tenth of the slowest pole: below it the test has its limit, and rounding
        grows.
        """
        size = np.abs(poles)[np.abs(poles) > 0]
        if self.dt:
            top = _BELOW_NYQUIST * np.pi / self.dt
        else:
            top = 100 * size.max(initial=1.0)
        low = max(_LOWEST * top, _SLOWEST * size.min(initial=top))
        return np.union1d(
            np.geomspace(low, top, _N_LINES),
            np.linspace(max(low, top / _N_LINES), top, _N_LINES // 2),
        )

    def mobility_terms(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a and b (W,) of the mobility a + b S."""
        m, zero = self.machine, np.zeros((2, 2))
        into, out = np.column_stack([m.B_force, m.B_port]), np.vstack([m.C_measured, m.C_port])
        (_, y_f), (x_u, x_f) = np.moveaxis(
            evaluate_transfer(m.A, into, out, zero, 1j * omega), 0, 2
        )
        late = np.exp(-1j * omega * self.delay) * (
            hold_response(omega, self.dt) if self.dt else 1.0
        )
        p = late * x_u * y_f / response(self.plant, omega)
        return -1j * omega * (x_f - p), -1j * omega * p

    def mobility(self, omega: np.ndarray, H: np.ndarray) -> np.ndarray:
        """Return (W,) velocity over friction at the port."""
        a, b = self.mobility_terms(omega)
        return a + b * H[:, self.place[0], self.place[1]]

    def test_terms(
        self, omega: np.ndarray, multipliers: Multipliers
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return C and L (W,) of the test."""
        assert self.limit.friction is not None
        K0 = self.limit.friction.K0
        rho = self.limit.friction.stiction
        a = multipliers.rates
        s = 1j * omega[:, None]
        C = multipliers.mu[0] + (1 - a / (rho * (a - s))) @ multipliers.mu[1:]
        lost = a * omega[:, None] ** 2 / (rho * K0 * (a**2 + omega[:, None] ** 2))
        return C, lost @ multipliers.mu[1:]

    def levels(self, omega: np.ndarray, H: np.ndarray, multipliers: Multipliers) -> np.ndarray:
        """Return (W,) the ratio over its bound; zero outside the lines, as at Nyquist, where G_d
        may be zero.
        """
        low, high = multipliers.lowest, multipliers.highest
        at = np.clip(omega, low, high)
        z = self.mobility(at, H)
        C, lost = self.test_terms(at, multipliers)
        ratio = 1 + ((C * z).real - lost) / (np.abs(C * z) + lost)
        return np.where((omega >= low) & (omega <= high), ratio, 0.0) * self.limit.factor(omega)

    def slopes(
        self, omega: float, H: np.ndarray, multipliers: Multipliers
    ) -> list[tuple[float, np.ndarray]]:
        """Return the ratio at one frequency and its adjoint: d ratio = Re tr(Q* dH)."""
        at = np.array([omega])
        (_,), (b,) = self.mobility_terms(at)
        (C,), (lost,) = self.test_terms(at, multipliers)
        z = C * self.mobility(at, H[None])[0]
        size, q = abs(z) + lost, z.real - lost
        of_z = 1 / size - q / size**2 * (z / abs(z) if z else 0.0)
        Q = np.zeros(H.shape, complex)
        Q[self.place] = np.conj(C * b) * of_z
        return [(float(1 + q / size), Q)]

    def best_multipliers(self, omega: np.ndarray, H: np.ndarray) -> Multipliers:
        """Return the multipliers with the largest share dissipated at every frequency, among those
        tried.
        """
        assert self.limit.friction is not None
        friction, M = self.limit.friction, self.mobility(omega, H)
        best: tuple[float, Multipliers | None] = (-np.inf, None)
        for rates in filter_rates(1.0, friction.bristle_time):
            mu, share = maxwell_slip_multipliers(
                multiplier_terms(M, omega, rates=rates, K0=friction.K0, rho=friction.stiction)
            )
            if share > best[0] and (mu[1:] > 0).any():
                used = rates[mu[1:] > 1e-9 * mu[1:].max()]
                lowest = max(min(omega[0], _SLOWEST * used.min()), _LOWEST * omega[-1])
                best = (
                    share,
                    Multipliers(rates=rates, mu=mu, lowest=lowest, highest=float(omega[-1])),
                )
        if best[1] is None:
            raise ValueError(
                "hard must contain a friction limit that can be computed, got a loop in which"
                " the point where the friction acts does not move"
            )
        return best[1]
