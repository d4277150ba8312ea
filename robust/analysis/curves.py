"""Sensitivities and robustness measures of a loop over frequency, for its whole set of plants.

S_p = S (1 + a Delta)/(1 + b Delta), |Delta| <= 1, with a and b of the form of the set (`robust.models.sets.forms`):
rs = |b|, and max |S_p| has a closed form (SP 7.5, 7.6), so no search over Delta is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nlfrf._base.values import value
from robust.analysis.findings import Margins, ReportCurves, reciprocal
from robust.lti.connections import largest_allowed_factor, worst_sensitivity
from robust.lti.lti import replace_infinite
from robust.models.sets.forms import FORMS, perturbed_sensitivity_terms


@value
class Curves:
    """Hold the responses of a loop at given frequencies, computed once.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    form : str
        Form of the uncertainty.
    G, K, w : (W,) complex ndarray
        Plant as the controller sees it, controller, weight (nan: no set).
    w_P : (W,) complex ndarray or None
        Performance weight, where one was asked for.
    S, a, b : (W,) complex ndarray
        Of the perturbed sensitivity S_p = S (1 + a Delta)/(1 + b Delta).
    W : (W,) complex ndarray
        What the plant is scaled by where the form depends on its units; one elsewhere.
    folded_rs, folded_S_worst, folded_performance_margin : (W,) ndarray or None
        rs, max |S_p| and `performance_margin` with every alias, where the set is one of continuous plants under a
        sampled controller.
    """

    omega: np.ndarray
    form: str
    G: np.ndarray
    K: np.ndarray
    w: np.ndarray
    w_P: np.ndarray | None
    S: np.ndarray
    a: np.ndarray
    b: np.ndarray
    W: np.ndarray
    folded_rs: np.ndarray | None = None
    folded_S_worst: np.ndarray | None = None
    folded_performance_margin: np.ndarray | None = None

    @property
    def rs(self) -> np.ndarray:
        """Return the robust-stability measure (W,): the set is stable iff it is below one everywhere (SP 7.43)."""
        return FORMS[self.form].rs_measure(self.w, self.b) if self.folded_rs is None else self.folded_rs

    @property
    def S_worst(self) -> np.ndarray:
        """Return the largest |S_p| (W,) over the set; inf where a plant of it is unstable."""
        return worst_sensitivity(self.S, self.a, self.b) if self.folded_S_worst is None else self.folded_S_worst

    @property
    def np_(self) -> np.ndarray:
        """Return |w_P S| (W,); nan without w_P."""
        return np.full(self.omega.size, np.nan) if self.w_P is None else np.abs(self.w_P * self.S)

    @property
    def rp(self) -> np.ndarray:
        """Return |w_P| max |S_p| (W,); nan without w_P."""
        if self.w_P is None:
            return np.full(self.omega.size, np.nan)
        worst = self.S_worst
        return np.where(np.isinf(worst), np.inf, np.abs(self.w_P) * np.where(np.isinf(worst), 1.0, worst))

    @property
    def K_S(self) -> np.ndarray:
        """Return complex K S (W,), finite at the poles of K."""
        return replace_infinite(self.K) * self.S

    @property
    def worst_performance(self) -> np.ndarray:
        """Return `rp` (W,) where a performance weight was given, else `S_worst`."""
        return self.S_worst if self.w_P is None else self.rp

    @property
    def half_disk(self) -> np.ndarray:
        """Return |S - 1/2| (W,), whose largest value is the inverse of the symmetric disk margin."""
        return np.abs(self.S - 0.5)

    @property
    def performance_margin(self) -> np.ndarray:
        """Return the factor (W,) on the uncertainty at which |w_P| max |S_p| = 1."""
        if self.folded_performance_margin is not None:
            return self.folded_performance_margin
        assert self.w_P is not None
        return FORMS[self.form].scale_for(
            self.w, largest_allowed_factor(np.abs(self.w_P) * np.abs(self.S), self.a, self.b)
        )

    @property
    def inverse_performance_margin(self) -> np.ndarray:
        """Return one over `performance_margin` (W,)."""
        return 1 / self.performance_margin

    def shown(self, stable: bool) -> ReportCurves:
        """Return the curves as a report shows them: nan for an unstable loop, and where there is no set."""
        nothing = np.full(self.omega.size, np.nan)
        seen = stable and bool(np.isfinite(self.w).all())
        return ReportCurves(
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
        """Merge two sets of curves of the same loop, sorted by frequency."""
        omega, at = np.unique(np.concatenate([self.omega, others.omega]), return_index=True)
        return self.with_responses(lambda name: np.concatenate([getattr(self, name), getattr(others, name)])[at], omega)

    def in_band(self, low: float, high: float) -> Curves:
        """Return the curves at the frequencies from low to high [rad/s]."""
        at = (self.omega >= low) & (self.omega <= high)
        return self.with_responses(lambda name: getattr(self, name)[at], self.omega[at])

    def with_responses(self, part: Callable[[str], np.ndarray], omega: np.ndarray) -> Curves:
        """Return curves at other frequencies, with the response that `part` gives for each name."""
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
                None if self.folded_performance_margin is None else part("folded_performance_margin")
            ),
        )


#: A largest value and its frequency [rad/s].
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
    """Compute the curves of a loop from the responses of its parts; they are finite at poles of the plant and of K."""
    W = np.ones(omega.size) if W is None or not FORMS[form].depends_on_units else W
    S, a, b = perturbed_sensitivity_terms(form, w, G=replace_infinite(G), K=replace_infinite(K), W=W)
    return Curves(omega=omega, form=form, G=G, K=K, w=w, w_P=w_P, S=S, a=a, b=b, W=W)


def margins_on_lines(curves: Curves) -> Margins:
    """Return the margins at the frequencies of the curves, without a search between them."""
    omega, rs, half = curves.omega, curves.rs, curves.half_disk
    found = Margins(disk=reciprocal(float(half.max())), omega_disk=float(omega[half.argmax()]))
    if not np.isfinite(rs).all():
        return found
    S_worst = curves.S_worst
    found = replace(
        found,
        rs=reciprocal(float(rs.max())),
        omega_rs=float(omega[rs.argmax()]),
        S_worst=float(S_worst.max()),
        omega_S_worst=float(omega[S_worst.argmax()]),
        S_worst_lines=omega.size,
    )
    if curves.w_P is None:
        return found
    met = curves.np_ < 1
    factors = curves.performance_margin if met.all() else np.where(met, 1.0, 0.0)
    return replace(found, rp=float(factors.min()), omega_rp=float(omega[factors.argmin()]))


@value(copy=False)
class MuCurves:
    """Hold upper bounds of mu (W,) for stability and (nan without it) performance."""

    omega: np.ndarray
    mu: np.ndarray
    mu_rp: np.ndarray

    @property
    def peak(self) -> float:
        """Return the largest bound for stability."""
        return float(self.mu.max())

    @property
    def omega_peak(self) -> float:
        """Return where it is [rad/s]."""
        return float(self.omega[self.mu.argmax()])

    @property
    def peak_rp(self) -> float:
        """Return the largest bound for performance, nan without it."""
        return float(self.mu_rp.max())
