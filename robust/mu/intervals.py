"""Search for a proof, interval by interval, that mu is below a level: scalings, P and Q for the
generalised KYP lemma.

An interval of x, which is omega or tan(omega dt / 2), is mapped to [-1, 1] by v = (alpha x +
beta)/(gamma x + delta), and one scaling is used on it. The proof needs a Q > 0 with

    X_R - N* X_L N + K N + N* K* - (1 - v^2) g* Q g > 0      at every real v, g the states,

so Q makes the inequality harder inside the interval, and easier outside, where the scaling does not
fit. Around v = 0 N moves along C A^-1. With Q along C and C A^-1 both effects improve as the
interval shrinks, so a level above mu is proved if the intervals are short enough. P is the solution
of a Riccati equation. All these numbers are only proposals: `robust.proofs.exact.interval_kyp`
decides over the rationals.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace

import control
import numpy as np
from scipy.linalg import schur, solve_continuous_lyapunov

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.lti.lti import Matrices, evaluate_transfer
from robust.mu.scalings import conjugate_transpose, upper_bound
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.interval_kyp import (
    ComplexMatrix,
    ExactLoop,
    IntervalClaim,
    IntervalProof,
    verify_level,
)
from robust.proofs.exact.scaled_kyp import LEVEL, Block
from robust.proofs.search.certificate import GENERALISED_KYP, Certificate, failed_certificate
from robust.proofs.search.scaled_kyp import ScalingSearch

_MOST_INTERVALS = 400
# relative width of the narrowest interval, also relative to the slowest and the fastest pole
_NARROW = 1e-6
_WITHIN = np.array([-1.0, -0.6, 0.0, 0.6, 1.0])  # v at which scalings are searched
_AROUND = np.tan(np.pi / 2 * np.linspace(-0.995, 0.995, 80))  # v at which Q is tried
_FARTHEST = 1e6  # v beyond which the response is that at infinity
#: Factors on the modulus of every pole, for further frequencies at which Q is tried.
_MODE_OFFSETS = (0.1, 0.3, 0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.7, 3.0, 10.0)
_SHARES = (
    0.05,
    0.15,
    0.4,
    0.7,
)  # of the slack of the scaling that Q may cost, along C and along C A^-1
#: Floors of all scalings relative to the largest: weakly coupled blocks may have any scaling, and
#: similar ones are best.
_FLOORS, _NEARLY = (0.1, 1e-2, 1e-3, 1e-5, 1e-9), 0.7
_LEAST_Q = 1e-3  # share of the remaining slack for Q along each state
_MARGINS = (
    0.7,
    0.3,
    0.03,
    1e-3,
)  # share of the remaining slack that all states together must leave


def certify_intervals(
    system: control.StateSpace,
    blocks: Sequence[Block],
    level: float,
    *,
    most: int = _MOST_INTERVALS,
) -> Certificate:
    """Return a certificate of a level for a stable system with one scaling an interval.

    system : continuous or discrete. blocks : (rows, cols, kind) of each. most : largest number of
    intervals. The reason of a certificate that does not hold names the open interval.

    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> proof = certify_intervals(control.append(lag, 2 * lag), [(1, 1, "full"), (1, 1, "real")], 2.001)
    >>> print(proof.method, proof.verify(), sep=chr(10))
    generalised KYP
    stability: proved, rigorous
    structured singular value: proved, rigorous
    """
    waiting: list[tuple[float, float]] = [(0.0, np.inf)]
    done: list[tuple[float, IntervalProof]] = []
    if not system.nstates:
        return failed_certificate(
            LEVEL, level, "no scaling was found, and a system without states has no intervals"
        )
    search = _IntervalSearch.of(system, tuple(blocks), level)
    while waiting:
        low, high = waiting.pop()
        piece, (reached, where) = search.prove(low, high)
        if piece is not None:
            done.append((low, piece))
            continue
        if reached >= 1:
            there = f"at {format_hertz(where)} it is {reached:.6g}"
            return failed_certificate(
                LEVEL, level, f"the bound does not stay below the level: {there}"
            )
        start, end = (format_hertz(search.omega_of(x)) for x in (low, high))
        if len(done) + len(waiting) >= most or search.is_narrow(low, high):
            return failed_certificate(
                LEVEL, level, f"undecided from {start} to {end}, {len(done)} intervals are proved"
            )
        cut = search.cut_between(low, high)
        waiting += [(cut, high), (low, cut)]
    claim = replace(
        search.claim,
        cuts=np.array([low for low, _ in done[1:]]),
        pieces=tuple(one for _, one in done),
    )
    return Certificate(
        subject=LEVEL,
        outcome=Outcome.HOLDS,
        level=level,
        method=GENERALISED_KYP,
        intervals=claim.intervals,
        reason="",
        claim=claim,
        again=verify_level,
    )


@value(copy=False)
class _Frozen:
    """A scaling: X of every block and K of the real blocks; X_L, X_R and K on the channels."""

    X: tuple[np.ndarray, ...]
    K: tuple[np.ndarray, ...]
    left: np.ndarray
    right: np.ndarray
    skew: np.ndarray

    def popov(self, N: np.ndarray) -> np.ndarray:
        """Return (W, m, m) X_R - N* X_L N + K N + N* K*; positive means the level is proved."""
        turned = self.skew @ N
        return np.asarray(
            self.right
            - conjugate_transpose(N) @ self.left @ N
            + turned
            + conjugate_transpose(turned)
        )

    @property
    def root(self) -> np.ndarray:
        """R with R X_R R* = I."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.right)))


@value(copy=False)
class _IntervalSearch:
    """A stable system at level one in continuous time, with the search for the proofs of its
    intervals.
    """

    search: ScalingSearch  # the system in balanced channels and good coordinates
    claim: IntervalClaim  # the claim, with a piece that proves nothing
    loop: ExactLoop  # exact test of a piece
    poles: np.ndarray  # poles of the system

    @classmethod
    def of(
        cls, system: control.StateSpace, blocks: tuple[Block, ...], level: float
    ) -> _IntervalSearch:
        search, exact = ScalingSearch.of(system, blocks, level), to_matrices(system)
        A = search.matrices[0]
        sizes = [1 if kind == "full" else rows for rows, _, kind in blocks]
        with warnings.catch_warnings():
            # near the boundary it may prove nothing: exact arithmetic decides
            warnings.simplefilter("ignore", RuntimeWarning)
            stability = solve_continuous_lyapunov(A.T, -np.eye(len(A)))
        none, *nothing = (ComplexMatrix.of(np.zeros((size, size))) for size in (len(A), *sizes))
        claim = IntervalClaim(
            system=exact,
            blocks=blocks,
            level=level,
            stability=stability,
            # g is sqrt(2) times the state of the continuous image
            T=search.T * level / (np.sqrt(2) if exact.dt else 1),
            cuts=np.zeros(0),
            pieces=(IntervalProof(P=none, Q=none, scalings=tuple(nothing), skews=tuple(nothing)),),
        )
        return cls(search=search, claim=claim, loop=ExactLoop.of(claim), poles=np.linalg.eigvals(A))

    def omega_of(self, x: float) -> float:
        """Return the frequency [rad/s] of x."""
        dt = self.claim.system.dt
        if dt:
            return float(2 / dt * np.arctan(x))
        return x

    def is_narrow(self, low: float, high: float) -> bool:
        speeds = np.abs(self.poles)
        if np.isinf(high):
            return bool(low > speeds.max() / _NARROW)
        return bool(high - low <= _NARROW * low if low else high < _NARROW * speeds.min())

    def cut_between(self, low: float, high: float) -> float:
        if np.isinf(high):
            return 6 * low or float(np.exp(np.log(np.maximum(np.abs(self.poles), 1e-300)).mean()))
        if not low:
            return high / 6
        if high > 2 * low:
            return float(np.sqrt(low * high))
        return (low + high) / 2

    def prove(self, low: float, high: float) -> tuple[IntervalProof | None, tuple[float, float]]:
        """Return the proof of one interval, or None; and the largest bound there over the level,
        and where.
        """
        if not low and np.isinf(high):
            return None, (0.0, 0.0)
        turned, back_to_x = _on_unit_interval(self.search.matrices, low, high)
        response = evaluate_transfer(*turned, 1j * _WITHIN)
        bound = upper_bound(response, self.claim.blocks, target=1.0)
        alpha, beta, gamma, delta = _mobius(low, high)
        v = _WITHIN[bound.value.argmax()]
        if alpha > gamma * v:
            there = (delta * v - beta) / (alpha - gamma * v)
        else:
            there = np.inf
        reached = float(bound.value.max()), self.omega_of(there)
        assert bound.scaling is not None  # for an upper bound
        tried = [
            self.freeze(*(each[:, :, k] for each in bound.scaling), floor=floor)
            for floor in _FLOORS
            for k in range(len(_WITHIN))
        ]
        left = [
            float(_least_eigenvalues(one.root @ one.popov(response) @ one.root.conj().T).min())
            for one in tried
        ]
        best = int(
            np.argmax(np.array(left) >= _NEARLY * max(left))
        )  # the highest floor that is nearly as good
        if reached[0] >= 1 or not left[best] > 0:
            return None, reached
        units = self.search.balance**2
        for P, Q in _storages(turned, tried[best], left[best], self.around(low, high)):
            piece = IntervalProof(
                P=ComplexMatrix.of(back_to_x[0] * P),
                Q=ComplexMatrix.of(back_to_x[1] * Q),
                scalings=tuple(
                    ComplexMatrix.of(d * X) for d, X in zip(units, tried[best].X, strict=True)
                ),
                skews=tuple(
                    ComplexMatrix.of(d * self.claim.level * K)
                    for d, K in zip(units, tried[best].K, strict=True)
                ),
            )
            if self.loop.holds(piece, low, None if np.isinf(high) else high):
                return piece, reached
        return None, reached

    def around(self, low: float, high: float) -> np.ndarray:
        """Return v for frequencies around an interval and every pole, with both signs."""
        alpha, beta, gamma, delta = _mobius(low, high)
        at_modes = np.abs(self.poles.imag)[:, None] + np.outer(self.poles.real, [-1, 0, 1])
        x = np.concatenate([np.outer(np.abs(self.poles), _MODE_OFFSETS).ravel(), at_modes.ravel()])
        x = np.concatenate([x, -x, [0.0]])
        with np.errstate(all="ignore"):
            v = (alpha * x + beta) / (gamma * x + delta)
        return np.concatenate([_AROUND, v[np.abs(v) < _FARTHEST]])

    def freeze(self, D_L: np.ndarray, D_R: np.ndarray, G: np.ndarray, *, floor: float) -> _Frozen:
        """Return the scaling of a bound with exact structure, bounded from below."""
        left, right = D_L.conj().T @ D_L, D_R.conj().T @ D_R
        skew, X, K, r, c = -1j * D_R.conj().T @ G @ D_L, [], [], 0, 0
        least = floor * float(np.abs(np.diag(left)).max())
        for rows, cols, kind in self.claim.blocks:
            if kind == "full":
                own = left[r : r + 1, r : r + 1].real + 0j
            else:
                own = left[r : r + rows, r : r + rows]
            if kind == "real":
                between = skew[c : c + cols, r : r + rows]
            else:
                between = np.zeros_like(own)
            X.append((own + own.conj().T) / 2 + least * np.eye(len(own)))
            K.append((between - between.conj().T) / 2)
            r, c = r + rows, c + cols
        size = float(np.exp(np.mean([np.log(np.trace(each).real / len(each)) for each in X])))
        X, K = ([each / size for each in group] for group in (X, K))
        left, right, skew = self.search.place(X, K)
        return _Frozen(X=tuple(X), K=tuple(K), left=left, right=right, skew=skew)


def _mobius(low: float, high: float) -> tuple[float, float, float, float]:
    """Return alpha, beta, gamma, delta of v = (alpha x + beta)/(gamma x + delta), which is -1 and 1
    at the ends.
    """
    if np.isinf(high):
        return 1.0, -3 * low, 1.0, low
    half = (high - low) / 2
    return 1 / half, -(low + high) / (2 * half), 0.0, 1.0


def _on_unit_interval(
    matrices: Matrices, low: float, high: float
) -> tuple[Matrices, tuple[float, float]]:
    """Return the system as a function of v, and the factors that take P and Q back to x."""
    A, B, C, D = matrices
    alpha, beta, gamma, delta = _mobius(low, high)
    one = np.eye(len(A))
    back = np.linalg.inv(delta * one - 1j * gamma * A)
    A_v = (alpha * A + 1j * beta * one) @ back
    turned = A_v, alpha * B + 1j * gamma * A_v @ B, C @ back, D + 1j * gamma * C @ back @ B
    return turned, (4 * low, 8 * low) if np.isinf(high) else (alpha, alpha**2)


def _least_eigenvalues(M: np.ndarray) -> np.ndarray:
    """Return (W,) least eigenvalues of Hermitian matrices; -inf if not finite."""
    fine = np.isfinite(M).all(axis=(1, 2))
    return np.where(fine, np.linalg.eigvalsh(np.where(fine[:, None, None], M, 0))[:, 0], -np.inf)


def _storages(
    turned: Matrices, scaling: _Frozen, left: float, v: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield P and Q as functions of v, with decreasing margin; nothing if no Q works."""
    A, B, C, D = turned
    n, root = len(A), scaling.root
    g = np.linalg.solve(
        1j * v[:, None, None] * np.eye(n) - A,
        np.broadcast_to(B @ root.conj().T, (len(v), *B.shape)),
    )
    size = np.maximum(
        np.linalg.norm(g, axis=2).max(axis=0), 1e-100
    )  # of each state, which is scaled to one below
    A, B, C, g = A * size / size[:, None], B / size[:, None], C * size, g / size[:, None]
    along = [L.conj().T @ scaling.left @ L for L in (C, C @ np.linalg.inv(A))]
    costs = [(1 - v**2)[:, None, None] * (conjugate_transpose(g) @ W @ g) for W in along]
    without = root @ scaling.popov(C @ (g @ np.linalg.inv(root.conj().T)) + D) @ root.conj().T
    within = np.abs(v) < 1
    units = [left / max(-float(_least_eigenvalues(-each[within]).min()), 1e-100) for each in costs]
    tried = [(p * units[0], q * units[1]) for p in _SHARES for q in (0.0, *_SHARES)]
    worst = [
        float(_least_eigenvalues(without - p * costs[0] - q * costs[1]).min()) for p, q in tried
    ]
    best = int(np.argmax(worst))
    if not worst[best] > 0:
        return
    Q = tried[best][0] * along[0] + tried[best][1] * along[1]
    Q = (Q + Q.conj().T) / 2 + _LEAST_Q * worst[best] / n * np.eye(n)
    for margin in _MARGINS:
        P = _riccati_storage((A, B, C, D), scaling, Q, margin * worst[best] / n)
        if P is not None:
            yield P / np.outer(size, size), Q / np.outer(size, size)


def _riccati_storage(
    turned: Matrices, scaling: _Frozen, Q: np.ndarray, margin: float
) -> np.ndarray | None:
    """Return P that solves the inequality with a margin for every state, or None."""
    A, B, C, D = turned
    n = len(A)
    top = Q - A.conj().T @ Q @ A + C.conj().T @ scaling.left @ C + margin * np.eye(n)
    side = -A.conj().T @ Q @ B + C.conj().T @ (scaling.left @ D - scaling.skew.conj().T)
    corner = -scaling.popov(D[None])[0] - B.conj().T @ Q @ B
    if not _least_eigenvalues(-corner[None])[0] > 0:
        return None
    try:
        F = A - B @ np.linalg.solve(corner, side.conj().T)
        G = B @ np.linalg.solve(corner, B.conj().T)
        H = top - side @ np.linalg.solve(corner, side.conj().T)
        if H.any() and G.any():
            scale = np.sqrt(np.linalg.norm(H) / np.linalg.norm(G))
        else:
            scale = 1.0
        _, Z, stable = schur(
            np.block([[F, -G * scale], [-H / scale, -F.conj().T]]), output="complex", sort="lhp"
        )
        P = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * scale
    except (np.linalg.LinAlgError, ValueError):
        return None
    if stable == n and np.isfinite(P).all():
        return (P + P.conj().T) / 2
    return None
