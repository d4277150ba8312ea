"""Sum the modes of the entries of a transfer matrix with a minimal number of states.

Each entry is split into modes. For each cluster of poles of all entries, only controllable and
observable states are kept (Gilbert 1963 for simple poles, the staircase algorithm of Van Dooren
1981 for others). Each rank decision is made with scaled channels and among poles of similar
magnitude, so it depends neither on units nor on the decades between poles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, schur, solve_sylvester

from nlfrf._base.numbers import EPS, TINY

#: Share of the largest direction above which a direction counts as reached; below it is rounding.
_LEAST_REACHED = 1e-9
#: Scatter of poles, relative to their size, below which their differences count less.
_LEAST_SCATTER = 1e-3
#: Distance of a zero of an entry from its pole, relative to the pole, below which both cancel.
_CANCELLED = 1e-9


class EntryModes(NamedTuple):
    """Modes of one entry of a transfer matrix: c (s - A)^-1 b in its row and column, and its
    numerator.
    """

    row: int
    column: int
    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    numerator: np.ndarray


def sum_modes(
    modes: Sequence[EntryModes], shape: tuple[int, int], link: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (A, B, C) of the minimal sum of modes, and the poles that vanish from it.

    Poles closer than `link`, relative to their size, lie together.
    """
    spectra = [np.linalg.eigvals(one.A) for one in modes]
    p = np.concatenate([np.zeros(0, complex), *spectra])
    p = p.real + 1j * np.abs(p.imag)  # one of each pair stands for both
    near = np.abs(p[:, None] - p) <= link * np.maximum(np.abs(p), np.abs(p)[:, None])
    for _ in range(len(p).bit_length()):  # neighbours of neighbours
        near = near @ near
    groups = [(np.zeros((0, 0)), np.zeros((0, shape[1])), np.zeros((shape[0], 0)))]
    lost = [np.zeros(0)]
    for inside in np.unique(near, axis=0):
        group, others = p[inside], p[~inside]
        is_real = bool(np.any(group.imag <= link * np.abs(group)))
        parts = [
            part for one in modes if (part := _select_modes(one, group, others, is_real)).c.any()
        ]
        if not parts:
            lost.append(group)
            continue
        A, B, C = _reach_and_see(parts, shape)
        if (
            not is_real
        ):  # one z stands for a pair: its real and imaginary part are the states of both
            A = np.block([[A.real, -A.imag], [A.imag, A.real]])
            B = np.sqrt(2) * np.vstack([B.real, B.imag])
            C = np.sqrt(2) * np.hstack([C.real, -C.imag])
        groups.append((A, B, C))
    As, Bs, Cs = zip(*groups, strict=True)
    return block_diag(*As[1:] or As), np.vstack(Bs), np.hstack(Cs), np.concatenate(lost)


def _select_modes(
    one: EntryModes, group: np.ndarray, others: np.ndarray, is_real: bool
) -> EntryModes:
    """Return the modes of an entry at a group of poles, those in the lower half plane only if the
    group is real.
    """

    def belongs(re: complex, im: float = 0.0) -> bool:
        pole = complex(re) + 1j * im
        upper = complex(pole.real, abs(pole.imag))
        nearest = np.abs(group - upper).min() < np.abs(others - upper).min(initial=np.inf)
        return bool(nearest and (is_real or pole.imag > 0))

    T, Z, k = schur(one.A, output="real" if is_real else "complex", sort=belongs)
    # T = [T11 T12; 0 T22] made block diagonal: T11 X - X T22 = -T12
    if 0 < k < len(T):
        X = solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:])
    else:
        X = np.zeros((k, len(T) - k))
    forth = Z.conj().T @ one.b
    at, n = np.linalg.eigvals(T[:k, :k]), one.numerator
    by_zero = _CANCELLED * np.abs(
        at * np.polyval(np.polyder(n), at)
    )  # one step of Newton's method away
    stays = np.abs(np.polyval(n, at)) > by_zero + 10 * EPS * np.polyval(np.abs(n), np.abs(at))
    return one._replace(A=T[:k, :k], b=forth[:k] - X @ forth[k:], c=stays.any() * one.c @ Z[:, :k])


def _reach_and_see(
    parts: Sequence[EntryModes], shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (A, B, C) with the states of poles of one size that are reached from inputs and seen
    at outputs.
    """
    size = np.zeros(shape)
    for one in parts:
        size[one.row, one.column] = np.linalg.norm(one.b) * np.linalg.norm(one.c)
    rows, columns = channel_units(size)
    A = block_diag(*(one.A for one in parts))
    B, C = np.zeros((len(A), shape[1]), A.dtype), np.zeros((shape[0], len(A)), A.dtype)
    first = 0
    for one in parts:
        at = slice(first, first + len(one.A))
        level = np.sqrt(
            np.linalg.norm(one.c) / np.linalg.norm(one.b) * columns[one.column] / rows[one.row]
        )
        B[at, one.column], C[one.row, at] = (
            level / columns[one.column] * one.b,
            one.c / level / rows[one.row],
        )
        first = at.stop
    centre = np.trace(A) / len(A)
    N = A - centre * np.eye(len(A))
    N /= max(float(np.linalg.norm(N)), _LEAST_SCATTER * abs(centre), TINY)
    Q = _reached_states(N, B)
    Q = Q @ _reached_states((Q.conj().T @ N @ Q).conj().T, (C @ Q).conj().T)
    return Q.conj().T @ A @ Q, Q.conj().T @ B * columns, C @ Q * rows[:, None]


def channel_units(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return scales of rows and columns that make entries of these sizes alike."""
    known = size > 0
    logs = np.log(np.where(known, size, 1.0))
    rows, columns = np.zeros(len(size)), np.zeros(size.shape[1])
    for _ in range(10):
        rows = np.sum((logs - columns) * known, axis=1) / np.maximum(known.sum(axis=1), 1)
        columns = np.sum((logs - rows[:, None]) * known, axis=0) / np.maximum(known.sum(axis=0), 1)
    return np.exp(rows), np.exp(columns)


def _reached_states(N: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, r) of the states that B reaches through an N of norm one."""
    basis = np.zeros((len(N), 0), N.dtype)
    new, least = B, _LEAST_REACHED * float(np.linalg.norm(B, 2))
    while basis.shape[1] < len(N):
        for _ in range(2):  # the second pass removes rounding
            new = new - basis @ (basis.conj().T @ new)
        U, sizes, _ = np.linalg.svd(new, full_matrices=False)
        found = U[:, sizes > least]
        if not found.shape[1]:
            break
        basis, least = np.hstack([basis, found]), _LEAST_REACHED
        new = N @ found
    return basis
