"""What a loop does over frequency, for its whole set of plants: the curves that a report shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf._base.values import value
from robust.lti.connections import largest_allowed_factor, worst_sensitivity
from robust.lti.lti import replace_infinite
from robust.models.sets.forms import FORMS, worst_terms

__all__ = ["Curves", "Peaks", "loop_curves", "peaks_on_lines"]


@value
class Curves:
    """Responses of a loop at given frequencies, computed once and handed on.

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
    folded_rs, folded_worst, folded_growth : (W,) ndarray or None
        rs, max |S_p| and growth with every alias, where the set is one of continuous plants under a sampled controller.
    """

    omega: np.ndarray
    form: str
    G: np.ndarray
    K: np.ndarray
    w: np.ndarray
    w_P: Any
    S: np.ndarray
    a: np.ndarray
    b: np.ndarray
    W: np.ndarray
    folded_rs: Any = None
    folded_worst: Any = None
    folded_growth: Any = None

    @property
    def rs(self) -> np.ndarray:
        """(W,) In proportion to |w|; one perturbation of the set destabilises the loop where it reaches one."""
        return FORMS[self.form].stays(self.w, self.b) if self.folded_rs is None else self.folded_rs

    @property
    def S_worst(self) -> np.ndarray:
        """(W,) largest |S_p| over the set; inf where a plant of it is unstable."""
        return worst_sensitivity(self.S, self.a, self.b) if self.folded_worst is None else self.folded_worst

    @property
    def np_(self) -> np.ndarray:
        """(W,) |w_P S|; nan without w_P."""
        return np.full(self.omega.size, np.nan) if self.w_P is None else np.abs(self.w_P * self.S)

    @property
    def rp(self) -> np.ndarray:
        """(W,) |w_P| max |S_p|; nan without w_P."""
        if self.w_P is None:
            return np.full(self.omega.size, np.nan)
        worst = self.S_worst
        return np.where(np.isinf(worst), np.inf, np.abs(self.w_P) * np.where(np.isinf(worst), 1.0, worst))

    @property
    def K_S(self) -> np.ndarray:
        """(W,) complex K S, finite at the poles of K."""
        return replace_infinite(self.K) * self.S

    @property
    def worst(self) -> np.ndarray:
        """(W,) largest |S_p| over the set, |w_P| times it where performance was asked for."""
        return self.S_worst if self.w_P is None else self.rp

    @property
    def half_disk(self) -> np.ndarray:
        """(W,) |S - 1/2|, whose largest value is the inverse of the symmetric disk margin."""
        return np.abs(self.S - 0.5)

    @property
    def growth(self) -> np.ndarray:
        """(W,) factor by which the uncertainty may grow until |w_P| max |S_p| = 1."""
        if self.folded_growth is not None:
            return self.folded_growth
        return FORMS[self.form].grown(self.w, largest_allowed_factor(np.abs(self.w_P) * np.abs(self.S), self.a, self.b))

    @property
    def limit(self) -> np.ndarray:
        """(W,) one over `growth`."""
        return 1 / self.growth

    def joined(self, others: Curves) -> Curves:
        """These and others of the same loop, by frequency."""
        omega, at = np.unique(np.concatenate([self.omega, others.omega]), return_index=True)
        return self.each(lambda name: np.concatenate([getattr(self, name), getattr(others, name)])[at], omega)

    def between(self, low: float, high: float) -> Curves:
        """Those at the frequencies from low to high [rad/s]."""
        at = (self.omega >= low) & (self.omega <= high)
        return self.each(lambda name: getattr(self, name)[at], self.omega[at])

    def each(self, part: Callable[[str], np.ndarray], omega: np.ndarray) -> Curves:
        """Curves at other frequencies, from what `part` gives by the name of each response."""
        names = ("G", "K", "w", "w_P", "S", "a", "b", "W", "folded_rs", "folded_worst", "folded_growth")
        of: dict[str, Any] = {name: part(name) for name in names if getattr(self, name) is not None}
        return replace(self, omega=omega, **of)


#: A largest value and its frequency [rad/s].
Peak = tuple[float, float]
NOWHERE: Peak = (np.nan, np.nan)


@value
class Peaks:
    """The largest values of the curves of a loop, each with its frequency [rad/s]; nan where there is none.

    Fields
    ------
    rs : (float, float)
        Largest |b|.
    margin_rp : (float, float)
        Factor on the uncertainty with |w_P| max |S_p| <= 1, and where it is limited.
    half_disk : (float, float)
        Largest |S - 1/2|.
    """

    rs: Peak = NOWHERE
    margin_rp: Peak = NOWHERE
    half_disk: Peak = NOWHERE

    @property
    def margins(self) -> dict[str, Any]:
        """The margins and where they are limited, named as in the report."""
        (rs, omega_rs), (rp, omega_rp), (half, omega_disk) = self.rs, self.margin_rp, self.half_disk
        places = {"omega_rs": omega_rs, "omega_rp": omega_rp, "omega_disk": omega_disk}
        return {"margin_rs": inverted(rs), "margin_rp": rp, "disk_margin": inverted(half)} | places


def inverted(peak: float) -> float:
    """One over a largest value; inf for zero, nan for nan."""
    return 1 / peak if peak > 0 else peak if np.isnan(peak) else np.inf


def loop_curves(
    form: str, omega: np.ndarray, G: np.ndarray, K: np.ndarray, w: np.ndarray, w_P: Any, W: Any = None
) -> Curves:
    """The curves from the responses of the parts of a loop, which are finite at a pole of the plant or of K too."""
    W = np.ones(omega.size) if W is None or not FORMS[form].scaled else W
    S, a, b = worst_terms(form, w, replace_infinite(G), replace_infinite(K), W)
    return Curves(omega=omega, form=form, G=G, K=K, w=w, w_P=w_P, S=S, a=a, b=b, W=W)


def peaks_on_lines(curves: Curves) -> Peaks:
    """The largest values on the frequencies of the curves, nothing between them."""
    omega, rs, half = curves.omega, curves.rs, curves.half_disk
    known = {"half_disk": (float(half.max()), float(omega[half.argmax()]))}
    if np.isfinite(rs).all():
        known["rs"] = float(rs.max()), float(omega[rs.argmax()])
        if curves.w_P is not None:
            met = curves.np_ < 1
            factors = curves.growth if met.all() else np.where(met, 1.0, 0.0)
            known["margin_rp"] = float(factors.min()), float(omega[factors.argmin()])
    return Peaks(**known)
