"""Both bounds of mu, or of the worst gain over a set, in one call, with the perturbation that attains the lower one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import control
import numpy as np

from nlfrf._base.arguments import random_generator
from nlfrf._base.types import Seed
from nlfrf._base.values import value
from robust._base.types import AnySystem, Blocks
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel
from robust.lti.realisation import multivariable
from robust.mu.blocks import structure_for
from robust.mu.gain import gain_bound, search_worst_case
from robust.mu.perturbations import lower
from robust.mu.scalings import response_matrices, upper

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

N_STARTS = 6  # of `lower`


@value(copy=False)
class StructuredBounds:
    """Both bounds at every frequency, with the perturbation that attains the lower one.

    Fields
    ------
    omega : (W,) ndarray or None
        Frequencies [rad/s]; None of an array without them.
    lower, upper : (W,) ndarray
        The structured singular value, or the worst gain over the set, lies between them.
    delta : (n_in, n_out, W) ndarray
        Of mu: the smallest perturbation found with det(I - N delta) = 0, of size 1/lower; nan where none was found. Of
        a gain: the perturbation of size at most one with the gain `lower`; with a lower of inf it makes the loop
        singular.
    quantity : str
        "mu" or "worst gain".

    References
    ----------
    SP 8.8 and 8.12; Packard & Doyle 1993.

    Examples
    --------
    >>> print(bounds(np.array([[2, 2], [-1, -1]]), [(1, 1), (1, 1)]))
    mu between 3 and 3
    """

    omega: np.ndarray | None
    lower: np.ndarray
    upper: np.ndarray
    delta: np.ndarray
    quantity: str = "mu"

    def __str__(self) -> str:
        k = int(np.argmax(self.upper))
        at = "" if self.omega is None else f", largest at {self.omega[k]:.4g} rad/s"
        return f"{self.quantity} between {self.lower.max():.4g} and {self.upper[k]:.4g}{at}"


def bounds(
    N: AnySystem | np.ndarray, blocks: Blocks, omega: ArrayLike | None = None, *, rng: Seed = 0
) -> StructuredBounds:
    """Bound the structured singular value of a system from both sides.

    Parameters
    ----------
    N : control.StateSpace, TransferFunction, FrequencyResponseData or (n_out, n_in, W) ndarray
        What the perturbation closes; one matrix may be (n_out, n_in).
    blocks : list
        As for `upper`: (rows, cols) as N is cut, (n, n, "repeated") or (n, n, "real").
    omega : (W,) array_like, optional
        Frequencies [rad/s]. Of a system they are chosen from its poles when not given, of a frequency response they are
        its own, of an array they are a label.
    rng : Generator, int or None
        For the random starts of the lower bound.

    Returns
    -------
    StructuredBounds
        upper : that of `upper`. lower, delta : those of `lower`.

    Raises
    ------
    ValueError
        Blocks that do not add up to N, frequencies that N does not have.

    References
    ----------
    SP 8.8; Packard & Doyle 1993.

    Examples
    --------
    >>> N = control.ss([[-1.0]], [[1.0, 1.0]], [[2.0], [-1.0]], np.zeros((2, 2)))      # [2, 2; -1, -1]/(s + 1)
    >>> found = bounds(N, [(1, 1), (1, 1)], [0.0, 1.0])
    >>> found.upper.round(3).tolist(), found.lower.round(3).tolist()
    ([3.0, 2.121], [3.0, 2.121])
    >>> abs(np.linalg.det(np.eye(2) - N(1j) @ found.delta[:, :, 1])).round(9).item()
    0.0
    """
    omega, M = sampled_response(N, omega)
    structure_for("blocks", blocks, M.shape[:2])
    found = lower(M, blocks, n_starts=N_STARTS, rng=rng)
    assert found.delta is not None  # of a lower bound
    above = np.maximum(upper(M, blocks).value, found.value)  # where they meet rounding may cross them
    return StructuredBounds(omega=omega, lower=found.value, upper=above, delta=found.delta)


def worst_gain(
    N: AnySystem | np.ndarray, blocks: Blocks, omega: ArrayLike | None = None, *, rng: Seed = 0
) -> StructuredBounds:
    """Bound the worst gain over a set of perturbations from both sides, with a worst case.

    Parameters
    ----------
    N : control.StateSpace, TransferFunction, FrequencyResponseData or (n_out, n_in, W) ndarray
        Its first outputs and inputs belong to the perturbations, the others are the performance; as for `bounds`.
    blocks : list
        The perturbations, of size at most one, as for `upper`.
    omega : (W,) array_like, optional
        Frequencies [rad/s]; as for `bounds`.
    rng : Generator, int or None
        For the random starts of the lower bound.

    Returns
    -------
    StructuredBounds
        upper : skewed mu, by scalings. lower : the gain with `delta`, of size at most one. Both are inf
        where a perturbation of the set makes the loop singular.

    Raises
    ------
    ValueError
        Blocks that leave nothing for the performance, frequencies that N does not have.

    References
    ----------
    SP 8.10.3 (skewed mu); Packard & Doyle 1993; Seiler, Packard & Balas 2010.

    Examples
    --------
    S of L = 1 with 50 % uncertain gain: at worst 1/(1 + 0.5), with the smallest gain.

    >>> N = np.array([[-0.5 * 0.5, 0.5], [-0.5 * 0.5, 0.5]])
    >>> found = worst_gain(N, [(1, 1)])
    >>> found.lower.round(4).item(), found.upper.round(4).item(), found.delta.real.round(4).item()
    (0.6667, 0.6667, -1.0)
    """
    omega, M = sampled_response(N, omega)
    bound = gain_bound(M, blocks)
    reached, delta = search_worst_case(response_matrices("N", M), blocks, upper=bound, rng=random_generator("rng", rng))
    return StructuredBounds(
        omega=omega,
        lower=reached,
        upper=np.maximum(bound, reached),  # where they meet rounding may cross them
        delta=np.moveaxis(delta, 0, 2),
        quantity="worst gain",
    )


def sampled_response(N: AnySystem | np.ndarray, omega: ArrayLike | None) -> tuple[np.ndarray | None, np.ndarray]:
    """Frequencies and the response (n_out, n_in, W) there."""
    if omega is not None:
        omega = np.atleast_1d(np.asarray(omega, dtype=float))
        if omega.ndim != 1 or not np.isfinite(omega).all():
            raise ValueError(f"omega must be a list of finite frequencies [rad/s], got shape {omega.shape}")
    if isinstance(N, control.FrequencyResponseData):
        own = np.asarray(N.omega, dtype=float)
        where = np.arange(own.size) if omega is None else np.searchsorted(own, omega).clip(0, own.size - 1)
        if omega is not None and not np.allclose(own[where], omega, rtol=1e-9, atol=0):
            raise ValueError(
                f"omega must hold frequencies of N, which has {own.size} from {own.min():.4g} to {own.max():.4g} rad/s"
            )
        return own[where], np.asarray(N.frdata)[:, :, where]
    if isinstance(N, control.lti.LTI):
        system = multivariable("N", N)
        at = structure_grid(system)[1:] if omega is None else omega
        return at, response_by_channel(system, at)
    M = np.asarray(N)
    M = M[:, :, None] if M.ndim == 2 else M
    if omega is not None and (M.ndim != 3 or M.shape[2] != omega.size):
        raise ValueError(f"omega must have one frequency for each matrix of N, got {omega.size} for shape {M.shape}")
    return omega, np.moveaxis(response_matrices("N", M), 0, 2)
