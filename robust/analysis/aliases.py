r"""A set of continuous plants as a sampler sees it: every alias of a frequency at once.

Behind hold and delay the sampled plant at omega is the sum over all aliases omega_k = omega + 2 pi k/T,

    G_d = sum_k h_k G_k,    |h_k| = |sin(omega T/2)| / |omega_k T/2|,

and a perturbation acts at each of them. With F = G w (multiplicative, inverse-additive) or w (additive,
inverse-multiplicative), and S = 1/(1 + K G_d), every loop of the set is stable where, at every omega up to Nyquist,

    class      form               condition
    LTI        mult., additive    |K S| sum_k |h_k F_k| < 1                                       (exact)
    operator   mult., additive    |K S| sqrt(sum_k |F_k|^2) < 1
    LTI        inverse            0 outside of sum_k {h_k G_k/(1 + F_k Delta_k)} K + 1, |F_k| < 1 for k != 0  (exact)
    operator   inverse            |M| < 1, M = diag(F_k) - g F^T, g_k = h_k G_k K S

LTI: the values of Delta at different frequencies are free of each other, so each alias fills its own disc, and the
sampled plant the sum of these discs (Dullerud & Glover 1993). Operator: a nonlinear or time-varying Delta moves
energy from one frequency to another. What counts then is the L2 gain of what it sees: by Cauchy-Schwarz the samples of
F p have at most (1/T) sum_k |F_k|^2 of the energy of p, and the hold makes T of the energy of its samples; both are
reached at one frequency, so the gain of the path is exactly the square root above (Braslavsky, Middleton & Freudenberg
1998). Where F does not fall off neither sum is finite: the perturbation reaches the sampler unfiltered.

Aliases near the band are taken one by one, those beyond in blocks with the largest |F| of each, the last ones by their
power law: nothing is cut off. `robust.proofs.exact.aliases` proves the same between frequencies, in exact arithmetic.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import control
import numpy as np
from scipy.special import psi, zeta

from nlfrf._base.values import value
from robust.lti.connections import in_series
from robust.lti.lti import make_response, poles, replace_infinite
from robust.models.sets.forms import FORMS
from robust.proofs.search.intervals import Magnitude, magnitude_of

__all__ = [
    "AliasSums",
    "Aliases",
    "Point",
    "Shares",
    "aliases_of",
    "at_points",
    "fold_down",
    "in_phase",
    "operator_performance",
    "shares",
]


#: Aliases on either side that are taken one by one: at least, and at most where light modes lie higher.
FEWEST, MOST = 12, 200
#: Blocks of aliases beyond: each so much longer than the one before, up to so many times the farthest root.
LONGER, FAR = 1.02, 1e4
LEAST_FACTOR = 1e-9  # and one over it: between them a factor on the uncertainty is looked for
DOMINANT = 1e4  # times all others together: then an alias is told from the sampled plant to six digits
LEAST_SHARE = 0.003  # of the whole: what an alias has to add to be part of a worst plant, whose order it raises by two
LIGHT = 0.3  # a damping ratio below which a mode has a peak that a block would spread over all its aliases


@value
class AliasSums:
    """Sums over the aliases k != 0 of a frequency, (I,) each.

    Fields
    ------
    F, G : (I,) ndarray
        sum |h_k F_k| and sum |h_k G_k|.
    FF, GG : (I,) ndarray
        sum |F_k|^2 and sum |h_k G_k|^2.
    GF : (I,) ndarray
        sum |h_k G_k| |F_k|/(1 - |F_k|), inf where an alias has |F_k| >= 1.
    product : (I,) ndarray
        sum |h_k G_k| |F_k|, which is finite there too.
    F_max : (I,) ndarray
        Largest |F_k|.
    """

    F: np.ndarray
    G: np.ndarray
    FF: np.ndarray
    GG: np.ndarray
    GF: np.ndarray
    product: np.ndarray
    F_max: np.ndarray


#: No alias at all.
NOTHING = AliasSums(**dict.fromkeys(("F", "G", "FF", "GG", "GF", "product", "F_max"), np.zeros(1)))


@value
class Aliases:
    """The aliases of a set of continuous plants.

    Fields
    ------
    dt, delay : float
        Sampling time and delay behind the hold [s].
    plant, weight : control.StateSpace
        Continuous plant without that delay, and weight.
    through : bool
        Whether F = G w (else w).
    inverse, operator : bool
        Form of the set, and whether Delta may be any causal operator.
    """

    dt: float
    delay: float
    plant: control.StateSpace
    weight: control.StateSpace
    through: bool
    inverse: bool
    operator: bool

    @property
    def step(self) -> float:
        """Distance of the aliases [rad/s]."""
        return 2 * np.pi / self.dt

    @cached_property
    def F(self) -> control.StateSpace:
        """What a perturbation passes to the output: G w, or w."""
        return in_series(self.weight, self.plant, dt=0) if self.through else self.weight

    @cached_property
    def at(self) -> tuple[Any, Any]:
        """Responses of plant and weight, made ready."""
        plant, w = make_response(self.plant), make_response(self.weight)

        def G(omega: np.ndarray) -> np.ndarray:
            return replace_infinite(plant(omega))  # at a pole on the axis S and K S are as small as that is large

        return G, w

    @cached_property
    def sharp(self) -> np.ndarray:
        """Lightly damped poles of plant and weight in the upper half plane [rad/s]."""
        p = np.concatenate([poles(self.plant), poles(self.weight)])
        return np.asarray(p[(np.abs(p.real) < LIGHT * np.abs(p)) & (p.imag > 0)])

    @cached_property
    def folded_modes(self) -> np.ndarray:
        """The light modes above Nyquist where they come down to, as poles [rad/s]."""
        p, nyquist = self.sharp, self.step / 2
        down = np.abs((p.imag + nyquist) % self.step - nyquist)
        return np.asarray((p.real + 1j * down)[p.imag > nyquist])

    @cached_property
    def single(self) -> np.ndarray:
        """(k,) the aliases k != 0 that are taken one by one."""
        high = self.sharp.imag.max() if self.sharp.size else 0.0
        n = int(np.clip(np.ceil(high / self.step) + 2, FEWEST, MOST))
        return np.concatenate([np.arange(-n, 0), np.arange(1, n + 1)])

    @cached_property
    def beyond(self) -> AliasSums:
        """(1,) upper bounds of the sums over all aliases that are not taken one by one, |h_k| without |sin(omega T/2)|.

        Blocks of aliases with the largest |G| and |F| of each, up to far beyond all roots; from there on power laws.
        """
        G, F = magnitude_of(self.plant), magnitude_of(self.F)
        first = float(self.single[-1]) + 1
        roots = np.abs(np.concatenate([G.zeros, G.poles, F.zeros, F.poles]))
        end = max(FAR * float(roots.max(initial=0.0)) / self.step, 2.0 * first)
        k = np.unique(np.ceil(first * LONGER ** np.arange(np.ceil(np.log(end / first) / np.log(LONGER)) + 1)))
        low, high = (k[:-1] - 0.5) * self.step, (k[1:] - 0.5) * self.step
        top_G, top_F = G.upper_each(low, high), F.upper_each(low, high)
        last = (k[-1] - 0.5) * self.step
        (c_G, g), (c_F, f) = power_law(G, last), power_law(F, last)
        far_F = c_F * last**-f

        def added(top: np.ndarray, c: float, power: int, hold: int) -> np.ndarray:
            """sum |h_k|^hold times a size that is `top` on the blocks and c omega^-power beyond; omega at most pi/T."""
            total, n = 0.0, power + hold
            for x in (-0.5, 0.5):  # each alias is at its nearest: 1/(k - x) + 1/(k + x) grows with x
                sizes = np.diff(k) if not hold else -np.diff(zeta(hold, k + x)) if hold > 1 else np.diff(psi(k + x))
                total += (2 / self.dt / self.step) ** hold * float(sizes @ top)
                if c and n > 1:
                    total += c * (2 / self.dt) ** hold * self.step**-n * float(zeta(n, k[-1] + x))
            return np.array([np.inf if c and n <= 1 else total])

        over = np.divide(top_F, 1 - top_F, out=np.full(top_F.size, np.inf), where=top_F < 1)
        over_far = far_F / (1 - far_F) if far_F < 1 else np.inf
        with np.errstate(invalid="ignore"):
            over, far = np.where(top_G > 0, top_G * over, 0.0), c_G * over_far if c_G else 0.0
        return AliasSums(
            F=added(top_F, c_F, f, 1),
            G=added(top_G, c_G, g, 1),
            FF=added(top_F**2, c_F**2, 2 * f, 0),
            GG=added(top_G**2, c_G**2, 2 * g, 2),
            GF=added(over, far, g, 1),
            product=added(top_G * top_F, c_G * c_F, g + f, 1),
            F_max=np.array([max(float(top_F.max()), far_F)]),
        )

    def radius(self, omega: np.ndarray, sampled: np.ndarray) -> np.ndarray:
        """(W,) how far a set moves the sampled plant at omega [rad/s]; inf where nothing filters it, nan if inverse.

        Of an operator it is the radius of the disc with the same rs. `sampled` is the response of the sampled plant.
        """
        if self.inverse:
            return np.full(omega.size, np.nan)
        one = np.ones(omega.size)
        point = at_points(self, omega, one, one, sampled)
        return stability_measure(self, point.sizes, point.sums())

    def terms(self, omega: np.ndarray, sampled: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(W, 1 + k) h_k, h_k G_k and |F_k| of the frequency itself and of the aliases taken one by one.

        `sampled` (W,) is the response of the sampled plant, which is what they add up to. Where one alias is nearly all
        of it, beside a pole on the axis, it is taken from there: G_d and S then share what rounding does to the pole.
        """
        k = np.concatenate([[0], self.single])
        at = omega[:, None] + self.step * k
        G, w = (self.at[i](np.abs(at).ravel()).reshape(at.shape) for i in (0, 1))
        hold = np.sinc(omega * self.dt / (2 * np.pi))[:, None] * omega[:, None] / at
        h = hold * np.exp(-1j * (omega[:, None] * self.dt / 2 + at * self.delay))
        hG = np.where(at < 0, np.conj(G), G) * h
        size = np.abs(hG)
        row, largest = np.arange(omega.size), size.argmax(1)
        alone = np.where(np.arange(k.size) == largest[:, None], 0.0, hG)
        dominant = size[row, largest] > DOMINANT * np.abs(alone).sum(1)
        hG[row[dominant], largest[dominant]] = replace_infinite(sampled[dominant]) - alone[dominant].sum(1)
        F = np.abs(hG / hold) if self.through else 1.0
        return h, hG, F * np.abs(w)


def sum_over_aliases(
    hold: np.ndarray, hG: np.ndarray, F: np.ndarray, beyond: AliasSums, sine: np.ndarray, inside: Any = True
) -> AliasSums:
    """The sums from |h_k|, |h_k G_k| and |F_k| (I, k), of those inside, and from all aliases beyond times |sin|."""
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.where(F < 1, F / (1 - F), np.inf)
        GF = np.where((hG > 0) & inside, hG * over, 0.0)
    hG, F = hG * inside, F * inside
    return AliasSums(
        F=(hold * F).sum(1) + sine * beyond.F,
        G=hG.sum(1) + sine * beyond.G,
        FF=(F**2).sum(1) + beyond.FF,
        GG=(hG**2).sum(1) + sine**2 * beyond.GG,
        GF=GF.sum(1) + sine * beyond.GF,
        product=(hG * F).sum(1) + sine * beyond.product,
        F_max=np.maximum(F.max(1), beyond.F_max),
    )


@value
class Sizes:
    """What the conditions are made of, (I,) each.

    Fields
    ------
    KS, FS, FKS, GKS : (I,) ndarray
        |K S|, |F S|, |F K S| and |h_0 G K S|, F and G those at the frequency itself.
    hold : (I,) ndarray
        |h_0|.
    """

    KS: np.ndarray
    FS: np.ndarray
    FKS: np.ndarray
    GKS: np.ndarray
    hold: np.ndarray


def stability_measure(aliases: Aliases, of: Sizes, others: AliasSums) -> np.ndarray:
    """(I,) what has to stay below one for robust stability: the table above; of an LTI inverse form at most that.

    For the inverse forms 1 + K G_p is put over 1 + F Delta_0, and every alias moves it by |h_k G_k| |F_k|/(1 - |F_k|)
    at most. In blocks of the frequency itself and the rest, the matrix of an operator has the norm of its blocks.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        if not aliases.inverse and aliases.operator:
            return np.sqrt(of.FKS**2 + product_or_zero(of.KS, np.sqrt(others.FF)) ** 2)
        if not aliases.inverse:
            return of.hold * of.FKS + product_or_zero(of.KS, others.F)
        own = of.FS + of.FKS * others.G
        if not aliases.operator:
            return own + product_or_zero(of.KS + of.FKS, others.GF)
        F, G = np.sqrt(others.FF), np.sqrt(others.GG)
        return largest_of_two(own, of.GKS * F, of.FKS * G, others.F_max + of.KS * G * F)


def operator_performance(of: Sizes, others: AliasSums, PS: Any, PFS: Any, scaling: float) -> np.ndarray:
    """(I,) the squared gain from (p, r) to (what Delta sees, w_P e) under one scaling, but of inverse forms.

    PS, PFS are |w_P S| and |w_P F S|. The matrix is a column times a row, so its gain is the product of their sizes.
    """
    d = scaling**2
    gain = of.FKS**2 + product_or_zero(of.KS**2, others.FF)
    return np.asarray(gain + of.KS**2 * d + PS**2 + (PFS**2 + product_or_zero(PS**2, others.FF)) / d)


def product_or_zero(size: np.ndarray, total: np.ndarray) -> np.ndarray:
    """size times total, nothing where the size is zero, however large the total."""
    return np.where(size == 0, 0.0, size * total)


def largest_of_two(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(I,) largest singular value of [[a, b], [c, d]], all nonnegative."""
    return (np.sqrt((a + d) ** 2 + (b - c) ** 2) + np.sqrt((a - d) ** 2 + (b + c) ** 2)) / 2


@value
class Folded:
    """What the set does to the loop, aliases included, at frequencies (W,).

    Fields
    ------
    rs : (W,) ndarray
        In proportion to |w|; one where the condition of the table is just met.
    S_worst : (W,) ndarray
        Largest |S_p|; inf where the set is not stable. Of an operator in an inverse form that of its LTI members.
    growth : (W,) ndarray or None
        Factor by which the uncertainty may grow until |w_P| max |S_p| = 1.
    """

    rs: np.ndarray
    S_worst: np.ndarray
    growth: Any = None


@value(copy=False)
class Point:
    """A loop and its set at frequencies omega (W,): S, K S, and h_k, h_k G_k, |F_k| (W, 1 + k) of the aliases."""

    aliases: Aliases
    omega: np.ndarray
    S: np.ndarray
    KS: np.ndarray
    h: np.ndarray
    hG: np.ndarray
    F: np.ndarray

    @property
    def hold(self) -> np.ndarray:
        """(W, 1 + k) |h_k|."""
        return np.abs(self.h)

    @property
    def sine(self) -> np.ndarray:
        """(W,) |sin(omega T/2)|."""
        return np.sin(np.minimum(self.omega * self.aliases.dt / 2, np.pi / 2))

    @property
    def sizes(self) -> Sizes:
        """What the conditions are made of, without performance."""
        F, KS, hold = self.F[:, 0], np.abs(self.KS), self.hold[:, 0]
        return Sizes(KS=KS, FS=F * np.abs(self.S), FKS=F * KS, GKS=np.abs(self.hG[:, 0]) * KS, hold=hold)

    def sums(self, band: tuple[float, float] | None = None) -> AliasSums:
        """The sums over the other aliases; only of those in a band [rad/s] if given."""
        beyond, inside = self.aliases.beyond, np.ones(1, bool)
        if band is not None:
            at = np.abs(self.omega[:, None] + self.aliases.step * self.aliases.single)
            beyond, inside = NOTHING, (at >= band[0]) & (at <= band[1])
        return sum_over_aliases(self.hold[:, 1:], np.abs(self.hG[:, 1:]), self.F[:, 1:], beyond, self.sine, inside)

    def distance(self, m: np.ndarray) -> np.ndarray:
        """(W,) smallest |1 + K G_p|/|1 + K G_d| over an inverse set grown by m (W,); negative if zero is inside.

        At alias k the set is a disc with the centre h_k G_k/(1 - |F_k|^2) and the radius |h_k G_k F_k|/(1 - |F_k|^2).
        All but the first add up to one disc. What is left, X + v/(1 + F Delta) with v = K S h_0 G_0, is a disc or the
        outside of one, |F| >= 1; its distance from zero is (|X + v|^2 - |F X|^2)/(|X (1 - |F|^2) + v| + |F v|),
        whichever it is.
        """
        u, hG, v = (m[:, None] * self.F[:, 1:]) ** 2, self.hG[:, 1:], self.hG[:, 0] * self.KS
        beyond, size = self.aliases.beyond, np.abs(self.KS)
        with np.errstate(all="ignore"):
            E = self.KS * (hG * u / (1 - u)).sum(1)
            rest = size * (np.abs(hG) * np.sqrt(u) / (1 - u)).sum(1)
            rest += size * self.sine * m * beyond.product / (1 - m * beyond.F_max)  # at most so much, either way
            F, own = m * self.F[:, 0], (m * self.F[:, 0]) ** 2
            found = np.abs(1 + E) ** 2 - own * np.abs(1 + E - v) ** 2
            found /= np.abs((1 + E - v) * (1 - own) + v) + F * np.abs(v)
            inside = (u < 1).all(1) & (m * beyond.F_max < 1) | (size == 0)
            return np.where(inside & ~np.isnan(found), found - np.where(size == 0, 0.0, rest), -np.inf)

    def factor(self, wanted: np.ndarray) -> np.ndarray:
        """(W,) the largest m with a distance of at least `wanted`, which falls with m; by bisection of its log."""
        low, high = np.full(wanted.size, np.log(LEAST_FACTOR)), np.full(wanted.size, -np.log(LEAST_FACTOR))
        for _ in range(60):
            middle = (low + high) / 2
            good = self.distance(np.exp(middle)) >= wanted
            low, high = np.where(good, middle, low), np.where(good, high, middle)
        return np.where(self.distance(np.full(wanted.size, LEAST_FACTOR)) >= wanted, np.exp(low), 0.0)


def at_points(aliases: Aliases, omega: np.ndarray, S: np.ndarray, KS: np.ndarray, sampled: np.ndarray) -> Point:
    """A loop at frequencies omega (W,) [rad/s], from the responses of the nominal one and of the sampled plant."""
    h, hG, F = aliases.terms(omega, sampled)
    return Point(aliases=aliases, omega=omega, S=S, KS=KS, h=h, hG=hG, F=F)


def fold_down(point: Point, w_P: np.ndarray | None) -> Folded:
    """What the set does to the loop at frequencies (W,), every alias included."""
    aliases, S = point.aliases, np.abs(point.S)
    wanted = None if w_P is None else np.abs(w_P) * S
    with np.errstate(divide="ignore", invalid="ignore"):
        if not aliases.inverse or aliases.operator:
            rs = stability_measure(aliases, point.sizes, point.sums())
        else:
            rs = 1 / point.factor(np.zeros(S.size))
        if not aliases.inverse:
            worst = np.where(rs < 1, S / (1 - rs), np.inf)
            growth = None if wanted is None else np.maximum((1 - wanted) / rs, 1e-12)
            return Folded(rs=rs, S_worst=worst, growth=growth)
        here = point.distance(np.ones(S.size))
        worst = np.where(here > 0, S / here, np.inf)
    return Folded(rs=rs, S_worst=worst, growth=None if wanted is None else np.maximum(point.factor(wanted), 1e-12))


@value
class Shares:
    """What rs is made of at one frequency omega [rad/s].

    Fields
    ------
    omega, total : float
        The frequency, and rs there.
    own : float
        rs of what acts at that frequency alone; with what folds down it is `total`.
    member : float
        One or more where a linear perturbation of that frequency alone makes the loop unstable. Of an operator it is
        less than `own`, which has all that the hold gives it to see.
    measured : float
        rs of what acts inside the measured band alone; the rest is assumed.
    source : float
        The frequency [rad/s] that adds most, the alias it is.
    filtered : bool
        Whether the sum over all aliases is finite at all.
    F_max : float
        Largest |F| of an alias.
    """

    omega: float
    total: float
    own: float
    member: float
    measured: float
    source: float
    filtered: bool
    F_max: float


def in_phase(point: Point) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (n,) [rad/s] and phases (n,) of a Delta whose aliases all act against 1 + L at the one of a point.

    Of additive and multiplicative sets: at alias k the loop is moved by K S h_k F_k Delta_k, which is to be negative.
    Aliases that add less than `LEAST_SHARE` of the whole are left out.
    """
    aliases = point.aliases
    k = np.concatenate([[0], aliases.single])
    at = point.omega[0] + aliases.step * k
    w = aliases.at[1](np.abs(at))
    acts = point.KS[0] * np.where(at < 0, w.conj(), w) * (point.hG if aliases.through else point.h)[0]
    keep = (np.abs(acts) > LEAST_SHARE * np.abs(acts).sum()) | (k == 0)
    phases = np.pi - np.angle(acts[keep])
    return np.abs(at[keep]), np.where(at[keep] < 0, -phases, phases)


def shares(point: Point, band: tuple[float, float], total: float) -> Shares:
    """What rs is made of at the one frequency of a point, where it is `total`."""
    aliases, omega, sizes = point.aliases, float(point.omega[0]), point.sizes
    own = float(stability_measure(aliases, sizes, NOTHING)[0])
    member = sizes.hold * sizes.FKS
    if aliases.inverse:
        member = point.F[:, 0] * np.abs(1 - point.hG[:, 0] * point.KS)
    inside = band[0] <= omega <= band[1]
    here = sizes if inside else replace(sizes, FS=np.zeros(1), FKS=np.zeros(1))
    measured = float(stability_measure(aliases, here, point.sums(band))[0])
    each = point.F[0] * (1.0 if aliases.operator else point.hold[0])
    each = each * (np.abs(point.hG[0]) / point.hold[0] if aliases.inverse and not aliases.through else 1.0)
    each = (each * abs(complex(point.KS[0])))[1:]
    source = omega
    if each.max() > own:
        source = float(abs(omega + aliases.step * aliases.single[each.argmax()]))
    sums = point.sums()
    counted = sums.FF if aliases.operator else sums.G if aliases.inverse else sums.F
    return Shares(
        omega=omega,
        total=total,
        own=own,
        member=float(member[0]),
        measured=min(measured, total),
        source=source,
        filtered=bool(np.isfinite(counted[0])),
        F_max=float(sums.F_max[0]),
    )


def power_law(G: Magnitude, low: float) -> tuple[float, int]:
    """c and r with |G| <= c omega^-r for all omega >= low, r the relative degree; low far beyond all roots."""
    log = np.sum(np.log1p(np.abs(G.zeros) / low)) - np.sum(np.log1p(-np.abs(G.poles) / low))
    return float(G.gain * np.exp(log)), int(G.poles.size - G.zeros.size)


def aliases_of(
    form: str, plant: control.StateSpace, weight: control.StateSpace, perturbation: str, dt: float, delay: float
) -> Aliases:
    """The aliases of a set of a form, around a continuous plant under a controller of sampling time dt [s]."""
    row = FORMS[form]
    return Aliases(
        dt=dt,
        delay=delay,
        plant=plant,
        weight=weight,
        through="G" in row.read,
        inverse=row.inverse,
        operator=perturbation == "operator",
    )
