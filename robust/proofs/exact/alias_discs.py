"""Stability of a set of an inverse form under a sampled controller, with one disc for each alias.

In an inverse form each alias fills a disc, and those with k != 0 add up to one disc. With

    E = K S sum h_k G_k |F_k|^2/(1 - |F_k|^2),   v = K S h_0 G_0,
    R = |K S| sum |h_k G_k F_k|/(1 - |F_k|^2),   sums over k != 0,

the least |1 + K G_p|/|1 + K G_d| of the set is (docs/guide/aliases.md)

    (|1 + E|^2 - |F_0|^2 |1 + E - v|^2)/(|1 + E - |F_0|^2 (1 + E - v)| + |F_0 v|) - R.

The set is stable if it is positive, and |w_P S_p| < 1 if it exceeds |w_P S|. Multiplied by the
closed-loop polynomial D + N, the numbers 1 + E and 1 + E - v become D + N + a z with a = N_K D_G
and z a sum over aliases. Taylor polynomials enclose the real and the imaginary part of z, so that
the aliases keep their phases; R has no phase, and the aliases that are not summed one by one are
bounded by their magnitudes.
"""

from __future__ import annotations

from typing import NamedTuple

from flint import acb, acb_poly, acb_series, arb, arb_poly

from robust.proofs.exact.conditions import Terms
from robust.proofs.exact.polynomials import Quotient
from robust.proofs.exact.stability import Axis, product_with_conjugate
from robust.proofs.exact.taylor_models import (
    TaylorModel,
    compose_polynomial,
    cosine,
    lower_bound,
    polynomial_in_sine,
    sine,
)

_ORDER = 3  # number of terms of the Taylor polynomials of sums over aliases, before the remainder


class _ComplexModel(NamedTuple):
    """Taylor models of the real and the imaginary part of a function."""

    re: TaylorModel
    im: TaylorModel


def _real_part(one: _ComplexModel, other: _ComplexModel) -> TaylorModel:
    """Return the real part of the product of two functions."""
    return one.re * other.re - one.im * other.im


class AliasDiscs:
    """The discs that the aliases of an inverse set fill.

    axis, samples : the loop, and a delay by whole samples that is not in it. F : |F|^2 as
    numerator and denominator. delay : the rest of the delay [s]. n : number of single aliases on
    each side.
    """

    def __init__(
        self,
        axis: Axis,
        plant: Quotient,
        F: tuple[arb_poly, arb_poly],
        *,
        samples: int,
        delay: arb,
        n: int,
    ) -> None:
        self.dt, self.samples, self.F, self.n = arb(axis.dt), samples, F, n
        self.step, self.delay = 2 * arb.pi() / self.dt, delay + samples * self.dt
        self.plant = acb_poly(arb_poly(plant.num)), acb_poly(arb_poly(plant.den))
        omega_squared = arb_poly([0, 0, -1])  # as a polynomial in s = j omega
        num, den = F[0](omega_squared), F[1](omega_squared)
        self.centres = self.plant[0] * num, self.plant[1] * (den - num)
        self.G, self.K = _phases_in_sine(axis.G), _phases_in_sine(axis.K)

    def exceed(self, radius: arb, t: Terms, y: TaylorModel, *, v: arb, low: arb, high: arb) -> bool:
        """Return whether the distance without R exceeds a radius on omega in [low, high].

        y : omega^2. v : upper bound of |v|.
        """
        first, c = self._sums(low, high)
        turned = self._loop_phase(low, high, t)
        z = _ComplexModel(c.re - first.re, c.im - first.im)
        num, den = (compose_polynomial(p, y) for p in self.F)
        size, closed = t.K_num * t.G_den, t.closed
        # |1 + E|^2, |1 + E - v|^2 and the real part of (1 + E)(1 + E - v)*, times |D + N|^2: those
        # of D + N + a c and D + N + a z, z without h_0 G_0
        moved_c, moved_z = _real_part(turned, c), _real_part(turned, z)
        inner = closed + moved_c * 2 + size * (c.re * c.re + c.im * c.im)
        outer = closed + moved_z * 2 + size * (z.re * z.re + z.im * z.im)
        mixed = closed + moved_c + moved_z + size * (c.re * z.re + c.im * z.im)
        least = lower_bound(closed)
        if not least > 0:
            return False
        width = (
            _upper(den * den * inner - num * den * mixed * 2 + num * num * outer) / least
        ).sqrt()
        width = width + v * (_upper(num) * _upper(den)).sqrt()
        clearance = den * inner - num * outer - closed * (radius * width).abs_upper()
        return bool(lower_bound(clearance) > 0)

    def _sums(self, low: arb, high: arb) -> tuple[_ComplexModel, _ComplexModel]:
        """Return h_0 G_0 and the sum of h_k G_k |F_k|^2/(1 - |F_k|^2) over the single aliases.

        The remainder of Taylor is the next coefficient about all points of the interval.
        """
        middle, half = (low + high) / 2, (high - low) / 2
        at_middle = self._series(middle, _ORDER)
        around = self._series(low.union(high), _ORDER + 1)
        found = []
        for series, all_over in zip(at_middle, around, strict=True):
            c = [series[k] * half**k for k in range(_ORDER)] + [all_over[_ORDER] * half**_ORDER]
            parts = [x.real for x in c], [x.imag for x in c]
            found.append(_ComplexModel(*(TaylorModel(arb_poly(part)) for part in parts)))
        return found[0], found[1]

    def _series(self, omega: arb, order: int) -> tuple[acb_series, acb_series]:
        """Return both functions of `_sums` as series about omega."""

        def quotient(parts: tuple[acb_poly, acb_poly], at: arb) -> acb_series:
            """Return num/den at s = j at, over the frequency."""
            line = acb_poly([acb(0, at), acb(0, 1)])
            num, den = (acb_series(p(line).coeffs(), order) for p in parts)
            den = den * acb_series([at, 1], order)
            if den[0].contains(acb(0)):  # a pole may lie within
                return acb_series([arb.nan()] * order, order)
            return num / den

        total = acb_series([0], order)
        for k in (k for k in range(-self.n, self.n + 1) if k):
            turn = acb(0, -k * self.step * self.delay).exp()  # of the delay at this alias
            total += quotient(self.centres, omega + k * self.step) * turn
        held, late = (
            acb_series([acb(0, -x * omega), acb(0, -x)], order).exp() for x in (self.dt, self.delay)
        )
        hold = (1 - held) * late / acb(0, self.dt)  # omega_k h_k
        return hold * quotient(self.plant, omega), hold * total

    def _loop_phase(self, low: arb, high: arb, t: Terms) -> _ComplexModel:
        """Return (D + N)* a, which is |D_G|^2 N_K D_K* + |N_K|^2 (N_G D_G*)*."""
        angle, turn = (low + high) / 2 * self.dt, (high - low) / 2 * self.dt
        u = (cosine(angle, turn) - 1) * arb("-0.5")
        x = sine(angle, turn) * arb("0.5")  # tan(omega dt/2) (1 - u)
        G, K = (
            _ComplexModel(compose_polynomial(even, u), compose_polynomial(odd, u) * x)
            for even, odd in (self.G, self.K)
        )
        if self.samples:
            c, s = (f(angle * self.samples, turn * self.samples) for f in (cosine, sine))
            G = _ComplexModel(G.re * c + G.im * s, G.im * c - G.re * s)
        return _ComplexModel(t.G_den * K.re + t.K_num * G.re, t.G_den * K.im - t.K_num * G.im)


def _phases_in_sine(X: Quotient) -> tuple[arb_poly, arb_poly]:
    """Return the even and the odd part of num den*, as polynomials in u = sin^2(omega dt/2)."""
    even, odd = product_with_conjugate(arb_poly(X.num), arb_poly(X.den))
    return polynomial_in_sine(even, X.degree), polynomial_in_sine(odd, max(X.degree - 1, 0))


def _upper(jet: TaylorModel) -> arb:
    """Return an upper bound of the jet on [-1, 1]."""
    return (-lower_bound(jet * arb(-1))).abs_upper()
