"""The forms of uncertainty, one row each: the perturbed plant and its loop, for a perturbation of
gain one.

    form                    set of plants, |Delta| <= 1      S_p = S (1 + a Delta)/(1 + b Delta)
    multiplicative          G (1 + w Delta)                  a = 0      b = w T
    additive                G + w Delta                      a = 0      b = w K S
    inverse-multiplicative  G / (1 + w Delta)                a = w      b = w S
    inverse-additive        G / (1 + w G Delta)              a = w G    b = w G S
    coprime                 (G + t Delta)/(1 - G* t Delta)   a = -t G*  b = t (K - G*) S,  t = w / sqrt(1 - |w|^2)

(SP 7.4, 7.5 and 8.2.3. The last is (N + Delta_N)/(M + Delta_M), G = N/M normalised, |[Delta_N,
Delta_M]| <= |w|; for a scaled plant W G stands for G and K/W for K: SP 4.1.5, 9.4.1.) No other
module branches on the name of a form: every difference between forms is a field of its row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import control
import numpy as np

from nlfrf._base.arguments import inverse_unit
from nlfrf._base.values import value
from robust.lti.connections import feedback, in_parallel, in_series, inverse_system, one_plus
from robust.lti.lti import divide_right
from robust.models.sets.coprime import (
    chord,
    coprime_phase_offset,
    plant_of_perturbed_factors,
    tangent,
    tangent_system,
)

Array = np.ndarray

#: Classes of perturbation Delta.
PERTURBATIONS = ("LTI", "statistical", "operator")


@value
class Form:
    """One way in which Delta enters the plant; G, w, K, Delta below are (W,) responses unless
    stated otherwise.
    """

    name: str  # name in the interface
    perturbed: Callable[[Array, Array, Array], Array]  # complex the perturbed plant
    # the same as a system
    perturbed_system: Callable[
        [control.StateSpace, control.StateSpace, control.StateSpace], control.StateSpace
    ]
    deviation: Callable[[Array, Array], Array]  # complex the w Delta that turns G into G_p
    # factor from a radius in the plane of G to one in this form; center and absolute are |G| and
    # that radius
    radius_scale: Callable[[Array, Array], Array]
    radius_limit: Callable[
        [Array], Array
    ]  # radius in the plane of G at and above which the form has no radius
    # a, b: complex coefficients of S_p = S (1 + a Delta)/(1 + b Delta)
    a: Callable[[Array, Array, Array, Array], Array]
    b: Callable[[Array, Array, Array, Array], Array]
    # |w| as a relative deviation of the plant (inverse: of 1/plant), size = |G|; None if it is not
    # relative
    relative_weight: Callable[[Array, Array], Array] | None
    # factors of q = b (1 + L). N and M denote the coprime factors, whose q is not a product.
    rs_factors: tuple[str, ...]
    inverse: bool  # True if Delta is in the denominator: the set is unbounded where |w| reaches one
    vanishes_with_plant: bool  # True if the deviation is zero where G is zero
    # number of times that Delta acts before delay and hold of the plant while b includes them
    delay_order: int
    # the closed-loop function that w weighs, as `mixsyn` names its weights; "" if it is none of
    # them
    weighted_transfer: str
    matlab_expression: str  # expression for the uncertain plant in MATLAB's Robust Control Toolbox
    # the measure of robust stability from responses, as a Python expression (SP 7.5; coprime:
    # Vinnicombe)
    python_measure: str
    # measure of robust stability, proportional to |w|: stable if and only if it is below one
    rs_measure: Callable[[Array, Array], Array] = lambda w, b: np.abs(b)
    scale_for: Callable[[Array, Array], Array] = lambda w, x: (
        x
    )  # factor on w that scales a and b by a factor x
    # complex Delta of `perturbed` over Delta of `perturbed_system` at omega [rad/s], for the same
    # plant
    phase_offset: Callable[[control.StateSpace, control.StateSpace, float], complex] = (
        lambda G, w, omega: 1.0
    )
    # True if the set depends on the units of the plant, which is then scaled
    depends_on_units: bool = False

    def unit_of(self, unit: str) -> str:
        """Return the unit of a radius in this form, from that of the plant; empty if dimensionless
        or unknown.
        """
        two, one = (
            float(self.radius_scale(np.array([c]), np.array([c / 2]))[0]) for c in (4.0, 2.0)
        )
        power = 1 + round(np.log2(two / one))
        if power == 1:
            return unit
        if unit and power == -1:
            return inverse_unit(unit)
        return ""

    def radius_factor(self, omega: Array, absolute: Array, center: Array) -> Array:
        """Return (W,) the factor from an absolute radius to the radius in this form."""
        if self.vanishes_with_plant and np.any(center == 0):
            raise ValueError(
                f"nominal must not vanish on a line for the {self.name} form, got zero"
            )
        with np.errstate(divide="ignore"):
            used = absolute / self.radius_limit(center)
        if np.any(used >= 1):
            k = int(np.argmax(used))
            limit = "|G| + 1/|G| of the scaled plant" if self.depends_on_units else "|G|"
            raise ValueError(
                f"form must be multiplicative or additive if the radius reaches {limit}, got"
                f" {self.name} with a radius of {absolute[k] / center[k]:.3g} |G| at"
                f" {omega[k] / 2 / np.pi:.4g} Hz"
            )
        return self.radius_scale(center, absolute)

    def gains(self, w: Array, size: Array) -> tuple[Array, Array]:
        """Return the least and the largest |G_p| over the set, from |w| and |G|."""
        if self.relative_weight is None:  # on the Riemann sphere angles add up
            angle, away = np.arctan(size), np.arcsin(np.minimum(w, 1))
            high = np.minimum(angle + away, np.pi / 2)
            return np.tan(np.maximum(angle - away, 0)), np.where(
                high < np.pi / 2, np.tan(high), np.inf
            )
        w = self.relative_weight(w, size)
        if not self.inverse:
            return size - size * w, size + size * w
        return size / (1 + w), np.where(w < 1, size / np.abs(1 - w), np.inf)


def _no_radius_limit(center: Array) -> Array:
    """Return an infinite limit (W,): every disc has a radius in the form."""
    return np.full(center.shape, np.inf)


#: Name -> row.
FORMS = {
    form.name: form
    for form in (
        Form(
            name="multiplicative",
            perturbed=lambda G, w, Delta: G * (1 + w * Delta),
            perturbed_system=lambda G, w, D: in_series(one_plus(in_series(D, w)), G),
            deviation=lambda G_p, G: (G_p - G) / G,
            radius_scale=lambda center, absolute: 1 / center,
            radius_limit=_no_radius_limit,
            a=lambda w, G, K, S: np.zeros_like(S),
            b=lambda w, G, K, S: w * G * K * S,
            relative_weight=lambda w, size: w,
            rs_factors=("w", "G", "K"),
            inverse=False,
            vanishes_with_plant=True,
            delay_order=0,
            weighted_transfer="w_T",
            matlab_expression="G * (1 + W * Delta)",
            python_measure="abs(W * G * K / (1 + G * K))",
        ),
        Form(
            name="additive",
            perturbed=lambda G, w, Delta: G + w * Delta,
            perturbed_system=lambda G, w, D: in_parallel(G, in_series(D, w)),
            deviation=lambda G_p, G: G_p - G,
            radius_scale=lambda center, absolute: np.ones(center.size),
            radius_limit=_no_radius_limit,
            a=lambda w, G, K, S: np.zeros_like(S),
            b=lambda w, G, K, S: w * K * S,
            relative_weight=lambda w, size: w / np.maximum(size, 1e-300),
            rs_factors=("w", "K"),
            inverse=False,
            vanishes_with_plant=False,
            delay_order=1,
            weighted_transfer="w_u",
            matlab_expression="G + W * Delta",
            python_measure="abs(W * K / (1 + G * K))",
        ),
        Form(
            name="inverse-multiplicative",
            perturbed=lambda G, w, Delta: G / (1 + w * Delta),
            perturbed_system=lambda G, w, D: in_series(
                inverse_system(one_plus(in_series(D, w))), G
            ),
            deviation=lambda G_p, G: (G - G_p) / G_p,
            radius_scale=lambda center, absolute: 1 / (center - absolute),
            radius_limit=lambda center: center,
            a=lambda w, G, K, S: w + 0 * S,
            b=lambda w, G, K, S: w * S,
            relative_weight=lambda w, size: w,
            rs_factors=("w",),
            inverse=True,
            vanishes_with_plant=True,
            delay_order=0,
            weighted_transfer="w_P",
            matlab_expression="G * feedback(1, W * Delta)",
            python_measure="abs(W / (1 + G * K))",
        ),
        Form(
            name="inverse-additive",
            perturbed=lambda G, w, Delta: G / (1 + w * G * Delta),
            perturbed_system=lambda G, w, D: feedback(G, in_series(D, w)),
            deviation=lambda G_p, G: (G - G_p) / (G * G_p),
            radius_scale=lambda center, absolute: 1 / (center - absolute) / center,
            radius_limit=lambda center: center,
            a=lambda w, G, K, S: w * G,
            b=lambda w, G, K, S: w * G * S,
            relative_weight=lambda w, size: w * size,
            rs_factors=("w", "G"),
            inverse=True,
            vanishes_with_plant=True,
            delay_order=-1,
            weighted_transfer="",
            matlab_expression="feedback(G, W * Delta)",
            python_measure="abs(W * G / (1 + G * K))",
        ),
        Form(
            name="coprime",
            perturbed=lambda G, w, Delta: (
                (G + tangent(w) * Delta) / (1 - np.conj(G) * tangent(w) * Delta)
            ),
            perturbed_system=lambda G, w, D: plant_of_perturbed_factors(
                G, in_series(D, tangent_system(w))
            ),
            deviation=lambda G_p, G: (
                (G_p - G) / np.sqrt((1 + np.abs(G) ** 2) * (1 + np.abs(G_p) ** 2))
            ),
            radius_scale=lambda center, absolute: chord(absolute, center) / absolute,
            radius_limit=lambda center: center + 1 / center,
            a=lambda w, G, K, S: -tangent(w) * np.conj(G),
            b=lambda w, G, K, S: tangent(w) * (K - np.conj(G)) * S,
            relative_weight=None,
            rs_factors=("w", "N", "M"),
            inverse=True,
            vanishes_with_plant=False,
            delay_order=0,
            weighted_transfer="",
            matlab_expression="(N + W * [1 0] * Delta) / (M + W * [0 1] * Delta) / Ws",
            python_measure=(
                "abs(W / (1 + G * K)) * np.hypot(1, abs(Ws * G)) * np.hypot(1, abs(K / Ws))"
            ),
            rs_measure=lambda w, b: np.sqrt(np.abs(b) ** 2 * (1 - np.abs(w) ** 2) + np.abs(w) ** 2),
            scale_for=lambda w, x: x / np.sqrt(1 + (x**2 - 1) * np.abs(w) ** 2),
            phase_offset=coprime_phase_offset,
            depends_on_units=True,
        ),
    )
}


# ---- Forms for a plant with several inputs and outputs; matrices G, G_p, S, T below are (..., n,
# n) responses.


@value
class MatrixForm:
    """One way in which W_l Delta W_r, a full block, enters a plant with several channels."""

    name: str  # name in the interface
    # reads, acts: the signals that W_r reads and on which W_l Delta acts: those of the plant input
    # or of the plant output
    reads: str
    acts: str
    # True if Delta closes a loop: its output is subtracted from a signal that W_r reads behind that
    # place
    inverse: bool
    deviation: Callable[[Array, Array], Array]
    weighed: Callable[[Array, Array, Array], Array]
    one_channel: str  # the corresponding form for one channel
    matlab_expression: str  # expression for the uncertain plant in MATLAB's Robust Control Toolbox
    python_measure: (
        str  # the response between W_l and W_r in the loop, as a Python expression (SP 8.6)
    )

    @property
    def needs_square_plant(self) -> bool:
        """Return True if the deviation includes the inverse of a plant."""
        return (self.reads, self.acts, self.inverse) != ("u", "y", False)

    @property
    def factors(self) -> tuple[str, str]:
        """Return L and R of E = L W_l Delta W_r R, the difference of plant G_p and nominal G: "",
        "G" or "G_p".
        """
        left = right = ""
        if self.acts == "u":
            left = "G_p" if self.inverse else "G"
        if self.reads == "y":
            right = "G_p" if self.inverse and not left else "G"
        return left, right


#: Name -> row, for the forms with a full block (SP 8.2.3).
BLOCK_FORMS = {
    form.name: form
    for form in (
        MatrixForm(
            name="additive",
            reads="u",
            acts="y",
            inverse=False,
            deviation=lambda G_p, G: G_p - G,
            weighed=lambda G, S, T: np.linalg.pinv(G) @ T,
            one_channel="additive",
            matlab_expression="G + Wl * Delta * Wr",
            python_measure="K @ S",
        ),
        MatrixForm(
            name="input",
            reads="u",
            acts="u",
            inverse=False,
            deviation=lambda G_p, G: np.linalg.solve(G, G_p - G),
            weighed=lambda G, S, T: T,
            one_channel="multiplicative",
            matlab_expression="G * (eye(nu) + Wl * Delta * Wr)",
            python_measure="K @ S @ G",
        ),
        MatrixForm(
            name="output",
            reads="y",
            acts="y",
            inverse=False,
            deviation=lambda G_p, G: divide_right(G_p - G, G),
            weighed=lambda G, S, T: T,
            one_channel="multiplicative",
            matlab_expression="(eye(ny) + Wl * Delta * Wr) * G",
            python_measure="G @ K @ S",
        ),
        MatrixForm(
            name="inverse-additive",
            reads="y",
            acts="u",
            inverse=True,
            deviation=lambda G_p, G: divide_right(np.linalg.solve(G_p, G - G_p), G),
            weighed=lambda G, S, T: S @ G,
            one_channel="inverse-additive",
            matlab_expression="feedback(G, Wl * Delta * Wr)",
            python_measure="S @ G",
        ),
        MatrixForm(
            name="inverse-input",
            reads="u",
            acts="u",
            inverse=True,
            deviation=lambda G_p, G: np.linalg.solve(G_p, G - G_p),
            weighed=lambda G, S, T: S,
            one_channel="inverse-multiplicative",
            matlab_expression="G * feedback(eye(nu), Wl * Delta * Wr)",
            python_measure="np.eye(len(K)) - K @ S @ G",
        ),
        MatrixForm(
            name="inverse-output",
            reads="y",
            acts="y",
            inverse=True,
            deviation=lambda G_p, G: divide_right(G - G_p, G_p),
            weighed=lambda G, S, T: S,
            one_channel="inverse-multiplicative",
            matlab_expression="feedback(eye(ny), Wl * Delta * Wr) * G",
            python_measure="S",
        ),
    )
}
AUTO = "auto"  # several forms, of which a check or the measure of `choose_form` selects one later
ELEMENTS, ADDITIVE, INPUT = "elements", "additive", "input"
#: Forms of sets, and those among them for sets made from records.
MATRIX_FORMS, RECORD_FORMS = (ELEMENTS, *BLOCK_FORMS), (ELEMENTS, ADDITIVE, INPUT)
#: Default form.
DEFAULT_FORM = "multiplicative"


def reduce_to_one_channel(
    form: str,
    left: Sequence[control.StateSpace],
    *,
    right: Sequence[control.StateSpace],
    radius: Array,
) -> dict[str, str | control.StateSpace | Array]:
    """Return form, weight and radius for one channel, from a set in a matrix form around a plant
    with one channel.
    """
    if (
        form not in MATRIX_FORMS
        or len(right) != 1
        or len(left) != (form != ELEMENTS)
        or radius.ndim != 2
    ):
        return {}
    if left:
        weight = in_series(*right, *left)
    else:
        weight = right[0]
    one = ADDITIVE if form == ELEMENTS else BLOCK_FORMS[form].one_channel
    return {"form": one, "weight": weight, "radius": np.prod(radius, axis=0)}


def relative_radius(form: str, w: Array, size: Array) -> Array:
    """Return (W,) |w| as a relative deviation of the plant; refuse a set of another kind."""
    row = FORMS[form]
    if row.relative_weight is None:
        raise ValueError(
            f"form must be a relative deviation of the plant here, got {form}. Design with another"
            " form of the same measurement, or with ncfsyn, and check with this form"
        )
    return row.relative_weight(w, size)


def perturbed_sensitivity_terms(
    form: str, w: Array, *, G: Array, K: Array, W: Array | float = 1.0
) -> tuple[Array, Array, Array]:
    """Return S, a, b of S_p = S (1 + a Delta)/(1 + b Delta), from responses."""
    row = FORMS[form]
    with np.errstate(all="ignore"):
        S = 1 / (1 + G * K)
        if row.depends_on_units:
            G, K = W * G, K / W
        else:
            G, K = G, K
        return S, row.a(w, G, K, S), row.b(w, G, K, S)


def plant_numerator(form: str, w: Array, *, G: Array, W: Array | float = 1.0) -> Array:
    """Return (W,) g of G_p = (G + g Delta)/(1 + a Delta), from responses; G is scaled by W if the
    form is.
    """
    row, one = FORMS[form], np.ones_like(G)
    if row.depends_on_units:
        G, K = W * G, one / W
    else:
        G, K = G, one
    return row.b(w, G, K, one) - row.a(w, G, K, one)  # b - a S = g K S holds for every K


def loop_discs(
    form: str, w: Array, *, G: Array, K: Array, W: Array | float = 1.0
) -> tuple[Array, Array]:
    """Return centre and radius of the disc that L fills over the set; nan if it fills the outside
    of a disc.
    """
    row, L = FORMS[form], G * K
    if row.depends_on_units:
        G, K = W * G, K / W
    else:
        G, K = G, K
    one = np.ones_like(L)
    a, q = row.a(w, G, K, one), row.b(w, G, K, one)  # with S = 1: b (1 + L)
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = 1 - np.abs(a) ** 2  # L_p = (L + (q - a) Delta)/(1 + a Delta)
        centre, radius = (L - (q - a) * np.conj(a)) / rest, np.abs((q - a) - a * L) / rest
    return np.where(rest > 0, centre, np.nan), np.where(rest > 0, radius, np.nan)
