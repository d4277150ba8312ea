r"""A sampled set that contains a set of continuous plants with several channels, every alias
included.

The sampled plant is G_d = sum_k h_k G_k, with |h_k| as in `aliases`, and with a perturbation at
each alias. The values of an LTI Delta at different frequencies are independent. So the sum of the
perturbations lies in a set around the sampled plant:

    elements  sum_k h_k w_ji Delta_ji       a disc of radius sum_k |h_k w_ji|, exactly
    additive  sum_k h_k W_l Delta_k W_r     M_k = W_l(omega_k)
    input     sum_k h_k G_k W_l Delta_k W_r M_k = G_k W_l(omega_k)

For additive and input, with m_k = |M_k| the sum is C^1/2 Delta R with |Delta| <= 1,

    C = sum_k |h_k| M_k M_k^H / m_k,      R_i^2 = sum_k |h_k| m_k |w_r,i(omega_k)|^2,

because the row of left factors and the column of right factors are contractions (Cauchy-Schwarz). C
is covered by diagonal weights like a measured covariance. Aliases near the band are summed one by
one; the others are bounded as in `aliases`.

The weights of the sampled set are fitted to these radii on a grid and then raised by a small
factor, so that `certify_aliases` can prove that they cover every alias at all frequencies
(`robust.proofs.exact.folded_sets`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_nonnegative
from nlfrf._base.values import value
from robust._base.states import Outcome
from robust._base.types import Controller
from robust.analysis.aliases import Aliases
from robust.lti.connections import require_shape
from robust.lti.grids import loop_grid
from robust.lti.lti import poles, response, response_by_channel, timebase
from robust.lti.realisation import multivariable, reachable_entry
from robust.lti.sampling import sampled
from robust.models.fit.weights import fit_weight
from robust.models.sets.forms import ADDITIVE, ELEMENTS
from robust.models.sets.measured import warn_of_unknown_hold
from robust.models.sets.model import UncertaintyModel, require_record_form, require_several_channels
from robust.models.sets.radius import diagonal_bound
from robust.models.sets.records import RecordHold
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.folded_sets import ALIASES, FoldedClaim, FoldedPart, verify_folded
from robust.proofs.search.certificate import EXACT, Certificate, failed_certificate

# order of a weight of the sampled set: two more than the default for a measured one
_WEIGHT_ORDER = 6
_COVERED = 1.01  # factor on every weight, for the proof between the frequencies of the grid
_BLOCKS = 1.06  # factor on the sum of the aliases in blocks, which the proof bounds to 5 % only
_FLAT_RATIO = 1.06  # largest over smallest radius below which a weight is a number
_GRID_START_RATIO = 1e-3  # start of the grid over the lowest line


@value
class SampledSet:
    """A set of sampled plants that contains a set of continuous plants."""

    model: UncertaintyModel  # the sampled set, in the form of the continuous one
    omega: np.ndarray  # (W,) grid on which its weights cover the radii [rad/s]
    own_share: (
        np.ndarray
    )  # (W,) part of the radius from the frequency itself; the rest is from its aliases
    claim: FoldedClaim  # the claim that it contains the continuous set

    def describe(self, *, proved: bool) -> str:
        """Describe the treatment of the aliases and the largest part of them."""
        k = int(np.argmin(self.own_share))
        if proved:
            how = "which is proved"
        else:
            how = f"as computed on {self.omega.size} frequencies in floating point"
        return (
            f"the weights of the sampled set cover every alias, {how}; the aliases are at most "
            f"{100 * (1 - self.own_share[k]):.2g} % of the radius, at {format_hertz(self.omega[k])}"
        )

    def certify_aliases(self) -> Certificate:
        """Return the proof that this set contains the continuous set, every alias included."""
        found = verify_folded(self.claim)
        if not found.verified:
            return failed_certificate(ALIASES, 1.0, found.failed[0][1])
        return Certificate(
            subject=ALIASES,
            outcome=Outcome.HOLDS,
            level=1.0,
            method=EXACT,
            intervals=np.array([[0.0, np.pi / self.claim.dt]]),
            reason="",
            claim=self.claim,
            again=verify_folded,
        )


def set_on_controller_time_base(
    model: UncertaintyModel, K: Controller, delay: float
) -> tuple[UncertaintyModel, SampledSet | None]:
    """Return the set on the time base of its controller, and the sampled set that contains it if it
    was folded.

    A continuous set under a sampled controller is folded. Any other set is returned as it is.
    """
    K = multivariable("K", K)
    if timebase(K) and not timebase(model.nominal):
        require_shape(K, model.n_outputs, model.n_inputs)
        warn_of_unknown_hold(model, timebase(K))
        found = sampled_set(model, timebase(K), require_nonnegative("delay", delay))
        return found.model, found
    if delay:
        raise ValueError(
            f"delay must be in the nominal for several channels, got {delay:g} s in addition: use"
            " sampled(nominal, dt, delay)"
        )
    return model, None


def sampled_set(model: UncertaintyModel, dt: float, delay: float = 0.0) -> SampledSet:
    """Return the sampled set that a controller with sampling time dt [s] sees of a continuous set.

    The set has several channels. Refused are operators, and perturbations that reach the sampler
    unfiltered, because the sum over their aliases is unbounded.
    """
    require_several_channels(
        model, "be folded into a sampled set", "use check, which includes its aliases"
    )
    require_record_form(model, "to be folded into a sampled set, or a sampled nominal")
    if model.perturbation == "operator":
        raise ValueError(
            'model must have a sampled nominal for the class "operator" with several channels'
            " and a sampled K, got a continuous one: use fit_nominal(..., dt=)"
        )
    nominal = sampled(model.nominal, dt, delay)
    omega = _sampled_grid(model, nominal, dt)
    k, tails = _alias_indices_and_tails(model, dt)
    if not np.isfinite(tails).all():
        raise ValueError(
            "model must have weights that fall above the Nyquist frequency, because the sum of"
            f' the aliases is unbounded otherwise ({model.form} form). Use form="input", or a'
            " sampled nominal (fit_nominal(..., dt=))"
        )
    left, right, share = _folded_radii(model, nominal, omega=omega, dt=dt, k=k, tails=tails)
    rows = np.concatenate([left, right])
    weights = tuple(_fit_sampled_weight(omega, row, dt) * _COVERED for row in rows)
    # on the grid, because the weights cover there; the measured lines belong to the continuous set
    made = replace(
        model,
        nominal=nominal,
        left=weights[: len(left)],
        right=weights[len(left) :],
        omega=omega,
        radius=rows,
        budget={},
        alternative_form=None,
        records=(),
        origin=replace(model.origin, hold=RecordHold(kind="zoh", fs=1 / dt)),
    )
    return SampledSet(model=made, omega=omega, own_share=share, claim=_folded_claim(model, made))


def _folded_claim(model: UncertaintyModel, made: UncertaintyModel) -> FoldedClaim:
    """Return the claim that a sampled set contains a continuous one; one block per element."""
    left, right, V_left, V_right = (
        tuple(map(to_matrices, weights))
        for weights in (model.left, model.right, made.left, made.right)
    )
    if model.form == ELEMENTS:
        one = (to_matrices(control.StateSpace([], [], [], [[1.0]], 0)),)
        parts = tuple(
            FoldedPart(
                plant=None, sampled=None, left=(w,), right=one, sampled_left=(v,), sampled_right=one
            )
            for w, v in zip(right, V_right, strict=True)
        )
        return FoldedClaim(dt=timebase(made.nominal), parts=parts)
    through = model.form != ADDITIVE
    part = FoldedPart(
        plant=to_matrices(model.nominal) if through else None,
        sampled=to_matrices(made.nominal) if through else None,
        left=left,
        right=right,
        sampled_left=V_left,
        sampled_right=V_right,
    )
    return FoldedClaim(dt=timebase(made.nominal), parts=(part,))


def _sampled_grid(model: UncertaintyModel, nominal: control.StateSpace, dt: float) -> np.ndarray:
    """Return frequencies (W,) [rad/s] up to Nyquist: lines, a log grid, every resonance and every
    aliased resonance.
    """
    top, step = np.pi / dt, 2 * np.pi / dt
    modes = np.concatenate([poles(part) for part in (model.nominal, *model.weights)])
    folded = np.abs((modes.imag + top) % step - top)
    lines = model.omega[model.omega < top]
    if not lines.size:
        lines = np.array([top / 10])
    found = loop_grid(
        lines, poles(nominal), systems=[], dt=dt, delay=0.0, folded=modes.real + 1j * folded
    )
    return found[found >= _GRID_START_RATIO * lines[0]]


def _alias_indices_and_tails(model: UncertaintyModel, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the aliases (k,) summed one by one, 0 first, and bounds of the other sums, without
    |sin(omega T/2)|.

    For elements these are bounds of sum |h_k w| for every weight; else of every |G_ji w_i| in M_k =
    G W_l, or |w_j| in W_l.
    """
    through = model.form not in (ELEMENTS, ADDITIVE)
    none = control.StateSpace([], [], [], [[0.0]], 0)
    of = partial(Aliases, dt=dt, delay=0.0, inverse=False, operator=False, F_includes_plant=through)
    parts = []
    for i, weight in enumerate(model.right if model.form == ELEMENTS else model.left):
        if through:
            plants = [reachable_entry(model.nominal, j, i) for j in range(model.n_outputs)]
        else:
            plants = [none]
        parts += [of(plant=plant, weight=weight) for plant in plants]
    n = max(int(part.single_indices[-1]) for part in parts)
    k = np.concatenate([[0], np.arange(-n, 0), np.arange(1, n + 1)])
    return k, np.array([float(part.tail_bounds.F[0]) for part in parts])


def _folded_radii(
    model: UncertaintyModel,
    nominal: control.StateSpace,
    *,
    omega: np.ndarray,
    dt: float,
    k: np.ndarray,
    tails: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the radii (n, W) of the sampled set, left and right, and the share (W,) of the
    frequency itself.
    """
    at = omega[:, None] + 2 * np.pi / dt * k
    sine = np.sin(np.minimum(omega * dt / 2, np.pi / 2))
    hold = np.abs(sine[:, None] / (at * dt / 2))
    flat = np.abs(at).ravel()

    def sizes(weights: tuple[control.StateSpace, ...]) -> np.ndarray:  # (n, W, k)
        return np.array([np.abs(response(weight, flat)) for weight in weights]).reshape(
            -1, *at.shape
        )

    if model.form == ELEMENTS:
        each = hold * sizes(model.right)
        rows = each.sum(axis=2) + _BLOCKS * tails[:, None] * sine
        return np.zeros((0, omega.size)), rows, np.min(each[:, :, 0] / rows, axis=0)
    left, right = sizes(model.left), sizes(model.right)
    if model.form == ADDITIVE:
        M, inverse = left.transpose(1, 2, 0)[..., None] * np.eye(len(left)), np.eye(len(left))[None]
    else:
        G = (
            response_by_channel(model.nominal, flat)
            .reshape(nominal.noutputs, nominal.ninputs, *at.shape)
            .transpose(2, 3, 0, 1)
        )
        M = G * left.transpose(1, 2, 0)[:, :, None]
        M = np.where(at[..., None, None] < 0, M.conj(), M)
        inverse = np.linalg.inv(np.moveaxis(response_by_channel(nominal, omega), 2, 0))
        M = inverse[:, None] @ M
    m = np.linalg.norm(M, 2, axis=(2, 3))
    size = np.linalg.norm(inverse, 2, axis=(1, 2))
    beyond = _BLOCKS * float(tails.sum()) * sine  # bound of |G W| by its entries
    C = np.einsum("wk,wkji,wkli->wjl", hold / np.maximum(m, 1e-300), M, M.conj())
    C = C + (beyond / size)[:, None, None] * (inverse @ np.swapaxes(inverse, 1, 2).conj())
    beyond = beyond * size
    highest = np.array(
        [
            response(weight, np.geomspace(flat.max() / 10, flat.max() * 1e4, 400))
            for weight in model.right
        ]
    )
    R = np.sqrt(
        (hold * m * right**2).sum(axis=2) + beyond * (np.abs(highest).max(axis=1) ** 2)[:, None]
    )
    scale = np.sqrt(np.mean(R**2, axis=0))  # only the product of left and right matters
    share = hold[:, 0] * m[:, 0] / ((hold * m).sum(axis=1) + beyond)
    return diagonal_bound(C) * scale, R / scale, share


def _fit_sampled_weight(omega: np.ndarray, radius: np.ndarray, dt: float) -> control.StateSpace:
    """Fit a sampled weight to a radius; a flat radius gives a number."""
    if radius.max() < _FLAT_RATIO * radius.min():
        return control.StateSpace([], [], [], [[radius.max()]], dt)
    return fit_weight(omega, radius, order=_WEIGHT_ORDER, dt=dt).W
