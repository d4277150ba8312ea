"""The forms of uncertainty, one row each: what a perturbation of gain one makes of a plant and of its loop.

    form                    set of plants, |Delta| <= 1      S_p = S (1 + a Delta)/(1 + b Delta)
    multiplicative          G (1 + w Delta)                  a = 0      b = w T
    additive                G + w Delta                      a = 0      b = w K S
    inverse-multiplicative  G / (1 + w Delta)                a = w      b = w S
    inverse-additive        G / (1 + w G Delta)              a = w G    b = w G S
    coprime                 (G + t Delta)/(1 - G* t Delta)   a = -t G*  b = t (K - G*) S,  t = w / sqrt(1 - |w|^2)

(SP 7.4, 7.5 and 8.2.3; the last is (N + Delta_N)/(M + Delta_M), G = N/M normalised, |[Delta_N, Delta_M]| <= |w|, with
W G for G and K/W for K where the plant is scaled: SP 4.1.5, 9.4.1.) No other module asks for the name of a
form: whatever differs between forms is a field of its row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import inverse_unit
from nlfrf._base.values import value
from robust.lti.connections import feedback, in_parallel, in_series, inverse_system, one_plus
from robust.models.sets.coprime import chord, other_plant, tangent, tangent_system, turned

__all__ = [
    "ADDITIVE",
    "AUTO",
    "ELEMENTS",
    "FORMS",
    "INPUT",
    "MATRIX_FORMS",
    "PERTURBATIONS",
    "RELATIVE",
    "Form",
    "loop_discs",
    "numerator",
    "of_one_channel",
    "relative",
    "worst_terms",
]

Array = np.ndarray

#: Classes of perturbation: what Delta may be.
PERTURBATIONS = ("LTI", "statistical", "operator")


@value
class Form:
    """One way in which Delta enters the plant; G, w, K, Delta below are (W,) responses unless said otherwise.

    Fields
    ------
    name : str
        What users call it.
    perturbed : (G, w, Delta) -> (W,) complex
        The perturbed plant.
    system : (G, w, Delta) -> control.StateSpace
        The same as a system.
    deviation : (G_p, G) -> (W,) complex
        w Delta that turns G into G_p.
    scale : (center, absolute) -> (W,)
        Factor from a radius in the plane of G to one of the form; center and absolute are |G| and that radius.
    largest : (center) -> (W,)
        The radius in the plane of G from which on the form has none.
    a, b : (w, G, K, S) -> (W,) complex
        Of S_p = S (1 + a Delta)/(1 + b Delta).
    relative : (w, size) -> (W,), or None
        |w| as a relative deviation of the plant (inverse: of one over it), size = |G|; None where it is none.
    read : tuple of str
        Factors of q = b (1 + L). N and M stand for the coprime factors, whose q is no product.
    inverse : bool
        Delta sits in the denominator: the set is unbounded where |w| reaches one.
    through : bool
        Delta acts through G, and vanishes where it does.
    lead : int
        How often Delta comes before delay and hold in the plant where b puts it behind.
    tames : str
        The closed-loop function that w weighs, as `mixsyn` names its weights; "" where that is none of them.
    matlab : str
        The uncertain plant in MATLAB's Robust Control Toolbox.
    stays : (w, b) -> (W,)
        What has to stay below one for robust stability, in proportion to |w|.
    grown : (w, x) -> (W,)
        Factor on w that makes a and b grow by a factor x.
    turn : (G, w, omega) -> complex
        What a Delta of `system` is to be divided by at omega [rad/s] for that of `perturbed`.
    scaled : bool
        Whether the set depends on the units of the plant, which is then scaled.
    """

    name: str
    perturbed: Callable[[Array, Array, Array], Array]
    system: Callable[[control.StateSpace, control.StateSpace, control.StateSpace], control.StateSpace]
    deviation: Callable[[Array, Array], Array]
    scale: Callable[[Array, Array], Array]
    largest: Callable[[Array], Array]
    a: Callable[[Array, Array, Array, Array], Array]
    b: Callable[[Array, Array, Array, Array], Array]
    relative: Callable[[Array, Array], Array] | None
    read: tuple[str, ...]
    inverse: bool
    through: bool
    lead: int
    tames: str
    matlab: str
    stays: Callable[[Array, Array], Array] = lambda w, b: np.abs(b)
    grown: Callable[[Array, Array], Array] = lambda w, x: x
    turn: Callable[[control.StateSpace, control.StateSpace, float], complex] = lambda G, w, omega: 1.0
    scaled: bool = False

    def unit_of(self, unit: str) -> str:
        """Unit of a radius of this form, from that of the plant; empty where it has none, or none is known."""
        two, one = (float(self.scale(np.array([c]), np.array([c / 2]))[0]) for c in (4.0, 2.0))
        power = 1 + round(np.log2(two / one))
        return unit if power == 1 else inverse_unit(unit) if unit and power == -1 else ""

    def radius_factor(self, omega: Array, absolute: Array, center: Array) -> Array:
        """(W,) factor from an absolute radius to the radius of the form, or a refusal where there is none."""
        if self.through and np.any(center == 0):
            raise ValueError(f"nominal must not vanish on a line for the {self.name} form, got zero")
        with np.errstate(divide="ignore"):
            used = absolute / self.largest(center)
        if np.any(used >= 1):
            k = int(np.argmax(used))
            limit = "|G| + 1/|G| of the scaled plant" if self.scaled else "|G|"
            raise ValueError(
                f"form must be multiplicative or additive where the radius reaches {limit}, got {self.name} with a "
                f"radius of {absolute[k] / center[k]:.3g} |G| at {omega[k] / 2 / np.pi:.4g} Hz"
            )
        return self.scale(center, absolute)

    def gains(self, w: Array, size: Array) -> tuple[Array, Array]:
        """Least and largest |G_p| over the set, from |w| and |G|."""
        if self.relative is None:  # on the sphere: angles add up
            angle, away = np.arctan(size), np.arcsin(np.minimum(w, 1))
            high = np.minimum(angle + away, np.pi / 2)
            return np.tan(np.maximum(angle - away, 0)), np.where(high < np.pi / 2, np.tan(high), np.inf)
        w = self.relative(w, size)
        if not self.inverse:
            return size - size * w, size + size * w
        return size / (1 + w), np.where(w < 1, size / np.abs(1 - w), np.inf)


def unbounded(center: Array) -> Array:
    """A form that has a radius for any disc."""
    return np.full(center.shape, np.inf)


#: Name -> row.
FORMS = {
    form.name: form
    for form in (
        Form(
            name="multiplicative",
            perturbed=lambda G, w, Delta: G * (1 + w * Delta),
            system=lambda G, w, D: in_series(one_plus(in_series(D, w)), G),
            deviation=lambda G_p, G: (G_p - G) / G,
            scale=lambda center, absolute: 1 / center,
            largest=unbounded,
            a=lambda w, G, K, S: np.zeros_like(S),
            b=lambda w, G, K, S: w * G * K * S,
            relative=lambda w, size: w,
            read=("w", "G", "K"),
            inverse=False,
            through=True,
            lead=0,
            tames="w_T",
            matlab="G * (1 + W * Delta)",
        ),
        Form(
            name="additive",
            perturbed=lambda G, w, Delta: G + w * Delta,
            system=lambda G, w, D: in_parallel(G, in_series(D, w)),
            deviation=lambda G_p, G: G_p - G,
            scale=lambda center, absolute: np.ones(center.size),
            largest=unbounded,
            a=lambda w, G, K, S: np.zeros_like(S),
            b=lambda w, G, K, S: w * K * S,
            relative=lambda w, size: w / np.maximum(size, 1e-300),
            read=("w", "K"),
            inverse=False,
            through=False,
            lead=1,
            tames="w_u",
            matlab="G + W * Delta",
        ),
        Form(
            name="inverse-multiplicative",
            perturbed=lambda G, w, Delta: G / (1 + w * Delta),
            system=lambda G, w, D: in_series(inverse_system(one_plus(in_series(D, w))), G),
            deviation=lambda G_p, G: (G - G_p) / G_p,
            scale=lambda center, absolute: 1 / (center - absolute),
            largest=lambda center: center,
            a=lambda w, G, K, S: w + 0 * S,
            b=lambda w, G, K, S: w * S,
            relative=lambda w, size: w,
            read=("w",),
            inverse=True,
            through=True,
            lead=0,
            tames="w_P",
            matlab="G * feedback(1, W * Delta)",
        ),
        Form(
            name="inverse-additive",
            perturbed=lambda G, w, Delta: G / (1 + w * G * Delta),
            system=lambda G, w, D: feedback(G, in_series(D, w)),
            deviation=lambda G_p, G: (G - G_p) / (G * G_p),
            scale=lambda center, absolute: 1 / (center - absolute) / center,
            largest=lambda center: center,
            a=lambda w, G, K, S: w * G,
            b=lambda w, G, K, S: w * G * S,
            relative=lambda w, size: w * size,
            read=("w", "G"),
            inverse=True,
            through=True,
            lead=-1,
            tames="",
            matlab="feedback(G, W * Delta)",
        ),
        Form(
            name="coprime",
            perturbed=lambda G, w, Delta: (G + tangent(w) * Delta) / (1 - np.conj(G) * tangent(w) * Delta),
            system=lambda G, w, D: other_plant(G, in_series(D, tangent_system(w))),
            deviation=lambda G_p, G: (G_p - G) / np.sqrt((1 + np.abs(G) ** 2) * (1 + np.abs(G_p) ** 2)),
            scale=lambda center, absolute: chord(absolute, center) / absolute,
            largest=lambda center: center + 1 / center,
            a=lambda w, G, K, S: -tangent(w) * np.conj(G),
            b=lambda w, G, K, S: tangent(w) * (K - np.conj(G)) * S,
            relative=None,
            read=("w", "N", "M"),
            inverse=True,
            through=False,
            lead=0,
            tames="",
            matlab="(N + W * [1 0] * Delta) / (M + W * [0 1] * Delta) / Ws",
            stays=lambda w, b: np.sqrt(np.abs(b) ** 2 * (1 - np.abs(w) ** 2) + np.abs(w) ** 2),
            grown=lambda w, x: x / np.sqrt(1 + (x**2 - 1) * np.abs(w) ** 2),
            turn=turned,
            scaled=True,
        ),
    )
}
#: Forms of a plant with several inputs and outputs; `model` says what they are.
AUTO = "auto"  # two forms at a time, of which a check may take the better
MATRIX_FORMS = ELEMENTS, ADDITIVE, INPUT = ("elements", "additive", "input")
#: The form that is meant where none is named.
RELATIVE = "multiplicative"


def of_one_channel(
    form: str, left: Sequence[control.StateSpace], right: Sequence[control.StateSpace], radius: Array
) -> dict[str, Any]:
    """Form, weight and radius of a set that has a form of several channels around a plant of one input and output."""
    if form not in MATRIX_FORMS or len(right) != 1 or len(left) != (form != ELEMENTS) or radius.ndim != 2:
        return {}
    weight = in_series(*right, *left) if left else right[0]
    return {"form": RELATIVE if form == INPUT else ADDITIVE, "weight": weight, "radius": np.prod(radius, axis=0)}


def relative(form: str, w: Array, size: Array) -> Array:
    """(W,) |w| as a relative deviation of the plant, or a refusal where the set is not one."""
    row = FORMS[form]
    if row.relative is None:
        raise ValueError(
            f"form must be a relative deviation of the plant here, got {form}. Take another form of the same "
            "measurement, or ncfsyn, and check with this one"
        )
    return row.relative(w, size)


def worst_terms(form: str, w: Array, G: Array, K: Array, W: Array | float = 1.0) -> tuple[Array, Array, Array]:
    """S, a and b of the perturbed sensitivity S_p = S (1 + a Delta)/(1 + b Delta), from responses; G scaled by W."""
    row = FORMS[form]
    with np.errstate(all="ignore"):
        S = 1 / (1 + G * K)
        G, K = (W * G, K / W) if row.scaled else (G, K)
        return S, row.a(w, G, K, S), row.b(w, G, K, S)


def numerator(form: str, w: Array, G: Array, W: Array | float = 1.0) -> Array:
    """(W,) g of G_p = (G + g Delta)/(1 + a Delta), from responses; of a G scaled by W the form, G and g themselves."""
    row, one = FORMS[form], np.ones_like(G)
    G, K = (W * G, one / W) if row.scaled else (G, one)
    return row.b(w, G, K, one) - row.a(w, G, K, one)  # b - a S = g K S, and no K is needed to tell it


def loop_discs(form: str, w: Array, G: Array, K: Array, W: Array | float = 1.0) -> tuple[Array, Array]:
    """Centre and radius of the disc that L fills over the set; nan where it is the outside of a disc instead."""
    row, L = FORMS[form], G * K
    G, K = (W * G, K / W) if row.scaled else (G, K)
    one = np.ones_like(L)
    a, q = row.a(w, G, K, one), row.b(w, G, K, one)  # with S = 1: b (1 + L)
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = 1 - np.abs(a) ** 2  # L_p = (L + (q - a) Delta)/(1 + a Delta)
        centre, radius = (L - (q - a) * np.conj(a)) / rest, np.abs((q - a) - a * L) / rest
    return np.where(rest > 0, centre, np.nan), np.where(rest > 0, radius, np.nan)
