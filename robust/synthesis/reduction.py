"""Controllers of lower order that keep what was proved: candidates by model reduction, each judged by the check."""

from __future__ import annotations

import time
from collections.abc import Iterator

import control
import numpy as np
from scipy.linalg import block_diag, schur, solve_continuous_are, solve_continuous_lyapunov, solve_sylvester

from nlfrf._base.arguments import require_integer, require_nonnegative, require_positive
from nlfrf._base.values import value
from robust._base.channels import is_single
from robust._base.types import Controller, LinearSystem, Weight
from robust.analysis.loop import assemble_loop
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.lti.connections import closed_loop
from robust.lti.lti import Matrices, response, response_by_channel, timebase, with_names
from robust.lti.norms import continuous_image, to_discrete
from robust.lti.realisation import multivariable, state_space
from robust.models.sets.measured import FrfSource
from robust.models.sets.model import UncertaintyModel, has_several_channels

# ---- Model reduction by balanced truncation: of a system itself, seen through weights, or of its coprime factors.
#
# Gramians P (how far states are driven) and Q (how much they show) are made equal and diagonal; the states of the
# smallest entries go. Truncated: they are left out, exact at high frequencies. Residualised: they are taken as settled,
# exact at zero frequency, so that integral action of the factors stays. Modes that are not stable are kept as they are.
#
# (Moore 1981; Enns 1984 for weights; Meyer 1990 for coprime factors; SP 11.2 to 11.4.)

AXIS_TOLERANCE = 1e-9  # of the size of A: modes nearer to the axis are kept as they are


def split_modes(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return (A, B, C) of the modes that are kept, those not strictly stable, and of the others."""
    n, size = A.shape[0], AXIS_TOLERANCE * max(float(np.linalg.norm(A)), 1e-300)
    T, Z, k = schur(A, output="real", sort=lambda re, im=0.0: re >= -size) if n else (A, np.eye(0), 0)
    # T = [T11 T12; 0 T22] made block diagonal: T11 X - X T22 = -T12
    X = solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:]) if 0 < k < n else np.zeros((k, n - k))
    forth, back = Z.T.copy(), Z.copy()
    forth[:k] = forth[:k] - X @ forth[k:]
    back[:, k:] = back[:, k:] + back[:, :k] @ X
    moved, shown = forth @ B, C @ back
    return (T[:k, :k], moved[:k], shown[:, :k]), (T[k:, k:], moved[k:], shown[:, k:])


def balanced_candidates(K: Matrices) -> Iterator[tuple[str, int, Matrices]]:
    """(way, order, system) for every order: of the strictly stable part of a system, the rest beside it."""
    A, B, C, D = K
    kept, (A, B, C) = split_modes(A, B, C)
    P, Q = solve_continuous_lyapunov(A, -B @ B.T), solve_continuous_lyapunov(A.T, -C.T @ C)
    for way, small in truncations((A, B, C, D), P, Q):
        yield f"balanced, {way}", small[0].shape[0] + kept[0].shape[0], add_systems(kept, small)


def weighted_candidates(K: Matrices, before: Matrices, behind: Matrices) -> Iterator[tuple[str, int, Matrices]]:
    """Return reductions K_r of each order, for a small norm of behind (K - K_r) before with stable weights (Enns)."""
    A, B, C, D = K
    kept, (A, B, C) = split_modes(A, B, C)
    n, (Ab, Bb, Cb, Db), (Aa, Ba, Ca, _) = A.shape[0], before, behind
    driven = np.block([[A, B @ Cb], [np.zeros((Ab.shape[0], n)), Ab]])
    A_weighted = np.block([[A, np.zeros((n, Aa.shape[0]))], [Ba @ C, Aa]])
    into, out = np.vstack([B @ Db, Bb]), np.hstack([behind[3] @ C, Ca])
    P = solve_continuous_lyapunov(driven, -into @ into.T)[:n, :n]
    Q = solve_continuous_lyapunov(A_weighted.T, -out.T @ out)[:n, :n]
    for way, small in truncations((A, B, C, D), P, Q):
        yield f"weighted by the loop, {way}", small[0].shape[0] + kept[0].shape[0], add_systems(kept, small)


def coprime_factor_candidates(K: Matrices) -> Iterator[tuple[str, int, Matrices]]:
    """Return reductions of K of each order by truncating its normalised left coprime factors, unstable modes too."""
    A, B, C, D = K
    R, S = np.eye(D.shape[0]) + D @ D.T, np.eye(D.shape[1]) + D.T @ D
    drift = A - B @ np.linalg.solve(S, D.T @ C)
    Y = solve_continuous_are(drift.T, C.T, B @ np.linalg.solve(S, B.T), R)
    H = -np.linalg.solve(R, (B @ D.T + Y @ C.T).T).T
    root = np.linalg.cholesky(np.linalg.inv(R)).T
    factors = A + H @ C, np.hstack([B + H @ D, H]), root @ C, root @ np.hstack([D, np.eye(D.shape[0])])
    P = solve_continuous_lyapunov(factors[0], -factors[1] @ factors[1].T)
    Q = solve_continuous_lyapunov(factors[0].T, -factors[2].T @ factors[2])
    m = B.shape[1]
    for way, (Ar, Br, Cr, Dr) in truncations(factors, P, Q):
        N, M, into = Dr[:, :m], Dr[:, m:], Br[:, m:]
        if np.linalg.cond(M) < 1e12:
            back = np.linalg.solve(M, np.hstack([Cr, N]))
            C_K, D_K = back[:, : Cr.shape[1]], back[:, Cr.shape[1] :]
            yield f"coprime factors, {way}", Ar.shape[0], (Ar - into @ C_K, Br[:, :m] - into @ D_K, C_K, D_K)


def truncations(system: Matrices, P: np.ndarray, Q: np.ndarray) -> Iterator[tuple[str, Matrices]]:
    """Every smaller order, truncated and residualised, from the Gramians of a system (square root, Tombs 1987)."""
    A, B, C, D = system
    Lc, Lo = gramian_root(P), gramian_root(Q)
    U, sizes, V = np.linalg.svd(Lo.T @ Lc)
    n = int(np.sum(sizes > 1e-12 * sizes.max(initial=0.0)))  # what neither drives nor shows is left out exactly
    scale = np.sqrt(sizes[:n])
    forth, back = (U[:, :n] / scale).T @ Lo.T, Lc @ V[:n].T / scale
    A, B, C = forth @ A @ back, forth @ B, C @ back
    for r in range(min(n, system[0].shape[0] - 1) + 1):
        yield "truncated", (A[:r, :r], B[:r], C[:, :r], D)
        rest = A[r:, r:]
        if r < n and np.linalg.cond(rest) < 1e12:
            settled = np.linalg.solve(rest, np.hstack([A[r:, :r], B[r:]]))
            A_s, B_s = settled[:, :r], settled[:, r:]
            yield "residualised", (
                A[:r, :r] - A[:r, r:] @ A_s, B[:r] - A[:r, r:] @ B_s, C[:, :r] - C[:, r:] @ A_s, D - C[:, r:] @ B_s,
            )  # fmt: skip


def gramian_root(gramian: np.ndarray) -> np.ndarray:
    """L with L L' the positive part of a Gramian."""
    values, vectors = np.linalg.eigh((gramian + gramian.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def add_systems(kept: tuple[np.ndarray, ...], small: Matrices) -> Matrices:
    """Return the sum of the modes that were kept and a reduced part."""
    A, B, C, D = small
    return block_diag(kept[0], A), np.vstack([kept[1], B]), np.hstack([kept[2], C]), D


LEAST_RADIUS = 1e-9  # of the set that a plant alone stands for
MAX_CHANGE_OF_T = 0.1  # max |T_r - T| where no performance was proved


@value
class Reduction:
    """A controller of lower order, and what the check says of it.

    Fields
    ------
    K : control.StateSpace
        The reduced controller; the one that was given where none of lower order keeps what was proved.
    order : int
        Its states.
    method : str
        How it was reduced: "balanced", "weighted by the loop" or "coprime factors", truncated (exact at high
        frequencies) or residualised (exact at zero); "not reduced" otherwise.
    kept : bool
        Whether its check proves what the check of the controller that was given proves.
    report, before : RobustnessReport or RobustnessReport
        Of the reduced controller and of the one that was given.
    reason : str
        Why it is not lower, or what was lost.
    n_tried : int
        Candidates looked at.

    References
    ----------
    SP 11.2 to 11.4.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2, 0.2], [0.05, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.2]), perturbation="LTI")
    >>> K = control.tf([2, 2], [1, 0]) * control.tf([1], [1e-3, 1]) * control.tf([1, 3.01], [1, 3])
    >>> found = reduce_controller(K, model)                # what is left is the integrator and its gain
    >>> found.order, found.kept, found.report.verdict
    (1, True, 'robust')
    """

    K: control.StateSpace
    order: int
    method: str
    kept: bool
    report: RobustnessReport
    before: RobustnessReport
    reason: str
    n_tried: int


def reduce_controller(
    K: Controller,
    model: FrfSource | LinearSystem,
    w_P: Weight | None = None,
    *,
    order: int | None = None,
    delay: float = 0.0,
    time_cap: float = 30.0,
) -> Reduction:
    """Find the controller of lowest order that keeps what the check of a controller proves.

    Looked at are balanced truncation, the same weighted by the loop (G S before and S behind the error of K: what the
    loop sees of it), and that of the coprime factors of K, each truncated and residualised. From the lowest order on
    the best is checked in full, until one keeps the verdict, and robust performance where that was proved. Where it was
    not, K = 0 would keep the verdict on a stable plant: then max |T_r - T| has to stay below 0.1 too.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction
        Controller, continuous or sampled, of one or several channels.
    model, w_P, delay
        As for `check`; or the plant alone that `mixsyn` took: stability and max |w_P S| < 1 are kept then.
    order : int, optional
        This order and no other: the best of it, kept or not.
    time_cap : float
        Seconds; where they are over K comes back as it was.

    Returns
    -------
    Reduction

    Raises
    ------
    ValueError
        A controller of which the check proves nothing (give an order then), an order that is no lower.

    References
    ----------
    SP 11.2 to 11.4; Moore 1981; Enns 1984; Meyer 1990; Anderson & Liu 1989 (weights from the loop).

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2, 0.2], [0.05, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.2]), perturbation="LTI")
    >>> K = control.tf([1], [1e-4, 1]) * control.tf([3], [1e-3, 1])
    >>> found = reduce_controller(K, model)                             # the gain of 3 alone
    >>> found.order, round(float(found.K.D[0, 0]), 6)
    (0, 3.0)
    """
    model = plant_as_set(model)
    several = has_several_channels(model)
    K, delay = multivariable("K", K) if several else state_space("K", K), require_nonnegative("delay", delay)
    deadline = time.monotonic() + require_positive("time_cap", time_cap)
    if order is not None and require_integer("order", order, least=0) >= K.nstates:
        raise ValueError(f"order must be below the {K.nstates} states of K, got {order}")
    before = check(model, K, w_P=w_P, delay=delay)
    if order is None and not before.verdict.is_robust:
        raise ValueError(
            f"K must be one of which something is proved, got '{before.verdict}': {before.reason}. Give an order "
            "to reduce it all the same."
        )
    by_order: dict[int, list[tuple[str, control.StateSpace]]] = {}
    for method, n, small in candidates(K, model, w_P=w_P, delay=delay):
        if order in (None, n) and n < K.nstates:
            by_order.setdefault(n, []).append((method, small))
    n_tried, reason = 0, "no controller of lower order keeps what was proved" if K.nstates else "a gain has no states"
    for n in sorted(by_order):
        if time.monotonic() > deadline:
            reason = f"the time cap was reached below order {n}"
            break
        n_tried += len(by_order[n])
        for method, small in rank_candidates(
            by_order[n], model, w_P=w_P, delay=delay, whole=K, before=before, every=order is not None
        ):
            report = check(model, small, w_P=w_P, delay=delay)
            kept, lost = compare_reports(report, before, change_of_T(model, K, small=small, before=before))
            if kept or order is not None:
                return Reduction(
                    K=with_names(small, K.input_labels, K.output_labels),
                    order=n,
                    method=method,
                    kept=kept,
                    report=report,
                    before=before,
                    reason=lost,
                    n_tried=n_tried,
                )
    return Reduction(
        K=K,
        order=K.nstates,
        method="not reduced",
        kept=True,
        report=before,
        before=before,
        reason=reason,
        n_tried=n_tried,
    )


def plant_as_set(model: FrfSource | LinearSystem) -> FrfSource:
    """Return a plant as the set of those within a billionth of it, anything else as it is."""
    if is_measured(model) or isinstance(model, UncertaintyModel):
        return model
    G = multivariable("model", model)
    omega, one, small = np.ones(1), *(control.StateSpace([], [], [], [[size]], G.dt) for size in (1.0, LEAST_RADIUS))
    if G.ninputs == G.noutputs == 1:
        radius = np.full(1, 0.9 * LEAST_RADIUS)
        return UncertaintyModel(G, small, "multiplicative", omega, radius, perturbation="LTI")
    left, right = (one,) * G.ninputs, (small,) * G.ninputs
    return UncertaintyModel(G, form="input", left=left, right=right, omega=omega, perturbation="LTI")


def candidates(
    K: control.StateSpace, model: FrfSource, *, w_P: Weight | None, delay: float
) -> Iterator[tuple[str, int, control.StateSpace]]:
    """(method, order, controller) by every way that works on this controller."""
    if not K.nstates:
        return
    dt = timebase(K)
    image = continuous_image(K)
    ways = [lambda: balanced_candidates(image), lambda: coprime_factor_candidates(image)]
    if not is_measured(model):
        pairs = ((("y",), ("p_in",)), (("e",), ("r",)))
        if has_several_channels(model):
            closed_loops = [
                control.StateSpace(*closed_loop(model.nominal, K, *pair), model.nominal.dt) for pair in pairs
            ]
        else:
            assert isinstance(model, UncertaintyModel)
            loop = assemble_loop(model, K, w_P=w_P, delay=delay)
            closed_loops = [loop.closed_loop(*pair) for pair in pairs]
        before, behind = map(continuous_image, closed_loops)
        if np.all(np.linalg.eigvals(before[0]).real < 0):
            ways.append(lambda: weighted_candidates(image, before, behind))
    for way in ways:
        try:
            for method, n, small in way():
                if all(np.isfinite(part).all() for part in small):
                    yield method, n, control.StateSpace(*(to_discrete(*small) if dt else small), K.dt)
        except (np.linalg.LinAlgError, ValueError):
            continue


def is_measured(model: FrfSource) -> bool:
    """Return whether the plant is known on its lines only."""
    return (
        is_single(model) or isinstance(model, control.FrequencyResponseData) or getattr(model, "measured_only", False)
    )


def rank_candidates(
    small: list[tuple[str, control.StateSpace]],
    model: FrfSource,
    *,
    w_P: Weight | None,
    delay: float,
    whole: control.StateSpace,
    before: RobustnessReport,
    every: bool,
) -> list[tuple[str, control.StateSpace]]:
    """Sort reduced controllers by their curves, best first, and drop those that cannot keep what was proved."""
    found = []
    for method, K in small:
        try:
            report = check(model, K, w_P=w_P, delay=delay, certify=False)
        except ValueError:  # a loop without a solution
            continue
        change = change_of_T(model, whole, small=K, before=before)
        performs = report.margins.rp >= 1 if before.proofs.robust_performance else change <= MAX_CHANGE_OF_T
        if (report.margins.rs > 1 and performs) or every:
            size = report.margins.rp if before.proofs.robust_performance else -change
            found.append((report.nominally_stable, float(np.nan_to_num(size)), method, K))
    return [(method, K) for _, _, method, K in sorted(found, key=lambda one: one[:2], reverse=True)]


def compare_reports(report: RobustnessReport, before: RobustnessReport, change: float) -> tuple[bool, str]:
    """Return whether everything that was proved before is proved again, and what is not."""
    if before.verdict.is_robust and report.verdict != before.verdict:
        return False, f"the verdict is '{report.verdict}' where it was '{before.verdict}': {report.reason}"
    if before.proofs.robust_performance and not report.proofs.robust_performance:
        return False, "robust performance is not proved any more"
    if not before.proofs.robust_performance and not change <= MAX_CHANGE_OF_T:
        return False, f"the closed loop moved by {change:.3g}"
    return True, ""


def change_of_T(
    model: FrfSource, K: control.StateSpace, *, small: control.StateSpace, before: RobustnessReport
) -> float:
    """max |T_r - T| of the nominal loop on the grid of its report, inf where nothing is known of it."""
    if has_several_channels(model):
        G, one = response_by_channel(model.nominal, before.curves.omega), np.eye(model.n_outputs)
        L = (
            np.moveaxis(np.einsum("jkw,klw->jlw", G, response_by_channel(part, before.curves.omega)), 2, 0)
            for part in (K, small)
        )
        S, S_r = (np.linalg.inv(one + part) for part in L)
        return float(np.linalg.norm(S_r - S, 2, axis=(1, 2)).max())
    with np.errstate(all="ignore"):
        d = before.curves.T * (1 - response(small, before.curves.omega) / before.curves.K)  # (W,) (K - K_r) G S
        change = np.abs(before.curves.S * d / (1 - d))
    return float(np.nanmax(change)) if np.isfinite(change).any() else np.inf
