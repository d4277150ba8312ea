"""A bound on the final distance from rest for Maxwell slip with stiction (theory: T7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq, fmpq_mat

from nlfrf._base.values import value
from robust.friction.exact.classes import PortClaim
from robust.friction.exact.supply import ExactLoop, ExactSupply, equilibrium, with_force_filters
from robust.proofs.exact.polynomials import to_rational


@value
class Settling:
    """A bound on the final distance from rest with stiction, and the decay rate that proves it."""

    decay: float  # lambda [1/s] in V' + 2 lambda V <= r^2
    Fs: np.ndarray  # (P,) largest friction force at each port [N]
    error: float  # bound of the final displacement at every port [m]
    # (P,) w_p in V' + 2 lambda V <= sum w_p r_p^2; the rests are relative to the largest of them
    rest_weights: np.ndarray

    @property
    def _forces(self) -> list[fmpq]:
        """Largest friction force at each port [N]."""
        return [to_rational(float(force)) for force in self.Fs]

    def fault(self, ports: Sequence[PortClaim]) -> str:
        """Return an empty string if decay and class satisfy T7, else the fault."""
        if not all(port.settles for port in ports):
            return "only for Maxwell slip without a damper, and with a weight of f v of zero"
        if not (self.decay > 0 and min(self.Fs) > 0):
            return "decay or Fs is not positive"
        shares = [to_rational(float(share)) for share in self.rest_weights]
        if min(shares) < 0 or sum(shares, start=to_rational(0.0)) > 1:
            return "a weight of the rests is negative, or their sum is above one"
        slow = any(
            weight > 0 and rate < self.decay
            for port in ports
            for rate, weight in zip(port.rates, port.weights, strict=True)
        )
        if slow:
            return "a filter is slower than the decay"
        return ""

    def _rests(self, ports: Sequence[PortClaim]) -> list[fmpq]:
        """Return the largest difference of each friction from that of the same elements with
        constant sliders [N].
        """
        return [
            (1 - 1 / to_rational(port.stiction)) * Fs / 2
            for port, Fs in zip(ports, self._forces, strict=True)
        ]

    def supply(self, ports: Sequence[PortClaim], loop: ExactLoop) -> ExactSupply:
        """Return the supply for friction without stiction plus a rest force (T7).

        States (y, e_j), inputs g - gh_1 and r. The decay is in the flow, A + decay I, and in the
        losses of the filters. stored : a form in (y, e_j, d), with d = g - gh_1. For several ports
        all d come before all r, and each r is relative to the largest rest of all ports.
        """
        zero, decay = to_rational(0.0), to_rational(self.decay)
        filters = [[to_rational(x) for x in port.rates] for port in ports]
        rests = self._rests(ports)
        most = max(rests)
        rest, n, P = equilibrium(loop), loop.F.nrows(), len(ports)
        A, jumps = with_force_filters(loop, [aj for a in filters for aj in a[1:]])
        size, first = len(A), n
        for i in range(size):
            A[i][i] += decay
        B = fmpq_mat(size, 2 * P).tolist()
        Q = fmpq_mat(size, size).tolist()
        N = fmpq_mat(size, 2 * P).tolist()
        stored, R = fmpq_mat(size + P, size + P).tolist(), fmpq_mat(2 * P, 2 * P).tolist()
        for p, (port, a) in enumerate(zip(ports, filters, strict=True)):
            mu, K0, d = [to_rational(x) for x in port.weights], to_rational(port.K0), size + p
            if most:
                share = rests[p] / most
            else:
                share = to_rational(1.0)
            v = loop.v.tolist()[p] + [zero] * (size - n)
            total = sum(mu, start=zero)
            lost = [m * (aj - decay) / K0 for m, aj in zip(mu, a, strict=True)]
            for i in range(n):
                B[i][p], B[i][P + p] = loop.B[i, p] - a[0] * rest[i, p], share * loop.B[i, p]
            for i in range(size):
                N[i][p] += total / 2 * v[i]
            stored[d][d] = total / (2 * K0)
            for j in range(1, len(a)):
                e, held = first + j - 1, mu[j] / (2 * K0)
                B[e][p] = a[j] - a[0]
                for i in range(size):
                    Q[e][i] -= mu[j] / 2 * v[i]
                    Q[i][e] -= mu[j] / 2 * v[i]
                Q[e][e] -= lost[j]
                N[e][p] += lost[j]
                stored[e][e] += held
                stored[e][d] -= held
                stored[d][e] -= held
            R[p][p], R[P + p][P + p] = (
                -sum(lost, start=zero),
                -to_rational(float(self.rest_weights[p])),
            )
            first += len(a) - 1
        return ExactSupply(
            A=fmpq_mat(A),
            B=fmpq_mat(B),
            Q=fmpq_mat(Q),
            N=fmpq_mat(N),
            R=fmpq_mat(R),
            stored=fmpq_mat(stored),
            jumps=jumps,
        )

    def holds(
        self, ports: Sequence[PortClaim], loop: ExactLoop, *, V: fmpq_mat, energies: list[fmpq_mat]
    ) -> bool:
        """Return whether the displacement at every port is within the bound for every V up to its
        final value.

        |x| <= |x_y| + sum |x_e| |gh_1|: the sliders without stiction hold at most (1 + 1/rho)/2 of Fs.
        """
        decay, most, size = to_rational(self.decay), max(self._rests(ports)), V.nrows()
        held = [
            (1 + 1 / to_rational(port.stiction)) / 2 * Fs
            for port, Fs in zip(ports, self._forces, strict=True)
        ]
        at_rest = (loop.x * equilibrium(loop)).tolist()
        turned, zero = V.transpose(), to_rational(0.0)
        for x, moved in zip(loop.x.tolist(), at_rest, strict=True):
            left = to_rational(self.error) - sum(
                (abs(a) * f for a, f in zip(moved, held, strict=True)), start=zero
            )
            if left <= 0:
                return False
            read = (turned * fmpq_mat([[a] for a in [*x, *[zero] * (size - len(x))]])).tolist()
            row = fmpq_mat(read + [[zero]] * len(held))
            reached = [(row.transpose() * energy.solve(row)).tolist()[0][0] for energy in energies]
            if not max(reached) * most * most <= 2 * decay * left * left:
                return False
        return True
