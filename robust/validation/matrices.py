"""A second matrix held against a set, or against a first one: entries, whole matrices, a change that all share.

The difference of two records has the sum of their covariances: noise and distortion of both count, while the bound of
one alone is for a new set without measurement noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf import Frm
from nlfrf.shared.roy import roy_quantile
from nlfrf.shared.values import value
from nlfrf.shared.wording import hertz
from robust.modelling.matrix_nominal import refuse_other_channels
from robust.modelling.nominal import behind_hold
from robust.systems.lti import timebase
from robust.uncertain.evidence import MatrixEvidence, matrix_evidence_of
from robust.uncertain.matrix_model import MatrixUncertainty
from robust.uncertain.matrix_radius import smoothed
from robust.validation.difference import local_slope, shape_and_level, shared_lines

__all__ = ["MatrixValidation", "validate_matrix"]


FLOOR = 1e-8  # of the largest eigenvalue of a covariance
CONFIDENCE = 0.95  # of a record that is held against a record


@value
class MatrixValidation:
    """A second record of several inputs or outputs held against a set, or against a first record.

    Fields
    ------
    n_outside : int
        Lines on which the whole matrix differs from the first record by more than both scatter.
    n_expected : float
        How many do where nothing has changed.
    entries_outside : (n_y, n_u) int ndarray
        The same of each entry; as many are expected of each.
    p_value : float
        Probability that two records of one machine differ as much along a change of gain, delay and frequency that all
        entries share; 1 for the same record, nan on fewer than eight lines.
    p_values : (n_y, n_u) ndarray
        The same of each entry by itself.
    n_lines : int
        Lines of the record; those outside the band of the first record are left out. Where the two have other lines
        they are compared on fewer, of which `n_expected` tells the number.
    omega, distance : (n_lines,) ndarray
        Those lines [rad/s], and how far each matrix lies from the nominal in units of the set; nan where a record is
        held against a record.
    gain, frequency, delay : float
        The change that fits best, relative and [s].
    level, p_level : float
        What is left of the difference over what both records say that they scatter, rms, and the probability of as much
        or more where nothing has changed.
    inputs, outputs : tuple of str
        Names of the channels.

    References
    ----------
    As `Validation`; Khatri 1964 for whole matrices, as `Frm.block`.

    Examples
    --------
    >>> import nlfrf, robust
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, n_inputs=2, n_realizations=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> y = u + 0.1 * u**3 + 0.2 * u[::-1]
    >>> first, second = (nlfrf.identify(nlfrf.MultiRecord(u=u[:, s], y=y[:, s], fs=128, lines=ms.lines))
    ...     for s in (slice(0, 2), slice(2, 4)))
    >>> seen = robust.validate(first, second)
    >>> seen.n_outside < 4, seen.p_value > 0.01
    (True, True)
    """

    n_outside: int
    n_expected: float
    entries_outside: np.ndarray
    p_value: float
    p_values: np.ndarray
    n_lines: int
    omega: np.ndarray
    distance: np.ndarray
    gain: float = float("nan")
    delay: float = float("nan")
    frequency: float = float("nan")
    level: float = float("nan")
    p_level: float = float("nan")
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    @property
    def n_outside_set(self) -> int:
        """Lines whose matrix lies outside the set itself."""
        return int(np.sum(self.distance > 1))

    def __str__(self) -> str:
        """What was found, in a few lines."""
        rows = [f"validation of {len(self.outputs)} outputs by {len(self.inputs)} inputs on {self.n_lines} lines"]
        if not np.isnan(self.distance).all():
            where = f", worst at {hertz(float(self.omega[np.argmax(self.distance)]))}" if self.n_outside_set else ""
            rows[0] += f": {self.n_outside_set} outside the set{where}"
        rows.append(
            f"  shape: p = {self.p_value:.2g}; best change of all entries: gain {100 * self.gain:+.2g} %, frequency "
            f"{100 * self.frequency:+.2g} %, delay {1e3 * self.delay:+.2g} ms"
        )
        j, i = (int(k) for k in np.unravel_index(np.argmin(np.nan_to_num(self.p_values, nan=1.0)), self.p_values.shape))
        rows.append(
            f"  the entry that changed most: {self.outputs[j]} by {self.inputs[i]}, p = {self.p_values[j, i]:.2g}"
        )
        rows.append(
            f"  level: the rest is {self.level:.2g} times what both records scatter, p = {self.p_level:.2g}; "
            f"{self.n_outside} matrices beyond both, {self.n_expected:.3g} expected; entries "
            f"{int(self.entries_outside.min())} to {int(self.entries_outside.max())}"
        )
        return "\n".join(rows)


def validate_matrix(model: MatrixUncertainty | Frm, frm: Frm) -> MatrixValidation:
    """`validate` of several inputs and outputs."""
    shape = (model.n_outputs, model.n_inputs)
    if (frm.n_outputs, frm.n_inputs) != shape:
        raise ValueError(
            f"bla must have {shape[0]} outputs and {shape[1]} inputs, as the model, got {frm.n_outputs} and "
            f"{frm.n_inputs}"
        )
    refuse_other_channels(frm, model, "the model")
    inside = (frm.omega >= model.omega[0] * (1 - 1e-9)) & (frm.omega <= model.omega[-1] * (1 + 1e-9))
    if not inside.any():
        raise ValueError("bla must have lines inside the band of the model, got none")
    if not isinstance(model, Frm):
        frm = behind_hold(frm, timebase(model.nominal))
    elif "unknown" not in (model.hold, frm.hold):
        model, frm = behind_hold(model, 0.0), behind_hold(frm, 0.0)
    second = on_lines(matrix_evidence_of(frm), frm.omega[inside])
    distance = np.full(second.omega.size, np.nan)
    confidence, simultaneous, nominal = CONFIDENCE, False, None
    if isinstance(model, Frm):
        firsts = [matrix_evidence_of(model)]
    else:
        confidence, simultaneous, nominal = model.confidence, model.simultaneous, model.nominal
        if np.isnan(confidence):
            raise ValueError("model must state a confidence to be validated against, got none")
        dt = timebase(nominal)
        at = np.exp(1j * second.omega * dt) if dt else 1j * second.omega
        G = np.moveaxis(np.asarray(nominal(at, squeeze=False)), 2, 0)
        distance = model.distances(second.omega, second.G - G, G)
        exact = MatrixEvidence(omega=second.omega, G=G, C=0 * second.C, gamma=second.gamma, dof=second.dof)
        firsts = reaching(model.measured, second.omega) or [exact]
    tried = []
    for first in firsts:
        lines = shared_lines(first.omega, second.omega)
        p = confidence ** (1 / lines.size) if simultaneous else confidence
        tried.append(compared(on_lines(first, lines), on_lines(second, lines), p))
    best = max(tried, key=lambda one: (np.nan_to_num(one.p_value), one.p_level))
    best = replace(best, omega=second.omega, n_lines=second.omega.size, distance=distance)
    return replace(best, inputs=frm.inputs, outputs=frm.outputs)


def reaching(measured: Sequence[MatrixEvidence], omega: np.ndarray) -> list[MatrixEvidence]:
    """The records behind a model, at several levels, that reach the lines of another one."""
    return [one for one in measured if one.omega[0] <= omega[-1] and one.omega[-1] >= omega[0]]


def on_lines(one: MatrixEvidence, omega: np.ndarray) -> MatrixEvidence:
    """On other lines, interpolated in log magnitude and phase; exact where the lines are its own."""
    if omega.size == one.omega.size and np.allclose(omega, one.omega, rtol=1e-9, atol=0):
        return one

    def between(x: np.ndarray) -> np.ndarray:
        """Every element between the lines."""
        flat = x.reshape(one.omega.size, -1)
        return np.array([np.interp(omega, one.omega, part) for part in flat.T]).T.reshape(-1, *x.shape[1:])

    log = between(np.log(np.maximum(np.abs(one.G), 1e-300)) + 1j * np.unwrap(np.angle(one.G), axis=0))
    return MatrixEvidence(omega=omega, G=np.exp(log), C=between(one.C), gamma=between(one.gamma), dof=between(one.dof))


def compared(first: MatrixEvidence, second: MatrixEvidence, p: float) -> MatrixValidation:
    """Two records on the same lines, one against the other."""
    omega, d = second.omega, second.G - first.G
    F, n_y, n_u = d.shape
    before, after = (np.einsum("fjj,fii->fji", one.C, one.gamma).real for one in (first, second))
    variance = np.maximum(before + after, np.finfo(float).tiny)
    L = together(before, after, first.dof[:, None, None], second.dof[:, None, None])
    outside = np.abs(d) ** 2 > L * np.expm1(-np.log1p(-p) / L) * variance
    # of inputs that went along the same directions both times the sum is a product again; else it lies above
    turned = np.linalg.eigvals(np.linalg.solve(first.gamma, second.gamma)).real.max(axis=1)
    C = [first.C, turned[:, None, None] * second.C]
    before, after = (np.einsum("fjj->f", one).real for one in C)
    L = together(before, after, first.dof, second.dof)
    Z = inverse_root(C[0] + C[1]) @ d @ inverse_root(first.gamma)
    limit = np.array([roy_quantile(p, n_y, n_u, round(float(one), 1)) for one in L])
    same = bool(np.all(np.abs(d) <= 1e-9 * np.abs(second.G)))
    found: dict[str, Any] = {"p_value": 1.0, "p_values": np.ones((n_y, n_u))}
    if not same:
        found = changes(first, second, d, C[0] + C[1])
    return MatrixValidation(
        n_outside=int(np.sum(np.linalg.norm(Z, 2, (1, 2)) ** 2 > limit)),
        n_expected=(1 - p) * F,
        entries_outside=outside.sum(axis=0),
        n_lines=F,
        omega=omega,
        distance=np.full(F, np.nan),
        **found,
    )


def together(a: np.ndarray, b: np.ndarray, dof_a: np.ndarray, dof_b: np.ndarray) -> np.ndarray:
    """Degrees of freedom of the sum of two estimated variances (Welch and Satterthwaite)."""
    tiny = np.finfo(float).tiny ** 0.25
    scale = np.maximum(a + b, tiny)
    return np.asarray(1 / ((a / scale) ** 2 / dof_a + (b / scale) ** 2 / dof_b + tiny))


def inverse_root(X: np.ndarray) -> np.ndarray:
    """(F, n, n) X^-1/2 of Hermitian matrices."""
    values, vectors = np.linalg.eigh(X)
    values = np.maximum(values, FLOOR * values[:, -1:] + np.finfo(float).tiny)
    return np.asarray((vectors / np.sqrt(values)[:, None]) @ np.swapaxes(vectors, 1, 2).conj())


def changes(first: MatrixEvidence, second: MatrixEvidence, d: np.ndarray, C: np.ndarray) -> dict[str, Any]:
    """The change that all entries share, and how likely each entry changed by itself."""
    omega, (F, n_y, n_u) = second.omega, d.shape
    G = (first.G + second.G) / 2
    slope = np.array(
        [
            local_slope(np.log(omega), np.log(np.maximum(np.abs(g), 1e-300)) + 1j * np.unwrap(np.angle(g)))
            for g in G.reshape(F, -1).T
        ]
    ).T.reshape(G.shape)
    one = np.ones_like(G)
    x = np.array([one, (-1j * omega / omega[-1])[:, None, None] * one, -slope]) * G
    units = np.array([1.0, 1 / omega[-1], 1.0])
    own = np.einsum("fii->fi", first.gamma).real
    level = smoothed(C, np.moveaxis(G, 0, 2), own.T)
    left, right = inverse_root(level), inverse_root(first.gamma)
    shared = shape_and_level((left @ x @ right).reshape(3, -1), units, (left @ d @ right).ravel(), F)
    size = np.sqrt(np.einsum("fjj->fj", level).real[:, :, None] * own[:, None])
    each = [
        shape_and_level((x / size)[:, :, j, i], units, (d / size)[:, j, i])["p_value"] for j, i in np.ndindex(n_y, n_u)
    ]
    return {**shared, "p_values": np.array(each).reshape(n_y, n_u)}
