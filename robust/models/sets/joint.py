"""Probability that a whole FRF lies in a set, all its lines together, estimated by simulation from
the record.

The confidence of one line is not the confidence of all lines: 148 independent discs of 95 % would
contain a whole FRF once in 2000 times. The probability of a whole FRF depends on the distance
between weight and radius, on the misfit, on distortion levels that are estimated conservatively,
and on the power that all lines share. Therefore FRFs are drawn at random, and those inside the set
are counted:

    G_new = G_0 + c + sqrt((v_c + s h) / g) z        G_bla = G_0 + c + sqrt(v_c / g) z

with z complex normal and white over the lines; s the scatter of one realisation, h a power that all
lines share; g the error of the levels, shared by neighbours; c and v_c mean and variance of the BLA
around the nominal G_0. They follow from the residual r = G - G_0 and the misfit m: c = r m^2/(m^2 +
v), v_c = v m^2/(m^2 + v) (a normal prior of variance m^2), with v added to v_c if the nominal
follows the record itself, where r carries no information.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from nlfrf import Bla
from robust.models.fit.shared_poles import hermitian_power
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import entry_misfits, nominal_response
from robust.models.sets.records import (
    FEW_LINES,
    LEVEL_DOF,
    WINDOW,
    JointProbability,
    RecordSummary,
    summarize_record,
)

N_DRAWS, N_NUMBERS = 1000, 1 << 18  # FRFs that are drawn, and numbers in all of them, at most
_MIN_DRAWS = 400
# mean |r|^2 over the variance below which a nominal follows the record itself
_MAX_FOLLOWED_SHARE = 0.5


def attach_records(
    model: UncertaintyModel, blas: list[Bla], recorded: list[Bla] | None = None
) -> UncertaintyModel:
    """Return the model with summaries of its records and the joint probabilities, the least over
    several levels.

    recorded : the records before the hold of the model was put into them; blas when not given.
    """
    records = tuple(map(summarize_record, blas, recorded or blas))
    missed = [entry_misfits(bla, nominal_response(model.nominal, bla.omega)) for bla in blas]
    joint, joint_bla = np.min(
        list(map(partial(_joint_probability, model), blas, records, missed)), axis=0
    )
    return replace(
        model, records=records, joint=JointProbability(frf=float(joint), bla=float(joint_bla))
    )


def _joint_probability(
    model: UncertaintyModel, bla: Bla, summary: RecordSummary, missed: np.ndarray
) -> tuple[float, float]:
    """Estimate the probability that the whole FRF of a new realisation lies in the set, and that
    the whole BLA does.

    summary, missed : summary of the record, and misfit of the nominal on its lines, entry by entry.
    """
    if model.is_single:
        return probability_of_frf(model, summary, missed)
    return _probability_of_matrix(model, bla, missed)


def _shrunk_residual(r: np.ndarray, v: np.ndarray, missed: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return m^2/(m^2 + v) of a residual r about the nominal, and whether the nominal follows the
    record itself.
    """
    square, tiny = missed**2, np.finfo(float).tiny
    follows = bool(np.mean(np.abs(r) ** 2 / np.maximum(v, tiny)) < _MAX_FOLLOWED_SHARE)
    return square / np.maximum(square + v, tiny), follows


def probability_of_frf(
    model: UncertaintyModel, summary: RecordSummary, missed: np.ndarray
) -> tuple[float, float]:
    """Return `_joint_probability` for one channel, with the level from the roughness of G."""
    assert summary.scatter is not None  # for one channel
    inside = (summary.omega >= model.omega[0] * (1 - 1e-9)) & (
        summary.omega <= model.omega[-1] * (1 + 1e-9)
    )
    omega, G, v, s = (
        part[inside] for part in (summary.omega, summary.G, summary.variance, summary.scatter)
    )
    G0 = nominal_response(model.nominal, omega)
    shrunk, follows = _shrunk_residual(G - G0, v, missed[inside])
    center, around = (G - G0) * shrunk, v * (shrunk + follows)
    n = int(np.clip(N_NUMBERS // omega.size, _MIN_DRAWS, N_DRAWS))
    rng = np.random.default_rng(0)  # the same set gives the same number
    g, common, z = (
        *draw_level_errors(n, omega.size, rng),
        _draw_complex_normals((n, omega.size), rng),
    )

    def held(variance: np.ndarray) -> float:
        return float(
            np.mean(np.all(model.is_within(omega, G0 + center + np.sqrt(variance) * z, G0), axis=1))
        )

    return held((s * common + around) / g), held(around / g)


def _probability_of_matrix(
    model: UncertaintyModel, frm: Bla, missed: np.ndarray
) -> tuple[float, float]:
    """Return `_joint_probability` for a matrix, whose error is C^1/2 Z gamma^1/2 with Z white."""
    n_y, n_u, F = frm.G.shape
    G0 = model.at(frm.omega)
    entries = [summarize_record(frm.entry(j, i)) for j, i in np.ndindex(n_y, n_u)]
    v = np.array([one.variance for one in entries]).reshape(n_y, n_u, F)
    share = np.mean(v / np.maximum(frm.entries(frm.cov.bound), np.finfo(float).tiny), axis=(0, 1))
    r = frm.G - G0
    shrunk, follows = _shrunk_residual(r, v, missed)
    n = int(np.clip(N_NUMBERS // frm.G.size, _MIN_DRAWS, N_DRAWS))
    rng = np.random.default_rng(0)
    g, common, z = (*draw_level_errors(n, F, rng), _draw_complex_normals((n, F, n_y, n_u), rng))
    bound, gamma = (
        hermitian_power(np.moveaxis(C, 2, 0), 0.5) for C in (frm.cov.bound, frm.cov.gamma)
    )
    # the most likely scatter, without the allowance for the peaks of the inputs
    extra = hermitian_power(
        np.moveaxis(frm.covariance_of("realization") - frm.cov.bound, 2, 0) / frm.typical, 0.5
    )
    center, kept, nominal = (
        np.moveaxis(x, 2, 0) for x in (r * shrunk, np.sqrt(shrunk + follows), G0)
    )
    size = np.sqrt(share / g)[..., None, None]

    def held(deviation: np.ndarray) -> float:
        return float(
            np.mean(np.all(model.is_within(frm.omega, nominal + deviation, nominal), axis=1))
        )

    about = center + size * kept * (bound @ z @ gamma)
    new = (
        size
        * np.sqrt(common)[..., None, None]
        * (extra @ _draw_complex_normals(z.shape, rng) @ gamma)
    )
    return held(about + new), held(about)


def draw_level_errors(
    n: int, n_lines: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw ratios of estimated to true levels (n, F), shared by neighbours, and a power that all
    lines share (n, 1).
    """
    sums = np.cumsum(rng.exponential(size=(n, n_lines + WINDOW)), axis=1)
    level = (sums[:, WINDOW:] - sums[:, :-WINDOW]) / WINDOW
    common = np.exp(np.sqrt(FEW_LINES / n_lines) * rng.normal(size=(n, 1)))
    return level ** np.sqrt(WINDOW / LEVEL_DOF), common


def _draw_complex_normals(shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Draw complex normal numbers of variance one."""
    pairs = rng.standard_normal((2, *shape)) * np.sqrt(0.5)
    return np.asarray(pairs[0] + 1j * pairs[1])
