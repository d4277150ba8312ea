"""Claims on a set of continuous plants under a sampled controller, with every alias.

With S = 1/(1 + K G_d), h_k the hold at alias omega_k = omega + 2 pi k/T, F = G w or w depending on
the form, and sums over k != 0,

    LTI, mult. and additive       |h_0 F K S| + |K S| sum |h_k F_k| < 1
    operator, mult. and additive  |F K S|^2 + |K S|^2 sum |F_k|^2 < 1
    LTI, inverse                  |F S| + |F K S| sum |h_k G_k|
                                    + (|K S| + |F K S|) sum |h_k G_k| |F_k|/(1 - |F_k|) < 1
    operator, inverse             |[a, b; c, d]| < 1, the blocks of the frequency itself and of all others

(docs/guide/aliases.md derives them). The third condition is only sufficient: where it fails, the
condition of `robust.proofs.exact.alias_discs` decides. On an interval each quotient is a maximum
over a minimum of two Taylor models. Aliases beyond the first are taken in blocks, the last ones by
their power law. The interval is cut until the sum of upper bounds stays below one. An upper bound
of one or more disproves nothing: the result is then undecided.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial, reduce
from itertools import pairwise
from math import ceil

from flint import arb, arb_poly, ctx, fmpq

from nlfrf._base.values import value
from robust.proofs.exact.alias_discs import AliasDiscs
from robust.proofs.exact.claim import ALIASED, OPERATOR_PERFORMANCE, STABILITY, LoopClaim
from robust.proofs.exact.conditions import Terms
from robust.proofs.exact.polynomials import (
    Decision,
    Polynomial,
    Quotient,
    proved,
    to_rational,
    transfer_quotient,
    undecided,
)
from robust.proofs.exact.stability import (
    WHOLE_SAMPLES,
    Axis,
    Squares,
    loop_on_axis,
    squared_magnitude,
    squared_magnitudes,
)
from robust.proofs.exact.taylor_models import (
    TaylorModel,
    bisect_axis,
    compose_polynomial,
    linear_model,
    lower_bound,
    reversed_polynomial,
    sampled_terms,
)

SINGLE, MOST_SINGLE = 12, 60  # least and largest number of single aliases on each side
# growth of the blocks beyond them, and their end as a multiple of the farthest root
_LONGER = 1.1
_FAR = 30.0
# ratio of both bounds of a maximum at which cutting ends, and largest number of cuts
_TIGHT = 1.05
_DEEPEST = 40
_REFINEMENT_FACTOR = 4  # a bound up to this value may fall below one with a closer look
# of the digits for the sums over aliases: sums of magnitudes, each relative to its interval
_SHARE_OF_DIGITS = 0.4
_LOOSE_RADIUS = 0.05  # relative radius of a ball above which a Taylor model is worth its price


@value(copy=False)
class Ratio:
    """|X|^2 = num(y)/den(y), y = omega^2, for a continuous system X, as balls; it falls as
    y^-order.
    """

    num: arb_poly
    den: arb_poly
    order: int

    def squares(self, low: arb, high: arb) -> list[arb]:
        """Return balls that contain num and den on omega in [low, high] (arb)."""
        y = (low * low).union(high * high)
        found = []
        for p in (self.num, self.den):
            ball = p(y)
            if not ball > 0 or ball.rad() > _LOOSE_RADIUS * abs(ball.mid()):
                first, *others = compose_polynomial(p, squared_line(low, high)).p.coeffs()
                ball = first + arb(0, sum((abs(c) for c in others), arb(0)).abs_upper())
            found.append(ball)
        return found

    def upper(self, low: arb, high: arb) -> arb:
        """Return an upper bound of |X| on omega in [low, high] (arb); infinite if none is found."""
        return _sqrt_upper(*self.squares(low, high))

    def bounds(self, low: arb, high: arb) -> tuple[arb, arb]:
        """Return an upper bound of |X|, and one of 1/|X|."""
        num, den = self.squares(low, high)
        return _sqrt_upper(num, den), _sqrt_upper(den, num)

    def beyond(self, low: arb) -> arb:
        """Return c with |X| <= c omega^-order for all omega >= low; infinite if none is found."""
        v = arb(0).union(1 / (low * low))
        top, bottom = (reversed_polynomial(p, v, p.degree()) for p in (self.num, self.den))
        return _sqrt_upper(top, bottom)


def squared_line(low: arb, high: arb) -> TaylorModel:
    """Return omega^2 on an interval as a Taylor model."""
    omega = linear_model((low + high) / 2, (high - low) / 2)
    return omega * omega


def _sqrt_upper(top: arb, bottom: arb) -> arb:
    """Return an upper bound of sqrt(top/bottom); infinite unless bottom is positive."""
    if not bottom > 0:
        return arb.pos_inf()
    found = (top.abs_upper() / bottom.abs_lower()).abs_upper()
    if found.is_finite():
        return found.sqrt().abs_upper()
    return arb.pos_inf()


def magnitude_ratio(system: Quotient) -> Ratio:
    """Return |X|^2 for a continuous system as a quotient of polynomials in omega^2."""
    num, den = squared_magnitude(arb_poly(system.num)), squared_magnitude(arb_poly(system.den))
    return Ratio(num=num, den=den, order=_true_degree(system.den) - _true_degree(system.num))


def _true_degree(p: Polynomial) -> int:
    return max(int(p.degree()), 0)


def product_of_systems(one: Quotient, other: Quotient) -> Quotient:
    return Quotient(
        num=one.num * other.num, den=one.den * other.den, degree=one.degree + other.degree
    )


@value(copy=False)
class _Sums:
    """Upper bounds of the sums over all aliases k != 0 on an interval (see `AliasBounds`).

    GG, GF, discs, F_max : read in inverse forms only; infinite in the others.
    discs : sum |h G F|/(1 - |F|^2), the radii without |K S|; beyond the single aliases the
    distance of the centres from h G is added.
    """

    F: arb
    G: arb
    FF: arb
    GG: arb
    GF: arb
    discs: arb
    F_max: arb


@value(copy=False)
class AliasBlocks:
    """All aliases with |k| above a number, in blocks that begin at `edges`; beyond the last edge
    all the others.
    """

    edges: tuple[int, ...]
    step: arb
    hold: arb

    @classmethod
    def beyond(cls, n: int, farthest: float, *, dt: arb) -> AliasBlocks:
        """Return the blocks of the aliases |k| > n, up to far beyond the farthest root, in sampling
        frequencies.
        """
        edges = [n + 1]
        while edges[-1] < max(_FAR * farthest, 2.0 * edges[0]):
            edges.append(max(edges[-1] + 1, int(edges[-1] * _LONGER)))
        step = 2 * arb.pi() / dt
        return cls(edges=tuple(edges), step=step, hold=2 / dt / step)

    @property
    def intervals(self) -> list[tuple[arb, arb]]:
        """The frequencies [rad/s] of each block, for all omega up to Nyquist."""
        return list(pairwise((edge - arb(1) / 2) * self.step for edge in self.edges))

    @property
    def end(self) -> arb:
        """End of the last block [rad/s]."""
        return (self.edges[-1] - arb(1) / 2) * self.step

    def total(self, sizes: list[arb], c: arb, order: int, *, holds: int) -> arb:
        """Return sum |h_k|^holds times the sizes on the blocks, c omega_k^-order beyond, without
        |sin(omega T/2)|.
        """
        halves, n = (-arb(1) / 2, arb(1) / 2), order + holds
        found = arb(0)
        for (a, b), size in zip(pairwise(self.edges), sizes, strict=True):
            for x in halves:
                share = arb(b - a)
                if holds == 1:
                    share = (b + x).digamma() - (a + x).digamma()
                if holds == 2:
                    share = arb(2).zeta(a + x) - arb(2).zeta(b + x)
                found += share * self.hold**holds * size
        if c == 0:
            return found
        if n <= 1:
            return arb.pos_inf()
        both = sum((arb(n).zeta(self.edges[-1] + x) for x in halves), arb(0))
        return found + c * self.hold**holds * both / self.step**order


class AliasBounds:
    """Plant and perturbation channel of a claim at every alias: sum |h F|, |h G|, |F|^2, |h G|^2,
    |h G F|/(1 - |F|).
    """

    def __init__(self, claim: LoopClaim, dt: fmpq) -> None:
        plant, weight = transfer_quotient(claim.plant), transfer_quotient(claim.weight)
        self.through, self.inverse = "G" in claim.reads, claim.inverse
        self.dt = arb(dt)
        self.step = 2 * arb.pi() / self.dt
        self.G, self.w = magnitude_ratio(plant), magnitude_ratio(weight)
        self.F = magnitude_ratio(product_of_systems(plant, weight)) if self.through else self.w
        farthest = float(root_radius(plant, weight)) / float(self.step.mid())
        self.n = min(max(SINGLE, ceil(min(farthest, 1e6)) + 2), MOST_SINGLE)
        self.rest = self.of_the_rest(farthest)

    def of_the_rest(self, farthest: float) -> _Sums:
        """Return the sums over all aliases beyond the single ones, with |h_k| without |sin(omega
        T/2)|.
        """
        blocks = AliasBlocks.beyond(self.n, farthest, dt=self.dt)
        G = [max_magnitude(self.G, *block) for block in blocks.intervals]
        F = [max_magnitude(self.F, *block, below_one=self.inverse) for block in blocks.intervals]
        f = self.F.beyond(blocks.end)
        g = self.G.beyond(blocks.end)
        n_F = self.F.order
        n_G = self.G.order
        f_last = f / blocks.end**n_F
        GF = blocks.total(
            [y * _over_one_minus(x) for x, y in zip(F, G, strict=True)],
            g * _over_one_minus(f_last),
            n_G,
            holds=1,
        )
        return _Sums(
            F=blocks.total(F, f, n_F, holds=1),
            G=blocks.total(G, g, n_G, holds=1),
            FF=blocks.total([x * x for x in F], f * f, 2 * n_F, holds=0),
            GG=blocks.total([x * x for x in G], g * g, 2 * n_G, holds=2),
            GF=GF,
            discs=GF,
            F_max=reduce(arb.max, F, f_last),
        )

    def hold(self, low: arb, high: arb) -> tuple[arb, arb]:
        """Return a lower and an upper bound of |h_0|, the hold at the frequency itself, on omega in
        [low, high].
        """
        first, last = low * self.dt / 2, high * self.dt / 2  # sin x/x falls up to Nyquist, x = pi/2
        if last > 0:
            least = (last.sin() / last).abs_lower()
        else:
            least = arb(1)
        return least, (first.sin() / first).abs_upper() if first > 0 else arb(1)

    def sums(self, low: arb, high: arb) -> _Sums:
        """Return the sums on omega in [low, high]."""
        sine = _sine_up(high * self.dt / 2)
        rest = self.rest
        F, G, FF, GG, GF = rest.F * sine, rest.G * sine, rest.FF, rest.GG * sine**2, rest.GF * sine
        discs = GF
        F_max = rest.F_max
        if not self.inverse:
            GG = GF = discs = F_max = arb.pos_inf()
        for k in range(1, self.n + 1):
            for near, far in (
                (k * self.step - high, k * self.step - low),
                (k * self.step + low, k * self.step + high),
            ):
                near, far = near.lower(), far.upper()
                f, g = self.F.upper(near, far), self.G.upper(near, far)
                hold = (2 * sine / (near * self.dt)).abs_upper()
                hG = hold * g
                F, G, FF = F + hold * f, G + hG, FF + f * f
                if not self.inverse:
                    continue
                GG = GG + hG * hG
                if g != 0:
                    share = hG * _over_one_minus(f)
                else:
                    share = arb(0)
                GF, discs = GF + share, discs + share / (1 + f)
                F_max = _larger(F_max, f)
        return _Sums(
            F=upper_end(F),
            G=upper_end(G),
            FF=upper_end(FF),
            GG=upper_end(GG),
            GF=upper_end(GF),
            discs=upper_end(discs),
            F_max=upper_end(F_max),
        )


def upper_end(x: arb) -> arb:
    """Return the upper end of a ball; infinity if it is not finite."""
    if x.is_finite():
        return x.abs_upper()
    return arb.pos_inf()


def _over_one_minus(f: arb) -> arb:
    """Return f/(1 - f), infinite if f may reach one."""
    if f < 1:
        return f / (1 - f)
    return arb.pos_inf()


def _larger(a: arb, b: arb) -> arb:
    if b > a or not b.is_finite():
        return b
    return a


def _sine_up(x: arb) -> arb:
    """Return an upper bound of sin on [0, x]."""
    if x < arb.pi() / 2:
        return x.sin().abs_upper()
    return arb(1)


def root_radius(*systems: Quotient) -> float:
    """Return an approximate bound of the roots (Fujiwara), which places the first cuts."""
    found = 0.0
    for system in systems:
        for p in (system.num, system.den):
            c = [abs(int(x.p) / int(x.q)) if x != 0 else 0.0 for x in p.coeffs()]
            n = len(c) - 1
            found = max(
                [found, *(2 * (c[n - k] / c[n]) ** (1 / k) for k in range(1, n + 1) if c[n - k])]
            )
    return found


def max_magnitude(X: Ratio, low: arb, high: arb, *, below_one: bool = False) -> arb:
    """Return an upper bound of |X| on a block, which is cut until the bound is close to the largest
    value.

    below_one : close also in the distance to one, if X is below it, because an inverse form uses
    1/(1 - |X|).
    """
    todo, found = [(low, high, 0)], X.upper(low, low)  # usually it falls
    while todo:
        a, b, depth = todo.pop()
        middle, top = (a + b) / 2, X.upper(a, b)
        if not _is_close(top, found, below_one):
            found = _larger(found, X.upper(middle, middle))
        if _is_close(top, found, below_one) or depth >= _DEEPEST:
            found = _larger(found, top)
        else:
            todo += [(a, middle, depth + 1), (middle, b, depth + 1)]
    return upper_end(found)


def _is_close(top: arb, found: arb, below_one: bool) -> bool:
    """Return whether an upper bound is close to a known value."""
    return bool(
        top <= found * _TIGHT and (not below_one or found >= 1 or 1 - found <= (1 - top) * _TIGHT)
    )


@value(copy=False)
class _DemandSizes:
    """Upper bounds on an interval for a performance weight: |w_P S|, |w_P F S|, |1 - |F|^2 S|."""

    PS: arb
    PFS: arb
    centre: arb


@value(copy=False)
class _Sizes:
    """Upper bounds on an interval: |K S|, |F S|, |F K S|, |h_0 G K S|, |h_0|."""

    KS: arb
    FS: arb
    FKS: arb
    GKS: arb
    hold: arb
    demand: _DemandSizes | None  # None without a performance weight

    def demand_of(self, name: str) -> _DemandSizes | None:
        """Return the bounds that a claim of performance needs; None for one of stability."""
        if name == ALIASED[STABILITY]:
            return None
        assert self.demand is not None  # LoopClaim refuses performance without a weight
        return self.demand


def _bound_sizes(aliases: AliasBounds, t: Terms, *, low: arb, high: arb, others: _Sums) -> _Sizes:
    """Return upper bounds of all terms of a claim on an interval.

    |q S| is bounded by |q| |S|; if G dominates the aliases, at a pole of G or K too, by |q/(K h_0 G)| |T|/(1 - e).
    """
    closed = lower_bound(t.closed)

    def quotient_up(*factors: TaylorModel) -> arb:
        top = factors[0] * factors[1]
        return _sqrt_upper(-lower_bound(top * arb(-1)), closed)

    S = quotient_up(t.G_den, t.K_den)
    KS = quotient_up(t.G_den, t.K_num)
    T = quotient_up(t.G_num, t.K_num)
    GS = quotient_up(t.G_num, t.K_den)
    hold_low, hold = aliases.hold(low, high)
    G, G_inverse = aliases.G.bounds(low, high)
    w = aliases.w.upper(low, high)
    share = others.G * G_inverse / hold_low
    # upper bound of |h_0 G|/|G_d|, over h_0
    if share < 1:
        factor = 1 / (hold_low * (1 - share))
    else:
        factor = arb.pos_inf()

    def least(*bounds: arb) -> arb:
        finite = [upper_end(b) for b in bounds if b.is_finite()]
        if finite:
            return min(finite, key=lambda b: float(b.mid()))
        return arb.pos_inf()

    KS_ = least(KS, T * G_inverse * factor)
    GKS0 = least(KS * G, T * factor)  # |G K S|
    GS_ = least(S * G, GS * factor)
    if aliases.through:
        FS, FKS = GS_ * w, GKS0 * w
    else:
        FS, FKS = S * w, KS_ * w
    demand = None
    if t.P_num is not None:
        size = _sqrt_upper(-lower_bound(t.P_num * arb(-1)), lower_bound(t.P_den))
        centre = _bound_centre(aliases, t, closed=closed, S=S, low=low, high=high)
        demand = _DemandSizes(
            PS=upper_end(S * size), PFS=upper_end(FS * size), centre=upper_end(centre)
        )
    return _Sizes(
        KS=upper_end(KS_),
        FS=upper_end(FS),
        FKS=upper_end(FKS),
        GKS=upper_end(GKS0 * hold),
        hold=upper_end(hold),
        demand=demand,
    )


def _bound_centre(
    aliases: AliasBounds, t: Terms, *, closed: arb, S: arb, low: arb, high: arb
) -> arb:
    """Return an upper bound of |1 - |F|^2 S|, from |F|^2 = a in the middle and the largest
    deviation from it.

    |1 - a S|^2 = (|D + N|^2 - 2 a (|D|^2 + Re N D*) + a^2 |D|^2)/|D + N|^2.
    """
    middle = (low + high) / 2
    top, inverse = aliases.F.bounds(low, high)
    y = middle * middle
    a = (aliases.F.num(y) / aliases.F.den(y)).mid()
    if not (top.is_finite() and a.is_finite()):
        return arb.pos_inf()
    moved = _larger(
        upper_end(top**2 - a), upper_end(a - 1 / inverse**2) if inverse.is_finite() else a
    )
    D = t.G_den * t.K_den
    size = t.closed - (D + t.cross) * (2 * a) + D * (a * a)
    return _sqrt_upper(-lower_bound(size * arb(-1)), closed) + moved * S


def _claim_measure(claim: LoopClaim, name: str, *, u: _Sizes, s: _Sums, scaling: arb) -> arb:
    """Return an upper bound of the quantity that must be below one for a claim."""
    operator, demand = claim.perturbation == "operator", u.demand_of(name)
    if not claim.inverse and operator:
        gain = u.FKS**2 + _product_or_zero(u.KS**2, s.FF)
        if demand is None:
            return gain
        return (
            gain
            + u.KS**2 * scaling
            + demand.PS**2
            + (demand.PFS**2 + _product_or_zero(demand.PS**2, s.FF)) / scaling
        )
    if not claim.inverse:
        return u.hold * u.FKS + _product_or_zero(u.KS, s.F) + (0 if demand is None else demand.PS)
    own = u.FS + u.FKS * s.G
    if operator:
        F, G = s.FF.sqrt(), s.GG.sqrt()
        return _largest_singular_value_2x2(
            own, u.GKS * F, c=u.FKS * G, d=s.F_max + _product_or_zero(u.KS * G, F)
        )
    if demand is None:
        return own + _product_or_zero(u.KS + u.FKS, s.GF)
    r, q, A = _product_or_zero(u.KS, s.GF), _product_or_zero(u.FKS, s.GF), u.FKS * s.G
    first, second = (demand.PS + r) * (demand.centre + r), (demand.PFS + q) * (A + q + u.GKS)
    return first + second + (u.FS + A + q) ** 2 + 2 * r


def _joint_claim_measure(
    aliases: AliasBounds,
    claim: LoopClaim,
    *,
    name: str,
    t: Terms,
    u: _Sizes,
    s: _Sums,
    scaling: arb,
    y: TaylorModel,
) -> bool:
    """Return whether the claim holds with all terms at the base frequency as one quotient, sharper
    near its peak.

    The bounds of single factors err by the change of each on the interval, those of the quotient by
    its square.
    """
    performance = name != ALIASED[STABILITY]
    if claim.inverse and (performance or claim.perturbation == "operator"):
        return False
    num, den = compose_polynomial(aliases.F.num, y), compose_polynomial(aliases.F.den, y)
    if (
        name == ALIASED[OPERATOR_PERFORMANCE]
    ):  # (|F|^2 + sum |F_k|^2 + d^2) (|K S|^2 + |w_P S|^2/d^2)
        if not s.FF.is_finite():
            return False
        rows = t.G_den * (t.K_num * t.P_den + t.P_num * t.K_den * (1 / scaling))
        return bool(
            lower_bound(den * t.closed * t.P_den - (num + den * (s.FF + scaling)) * rows) > 0
        )
    if claim.inverse:
        left = 1 - u.FKS * s.G - _product_or_zero(u.KS + u.FKS, s.GF)
        channel = t.K_den
    elif claim.perturbation == "operator":
        left = 1 - _product_or_zero(u.KS**2, s.FF)
        if left > 0:
            left = left.abs_lower().sqrt()
        channel = t.K_num
    else:
        left = (1 - _product_or_zero(u.KS, s.F)) / (1 if performance else u.hold)
        channel = t.K_num
    if not left > 0:
        return False
    denominator, own = den * t.closed * (left.abs_lower() ** 2), num * t.G_den * channel
    if not performance:
        return bool(lower_bound(denominator - own) > 0)
    a, b = own * t.P_den * (u.hold**2), t.P_num * t.G_den * t.K_den * den
    rest = denominator * t.P_den - a - b
    return bool(lower_bound(rest) > 0 and lower_bound(rest * rest - a * b * 4) > 0)


def _product_or_zero(size: arb, total: arb) -> arb:
    if size == 0:
        return arb(0)
    return size * total


def _largest_singular_value_2x2(a: arb, b: arb, *, c: arb, d: arb) -> arb:
    """Return the largest singular value of [[a, b], [c, d]], all entries nonnegative."""
    return (((a + d) ** 2 + (b - c) ** 2).sqrt() + ((a - d) ** 2 + (b + c) ** 2).sqrt()) / 2


def aliased_terms(
    claim: LoopClaim, name: str, *, axis: Axis, found: Squares
) -> tuple[AliasBounds, Callable[[arb, arb], Terms], AliasDiscs]:
    """Return the aliases of a claim, the terms of its sampled loop on an interval of omega, and the
    discs.
    """
    if claim.plant.dt or not axis.dt or "M" in claim.reads:
        raise ValueError(
            f"claims must be about a continuous plant under a sampled controller to be {name!r}"
        )
    samples = int((to_rational(claim.delay) / axis.dt + to_rational(WHOLE_SAMPLES)).floor())
    if samples:
        G, K, *_ = loop_on_axis(
            claim.plant, claim.controller, to_rational(claim.delay) - samples * axis.dt
        )
        axis = replace(axis, G=G, K=K)
        found = squared_magnitudes(axis)
    aliases = AliasBounds(claim, axis.dt)
    rest = to_rational(claim.delay) - samples * axis.dt
    if rest < to_rational(WHOLE_SAMPLES) * axis.dt:  # as in the sampled plant
        rest = fmpq(0)
    discs = AliasDiscs(
        axis,
        transfer_quotient(claim.plant),
        (aliases.F.num, aliases.F.den),
        samples=samples,
        delay=arb(rest),
        n=aliases.n,
    )
    return aliases, sampled_terms(axis, found, samples), discs


def prove_with_aliases(
    claim: LoopClaim, names: list[str], *, axis: Axis, found: Squares, scaling: arb, deadline: float
) -> dict[str, Decision]:
    """Prove claims from zero to Nyquist, interval by interval; all claims share the results of an
    interval.
    """
    aliases, terms, discs = aliased_terms(claim, names[0], axis=axis, found=found)

    @lru_cache(maxsize=4096)  # some 15 kB each
    def known(low: float, high: float) -> tuple[Terms, _Sizes, _Sums]:
        a, b = arb(low), arb(high)
        with ctx.workprec(int(ctx.prec * _SHARE_OF_DIGITS)):
            others = aliases.sums(a, b)
        t = terms((a + b) / 2, (b - a) / 2)
        return t, _bound_sizes(aliases, t, low=a, high=b, others=others), others

    def holds(name: str, low: float, high: float) -> bool:
        t, sizes, others = known(low, high)
        bound = _claim_measure(claim, name, u=sizes, s=others, scaling=scaling)
        if bound < 1:
            return True
        y = squared_line(arb(low), arb(high))
        if bound < _REFINEMENT_FACTOR and _joint_claim_measure(
            aliases, claim, name=name, t=t, u=sizes, s=others, scaling=scaling, y=y
        ):
            return True
        if not claim.inverse or claim.perturbation == "operator" or not bound.is_finite():
            return False
        # the distance needs many more operations: only where both bounds fail
        demand = sizes.demand_of(name)
        radius = sizes.KS * others.discs + (0 if demand is None else demand.PS)
        return discs.exceed(radius, t, y, v=sizes.GKS, low=arb(low), high=arb(high))

    top = float((arb.pi() / arb(axis.dt)).upper()) * (1 + 1e-15)

    def at_point(name: str, omega: float) -> Decision:
        if holds(name, omega, omega):
            return proved()
        return undecided(f"undecided at {omega:.6g} rad/s", needs_digits=True)

    return {
        name: bisect_axis(partial(holds, name), partial(at_point, name), top, deadline)
        for name in names
    }
