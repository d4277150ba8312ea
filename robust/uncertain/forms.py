"""The forms of uncertainty, one row each: what a perturbation of gain one makes of a plant and of its loop.

    form                    set of plants, |Delta| <= 1      S_p = S (1 + a Delta)/(1 + b Delta)
    multiplicative          G (1 + w Delta)                  a = 0      b = w T
    additive                G + w Delta                      a = 0      b = w K S
    inverse-multiplicative  G / (1 + w Delta)                a = w      b = w S
    inverse-additive        G / (1 + w G Delta)              a = w G    b = w G S

(SP 7.4, 7.5 and 8.2.3.) Nothing outside this room asks for the name of a form: whatever differs between forms is a
field of its row.
"""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np

from nlfrf.shared.values import value
from robust.systems.connections import feedback, in_parallel, in_series, inverse, one_plus

__all__ = [
    "ADDITIVE",
    "ELEMENTS",
    "FORMS",
    "INPUT",
    "MATRIX_FORMS",
    "PERTURBATIONS",
    "RELATIVE",
    "Form",
    "loop_discs",
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
    system : (G, X) -> control.StateSpace
        The same as a system, X = w Delta.
    deviation : (G_p, G) -> (W,) complex
        w Delta that turns G into G_p.
    scale : (center, absolute) -> (W,)
        Factor from a radius in the plane of G to one of the form; center and absolute are |G| and that radius.
    a, b : (w, G, K, S) -> (W,) complex
        Of S_p = S (1 + a Delta)/(1 + b Delta).
    spread : (w, G, K) -> (W,) complex
        What |L_p - L| is of (inverse: of |L_p - L| / |L_p|).
    relative : (w, size) -> (W,)
        |w| as a relative deviation of the plant, size = |G|.
    ports : (str, str)
        Where Delta reads and where it acts in the loop of `systems.closed_loop`.
    read, beside : tuple of str
        Factors of q = b (1 + L), and what q is to be divided by for q / L: the parts of a proof along the axis.
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
    """

    name: str
    perturbed: Callable[[Array, Array, Array], Array]
    system: Callable[[control.StateSpace, control.StateSpace], control.StateSpace]
    deviation: Callable[[Array, Array], Array]
    scale: Callable[[Array, Array], Array]
    a: Callable[[Array, Array, Array, Array], Array]
    b: Callable[[Array, Array, Array, Array], Array]
    spread: Callable[[Array, Array, Array], Array]
    relative: Callable[[Array, Array], Array]
    ports: tuple[str, str]
    read: tuple[str, ...]
    beside: tuple[str, ...]
    inverse: bool
    through: bool
    lead: int
    tames: str
    matlab: str

    def radius_factor(self, omega: Array, absolute: Array, center: Array) -> Array:
        """(W,) factor from an absolute radius to the radius of the form, or a refusal where there is none."""
        if self.through and np.any(center == 0):
            raise ValueError(f"nominal must not vanish on a line for the {self.name} form, got zero")
        if self.inverse and np.any(absolute >= center):
            k = int(np.argmax(absolute / center))
            raise ValueError(
                f"form must be multiplicative or additive where the radius reaches |G|, got {self.name} with a radius "
                f"of {absolute[k] / center[k]:.3g} |G| at {omega[k] / 2 / np.pi:.4g} Hz"
            )
        return self.scale(center, absolute)

    def gains(self, w: Array, size: Array) -> tuple[Array, Array]:
        """Least and largest |G_p| over the set, from |w| and |G|."""
        if not self.inverse:
            away = self.spread(w, size, np.ones(size.shape))
            return size - away, size + away
        w = self.relative(w, size)
        return size / (1 + w), np.where(w < 1, size / np.abs(1 - w), np.inf)


#: Name -> row.
FORMS = {
    form.name: form
    for form in (
        Form(
            name="multiplicative",
            perturbed=lambda G, w, Delta: G * (1 + w * Delta),
            system=lambda G, X: in_series(one_plus(X), G),
            deviation=lambda G_p, G: (G_p - G) / G,
            scale=lambda center, absolute: 1 / center,
            a=lambda w, G, K, S: np.zeros_like(S),
            b=lambda w, G, K, S: w * G * K * S,
            spread=lambda w, G, K: w * (G * K),
            relative=lambda w, size: w,
            ports=("u", "p_in"),
            read=("w", "G", "K"),
            beside=(),
            inverse=False,
            through=True,
            lead=0,
            tames="w_T",
            matlab="G * (1 + W * Delta)",
        ),
        Form(
            name="additive",
            perturbed=lambda G, w, Delta: G + w * Delta,
            system=in_parallel,
            deviation=lambda G_p, G: G_p - G,
            scale=lambda center, absolute: np.ones(center.size),
            a=lambda w, G, K, S: np.zeros_like(S),
            b=lambda w, G, K, S: w * K * S,
            spread=lambda w, G, K: w * K,
            relative=lambda w, size: w / np.maximum(size, 1e-300),
            ports=("u", "p_out"),
            read=("w", "K"),
            beside=("G",),
            inverse=False,
            through=False,
            lead=1,
            tames="w_u",
            matlab="G + W * Delta",
        ),
        Form(
            name="inverse-multiplicative",
            perturbed=lambda G, w, Delta: G / (1 + w * Delta),
            system=lambda G, X: in_series(inverse(one_plus(X)), G),
            deviation=lambda G_p, G: (G - G_p) / G_p,
            scale=lambda center, absolute: 1 / (center - absolute),
            a=lambda w, G, K, S: w + 0 * S,
            b=lambda w, G, K, S: w * S,
            spread=lambda w, G, K: w,
            relative=lambda w, size: w,
            ports=("y", "p_out"),
            read=("w",),
            beside=("G", "K"),
            inverse=True,
            through=True,
            lead=0,
            tames="w_P",
            matlab="G * feedback(1, W * Delta)",
        ),
        Form(
            name="inverse-additive",
            perturbed=lambda G, w, Delta: G / (1 + w * G * Delta),
            system=feedback,
            deviation=lambda G_p, G: (G - G_p) / (G * G_p),
            scale=lambda center, absolute: 1 / (center - absolute) / center,
            a=lambda w, G, K, S: w * G,
            b=lambda w, G, K, S: w * G * S,
            spread=lambda w, G, K: w * G,
            relative=lambda w, size: w * size,
            ports=("y", "p_in"),
            read=("w", "G"),
            beside=("K",),
            inverse=True,
            through=True,
            lead=-1,
            tames="",
            matlab="feedback(G, W * Delta)",
        ),
    )
}
#: Forms of a plant with several inputs and outputs; `matrix_model` says what they are.
MATRIX_FORMS = ELEMENTS, ADDITIVE, INPUT = ("elements", "additive", "input")
#: The form that is meant where none is named.
RELATIVE = "multiplicative"


def worst_terms(form: str, w: Array, G: Array, K: Array) -> tuple[Array, Array, Array]:
    """S, a and b of the perturbed sensitivity S_p = S (1 + a Delta)/(1 + b Delta), from responses."""
    row = FORMS[form]
    with np.errstate(all="ignore"):
        S = 1 / (1 + G * K)
        return S, row.a(w, G, K, S), row.b(w, G, K, S)


def loop_discs(form: str, w: Array, G: Array, K: Array) -> tuple[Array, Array]:
    """Centre and radius of the disc that L fills over the set; nan where it is the outside of a disc instead."""
    row, L = FORMS[form], G * K
    spread = np.abs(row.spread(w, G, K))
    if not row.inverse:
        return L, spread
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = spread < 1
        centre, radius = L / (1 - spread**2), np.abs(L) * spread / (1 - spread**2)
    return np.where(inside, centre, np.nan), np.where(inside, radius, np.nan)
