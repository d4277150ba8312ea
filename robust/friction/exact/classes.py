"""Classes of friction in a claim: limits at a port, weights of a proof, and what they guarantee
over the rationals.

The inequalities are derived in the guide on the theory of friction proofs (T1, T2, T3). This module
is independent of the code that searches the weights. A certificate file identifies the class by the
names of its entries, so no two classes have the same names.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, TypeAlias

import numpy as np
from flint import fmpq, fmpq_mat

from nlfrf._base.values import value
from robust.friction.exact.supply import ExactLoop, ExactSupply, equilibrium, with_force_filters
from robust.proofs.exact.matrices import positive_definite
from robust.proofs.exact.polynomials import to_rational


@value
class MaxwellSlipPort:
    """Maxwell slip at one port, and the weights of its filters."""

    # K0, stiction, bristle_time: limits of the class [N/m], [-], [s]
    K0: float
    stiction: float
    bristle_time: float
    free: float  # weight of the friction itself
    # rates, weights: (J,) rates of the filters [rad/s], the reference first, and their weights
    rates: np.ndarray
    weights: np.ndarray

    joins_ports: ClassVar[bool] = True

    @property
    def settles(self) -> bool:
        """True if a bound of the distance from rest can be proved (T7)."""
        return not (self.bristle_time or self.free)

    @property
    def fault(self) -> str:
        """Return an empty string if the weights are admissible for the class, else the fault."""
        if not self.rates.size or any(
            to_rational(a) * to_rational(self.bristle_time) >= 1 for a in self.rates
        ):
            return "a filter is faster than the bristles, or there is none"
        return _fault_of_weights(self)

    def supply(self, others: Sequence[PortClaim], loop: ExactLoop) -> ExactSupply:
        """Return the supply of Maxwell-slip friction (T1, T2): states (y, e_j), inputs d = f - fh_1
        of each port.
        """
        zero, ports, n = to_rational(0.0), (self, *others), loop.F.nrows()
        # at a stiction of one the energy is not positive
        ratios = [to_rational(port.stiction if port.stiction > 1 else 1.001) for port in ports]
        filters = [[to_rational(a) for a in port.rates] for port in ports]
        rest = equilibrium(loop)
        moved = (loop.x * rest).tolist()
        scales = _port_scales(ports, ratios, moved)
        A, jumps = with_force_filters(loop, [a for own in filters for a in own[1:]])
        size, P, first = len(A), len(ports), n
        B = fmpq_mat(size, P).tolist()
        Q = fmpq_mat(size, size).tolist()
        N = fmpq_mat(size, P).tolist()
        R, stored = fmpq_mat(P, P).tolist(), fmpq_mat(size + 2 * P, size + 2 * P).tolist()
        shares = []  # s of each port
        for p, (port, a, rho, scale) in enumerate(zip(ports, filters, ratios, scales, strict=True)):
            mu = [scale * to_rational(x) for x in port.weights]
            free = scale * to_rational(port.free)
            K0 = to_rational(port.K0)
            x, v = (rows.tolist()[p] + [zero] * (size - n) for rows in (loop.x, loop.v))
            total = sum(mu, start=zero)
            s = free + (1 - 1 / rho) * total
            lost = [m * aj / (rho * K0) for m, aj in zip(mu, a, strict=True)]
            h, F = size + 2 * p, size + 2 * p + 1
            for i in range(n):
                B[i][p] = loop.B[i, p] - a[0] * rest[i, p]
            for i in range(size):
                N[i][p] += (free + total) / 2 * v[i] - s * a[0] / 2 * x[i]
                stored[i][h] = stored[h][i] = -s / 2 * x[i]
            stored[h][h] = total / (2 * rho * K0)
            stored[F][F] = (free + total) / (2 * K0)
            stored[h][F] = stored[F][h] = -total / (2 * rho * K0)
            for j in range(1, len(a)):
                e, held = first + j - 1, mu[j] / (2 * K0 * rho)
                B[e][p] = a[j] - a[0]
                for i in range(size):
                    Q[e][i] -= mu[j] / (2 * rho) * v[i]
                    Q[i][e] -= mu[j] / (2 * rho) * v[i]
                Q[e][e] -= lost[j]
                N[e][p] += lost[j]
                stored[e][e] += held
                for other, sign in ((h, 1), (F, -1)):
                    stored[e][other] += sign * held
                    stored[other][e] += sign * held
            R[p][p] = -sum(lost, start=zero)
            first += len(a) - 1
            shares.append(s)
        for p in range(P):
            for q in range(P):
                if shares[p] * moved[p][q] != shares[q] * moved[q][p]:
                    raise ValueError("no stored energy fits the rests of the ports")
                stored[size + 2 * p][size + 2 * q] -= shares[p] * moved[p][q] / 2
        return ExactSupply(
            A=fmpq_mat(A),
            B=fmpq_mat(B),
            Q=fmpq_mat(Q),
            N=fmpq_mat(N),
            R=fmpq_mat(R),
            stored=fmpq_mat(stored),
            jumps=jumps,
        )


def _port_scales(
    ports: Sequence[PortClaim], ratios: list[fmpq], moved: list[list[fmpq]]
) -> list[fmpq]:
    """Return factors near one on the weights of each port that make s_p X_pq symmetric in spite of
    rounding.

    moved : X, the displacement at port p at rest under f_q = 1. A claim may have any nonnegative
    weights.
    """
    scales = [to_rational(1.0)]
    shares = [
        to_rational(port.free)
        + (1 - 1 / rho) * sum(map(to_rational, port.weights), start=to_rational(0.0))
        for port, rho in zip(ports, ratios, strict=True)
    ]
    for p in range(1, len(shares)):
        own, other = shares[p] * moved[p][0], shares[0] * moved[0][p]
        scales.append(other / own if own != 0 and other / own > 0 else to_rational(1.0))
    return scales


@value
class BristlePort:
    """Bristles that creep, and the weights of their forms."""

    # K0, stiction, microdamping: limits of the class [N/m], [-], [Ns/m]
    K0: float
    stiction: float
    microdamping: float
    free: float  # weight of the elastic force itself
    # rates, weights: (J,) rates of the filters [rad/s] and their weights
    rates: np.ndarray
    weights: np.ndarray
    block: np.ndarray  # (3, 3) the form in (v, q, gamma)
    bounds: np.ndarray  # (2,) multiples of the sector form that are below the block

    joins_ports: ClassVar[bool] = False
    settles: ClassVar[bool] = False

    @property
    def fault(self) -> str:
        """Return an empty string if the weights are admissible for the class, else the fault."""
        M, rho = [[to_rational(x) for x in row] for row in self.block], to_rational(self.stiction)
        if M[2][2] > 0 or min(self.bounds) < 0:
            return "the block is not concave in the slope, or a bound is negative"
        ends = [
            (M[0][0], M[0][1], M[1][1]),
            (M[0][0], M[0][1] + M[0][2], M[1][1] + 2 * M[1][2] + M[2][2]),
        ]
        for (p, cross, r), bound in zip(ends, self.bounds, strict=True):
            m = to_rational(bound)
            left = fmpq_mat([[p - m * (rho * rho - 1), cross - m], [cross - m, r + m]])
            if not positive_definite(left):
                return "the block is negative somewhere in the sector"
        return _fault_of_weights(self)

    def supply(self, _: Sequence[PortClaim], loop: ExactLoop) -> ExactSupply:
        """Return the supply of bristles (T3): states (y, e_j), inputs gamma = F'/K0 and q = z'."""
        a = [to_rational(x) for x in self.rates]
        nu = [to_rational(x) for x in self.weights]
        mu = to_rational(self.free)
        K0, sigma = to_rational(self.K0), to_rational(self.microdamping)
        M = [[to_rational(x) for x in row] for row in self.block]
        rest, n = [row[0] for row in equilibrium(loop).tolist()], loop.F.nrows()
        size = n + len(a)
        A, jumps = with_force_filters(loop, a)
        B = [[-K0 * r, sigma * b[0]] for b, r in zip(loop.B.tolist(), rest, strict=True)]
        B += [[-K0, to_rational(0.0)] for _ in a]
        x, v = (row.tolist()[0] + [to_rational(0.0)] * (size - n) for row in (loop.x, loop.v))
        Q = [[M[0][0] * v[i] * v[j] for j in range(size)] for i in range(size)]
        N = [[M[0][2] * v[i] - mu * K0 / 2 * x[i], M[0][1] * v[i]] for i in range(size)]
        kept = size + (mu > 0)
        stored = fmpq_mat(kept, kept).tolist()
        for j, (rate, weight) in enumerate(zip(a, nu, strict=True)):
            Q[n + j][n + j] -= weight * rate / K0
            N[n + j][1] -= weight / 2
            stored[n + j][n + j] = weight / (2 * K0)
        if mu > 0:
            for i in range(size):
                stored[i][size] = stored[size][i] = -mu / 2 * x[i]
            x_e = sum(c * r for c, r in zip(x, rest, strict=False))
            stored[size][size] = mu / (2 * K0) - mu / 2 * x_e
        R = [[M[2][2], M[1][2]], [M[1][2], M[1][1]]]
        return ExactSupply(
            A=fmpq_mat(A),
            B=fmpq_mat(B),
            Q=fmpq_mat(Q),
            N=fmpq_mat(N),
            R=fmpq_mat(R),
            stored=fmpq_mat(stored),
            jumps=jumps,
        )


def _fault_of_weights(port: PortClaim) -> str:
    if min([port.free, *port.weights]) < 0 or min([1.0, *port.rates]) <= 0:
        return "a weight is negative, or a rate is not positive"
    if port.K0 > 0 and port.stiction >= 1:
        return ""
    return "K0 is not positive, or the stiction is below one"


#: The classes that a claim can be about.
PortClaim: TypeAlias = MaxwellSlipPort | BristlePort
