r"""Robust stability and performance of a continuous set with a sampled controller, all aliases
included.

After hold and delay the sampled plant at omega is the sum over all aliases omega_k = omega + 2 pi
k/T,

    G_d = sum_k h_k G_k,    |h_k| = |sin(omega T/2)| / |omega_k T/2|,

and a perturbation acts at each of them. With F = G w (multiplicative, inverse-additive) or w
(additive, inverse-multiplicative), and S = 1/(1 + K G_d), every loop of the set is stable if, at
every omega up to Nyquist,

    class      form               condition
    LTI        mult., additive    |K S| sum_k |h_k F_k| < 1                                       (exact)
    operator   mult., additive    |K S| sqrt(sum_k |F_k|^2) < 1
    LTI        inverse            0 outside of sum_k {h_k G_k/(1 + F_k Delta_k)} K + 1, |F_k| < 1 for k != 0  (exact)
    operator   inverse            |M| < 1, M = diag(F_k) - g F^T, g_k = h_k G_k K S

LTI: the values of Delta at different frequencies are independent, so each alias fills its own disc,
and the sampled plant fills the sum of these discs (Dullerud & Glover 1993). Operator: a nonlinear
or time-varying Delta moves energy from one frequency to another, so its condition uses the L2 gain
of the path around it. By Cauchy-Schwarz the samples of F p have at most (1/T) sum_k |F_k|^2 of the
energy of p, and the hold multiplies the energy of its samples by T. Both are attained at one
frequency, so the gain of the path is exactly the square root above (Braslavsky, Middleton &
Freudenberg 1998). If F does not fall off at high frequency, neither sum is finite, because the
perturbation reaches the sampler unfiltered.

Aliases near the band are summed one by one. The next ones are summed in blocks with the largest |F|
of each, the last ones by their power law, so no alias is left out. `robust.proofs.exact.aliases`
proves the same between frequencies, in exact arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import control
import numpy as np
from scipy.special import psi, zeta

from nlfrf._base.values import value
from robust.lti.lti import make_response, poles, replace_infinite
from robust.models.sets.forms import FORMS
from robust.proofs.search.intervals import Magnitude, magnitude_of

#: Number of aliases on either side that are summed one by one: minimum, and maximum if light modes
#: lie higher.
_MIN_SINGLE_ALIASES, _MAX_SINGLE_ALIASES = 12, 200
#: Further aliases are bounded in blocks: growth of the blocks, and end of the last block over the
#: largest root.
_BLOCK_GROWTH, _TAIL_START_RATIO = 1.02, 1e4
# the factor on the uncertainty is searched between this and its inverse
_MIN_UNCERTAINTY_FACTOR = 1e-9
# alias over the sum of all others, above which it is computed from the sampled plant
_DOMINANT_RATIO = 1e4
# of the sum: smaller aliases are left out of the worst plant; each adds two to its order
_MIN_ALIAS_SHARE = 0.003
# below this damping ratio a mode has a peak that a block would spread over all its aliases
_LIGHT_DAMPING = 0.3


@value
class _AliasSums:
    """Sums over the aliases k != 0 of a frequency, (I,) each."""

    F: np.ndarray  # sum |h_k F_k|
    G: np.ndarray  # sum |h_k G_k|
    FF: np.ndarray  # sum |F_k|^2
    GG: np.ndarray  # sum |h_k G_k|^2
    GF: np.ndarray  # sum |h_k G_k| |F_k|/(1 - |F_k|); inf if an alias has |F_k| >= 1
    product: np.ndarray  # sum |h_k G_k| |F_k|; finite in that case too
    F_max: np.ndarray  # largest |F_k|


#: Sums without any alias.
_NO_ALIASES = _AliasSums(
    **dict.fromkeys(("F", "G", "FF", "GG", "GF", "product", "F_max"), np.zeros(1))
)


@value
class Aliases:
    """Aliases of a set of continuous plants."""

    dt: float  # sampling time [s]
    delay: float  # delay after the hold [s]
    plant: control.StateSpace  # continuous plant without that delay
    weight: control.StateSpace
    F_includes_plant: bool  # F = G w, else F = w
    inverse: bool  # form of the set
    operator: bool  # Delta may be any causal operator

    @property
    def spacing(self) -> float:
        """Sampling frequency, the distance of the aliases [rad/s]."""
        return 2 * np.pi / self.dt

    @cached_property
    def responders(
        self,
    ) -> tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]:
        """Functions of omega that evaluate plant and weight."""
        plant, w = make_response(self.plant), make_response(self.weight)

        def G(omega: np.ndarray) -> np.ndarray:
            return replace_infinite(
                plant(omega)
            )  # at a pole on the axis S and K S are as small as this value is large

        return G, w

    @cached_property
    def light_modes(self) -> np.ndarray:
        """Lightly damped poles of plant and weight in the upper half plane [rad/s]."""
        p = np.concatenate([poles(self.plant), poles(self.weight)])
        return np.asarray(p[(np.abs(p.real) < _LIGHT_DAMPING * np.abs(p)) & (p.imag > 0)])

    @cached_property
    def folded_modes(self) -> np.ndarray:
        """Light modes above Nyquist, as poles at their alias below Nyquist [rad/s]."""
        p, nyquist = self.light_modes, self.spacing / 2
        down = np.abs((p.imag + nyquist) % self.spacing - nyquist)
        return np.asarray((p.real + 1j * down)[p.imag > nyquist])

    @cached_property
    def single_indices(self) -> np.ndarray:
        """Numbers (k,) of the aliases k != 0 that are summed one by one."""
        if self.light_modes.size:
            high = self.light_modes.imag.max()
        else:
            high = 0.0
        n = int(np.clip(np.ceil(high / self.spacing) + 2, _MIN_SINGLE_ALIASES, _MAX_SINGLE_ALIASES))
        return np.concatenate([np.arange(-n, 0), np.arange(1, n + 1)])

    @cached_property
    def tail_bounds(self) -> _AliasSums:
        """Upper bounds (1,) of the sums over all other aliases, |h_k| without |sin(omega T/2)|.

        Blocks of aliases with the largest |G| and |F| of each, up to far beyond all roots; power
        laws above.
        """
        G, F = magnitude_of(self.plant), magnitude_of(self.weight)
        if (
            self.F_includes_plant
        ):  # rounding in the series would add far zeros, and F would no longer fall off
            roots = {
                name: np.append(getattr(F, name), getattr(G, name)) for name in ("zeros", "poles")
            }
            F = Magnitude(**roots, gain=F.gain * G.gain)
        first = float(self.single_indices[-1]) + 1
        roots = np.abs(np.concatenate([G.zeros, G.poles, F.zeros, F.poles]))
        end = max(_TAIL_START_RATIO * float(roots.max(initial=0.0)) / self.spacing, 2.0 * first)
        k = np.unique(
            np.ceil(
                first
                * _BLOCK_GROWTH
                ** np.arange(np.ceil(np.log(end / first) / np.log(_BLOCK_GROWTH)) + 1)
            )
        )
        low, high = (k[:-1] - 0.5) * self.spacing, (k[1:] - 0.5) * self.spacing
        top_G, top_F = G.upper_each(low, high), F.upper_each(low, high)
        last = (k[-1] - 0.5) * self.spacing
        (c_G, g), (c_F, f) = _power_law_bound(G, last), _power_law_bound(F, last)
        far_F = c_F * last**-f

        def added(top: np.ndarray, c: float, power: int, hold: int) -> np.ndarray:
            """Sum |h_k|^hold times a size that is `top` on the blocks and c omega^-power beyond,
            omega at most pi/T.
            """
            total, n = 0.0, power + hold
            for x in (
                -0.5,
                0.5,
            ):  # each alias is at its nearest: 1/(k - x) + 1/(k + x) grows with x
                # the sum of 1/(k + x)^hold over a block: a difference of Hurwitz zeta functions, of digamma for 1
                if not hold:
                    sizes = np.diff(k)
                elif hold > 1:
                    sizes = -np.diff(zeta(hold, k + x))
                else:
                    sizes = np.diff(psi(k + x))
                total += (2 / self.dt / self.spacing) ** hold * float(sizes @ top)
                if c and n > 1:
                    total += (
                        c * (2 / self.dt) ** hold * self.spacing**-n * float(zeta(n, k[-1] + x))
                    )
            return np.array([np.inf if c and n <= 1 else total])

        over = np.divide(top_F, 1 - top_F, out=np.full(top_F.size, np.inf), where=top_F < 1)
        if far_F < 1:
            over_far = far_F / (1 - far_F)
        else:
            over_far = np.inf
        with np.errstate(invalid="ignore"):
            over, far = np.where(top_G > 0, top_G * over, 0.0), c_G * over_far if c_G else 0.0
        return _AliasSums(
            F=added(top_F, c_F, f, 1),
            G=added(top_G, c_G, g, 1),
            FF=added(top_F**2, c_F**2, 2 * f, 0),
            GG=added(top_G**2, c_G**2, 2 * g, 2),
            GF=added(over, far, g, 1),
            product=added(top_G * top_F, c_G * c_F, g + f, 1),
            F_max=np.array([max(float(top_F.max()), far_F)]),
        )

    def sampled_radius(self, omega: np.ndarray, sampled: np.ndarray) -> np.ndarray:
        """Return the radius (W,) of the sampled set at omega [rad/s]; inf if nothing filters it,
        nan if inverse.

        For an operator it is the radius of the disc with the same rs. `sampled` is the response of
        the sampled plant.
        """
        if self.inverse:
            return np.full(omega.size, np.nan)
        one = np.ones(omega.size)
        point = evaluate_aliases(self, omega, S=one, KS=one, sampled=sampled)
        return point.stability_measure(point.alias_sums())

    def alias_terms(
        self, omega: np.ndarray, sampled: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return h_k, h_k G_k and |F_k|, (W, 1 + k) each, for the frequency itself and the aliases
        summed one by one.

        `sampled` (W,) is the response of the sampled plant, the sum of all h_k G_k. If one alias is
        nearly the whole sum, near a pole on the axis, it is computed from `sampled`: G_d and S then
        have the same rounding of the pole.
        """
        k = np.concatenate([[0], self.single_indices])
        at = omega[:, None] + self.spacing * k
        G, w = (self.responders[i](np.abs(at).ravel()).reshape(at.shape) for i in (0, 1))
        hold = np.sinc(omega * self.dt / (2 * np.pi))[:, None] * omega[:, None] / at
        h = hold * np.exp(-1j * (omega[:, None] * self.dt / 2 + at * self.delay))
        hG = np.where(at < 0, np.conj(G), G) * h
        size = np.abs(hG)
        row, largest = np.arange(omega.size), size.argmax(1)
        alone = np.where(np.arange(k.size) == largest[:, None], 0.0, hG)
        dominant = size[row, largest] > _DOMINANT_RATIO * np.abs(alone).sum(1)
        hG[row[dominant], largest[dominant]] = replace_infinite(sampled[dominant]) - alone[
            dominant
        ].sum(1)
        if self.F_includes_plant:
            F = np.abs(hG / hold)
        else:
            F = 1.0
        return h, hG, F * np.abs(w)


def _multiply_or_zero(size: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return size times total; zero for zero size, even if the total is infinite."""
    return np.where(size == 0, 0.0, size * total)


def _largest_singular_value_2x2(
    a: np.ndarray, b: np.ndarray, *, c: np.ndarray, d: np.ndarray
) -> np.ndarray:
    """Return the largest singular value (I,) of [[a, b], [c, d]], all nonnegative."""
    return (np.sqrt((a + d) ** 2 + (b - c) ** 2) + np.sqrt((a - d) ** 2 + (b + c) ** 2)) / 2


@value(copy=False)
class AliasedLoop:
    """A loop at frequencies omega (W,):

    S, K S, and h_k, h_k G_k, |F_k| (W, 1 + k) for the aliases.
    """

    aliases: Aliases
    omega: np.ndarray
    S: np.ndarray
    KS: np.ndarray
    h: np.ndarray
    hG: np.ndarray
    F: np.ndarray

    @property
    def hold(self) -> np.ndarray:
        """|h_k| (W, 1 + k)."""
        return np.abs(self.h)

    @property
    def sin_half_angle(self) -> np.ndarray:
        """|sin(omega T/2)| (W,)."""
        return np.sin(np.minimum(self.omega * self.aliases.dt / 2, np.pi / 2))

    def stability_measure(self, others: _AliasSums) -> np.ndarray:
        """Return (W,) the left side of the table above, or a bound of it (LTI inverse): robustly
        stable if below one.

        For the inverse forms 1 + K G_p is written over the denominator 1 + F Delta_0, and every
        alias moves it by at most |h_k G_k| |F_k|/(1 - |F_k|). The matrix of an operator is split
        into the frequency itself and the rest; its norm is at most that of the matrix of the norms
        of its blocks.
        """
        KS, FS = np.abs(self.KS), self.F[:, 0] * np.abs(self.S)
        FKS = self.F[:, 0] * KS
        with np.errstate(invalid="ignore", over="ignore"):
            if not self.aliases.inverse and self.aliases.operator:
                return np.sqrt(FKS**2 + _multiply_or_zero(KS, np.sqrt(others.FF)) ** 2)
            if not self.aliases.inverse:
                return self.hold[:, 0] * FKS + _multiply_or_zero(KS, others.F)
            own = FS + FKS * others.G
            if not self.aliases.operator:
                return own + _multiply_or_zero(KS + FKS, others.GF)
            F, G = np.sqrt(others.FF), np.sqrt(others.GG)
            GKS = np.abs(self.hG[:, 0]) * KS
            return _largest_singular_value_2x2(own, GKS * F, c=FKS * G, d=others.F_max + KS * G * F)

    def squared_performance_gain(
        self, others: _AliasSums, *, PS: np.ndarray, scaling: float
    ) -> np.ndarray:
        """Return the squared gain (W,) from (p, r) to (input of Delta, w_P e) for one scaling; not
        for inverse forms.

        PS is |w_P S|. The matrix is a column times a row, so its gain is the product of their
        norms.
        """
        d, KS, F = scaling**2, np.abs(self.KS), self.F[:, 0]
        gain = (F * KS) ** 2 + _multiply_or_zero(KS**2, others.FF)
        return np.asarray(
            gain + KS**2 * d + PS**2 + ((F * PS) ** 2 + _multiply_or_zero(PS**2, others.FF)) / d
        )

    def alias_sums(self, band: tuple[float, float] | None = None) -> _AliasSums:
        """Return the sums over the other aliases; only over those in a band [rad/s] if given."""
        beyond, inside = self.aliases.tail_bounds, np.ones(1, bool)
        if band is not None:
            at = np.abs(self.omega[:, None] + self.aliases.spacing * self.aliases.single_indices)
            beyond, inside = _NO_ALIASES, (at >= band[0]) & (at <= band[1])
        hG, F, sine = np.abs(self.hG[:, 1:]), self.F[:, 1:], self.sin_half_angle
        with np.errstate(divide="ignore", invalid="ignore"):
            over = np.where(F < 1, F / (1 - F), np.inf)
            GF = np.where((hG > 0) & inside, hG * over, 0.0)
        hG, F = hG * inside, F * inside
        return _AliasSums(
            F=(self.hold[:, 1:] * F).sum(1) + sine * beyond.F,
            G=hG.sum(1) + sine * beyond.G,
            FF=(F**2).sum(1) + beyond.FF,
            GG=(hG**2).sum(1) + sine**2 * beyond.GG,
            GF=GF.sum(1) + sine * beyond.GF,
            product=(hG * F).sum(1) + sine * beyond.product,
            F_max=np.maximum(F.max(1), beyond.F_max),
        )

    def least_return_difference(self, m: np.ndarray) -> np.ndarray:
        """Return the least |1 + K G_p|/|1 + K G_d| (W,) over an inverse set times m (W,); negative
        if zero is inside.

        At alias k the set is a disc with the centre h_k G_k/(1 - |F_k|^2) and the radius |h_k G_k
        F_k|/(1 - |F_k|^2). All discs except the first add up to one disc. The rest, X + v/(1 + F
        Delta) with v = K S h_0 G_0, is a disc, or the outside of one if |F| >= 1. In both cases its
        distance from zero is (|X + v|^2 - |F X|^2)/(|X (1 - |F|^2) + v| + |F v|).
        """
        u, hG, v = (m[:, None] * self.F[:, 1:]) ** 2, self.hG[:, 1:], self.hG[:, 0] * self.KS
        beyond, size = self.aliases.tail_bounds, np.abs(self.KS)
        with np.errstate(all="ignore"):
            E = self.KS * (hG * u / (1 - u)).sum(1)
            rest = size * (np.abs(hG) * np.sqrt(u) / (1 - u)).sum(1)
            rest += (
                size * self.sin_half_angle * m * beyond.product / (1 - m * beyond.F_max)
            )  # bound for the aliases in blocks, in either direction
            F, own = m * self.F[:, 0], (m * self.F[:, 0]) ** 2
            found = np.abs(1 + E) ** 2 - own * np.abs(1 + E - v) ** 2
            found /= np.abs((1 + E - v) * (1 - own) + v) + F * np.abs(v)
            inside = (u < 1).all(1) & (m * beyond.F_max < 1) | (size == 0)
            return np.where(
                inside & ~np.isnan(found), found - np.where(size == 0, 0.0, rest), -np.inf
            )

    def largest_uncertainty_factor(self, least: np.ndarray) -> np.ndarray:
        """Return the largest m (W,) with a return difference of at least `least`, by bisection of
        log m.
        """
        low = np.full(least.size, np.log(_MIN_UNCERTAINTY_FACTOR))
        high = np.full(least.size, -np.log(_MIN_UNCERTAINTY_FACTOR))
        for _ in range(60):
            middle = (low + high) / 2
            good = self.least_return_difference(np.exp(middle)) >= least
            low, high = np.where(good, middle, low), np.where(good, high, middle)
        return np.where(
            self.least_return_difference(np.full(least.size, _MIN_UNCERTAINTY_FACTOR)) >= least,
            np.exp(low),
            0.0,
        )


def evaluate_aliases(
    aliases: Aliases, omega: np.ndarray, *, S: np.ndarray, KS: np.ndarray, sampled: np.ndarray
) -> AliasedLoop:
    """Evaluate the aliases at omega (W,) [rad/s] from responses of the nominal loop and the sampled
    plant.
    """
    h, hG, F = aliases.alias_terms(omega, sampled)
    return AliasedLoop(aliases=aliases, omega=omega, S=S, KS=KS, h=h, hG=hG, F=F)


def fold_aliases(
    aliased: AliasedLoop, w_P: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Compute rs, max |S_p| and the performance margin (W,) of a loop, every alias included.

    rs is proportional to |w|, and one if the condition of the table is just met. |S_p| is inf if
    the set is not stable; for an operator in an inverse form it is that of the LTI members. The
    margin is the factor by which the uncertainty may grow until |w_P| max |S_p| = 1.
    """
    aliases, S = aliased.aliases, np.abs(aliased.S)
    if w_P is None:
        wanted = None
    else:
        wanted = np.abs(w_P) * S
    with np.errstate(divide="ignore", invalid="ignore"):
        if not aliases.inverse or aliases.operator:
            rs = aliased.stability_measure(aliased.alias_sums())
        else:
            rs = 1 / aliased.largest_uncertainty_factor(np.zeros(S.size))
        if not aliases.inverse:
            worst = np.where(rs < 1, S / (1 - rs), np.inf)
            if wanted is None:
                growth = None
            else:
                growth = np.maximum((1 - wanted) / rs, 1e-12)
            return rs, worst, growth
        here = aliased.least_return_difference(np.ones(S.size))
        worst = np.where(here > 0, S / here, np.inf)
    return (
        rs,
        worst,
        None if wanted is None else np.maximum(aliased.largest_uncertainty_factor(wanted), 1e-12),
    )


@value
class RsBreakdown:
    """Parts of rs at one frequency: from it, from the aliases, from the measured band."""

    omega: float  # the frequency [rad/s]
    total: float  # rs there
    without_aliases: float  # rs from that frequency alone
    # At least one if a linear perturbation at that frequency alone makes the loop unstable. For an
    # operator it is less than `without_aliases`, which counts every input that the hold passes to
    # the perturbation.
    single_frequency: float
    in_band: float  # rs from the measured band alone; the rest is assumed
    omega_source: float  # the frequency or alias with the largest part [rad/s]
    is_bounded: bool  # the sum over all aliases is finite
    F_max: float  # largest |F| of an alias


def worst_alias_phases(aliased: AliasedLoop) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (n,) [rad/s] and phases (n,) of the Delta whose aliases all reduce |1 + L|
    at one frequency.

    For additive and multiplicative sets: alias k moves the loop by K S h_k F_k Delta_k, which is
    made negative. Aliases with less than `_MIN_ALIAS_SHARE` of the sum are left out.
    """
    aliases = aliased.aliases
    k = np.concatenate([[0], aliases.single_indices])
    at = aliased.omega[0] + aliases.spacing * k
    w = aliases.responders[1](np.abs(at))
    acts = (
        aliased.KS[0]
        * np.where(at < 0, w.conj(), w)
        * (aliased.hG if aliases.F_includes_plant else aliased.h)[0]
    )
    keep = (np.abs(acts) > _MIN_ALIAS_SHARE * np.abs(acts).sum()) | (k == 0)
    phases = np.pi - np.angle(acts[keep])
    return np.abs(at[keep]), np.where(at[keep] < 0, -phases, phases)


def rs_breakdown(aliased: AliasedLoop, band: tuple[float, float], total: float) -> RsBreakdown:
    """Split rs, which is `total`, at the single frequency of `aliased`."""
    aliases, omega = aliased.aliases, float(aliased.omega[0])
    own = float(aliased.stability_measure(_NO_ALIASES)[0])
    member = aliased.hold[:, 0] * aliased.F[:, 0] * np.abs(aliased.KS)
    if aliases.inverse:
        member = aliased.F[:, 0] * np.abs(1 - aliased.hG[:, 0] * aliased.KS)
    inside = band[0] <= omega <= band[1]
    if inside:
        here = aliased
    else:
        here = replace(aliased, F=np.where(np.arange(aliased.F.shape[1]) > 0, aliased.F, 0.0))
    measured = float(here.stability_measure(aliased.alias_sums(band))[0])
    each = aliased.F[0] * (1.0 if aliases.operator else aliased.hold[0])
    each = each * (
        np.abs(aliased.hG[0]) / aliased.hold[0]
        if aliases.inverse and not aliases.F_includes_plant
        else 1.0
    )
    each = (each * abs(complex(aliased.KS[0])))[1:]
    source = omega
    if each.max() > own:
        source = float(abs(omega + aliases.spacing * aliases.single_indices[each.argmax()]))
    sums = aliased.alias_sums()
    counted = sums.G if aliases.inverse else sums.F
    if aliases.operator:
        counted = sums.FF
    return RsBreakdown(
        omega=omega,
        total=total,
        without_aliases=own,
        single_frequency=float(member[0]),
        in_band=min(measured, total),
        omega_source=source,
        is_bounded=bool(np.isfinite(counted[0])),
        F_max=float(sums.F_max[0]),
    )


def _power_law_bound(G: Magnitude, low: float) -> tuple[float, int]:
    """Return c and r with |G| <= c omega^-r for all omega >= low, r the relative degree; low is far
    above all roots.
    """
    log = np.sum(np.log1p(np.abs(G.zeros) / low)) - np.sum(np.log1p(-np.abs(G.poles) / low))
    return float(G.gain * np.exp(log)), int(G.poles.size - G.zeros.size)


def aliases_of_set(
    form: str,
    plant: control.StateSpace,
    *,
    weight: control.StateSpace,
    perturbation: str,
    dt: float,
    delay: float,
) -> Aliases:
    """Return the aliases of a continuous set with a controller of sampling time dt [s]."""
    row = FORMS[form]
    return Aliases(
        dt=dt,
        delay=delay,
        plant=plant,
        weight=weight,
        F_includes_plant="G" in row.rs_factors,
        inverse=row.inverse,
        operator=perturbation == "operator",
    )
