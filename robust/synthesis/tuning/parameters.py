"""All blocks as one static matrix M(x) = [[A, B], [C, D]] of the search variables x, and dM/dx.

The derivatives are complex steps (Squire & Trapp 1998), block by block: exact to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nlfrf._base.values import value
from robust.synthesis.blocks import Parameter, TunableBlock, parameter_values, with_parameters

_COMPLEX_STEP = 1e-30  # without a difference nothing cancels


@value
class Controller:
    """The blocks of a design and their free parameters."""

    blocks: dict[str, TunableBlock]
    parameters: tuple[tuple[str, Parameter], ...]  # name of the block, and the parameter
    # n_states, n_in, n_out: sums over all blocks: M has n_states + n_out rows and n_states + n_in
    # columns
    n_states: int
    n_in: int
    n_out: int
    # lower, upper, start: (p,) coordinates
    lower: np.ndarray
    upper: np.ndarray
    start: np.ndarray
    dt: float  # sampling time [s]; 0 if continuous

    @property
    def labels(self) -> list[str]:
        """Return the names of the parameters, with those of their blocks."""
        return [parameter.label(block) for block, parameter in self.parameters]

    def numbers(self, x: np.ndarray) -> np.ndarray:
        """Return (p,) numbers of the blocks at the coordinates x."""
        return np.array(
            [p.from_coordinate(float(one)) for (_, p), one in zip(self.parameters, x, strict=True)]
        )

    @property
    def scheduled(self) -> dict[str, int]:
        """Return the degrees of the scheduled numbers, by their names with those of their blocks."""
        return {
            f"{name}.{number}": degree
            for name, block in self.blocks.items()
            for number, degree in block.scheduled.items()
        }

    def matrix(self, x: np.ndarray, theta: float = 0.0) -> np.ndarray:
        """Return M at the coordinates x and an operating point theta in [-1, 1]."""
        return self.assemble(x, theta, None)

    def slopes(self, x: np.ndarray, theta: float = 0.0) -> np.ndarray:
        """Return (p, rows, columns) dM/dx."""
        return np.array([self.assemble(x, theta, k) for k in range(len(x))]).reshape(
            len(x), self.n_states + self.n_out, self.n_states + self.n_in
        )

    def assemble(self, x: np.ndarray, theta: float, along: int | None) -> np.ndarray:
        """Return M, or its derivative by one coordinate, from the block of that coordinate
        alone.
        """
        M = np.zeros((self.n_states + self.n_out, self.n_states + self.n_in))
        state, row, column, k = 0, self.n_states, self.n_states, 0
        for name, block in self.blocks.items():
            own = [p for owner, p in self.parameters if owner == name]
            n, m, p = block.order, len(block.reads), len(block.drives)
            if along is None or k <= along < k + len(own):
                numbers = parameter_values(block)
                if along is not None:
                    numbers = {key: array.astype(complex) for key, array in numbers.items()}
                for i, parameter in enumerate(own):
                    if along == k + i:
                        step = 1j * _COMPLEX_STEP
                    else:
                        step = 0.0
                    numbers[parameter.name][parameter.index] = parameter.from_coordinate(
                        x[k + i] + step
                    )
                numbers = {
                    key: array if array.ndim else array[()] for key, array in numbers.items()
                }
                parts = block.state_space(block.numbers_at(numbers, theta), self.dt)
                A, B, C, D = (
                    np.asarray(part) if along is None else np.imag(part) / _COMPLEX_STEP
                    for part in parts
                )
                s, o, i_ = slice(state, state + n), slice(row, row + p), slice(column, column + m)
                M[s, s], M[s, i_], M[o, s], M[o, i_] = A, B, C, D
            state, row, column, k = state + n, row + p, column + m, k + len(own)
        return M

    def blocks_at(self, x: np.ndarray) -> dict[str, TunableBlock]:
        """Return the blocks with the numbers at the coordinates x."""
        numbers, found = self.numbers(x), {}
        for name, block in self.blocks.items():
            own = [k for k, (owner, _) in enumerate(self.parameters) if owner == name]
            found[name] = with_parameters(block, [self.parameters[k][1] for k in own], numbers[own])
        return found


def controller_of_blocks(blocks: Mapping[str, TunableBlock], dt: float) -> Controller:
    """Return the blocks at a sampling time dt [s]; refuse blocks without a free parameter."""
    parameters: list[tuple[str, Parameter]] = []
    for name, block in blocks.items():
        try:
            parameters += [(name, parameter) for parameter in block.parameters(dt)]
        except ValueError as error:
            raise ValueError(f"blocks[{name!r}]: {error}") from None
    if not parameters:
        raise ValueError("blocks must have at least one free parameter, got none: all are fixed")
    bounds = np.array([parameter.coordinate_bounds() for _, parameter in parameters])
    return Controller(
        blocks=dict(blocks),
        parameters=tuple(parameters),
        n_states=sum(block.order for block in blocks.values()),
        n_in=sum(len(block.reads) for block in blocks.values()),
        n_out=sum(len(block.drives) for block in blocks.values()),
        lower=bounds[:, 0],
        upper=bounds[:, 1],
        start=np.array([parameter.to_coordinate(parameter.start) for _, parameter in parameters]),
        dt=dt,
    )
