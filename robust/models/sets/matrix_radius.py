"""How wide a set around the nominal of a measured matrix has to be: scatter of a new set, even level, misfit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import require_choice, require_integer, require_probability
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import timebase
from robust.lti.realisation import multivariable
from robust.lti.sampling import delayed
from robust.models.fit.nominal import NominalFit, behind_hold, refuse_other_channels
from robust.models.fit.weights import fit_weight
from robust.models.sets.evidence import matrix_evidence_of
from robust.models.sets.forms import ADDITIVE, AUTO, ELEMENTS, INPUT, MATRIX_FORMS
from robust.models.sets.joint import matrix_chance
from robust.models.sets.matrix_model import MatrixUncertainty
from robust.models.sets.radius import extrapolated, record_disc, slope, spread_over, total_of, worded

__all__ = ["full_block", "matrix_uncertainty", "smoothed"]


PADE_ORDER = 2
SMOOTHED = 9  # lines over which a covariance is averaged, relative to |G|: an order of weights does not follow scatter
FLAT = 1.06  # largest over smallest radius up to which a weight is a number


def matrix_uncertainty(
    frms: list[Bla],
    nominal: Any,
    *,
    form: str,
    order: int,
    confidence: float,
    simultaneous: bool,
    even: bool,
    below: str | float,
    above: str | float,
    perturbation: str,
) -> MatrixUncertainty:
    """`uncertainty` of a measured matrix, or of one at several levels: the widest of what each of them asks for."""
    require_choice("form", form, (*MATRIX_FORMS, AUTO))
    if form == AUTO:  # the price of looking at both: what may go wrong is shared between them
        each: dict[str, Any] = {"order": order, "confidence": (1 + require_probability("confidence", confidence)) / 2}
        each |= {"simultaneous": simultaneous, "even": even, "below": below, "above": above}
        both = [
            matrix_uncertainty(frms, nominal, form=one, perturbation=perturbation, **each)
            for one in (ELEMENTS, ADDITIVE)
        ]
        return replace(both[0], other=both[1])
    below, above = slope("below", below), slope("above", above)
    p, order = require_probability("confidence", confidence), require_integer("order", order, least=0)
    if isinstance(nominal, NominalFit):
        refuse_other_channels(frms[0], nominal, "its nominal")
        nominal = behind_delays(nominal.G, nominal.delays)
    nominal = multivariable("nominal", nominal)
    frm = frms[0]
    if (nominal.noutputs, nominal.ninputs) != (frm.n_outputs, frm.n_inputs):
        raise ValueError(
            f"nominal must have {frm.n_outputs} outputs and {frm.n_inputs} inputs, as the record, "
            f"got {nominal.noutputs} and {nominal.ninputs}"
        )
    dt = timebase(nominal)
    frms = [behind_hold(one, dt) for one in frms]
    models = [np.asarray(nominal(np.exp(1j * one.omega * dt) if dt else 1j * one.omega, squeeze=False)) for one in frms]
    pairs = list(zip(frms, models, strict=True))
    split = 0 if form == ELEMENTS else nominal.noutputs if form == ADDITIVE else nominal.ninputs
    radii = [asked_radii(one, model, p, simultaneous, even, form) for one, model in pairs]
    omega, radius = widest(frms, radii, split)
    # what is assumed outside the band is said once, of W_l
    rules = [(below, above)] * (split or len(radius)) + [(0.0, 0.0)] * (len(radius) - split if split else 0)
    weights = tuple(covering(omega, one, order, *rule, dt) for one, rule in zip(radius, rules, strict=True))
    made = MatrixUncertainty(
        nominal=nominal,
        form=form,
        left=weights[:split],
        right=weights[split:],
        omega=omega,
        radius=radius,
        confidence=p,
        simultaneous=simultaneous,
        perturbation=perturbation,
        inputs=frm.inputs,
        outputs=frm.outputs,
        extrapolation=f"below the band {worded(below)}, above it {worded(above)}",
        source="; ".join(map(matrix_measured_as, frms)),
        measured=tuple(map(matrix_evidence_of, frms)),
    )
    held = [matrix_chance(made, one, model, misfits(one, model)) for one, model in pairs]
    joint, joint_bla = np.min(held, axis=0)
    return replace(made, joint=float(joint), joint_bla=float(joint_bla))


def matrix_measured_as(frm: Bla) -> str:
    """What a matrix was measured with, in words."""
    if frm.grid == "given":
        lines = f"{frm.f.size} lines {frm.f[0]:g} to {frm.f[-1]:g} Hz"
        return f"a matrix of FRFs that was given, {lines}, variance from its {frm.level_source}"
    return (
        f"{frm.design} {frm.grid} multisine, {frm.f.size} lines {frm.f[0]:g} to {frm.f[-1]:g} Hz, "
        f"{frm.n_realizations} sets of {frm.n_inputs} experiments x {frm.n_periods} periods, level from "
        f"{frm.level_source}"
    )


def asked_radii(frm: Bla, model: np.ndarray, p: float, simultaneous: bool, even: bool, form: str) -> np.ndarray:
    """(n, F) radii that one record asks for: of the elements, or those of W_l before those of W_r."""
    if form == ELEMENTS:
        discs = entry_discs(frm, model, p, simultaneous, even)
        return np.concatenate([discs[:, i] for i in range(frm.n_inputs)])
    return np.concatenate(full_block(frm, model, misfits(frm, model), p, simultaneous, even, form))


def widest(frms: list[Bla], each: list[np.ndarray], split: int) -> tuple[np.ndarray, np.ndarray]:
    """All frequencies, and (n, W) the largest radius of all records there.

    A block W_l D W_r lies in every one of larger diagonals. What stands left and what right of it is a matter of scale,
    which a level of excitation changes: of several records each has W_r of mean square one.
    """
    if len(frms) == 1:
        return frms[0].omega, each[0]
    omega = np.unique(np.concatenate([frm.omega for frm in frms]))
    spread = np.full((len(frms), len(each[0]), omega.size), np.nan)
    for k, (frm, radius) in enumerate(zip(frms, each, strict=True)):
        scale = np.sqrt(np.mean(radius[split:] ** 2, axis=0)) if split else 1.0
        sides = np.concatenate([radius[:split] * scale, radius[split:] / scale])
        spread[k] = [spread_over(omega, frm.omega, row) for row in sides]
    return omega, np.nanmax(spread, axis=0)


def behind_delays(G: control.StateSpace, delays: np.ndarray | None) -> control.StateSpace:
    """The plant with each of its inputs behind a delay."""
    if delays is None or not np.any(delays):
        return G
    through = control.StateSpace([], [], [], [[1.0]], G.dt)
    return in_series(block_diagonal([delayed(through, float(tau), order=PADE_ORDER) for tau in delays], G.dt), G)


def entry_discs(frm: Bla, model: np.ndarray, p: float, simultaneous: bool, even: bool) -> np.ndarray:
    """(n_y, n_u, F) radii of the entries about the nominal that hold all of them together with probability p."""
    each = p ** (1 / (frm.n_outputs * frm.n_inputs))
    discs = np.empty(model.shape)
    for j, i in np.ndindex(model.shape[:2]):
        nominal = control.FrequencyResponseData(model[j, i], frm.omega)
        discs[j, i] = total_of(record_disc(frm.entry(j, i), nominal, each, simultaneous, even, None))
    return discs


def misfits(frm: Bla, model: np.ndarray) -> np.ndarray:
    """(n_y, n_u, F) what the nominal misses beyond scatter, entry by entry."""
    out = np.empty(model.shape)
    for j, i in np.ndindex(model.shape[:2]):
        nominal = control.FrequencyResponseData(model[j, i], frm.omega)
        out[j, i] = record_disc(frm.entry(j, i), nominal, 0.95, False, False, None)["misfit"]
    return out


def full_block(
    frm: Bla, model: np.ndarray, misfit: np.ndarray, p: float, simultaneous: bool, even: bool, form: str
) -> tuple[np.ndarray, np.ndarray]:
    """Radii (n, F) of diagonal W_l and W_r whose full block holds the matrix of a new set.

    W_l W_l^H >= (1 + 1/t) x_p C + (1 + t) B with the misfit B = n_y diag_j sum_i m_ji^2 / gamma_ii, t to make its
    trace least; a Hermitian X lies under the diagonal lambda_max(corr X) X_jj.
    """
    gamma = np.moveaxis(frm.gamma, 2, 0)
    x = quantiles(frm, p, simultaneous)
    C = frm.covariance_of("realization")
    if even:
        C = C + frm.n_realizations * np.nan_to_num(frm.cov_even)
    own = np.einsum("iif->if", frm.gamma).real
    C = x[:, None, None] * smoothed(np.moveaxis(C, 2, 0), model, own)
    n_y = frm.n_outputs
    B = n_y * np.einsum("jif,if->fj", misfit**2, 1 / own)
    trace_C, trace_B = np.einsum("fjj->f", C).real, B.sum(axis=1) + np.finfo(float).tiny
    t = np.sqrt(trace_C / trace_B) + np.finfo(float).tiny
    X = (1 + 1 / t)[:, None, None] * C + ((1 + t)[:, None] * B)[:, :, None] * np.eye(n_y)
    if form == INPUT:
        inverse = np.linalg.inv(np.moveaxis(model, 2, 0))
        X = inverse @ X @ np.swapaxes(inverse, 1, 2).conj()
    return diagonal_over(X), diagonal_over(gamma)


def quantiles(frm: Bla, p: float, simultaneous: bool) -> np.ndarray:
    """(F,) the quantile of Roy's root: the block of a `Bla` over its root of the covariance."""
    left, _ = frm.block(p, simultaneous=simultaneous)
    size = np.einsum("jkf,jkf->f", left, left.conj()).real
    return size / np.einsum("jjf->f", frm.cov_bound).real


def smoothed(C: np.ndarray, model: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(F, n_y, n_y) averaged over neighbouring lines, relative to the size of the nominal's rows."""
    size = np.sqrt(np.einsum("jif,if->fj", np.abs(model) ** 2, 1 / own))
    relative = C / size[:, :, None] / size[:, None]
    half, F = SMOOTHED // 2, len(C)
    sums = np.concatenate([np.zeros((1, *C.shape[1:])), np.cumsum(relative, axis=0)])
    first = np.clip(np.arange(F) - half, 0, max(F - SMOOTHED, 0))
    last = np.minimum(first + SMOOTHED, F)
    return (sums[last] - sums[first]) / (last - first)[:, None, None] * size[:, :, None] * size[:, None]


def diagonal_over(X: np.ndarray) -> np.ndarray:
    """(n, F) roots of the diagonal that lies over a Hermitian (F, n, n): lambda_max of its correlation."""
    size = np.sqrt(np.einsum("fjj->fj", X).real)
    correlation = X / size[:, :, None] / size[:, None]
    return (size * np.sqrt(np.linalg.eigvalsh(correlation)[:, -1:])).T


def covering(
    omega: np.ndarray, radius: np.ndarray, order: int, below: float, above: float, dt: float
) -> control.StateSpace:
    """A weight over a radius: a number where that is flat and nothing rises outside the band."""
    if radius.max() < FLAT * radius.min() and below == above == 0:
        return control.StateSpace([], [], [], [[radius.max()]], dt)
    return fit_weight(*extrapolated(omega, radius, below, above, dt), order=order, dt=dt).W
