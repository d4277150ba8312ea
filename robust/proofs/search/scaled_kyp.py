"""Search for one matrix P and one scaling that prove a level of the structured singular value at
every frequency.

cvxpy proposes both. P is also computed from a Riccati equation for the proposed scaling, because
that P passes closer to the level. No solver status is used: `robust.proofs.exact.scaled_kyp`
decides over the rationals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.lti.grids import structure_grid
from robust.lti.lti import Matrices, response_by_channel, timebase
from robust.lti.norms import continuous_image, stabilising_riccati, well_conditioned_with
from robust.proofs.exact import claim as exact
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.interval_kyp import verify_level
from robust.proofs.exact.scaled_kyp import LEVEL, ScaledClaim
from robust.proofs.search.certificate import SCALED_KYP, Certificate, failed_certificate
from robust.proofs.search.intervals import SLACK
from robust.proofs.search.programs import SCS_STEPS, SOLVERS, solve_program

# of a program, ten seconds of CLARABEL; larger systems are proved without a solver if possible
_MAX_STATES = 60
# number of states up to which SCS takes all its steps; larger systems get steps for about the same
# time
_WHOLE = 20
# least eigenvalue of a scaling with trace one a row, against solvers that return zero
_MIN_SCALING = 1e-7
# a margin below which no other solver is tried: there is no scaling for all frequencies
_HOPELESS = -1e-3
_MARGINS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)  # relative to the output energy, demanded of every state
Block = tuple[int, int, str]


def certify_scaled(
    system: control.StateSpace,
    blocks: Sequence[Block],
    level: float,
    *,
    solver: str | None = None,
    subject: str = LEVEL,
) -> Certificate | None:
    """Return a certificate of a level with one scaling for all frequencies; None if none is found.

    Parameters
    ----------
    system : control.StateSpace
        Stable, continuous or discrete.
    blocks : list of (rows, cols, kind)
        As in `ScaledClaim`.
    level : float
        Level to prove.
    solver : str, optional
        "CLARABEL" or "SCS" of cvxpy. If it is not given, a scaling without a solver is tried first,
        then both.
    subject : str
        Name of the claim.

    Examples
    --------
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> proof = certify_scaled(control.append(lag, 2 * lag), [(1, 1, "full"), (1, 1, "full")], 2.001)
    >>> print(proof.method, proof.verify(), sep=chr(10))
    scaled KYP
    stability: proved, rigorous
    structured singular value: proved, rigorous
    """
    matrices, search = to_matrices(system), ScalingSearch.of(system, tuple(blocks), level)
    for scaling in search.scalings(solver):
        for P in search.storages(scaling):
            claim = search.claim(matrices, level, scaling, P)
            if all(found.holds for found in claim.decide().values()):
                return Certificate(
                    subject=subject,
                    outcome=Outcome.HOLDS,
                    level=level,
                    method=SCALED_KYP,
                    intervals=np.array(
                        [[0.0, np.pi / timebase(system) if timebase(system) else np.inf]]
                    ),
                    reason="",
                    claim=claim,
                    again=verify_level,
                )
    return None


def certify_with_one_scaling(
    system: control.StateSpace, blocks: Sequence[Block], *, solver: str | None, subject: str
) -> Certificate:
    """Return the certificate of mu < 1 with one scaling for all frequencies."""
    found = certify_scaled(system, blocks, 1 - SLACK, solver=solver, subject=subject)
    if found is None:
        return failed_certificate(
            subject, 1.0, "no P was found with one scaling for all frequencies"
        )
    return replace(found, level=1.0)


@value(copy=False)
class _Scaling:
    """X of every block and G of the real ones, for balanced channels; P and margin of the solver,
    if there is one.
    """

    X: tuple[np.ndarray, ...]
    G: tuple[np.ndarray, ...]
    P: np.ndarray | None = None
    margin: float = 0.0


@value(copy=False)
class ScalingSearch:
    """A system at level one in continuous time, with balanced channels and states."""

    matrices: Matrices  # matrices in coordinates T x, with the channels times `balance`
    blocks: tuple[Block, ...]  # the structure
    T: np.ndarray  # coordinates
    balance: (
        np.ndarray
    )  # (K,) number d of each block: its outputs are multiplied by d, its inputs divided by it

    @classmethod
    def of(
        cls, system: control.StateSpace, blocks: tuple[Block, ...], level: float
    ) -> ScalingSearch:
        d = _balance_channels(system, blocks)
        left, right = (np.repeat(d, sizes) for sizes in _channel_sizes(blocks))
        A, B, C, D = continuous_image(system)  # a discrete loop has the same P
        scaled = A, B / right, left[:, None] * C / level, left[:, None] * D / right / level
        conditioned, first = well_conditioned_with(scaled)
        T = _riccati_coordinates(conditioned)
        return cls(
            matrices=_change_coordinates(conditioned, T), blocks=blocks, T=T @ first, balance=d
        )

    def claim(
        self, system: exact.Matrices, level: float, scaling: _Scaling, P: np.ndarray
    ) -> ScaledClaim:
        """Return the claim in the units of the system."""
        d = self.balance
        return ScaledClaim(
            system=system,
            blocks=self.blocks,
            level=level,
            P=P,
            T=self.T * level,
            scalings=tuple(d[k] ** 2 * X for k, X in enumerate(scaling.X)),
            skews=tuple(d[k] ** 2 * level * G for k, G in enumerate(scaling.G)),
        )

    def scalings(self, solver: str | None) -> Iterator[_Scaling]:
        """Yield scalings to try: that of the solver; if none is given, the balance, then those of
        all solvers.
        """
        sizes = [1 if kind == "full" else rows for rows, _, kind in self.blocks]
        if solver is None:
            yield _Scaling(
                X=tuple(np.eye(n) for n in sizes), G=tuple(np.zeros((n, n)) for n in sizes)
            )
        if self.T.shape[0] > _MAX_STATES:
            return
        for one in SOLVERS if solver is None else (solver,):
            if (found := self.solve(one)) is not None:
                yield found
                if found.margin < _HOPELESS:
                    break

    def solve(self, solver: str) -> _Scaling | None:
        """Return the P, X and G with the largest margin that cvxpy finds, or None."""
        import cvxpy as cp

        A, B, C, D = self.matrices
        n, m = B.shape
        P, t = cp.Variable((n, n), symmetric=True), cp.Variable()
        X, G, constraints = [], [], []
        for rows, _, kind in self.blocks:
            size = 1 if kind == "full" else rows
            X.append(
                cp.Variable((1, 1)) if size == 1 else cp.Variable((size, size), symmetric=True)
            )
            constraints.append(X[-1] >> _MIN_SCALING * np.eye(size))
            G.append(np.zeros((size, size)))
            if kind == "real" and size > 1:
                half = cp.Variable((size, size))
                G[-1] = half - half.T
                constraints.append(cp.norm_inf(cp.vec(half, order="F")) <= 1e3)
        X_L, X_R, skew = self.place(X, G)
        constraints.append(cp.trace(X_L) == C.shape[0])
        CD = np.hstack([C, D])
        lower = np.vstack([np.zeros((n, m)), np.eye(m)])
        cross = lower @ skew @ CD
        if n:
            energy = cp.bmat([[A.T @ P + P @ A, P @ B], [B.T @ P, -X_R]])
        else:
            energy = -X_R
        M = energy + CD.T @ X_L @ CD - cross - cross.T
        units = np.diag(
            1 / np.sqrt(np.concatenate([np.maximum(np.linalg.norm(A, axis=0), 1e-6), np.ones(m)]))
        )
        constraints += [units @ M @ units << -t * np.eye(n + m), t <= 1]
        if n:
            constraints.append(P >> 1e-7 * np.eye(n))
        problem = cp.Problem(cp.Maximize(t), constraints)
        if solve_program(
            problem, solver, steps=round(SCS_STEPS * min(1, (_WHOLE / max(n, 1)) ** 3))
        ):
            return None
        values = [
            np.asarray(V.value if hasattr(V, "value") else V, dtype=float) for V in (*X, *G, P)
        ]
        if any(V.ndim != 2 or not np.isfinite(V).all() for V in values):
            return None
        found = (
            [(V + V.T) / 2 for V in values[: len(X)]],
            [(V - V.T) / 2 for V in values[len(X) : -1]],
        )
        return _Scaling(
            X=tuple(found[0]),
            G=tuple(found[1]),
            P=(values[-1] + values[-1].T) / 2,
            margin=float(t.value),
        )

    def place(self, X: Sequence, G: Sequence) -> tuple:
        """Return X_L, X_R and G on the channels, as numbers or as expressions of cvxpy."""
        outputs, inputs = map(sum, _channel_sizes(self.blocks))
        left, right, skew = 0, 0, np.zeros((inputs, outputs))
        r = c = 0
        for (rows, cols, kind), X_k, G_k in zip(self.blocks, X, G, strict=True):
            E_L, E_R = np.eye(outputs)[:, r : r + rows], np.eye(inputs)[:, c : c + cols]
            if kind == "full":
                left, right = left + X_k[0, 0] * (E_L @ E_L.T), right + X_k[0, 0] * (E_R @ E_R.T)
            else:
                left, right = left + E_L @ X_k @ E_L.T, right + E_R @ X_k @ E_R.T
                skew = skew + E_R @ G_k @ E_L.T
            r, c = r + rows, c + cols
        return left, right, skew

    def storages(self, scaling: _Scaling) -> Iterator[np.ndarray]:
        """Yield P for a scaling: that of the solver, then solutions of the Riccati equation with
        decreasing margin.
        """
        if scaling.P is not None:
            yield scaling.P
        A, B, C, D = self.matrices
        n = A.shape[0]
        X_L, X_R, skew = self.place(scaling.X, scaling.G)
        if not n:
            yield np.zeros((0, 0))
            return
        Q, S = C.T @ X_L @ C, C.T @ (X_L @ D - skew.T)
        R = D.T @ X_L @ D - X_R - skew @ D - (skew @ D).T
        if not np.linalg.eigvalsh(R)[-1] < 0:
            return
        size = np.linalg.norm(Q) / n
        for margin in _MARGINS:
            P = stabilising_riccati(A, B, Q=Q + margin * size * np.eye(n), R=R, S=S)
            if P is not None:
                yield P


def _channel_sizes(blocks: Sequence[Block]) -> tuple[list[int], list[int]]:
    """Return the number of outputs and the number of inputs of each block."""
    return [rows for rows, _, _ in blocks], [cols for _, cols, _ in blocks]


def _change_coordinates(matrices: Matrices, T: np.ndarray) -> Matrices:
    """Return the system in the coordinates T x."""
    A, B, C, D = matrices
    back = np.linalg.inv(T)
    return T @ A @ back, T @ B, C @ back, D


def _riccati_coordinates(matrices: Matrices) -> np.ndarray:
    """Return coordinates in which the identity nearly solves the inequality at a level above the
    norm, as T'T does.
    """
    A, B, C, D = matrices
    n, m = B.shape
    size = np.linalg.norm(C) ** 2 / max(n, 1) + 1e-12
    for level in (1.0, 1.1, 2.0, 10.0, 100.0):
        for margin in (1e-2, 1e-4, 1e-6, 1e-9):
            R = D.T @ D - level**2 * np.eye(m)
            if not n or np.linalg.eigvalsh(R)[-1] >= 0:
                break
            P = stabilising_riccati(A, B, Q=C.T @ C + margin * size * np.eye(n), R=R, S=C.T @ D)
            try:
                T = np.linalg.cholesky(np.zeros((n, n)) if P is None else P).T
            except np.linalg.LinAlgError:
                continue
            if np.isfinite(T).all() and np.linalg.cond(T) < 1e12:
                return np.asarray(T)
    return np.eye(n)


def _balance_channels(
    system: control.StateSpace, blocks: Sequence[Block], n_steps: int = 30
) -> np.ndarray:
    """Return a number for each block, a power of two, that balances the largest gains between them
    (Osborne 1960).
    """
    response = response_by_channel(system, structure_grid(system))
    rows, cols = (np.cumsum([0, *sizes]) for sizes in _channel_sizes(blocks))
    K = len(blocks)
    gains = np.array(
        [
            [
                np.linalg.norm(
                    response[rows[i] : rows[i + 1], cols[k] : cols[k + 1]], axis=(0, 1)
                ).max()
                ** 2
                for k in range(K)
            ]
            for i in range(K)
        ]
    )
    gains = gains * (1 - np.eye(K)) + 1e-40 * (gains.sum() + 1e-200)
    d2 = np.ones(K)
    for _ in range(n_steps):
        for i in range(K):
            d2[i] = np.sqrt((gains[:, i] * d2).sum() / (gains[i] / d2).sum())
    d2 /= np.exp(np.log(d2).mean())
    return np.asarray(2.0 ** np.round(np.log2(d2) / 2))
