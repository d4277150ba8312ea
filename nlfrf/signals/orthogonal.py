"""Multisines for several inputs: orthogonal sets of experiments, or one experiment in which each
line excites one input.

    U_ie(k) = A_i(k) exp(j phi_i(k)) T_ie exp(j psi_e(k)),    T T^H = n_u I,  |T_ie| = 1

phi and psi are random over lines, inputs, experiments and sets. So every experiment has independent
random phases in every channel, and the theory of random-phase multisines holds for each of them.
Yet U U^H = n_u diag(A_i^2) exactly, which separates the inputs (Dobrowiecki & Schoukens 2007). In a
"zippered" design each line excites one input only.
"""

from __future__ import annotations

import numpy as np

from nlfrf.signals.lines import LineGrid

DESIGNS = ("orthogonal", "zippered")


def draw_phases(
    shape: tuple[int, int], n_realizations: int, *, design: str, rng: np.random.Generator
) -> np.ndarray:
    """Return phases (M, F) for one input, or (n_u, M, F) for several in all experiments; `shape` is
    (n_u, F).
    """
    n_inputs, n_lines = shape
    if n_inputs == 1:
        return rng.uniform(0, 2 * np.pi, size=(n_realizations, n_lines))
    sets = [_set_phases(n_inputs, n_lines, design=design, rng=rng) for _ in range(n_realizations)]
    return np.concatenate(sets, axis=1)


def _set_phases(
    n_inputs: int, n_lines: int, *, design: str, rng: np.random.Generator
) -> np.ndarray:
    """Return (n_u, n_u or 1, F) phases of one set: phi_i + psi_e + arg T_ie, all of them from 0 to
    2 pi.
    """
    phi = rng.uniform(0, 2 * np.pi, size=(n_inputs, 1, n_lines))
    if design == "zippered":
        return phi
    psi = rng.uniform(0, 2 * np.pi, size=(1, n_inputs, n_lines))
    return np.mod(phi + psi + np.angle(_dft_matrix(n_inputs))[:, :, None], 2 * np.pi)


def assign_lines(
    kind: str, grid: LineGrid, *, n_inputs: int, rng: np.random.Generator
) -> np.ndarray:
    """Return (n_u, F) ones on the lines of each zippered input: one line in every n_u excited
    lines, at random.

    On a periodic grid the power that u1^3 puts on detection lines is never that on its own lines.
    """
    if kind in ("special-odd", "odd-odd"):
        raise ValueError(
            f"kind must be random-odd for a zippered design, got {kind!r}: its 95 % bound would"
            " hold for 61 to 78 % only"
        )
    n_lines = grid.excited.size
    if n_lines < 2 * n_inputs:
        raise ValueError(
            f"f_min and f_max must hold at least two lines per input, {2 * n_inputs}, got {n_lines}"
        )
    rounds = -(-n_lines // n_inputs)
    owner = np.concatenate([rng.permutation(n_inputs) for _ in range(rounds)])[:n_lines]
    return (owner == np.arange(n_inputs)[:, None]).astype(float)


def _dft_matrix(n: int) -> np.ndarray:
    """Return (n, n) T with T T^H = n I and |T_ie| = 1, which separates the experiments of a set."""
    return np.exp(-2j * np.pi * np.outer(np.arange(n), np.arange(n)) / n)


def check_mixing(mixing: np.ndarray, n_inputs: int) -> None:
    """Refuse a mixing that leaves a direction without input."""
    if mixing.shape != (n_inputs, n_inputs):
        raise ValueError(f"mixing must have shape ({n_inputs}, {n_inputs}), got {mixing.shape}")
    sizes = np.linalg.svd(mixing, compute_uv=False)
    if not sizes[-1] > 1e-9 * sizes[0]:
        raise ValueError(
            f"mixing must have full rank, got singular values from {sizes[-1]:.3g} to"
            f" {sizes[0]:.3g}"
        )
