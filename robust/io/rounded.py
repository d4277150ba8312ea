"""A sampled controller as statements in the arithmetic of its target, with bounds on the rounding.

A section is written in powers of q = z - 1, or of q = z if all its roots are nearer to 0. With x
its input:

    y  := b0 x + s1                        (b0 q^2 + b1 q + b2) / (q^2 + a1 q + a2)
    s1 := b1 x - a1 y + s2 (+ s1)          the old s1 and s2 in brackets are added for q = z - 1
    s2 := b2 x - a2 y (+ s2)

A slow pole has a small q. The coefficients in powers of q represent it accurately, while in powers
of z the distance of the pole from 1 is a difference of numbers near 2 (Middleton & Goodwin 1990). A
balanced state space is worse in single precision. For 49 random controllers of orders 1 to 20 its
rounded coefficients changed K by 9 times as much (median; up to 2e7). The rounding of its
operations changed u by 0.95 times as much (median), with n^2 products per step.

A single pole at z = 1 is split off by partial fractions. Its sum is compensated (Kahan 1965),
because single precision would otherwise lose increments below 6e-8 of the integral.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eig, null_space

from nlfrf._base.arguments import (
    data_warning,
    require_choice,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.values import ArrayField, value
from robust._base.types import Controller, SystemField
from robust._base.warnings import DesignWarning
from robust.io.biquads import comparison_angles, group_roots, roots_and_gain
from robust.lti.connections import in_parallel
from robust.lti.lti import poles, response, scale_states, timebase, with_names, zeros
from robust.lti.realisation import multivariable

_INTEGRATOR_TOLERANCES = (
    1e-10,
    1e-7,
)  # |z - 1| of one pole at 1, and of two: they come out with a distance of 1e-8
_LARGEST_ERROR = 1e-3  # error over |K| before rounding, above which the roots are not those of K
_NEGLIGIBLE_GAIN = 1e-6  # share of the median |K|, the least unit for errors
NOTABLE_ERROR = 0.01  # of |K| by rounding, or of the largest output, above which there is a warning


class Statement(NamedTuple):
    """A sum of products, added from left to right: target := c1 name1 + c2 name2 + ...

    In a schedule a factor may be the name of a `Polynomial`.
    """

    target: str
    terms: tuple[tuple[Any, str], ...]


class Polynomial(NamedTuple):
    """A coefficient of a schedule, lowest power of theta first, evaluated by Horner's rule."""

    target: str
    coefficients: tuple[float, ...]


@value
class RoundedController:
    """A controller in the floating-point arithmetic of its target, with bounds on the effect of
    rounding.

    Fields
    ------
    K : control.StateSpace or LpvModel
        The controller with the rounded coefficients, for `check`; or for `prove_schedule`, if it is
        scheduled. Its matrices are computed from these coefficients and rounded to float64.
    dtype : str
        "float32" or "float64".
    before, after : tuple of Statement, Polynomial
        Statements of the code: from the error e to the unlimited output v, and those after v has
        been limited to u.
    limit : (2,) ndarray
        Smallest and largest u; infinite without a limit.
    coefficient_error : float
        Largest relative error |dK|/|K| over frequency caused by rounded coefficients.
    gain : float
        l1 norm from e to u, which is the largest |u| for |e| <= 1. A pole that the code treats
        separately is not counted: an integrator, and with a limit also the slowest real lag. nan
        for a scheduled controller.
    rounding : float
        Bound on the error of u by rounding in all operations, divided by the largest |e|. It is the
        sum of the l1 norms from each operation to u. The poles that `gain` leaves out are left out
        here, too. Infinite if any other pole lies on or outside the unit circle; nan for a
        scheduled controller.
    facts : tuple of str
        These numbers with their conditions, as text.
    theta : (middle, scale) or None
        For a scheduled controller: theta = scale (p - middle), limited to [-1, 1], is the variable
        of its polynomials, with the operating point p.

    References
    ----------
    R. H. Middleton, G. C. Goodwin, *Digital Control and Estimation*, 1990, 5 (delta operator). K.
    J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 3.5 (anti-windup), 9.6
    (word length). W. Kahan, Further remarks on reducing truncation errors, *Comm. ACM* 8, 1965.

    Examples
    --------
    >>> import robust
    >>> rounded = round_controller(robust.shaping.pid(2.0, 3.0, dt=1e-3), dtype="float32")
    >>> rounded.K.poles().real.tolist(), round(rounded.gain, 4)
    ([1.0], 2.0015)
    """

    K: SystemField
    dtype: str
    before: tuple[Statement | Polynomial, ...]
    after: tuple[Statement, ...]
    limit: ArrayField
    coefficient_error: float
    gain: float
    rounding: float
    facts: tuple[str, ...]
    theta: tuple[float, float] | None = None

    @property
    def states(self) -> list[str]:
        """Return the names of the states; all states are zero at the start."""
        sections = [row.target for row in self.before if row.target[0] == "s"]
        if self.after:
            return [*sections, "integral", "carry"]
        return sections

    def __str__(self) -> str:
        return "\n".join(self.facts)


def round_controller(
    K: Controller, *, dtype: str, limit: ArrayLike | None = None
) -> RoundedController:
    """Return a sampled controller for one loop as statements with rounded coefficients, and bounds
    of their rounding.

    dtype : "float32" or "float64"; limit : a number, for -limit to limit, or (least, largest).
    """
    K, bounds = multivariable("K", K), _require_limit(limit)
    kind = np.dtype(require_choice("dtype", dtype, ("float32", "float64"))).type
    limited, unit = bool(np.isfinite(bounds).any()), float(np.finfo(kind).eps) / 2
    _require_one_sampled_loop(K)
    rest, gain, pole = _split_slowest(K, limited=limited)
    z, p, scale = roots_and_gain(rest)
    groups = group_roots(z, np.where(_are_integrators(p), 0.0, p)) or [((), ())]
    error, omega = largest_error(K, _realise(K, _chain(groups, scale), gain, pole))
    if not error <= _LARGEST_ERROR:
        raise ValueError(
            f"K must be accurate as second-order sections, got an error of {error:.2g} of |K|"
            f" at {omega:.3g} rad/s: lower its order with robust.reduce_controller"
        )
    if limited and gain:
        tracking = _tracking_gain(rest, gain, pole)
    else:
        tracking = 0.0
    chain = [
        _round_statement(row, kind) for row in _chain(_order_sections(groups, scale, unit), scale)
    ]
    if gain:
        after = [_round_statement(row, kind) for row in _integral(gain, pole, tracking)]
    else:
        after = []
    found = _realise(K, chain, float(kind(gain)), float(kind(pole)))
    (error, omega), (total, noise) = largest_error(K, found), _bound_rounding(chain, unit)
    if np.isfinite(noise) and total:
        share = noise / total
    else:
        share = 0.0
    if not max(error, share) <= NOTABLE_ERROR:
        data_warning(
            f"K changes by up to {error:.2g} of |K| with coefficients in {dtype}, and u by up to"
            f" {share:.2g} of its largest value by rounded operations"
            + ": use dtype='float64'"
            * (dtype == "float32"),
            DesignWarning,
        )
    outside = " outside the integral" * bool(gain)
    facts = [
        (
            f"sections: {len(groups)}, in powers of z - 1 (of z if all roots are nearer to 0),"
            " which keeps the digits of slow poles; in the order with the least bound of rounding"
        ),
        (
            f"coefficients in {dtype} change |K| by at most {error:.2g} of itself, at"
            f" {omega / 2 / np.pi:.4g} Hz"
        ),
        (
            f"operations in {dtype} move u by at most {noise:.2g} max|e|{outside}, {share:.2g} of"
            " the largest u that such an e makes there (l1 norms from each operation to u)"
            if np.isfinite(noise)
            else (
                "rounded operations have no bound for K alone: it has a pole on or outside the unit"
                " circle"
            )
        ),
        (
            f"quantisation: an error q of e moves u by at most {total:.4g} q{outside} (l1 norm), an"
            " error q of u by q"
        ),
    ]
    if gain:
        facts.append(
            "integral: split off by partial fractions, its sum compensated; its rounding acts like"
            f" an error of e of at most {(8 if pole else 4) * unit:.2g} max|e|"
        )
    if limited:
        facts.append(
            f"limit: u from {bounds[0]:.9g} to {bounds[1]:.9g}. Nothing is proved after u reaches"
            " it. "
            + (
                f"The integral follows in {timebase(K) / tracking:.4g} s (anti-windup by"
                " back-calculation)"
                if tracking
                else "K does not integrate: no anti-windup"
            )
        )
    last = Statement("v", (*chain[-1].terms, *([(1.0, "integral")] if gain else [])))
    return RoundedController(
        K=found,
        dtype=dtype,
        before=(*chain[:-1], last),
        after=tuple(after),
        limit=bounds,
        coefficient_error=error,
        gain=total,
        rounding=noise,
        facts=tuple(facts),
    )


def _require_limit(limit: ArrayLike | None) -> np.ndarray:
    """Return the least and largest output, infinite without a limit; refuse others, and a range
    without u = 0, at which K is at rest.
    """
    if limit is None:
        return np.array([-np.inf, np.inf])
    if np.size(limit) == 1:
        largest = require_positive("limit", np.ravel(limit)[0])
        return np.array([-largest, largest])
    bounds = require_real_array("limit", limit, ndim=1)
    if bounds.size != 2 or not bounds[0] < bounds[1]:
        raise ValueError(
            "limit must be a positive number, or the least and the largest u, got"
            f" {short_form(limit)}"
        )
    if not bounds[0] <= 0 <= bounds[1]:
        raise ValueError(
            f"limit must include u = 0, which K gives at rest, got {bounds[0]:g} to {bounds[1]:g}:"
            " subtract the output at the operating point, and add it behind K"
        )
    return bounds


def _require_one_sampled_loop(K: control.StateSpace) -> None:
    """Refuse a controller for several channels, and a continuous one."""
    if (K.ninputs, K.noutputs) != (1, 1):
        raise ValueError(
            f"K must have one input and one output to be written as code, got {K.ninputs} and"
            f" {K.noutputs}: write each loop of a diagonal K, such as K[0, 0], into its own file"
        )
    if not timebase(K):
        raise ValueError(
            "K must be discrete to be written as code, got a continuous controller: use"
            " robust.lti.discretize(K, dt)"
        )


def _split_slowest(
    K: control.StateSpace, *, limited: bool
) -> tuple[control.StateSpace, float, float]:
    """Return R, g and q of K = R + g/(z - 1 - q) for a single integrator, q = 0; g = 0 if nothing
    is split off.

    With a limit also the real lag with most of the gain at zero frequency: it winds up like an
    integrator.
    """
    if K.nstates:
        A, B, C = scale_states(K.A, K.B, K.C)
    else:
        A, B, C = K.A, K.B, K.C
    whole = control.StateSpace(A, B, C, K.D, K.dt, remove_useless_states=False), 0.0, 0.0
    if K.nstates:
        offsets, left, right = eig(A - np.eye(len(A)), left=True, right=True)
    else:
        offsets, left, right = np.zeros(0), A, A
    n_integrators = int(_are_integrators(offsets).sum())
    real = np.flatnonzero(
        (offsets.imag == 0)
        & (offsets.real > -0.5)
        & (_are_integrators(offsets) | (offsets.real < 0))
    )
    if n_integrators > 1 and limited:
        raise ValueError(
            "limit must be left out for a controller with more than one integrator, got"
            f" {n_integrators} integrators"
        )
    if n_integrators > 1 or not real.size:
        return whole
    k = real[np.argmin(np.abs(offsets[real]))]
    w, v = left[:, k].real, right[:, k].real
    # the other modes, and B of this one
    V = null_space(w[None])
    mode = np.outer(v, w @ B) / (w @ v)
    rest = control.StateSpace(
        V.T @ A @ V, V.T @ (B - mode), C @ V, K.D, K.dt, remove_useless_states=False
    )
    gain, pole = float((C @ mode)[0, 0]), 0.0 if n_integrators else float(offsets[k].real)
    dominates = not pole or (limited and abs(gain / pole) > 2 * abs(_static_gain(rest)))
    if dominates:
        return rest, gain, pole
    return whole


def _are_integrators(offsets: np.ndarray) -> np.ndarray:
    """Return (n,) True for poles, given minus one, that are at one except for rounding."""
    one, two = (np.abs(offsets) < tolerance for tolerance in _INTEGRATOR_TOLERANCES)
    if two.sum() > 1:
        return two
    return one


def _static_gain(system: control.StateSpace) -> float:
    return float(response(system, np.zeros(1))[0].real)


def _tracking_gain(rest: control.StateSpace, gain: float, pole: float) -> float:
    """Return the share of the excess that the integral takes back in one step.

    It puts the pole of the limited controller at the zero of g/(z - 1 - q) + R(1): for a PI, the
    tracking time is Ti. A zero that is negative or unstable is replaced by z = 0.
    """
    static = _static_gain(rest)
    if static:
        ratio = gain / static
    else:
        ratio = np.inf
    if 0 < ratio < 1 + pole:
        return ratio
    return 1 + pole


def _chain(
    groups: list[tuple[tuple[complex, ...], tuple[complex, ...]]], gain: float
) -> list[Statement]:
    """Return the statements of sections in series, from e to v, for zeros and poles minus one; the
    gain comes first.
    """
    rows: list[Statement] = []
    x, n = "e", 0
    for k, (above, below) in enumerate(groups, 1):
        origin = 1.0 if max(np.real([*above, *below]), default=-1.0) > -0.5 else 0.0
        top, a = (
            np.atleast_1d(np.poly(np.array(roots) + 1 - origin).real) for roots in (above, below)
        )
        b = np.append(np.zeros(a.size - top.size), top) * (gain if k == 1 else 1.0)
        y, states = f"y{k}", [f"s{n + j}" for j in range(1, a.size)]
        rows.append(Statement(y, ((b[0], x), *((1.0, name) for name in states[:1]))))
        for j, name in enumerate(states, 1):
            # the old value last: the sum before it is small for a slow pole
            kept = [*states[j : j + 1], *([name] if origin else [])]
            rows.append(Statement(name, ((b[j], x), (-a[j], y), *((1.0, other) for other in kept))))
        x, n = y, n + len(states)
    return [*rows, Statement("v", ((1.0, x),))]


def _integral(gain: float, pole: float, tracking: float) -> list[Statement]:
    """Return the statements of the integral: the part lost when it grows by `change` is carried to
    the next step.
    """
    terms = ((gain, "e"), (pole, "integral"), (tracking, "excess"), (1.0, "carry"))
    return [
        *([Statement("excess", ((1.0, "u"), (-1.0, "v")))] if tracking else []),
        Statement("change", terms),
        Statement("total", ((1.0, "integral"), (1.0, "change"))),
        Statement("added", ((1.0, "total"), (-1.0, "integral"))),
        Statement("carry", ((1.0, "change"), (-1.0, "added"))),
        Statement("integral", ((1.0, "total"),)),
    ]


def _round_statement(statement: Statement, kind: type[np.floating]) -> Statement:
    """Return a statement with rounded coefficients, without terms that are zero."""
    require_representable(np.array([number for number, _ in statement.terms]), kind)
    terms = [(float(kind(number)), name) for number, name in statement.terms]
    return Statement(
        statement.target,
        tuple(term for term in terms if term[0]) or ((0.0, statement.terms[0][1]),),
    )


def require_representable(numbers: np.ndarray, kind: type[np.floating]) -> None:
    """Refuse coefficients that are too large for a type."""
    largest, limit = float(np.abs(numbers).max(initial=0.0)), float(np.finfo(kind).max)
    if not largest <= limit:
        raise ValueError(
            f"K must have coefficients of at most {limit:.2g} in {np.dtype(kind)}, got"
            f" {largest:.3g}"
        )


def _propagate(chain: list[Statement]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the new states and v, one row each, over (old states, e, an error of each statement);
    their terms.
    """
    states = [row.target for row in chain if row.target[0] == "s"]
    unit = np.eye(len(states) + 1 + len(chain))
    rows = dict(zip((*states, "e"), unit, strict=False))
    read = []
    for (target, terms), error in zip(chain, unit[len(states) + 1 :], strict=True):
        read.append(np.array([rows[name] for _, name in terms]))
        rows[target] = np.array([number for number, _ in terms]) @ read[-1] + error
    return np.array([rows[name] for name in (*states, "v")]), read


def _realise(
    K: control.StateSpace, chain: list[Statement], gain: float, pole: float
) -> control.StateSpace:
    """Return the controller of the statements, with the names and the sampling time of K."""
    rows, _ = _propagate(chain)
    n = len(rows) - 1
    sections = control.StateSpace(
        rows[:n, :n],
        rows[:n, n : n + 1],
        rows[n:, :n],
        rows[n:, n : n + 1],
        K.dt,
        remove_useless_states=False,
    )
    integral = control.StateSpace([[1 + pole]], [[1.0]], [[gain]], [[0.0]], K.dt)
    return with_names(
        in_parallel(sections, integral) if gain else sections, K.input_labels, K.output_labels
    )


def _bound_rounding(chain: list[Statement], unit: float) -> tuple[float, float]:
    """Return the l1 norm of a chain of sections, and a bound of its rounding at the output for |e|
    of at most one.

    A term is rounded once as a product, and once in each addition that includes it: unit of its
    size each time.
    """
    rows, read = _propagate(chain)
    n = len(rows) - 1
    A, used = rows[:n, :n], np.concatenate(read)
    sizes = _bound_l1(A, rows[:n, n], used[:, :n]) + np.abs(used[:, n])
    to_output = _bound_l1(A.T, rows[n, :n], rows[:n, n + 1 :].T) + np.abs(rows[n, n + 1 :])
    if not np.isfinite(sizes).all():
        return np.inf, np.inf
    counted = [
        (len(terms) - max(k, 1) + (abs(number) != 1.0)) * abs(number)
        for _, terms in chain
        for k, (number, _) in enumerate(terms)
    ]
    reached = np.repeat(to_output, [len(terms) for _, terms in chain])
    return float(sizes[-1]), float(unit * np.sum(counted * sizes * reached))


def _bound_l1(A: np.ndarray, b: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return (R,) upper bounds of sum_k |r A^k b|; infinite if A is not stable.

    sum |h| <= sqrt(1/(1 - c)) sqrt(sum h^2 c^-k) for any c < 1 (Cauchy and Schwarz). The second
    root is of a Gramian. The best of eight c between the square of the slowest pole and 1 is taken.
    """
    slowest = np.abs(np.linalg.eigvals(A)).max(initial=0.0) ** 2
    best = np.full(len(rows), np.inf)
    for share in np.geomspace(0.02, 0.98, 8) if slowest < 1 else ():
        c = 1 - share * (1 - slowest)
        power, gramian = A / np.sqrt(c), np.outer(b, b)
        while (
            np.abs(power).max(initial=0.0) > 1e-12
        ):  # each round doubles the number of terms (Smith 1968)
            gramian, power = gramian + power @ gramian @ power.T, power @ power
        best = np.minimum(
            best, np.sqrt(np.maximum(np.sum(rows @ gramian * rows, axis=1), 0.0) / (1 - c))
        )
    return best


def _order_sections(
    groups: list[tuple[tuple[complex, ...], tuple[complex, ...]]], gain: float, unit: float
) -> list[tuple[tuple[complex, ...], tuple[complex, ...]]]:
    """Return the sections in an order with a small rounding bound."""
    found: list[tuple[tuple[complex, ...], tuple[complex, ...]]] = []
    for group in groups:
        trials = [[*found[:k], group, *found[k:]] for k in range(len(found) + 1)]
        found = min(trials, key=lambda trial: _bound_rounding(_chain(trial, gain), unit)[1])
    return found


def largest_error(K: control.StateSpace, found: control.StateSpace) -> tuple[float, float]:
    """Return the largest |found - K|/|K| over all speeds of K and at its resonances, and its
    frequency [rad/s].
    """
    p, offsets = poles(K), np.concatenate([zeros(K), poles(K)]) - 1
    resonances = np.abs(np.angle(p[np.abs(np.abs(p) - 1) > _INTEGRATOR_TOLERANCES[1]]))
    slowest = comparison_angles(offsets[~_are_integrators(offsets)])
    angles = np.concatenate([slowest, resonances[resonances > 0]])
    omega = np.unique(np.minimum(angles, 0.99 * np.pi)) / timebase(K)
    wanted = response(K, omega)
    size = np.abs(wanted)
    with np.errstate(all="ignore"):
        error = np.abs(response(found, omega) - wanted) / np.maximum(
            size, _NEGLIGIBLE_GAIN * np.median(size) + 1e-300
        )
    k = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
    return float(error[k]), float(omega[k])
