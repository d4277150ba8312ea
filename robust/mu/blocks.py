"""The block structure of a perturbation, and the scalings that commute with it.

N is partitioned as Delta^T: the input of a block (rows, cols) is `rows` outputs of N, and its
output is `cols` inputs of N.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf._base.arguments import as_list, short_form
from nlfrf._base.values import value
from robust._base.types import Blocks

KINDS = ("full", "repeated", "real")


@value(copy=False)
class BlockStructure:
    """Blocks of a perturbation along the diagonal."""

    # "full" (any complex matrix), "repeated" (a complex number times the identity), "real" (a real
    # one)
    kinds: tuple[str, ...]
    # rows, cols: outputs of N that each block reads, and inputs of N that it drives
    rows: tuple[slice, ...]
    cols: tuple[slice, ...]
    # left, right: (K, ., .) basis of the Hermitian scalings that commute with the blocks, on the
    # outputs and the inputs of N
    left: np.ndarray
    right: np.ndarray
    skew: np.ndarray  # (L, n_cols, n_rows) basis of the Hermitian G for the real blocks

    @property
    def shape(self) -> tuple[int, int]:
        """Number of outputs and of inputs of N that belong to the perturbation."""
        return self.rows[-1].stop, self.cols[-1].stop

    @property
    def scalar(self) -> bool:
        """True if the scaling is one number for each block."""
        return all(
            kind == "full" or r.stop - r.start == 1
            for kind, r in zip(self.kinds, self.rows, strict=True)
        )


def block_structure(name: str, blocks: Blocks) -> BlockStructure:
    """Return the blocks, checked, with the bases of their scalings."""
    if not isinstance(blocks, list | tuple) or not blocks:
        raise ValueError(
            f"{name} must be a list of (rows, cols), (n, n, 'repeated') or (n, n, 'real')"
        )
    kinds, rows, cols, r, c = [], [], [], 0, 0
    for k, block in enumerate(blocks):
        n, m, kind = _check_block(f"{name}[{k}]", block)
        kinds.append(kind)
        rows.append(slice(r, r + n))
        cols.append(slice(c, c + m))
        r, c = r + n, c + m
    left, right, skew = [], [], []
    for kind, row, col in zip(kinds, rows, cols, strict=True):
        n = row.stop - row.start
        if kind == "full":
            left.append(_place_block(np.eye(n), (r, r), row=row, col=row))
            right.append(_place_block(np.eye(col.stop - col.start), (c, c), row=col, col=col))
            continue
        for H in _hermitian_basis(n):
            left.append(_place_block(H, (r, r), row=row, col=row))
            right.append(_place_block(H, (c, c), row=col, col=col))
            if kind == "real":
                skew.append(_place_block(H, (c, r), row=col, col=row))
    return BlockStructure(
        kinds=tuple(kinds),
        rows=tuple(rows),
        cols=tuple(cols),
        left=np.array(left),
        right=np.array(right),
        skew=np.array(skew) if skew else np.zeros((0, c, r), complex),
    )


def _check_block(name: str, block: object) -> tuple[int, int, str]:
    """Return rows, columns and kind of one block, or refuse it."""
    parts: list[Any] = as_list(block)
    if len(parts) not in (2, 3) or not all(
        isinstance(n, (int, np.integer)) and n >= 1 for n in parts[:2]
    ):
        raise ValueError(
            f"{name} must be (rows, cols) with whole numbers of at least 1, got {short_form(block)}"
        )
    if len(parts) == 3:
        kind = parts[2]
    else:
        kind = "full"
    if kind not in KINDS:
        raise ValueError(
            f"{name} must be of the kind 'full', 'repeated' or 'real', got {short_form(kind)}"
        )
    if kind != "full" and parts[0] != parts[1]:
        raise ValueError(
            f"{name} must be square to be {kind}, got {parts[0]} rows and {parts[1]} columns"
        )
    if kind == "repeated" and parts[0] == 1:
        kind = "full"  # one complex number is a full block too
    return int(parts[0]), int(parts[1]), kind


def blocks_with_kinds(blocks: Blocks) -> list[tuple[int, int, str]]:
    """Return (rows, cols, kind) of every block, checked."""
    return [_check_block(f"blocks[{k}]", block) for k, block in enumerate(blocks)]


def structure_for(
    name: str, blocks: Blocks, shape: tuple[int, int], *, of: str = "N"
) -> BlockStructure:
    """Return the structure; refuse one that does not match the outputs and inputs of the system."""
    found = block_structure(name, blocks)
    if found.shape != tuple(shape):
        raise ValueError(
            f"{name} must add up to the {shape[0]} outputs and {shape[1]} inputs of {of}, got"
            f" {found.shape[0]} rows and {found.shape[1]} columns. A block is (rows, cols): the"
            f" number of outputs of {of} that are its input, and of inputs of {of} that are its"
            " output."
        )
    return found


def with_performance_block(blocks: Blocks, shape: tuple[int, int]) -> tuple[Blocks, np.ndarray]:
    """Return the blocks with a full one for the remaining channels of N, and a mask of it (K,)."""
    rows, cols = block_structure("blocks", blocks).shape
    whole = [*blocks, (shape[0] - rows, shape[1] - cols)]
    return whole, np.arange(len(whole)) == len(blocks)


def _place_block(
    block: np.ndarray, shape: tuple[int, int], *, row: slice, col: slice
) -> np.ndarray:
    out = np.zeros(shape, complex)
    out[row, col] = block
    return out


def _hermitian_basis(n: int) -> list[np.ndarray]:
    """Return n^2 Hermitian matrices of norm one; the diagonal ones come first."""
    basis = [np.diag(row).astype(complex) for row in np.eye(n)]
    for i in range(n):
        for k in range(i + 1, n):
            for entry in (1.0, 1j):
                H = np.zeros((n, n), complex)
                H[i, k], H[k, i] = entry, np.conj(entry)
                basis.append(H / np.sqrt(2))
    return basis
