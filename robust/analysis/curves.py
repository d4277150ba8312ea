"""Sensitivities and robustness measures of a loop over frequency, for its whole set of plants.

S_p = S (1 + a Delta)/(1 + b Delta), |Delta| <= 1, with a and b of the form of the set
(`robust.models.sets.forms`): rs = |b|, and max |S_p| has a closed form (SP 7.5, 7.6), so no search
over Delta is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nlfrf._base.values import value
from robust.analysis.findings import LoopCurves, Margins
from robust.lti.connections import largest_allowed_factor, worst_sensitivity
from robust.lti.grids import peak_of
from robust.lti.lti import replace_infinite
from robust.models.sets.forms import FORMS, perturbed_sensitivity_terms


@value
class Curves:
    """Responses of a loop at given frequencies, computed once; S_p = S (1 + a Delta)/(1 + b Delta).

    With `folded_*`, rs, max |S_p| and `performance_margin` include every alias: continuous plants,
    sampled controller.
    """

    omega: np.ndarray  # (W,) frequencies [rad/s], for all fields below
    form: str  # form of the uncertainty
    G: np.ndarray  # complex plant with hold and delay
    K: np.ndarray  # complex controller
    w: np.ndarray  # complex weight; nan without a set
    w_P: np.ndarray | None  # complex performance weight
    S: np.ndarray
    a: np.ndarray
    b: np.ndarray
    W: np.ndarray  # complex scaling of the plant if the form depends on its units, else one
    folded_rs: np.ndarray | None = None
    folded_S_worst: np.ndarray | None = None
    folded_performance_margin: np.ndarray | None = None

    @property
    def rs(self) -> np.ndarray:
        """Robust-stability measure (W,): the set is stable iff rs < 1 everywhere (SP 7.43)."""
        if self.folded_rs is None:
            return FORMS[self.form].rs_measure(self.w, self.b)
        return self.folded_rs

    @property
    def S_worst(self) -> np.ndarray:
        """Largest |S_p| (W,) over the set; inf if a plant of the set is unstable."""
        if self.folded_S_worst is None:
            return worst_sensitivity(self.S, self.a, self.b)
        return self.folded_S_worst

    @property
    def np_(self) -> np.ndarray:
        """|w_P S| (W,); nan without w_P."""
        if self.w_P is None:
            return np.full(self.omega.size, np.nan)
        return np.abs(self.w_P * self.S)

    @property
    def rp(self) -> np.ndarray:
        """|w_P| max |S_p| (W,); nan without w_P."""
        if self.w_P is None:
            return np.full(self.omega.size, np.nan)
        worst = self.S_worst
        return np.where(
            np.isinf(worst), np.inf, np.abs(self.w_P) * np.where(np.isinf(worst), 1.0, worst)
        )

    @property
    def loop_gain(self) -> np.ndarray:
        """Complex G K (W,)."""
        return self.G * self.K

    @property
    def K_S(self) -> np.ndarray:
        """Complex K S (W,), finite at the poles of K."""
        return replace_infinite(self.K) * self.S

    @property
    def worst_performance(self) -> np.ndarray:
        """`rp` (W,) with a performance weight, else `S_worst`."""
        if self.w_P is None:
            return self.S_worst
        return self.rp

    @property
    def half_disk(self) -> np.ndarray:
        """|S - 1/2| (W,); its largest value is the inverse of the symmetric disk margin."""
        return np.abs(self.S - 0.5)

    @property
    def performance_margin(self) -> np.ndarray:
        """Factor (W,) on the uncertainty at which |w_P| max |S_p| = 1."""
        if self.folded_performance_margin is not None:
            return self.folded_performance_margin
        assert self.w_P is not None
        return FORMS[self.form].scale_for(
            self.w, largest_allowed_factor(np.abs(self.w_P) * np.abs(self.S), self.a, self.b)
        )

    @property
    def inverse_performance_margin(self) -> np.ndarray:
        """One over `performance_margin` (W,)."""
        return 1 / self.performance_margin

    def shown(self, stable: bool) -> LoopCurves:
        """Return the curves for a report: nan for an unstable loop and without a set."""
        nothing = np.full(self.omega.size, np.nan)
        seen = stable and bool(np.isfinite(self.w).all())
        return LoopCurves(
            omega=self.omega,
            rs=self.rs if seen else nothing,
            np_=self.np_ if stable else nothing,
            rp=self.rp if seen else nothing,
            S=self.S,
            T=1 - self.S,
            G=self.G,
            K=self.K,
            radius=np.abs(self.w),
            w_P=None if self.w_P is None else np.abs(self.w_P),
            shaping=None if np.all(self.W == 1) else self.W,
        )

    def merge(self, others: Curves) -> Curves:
        """Merge the curves of the same loop on two grids, sorted by frequency."""
        omega, at = np.unique(np.concatenate([self.omega, others.omega]), return_index=True)
        return self.with_responses(
            lambda name: np.concatenate([getattr(self, name), getattr(others, name)])[at], omega
        )

    def in_band(self, low: float, high: float) -> Curves:
        """Select the curves at the frequencies from low to high [rad/s]."""
        at = (self.omega >= low) & (self.omega <= high)
        return self.with_responses(lambda name: getattr(self, name)[at], self.omega[at])

    def with_responses(self, part: Callable[[str], np.ndarray], omega: np.ndarray) -> Curves:
        """Return curves at other frequencies; `part` gives the response for each name."""
        return replace(
            self,
            omega=omega,
            G=part("G"),
            K=part("K"),
            w=part("w"),
            w_P=None if self.w_P is None else part("w_P"),
            S=part("S"),
            a=part("a"),
            b=part("b"),
            W=part("W"),
            folded_rs=None if self.folded_rs is None else part("folded_rs"),
            folded_S_worst=None if self.folded_S_worst is None else part("folded_S_worst"),
            folded_performance_margin=(
                None
                if self.folded_performance_margin is None
                else part("folded_performance_margin")
            ),
        )


def loop_curves(
    form: str,
    omega: np.ndarray,
    *,
    G: np.ndarray,
    K: np.ndarray,
    w: np.ndarray,
    w_P: np.ndarray | None,
    W: np.ndarray | None = None,
) -> Curves:
    """Compute the curves of a loop from the responses of its parts; finite at poles of G and K."""
    if W is None or not FORMS[form].depends_on_units:
        W = np.ones(omega.size)
    S, a, b = perturbed_sensitivity_terms(
        form, w, G=replace_infinite(G), K=replace_infinite(K), W=W
    )
    return Curves(omega=omega, form=form, G=G, K=K, w=w, w_P=w_P, S=S, a=a, b=b, W=W)


def margins_on_lines(curves: Curves) -> Margins:
    """Return the margins at the frequencies of the curves, without a search between them."""
    omega, rs = curves.omega, curves.rs
    found = Margins(peak_disk=peak_of(omega, curves.half_disk))
    if not np.isfinite(rs).all():
        return found
    found = replace(
        found,
        peak_rs=peak_of(omega, rs),
        peak_S=peak_of(omega, curves.S_worst),
        S_worst_lines=omega.size,
    )
    if curves.w_P is None:
        return found
    met = curves.np_ < 1
    if met.all():
        return replace(found, peak_rp=peak_of(omega, curves.inverse_performance_margin))
    return replace(found, peak_rp=peak_of(omega, np.where(met, 1.0, np.inf)))


@value(copy=False)
class MuCurves:
    """Upper bounds of mu (W,) for stability and performance (nan without a demand)."""

    omega: np.ndarray
    mu: np.ndarray
    mu_rp: np.ndarray

    @property
    def peak(self) -> float:
        """Largest bound for stability."""
        return float(self.mu.max())

    @property
    def omega_peak(self) -> float:
        """Frequency of the largest bound for stability [rad/s]."""
        return float(self.omega[self.mu.argmax()])

    @property
    def peak_rp(self) -> float:
        """Largest bound for performance; nan without a demand."""
        return float(self.mu_rp.max())
