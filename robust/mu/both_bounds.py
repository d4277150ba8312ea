"""Both bounds of mu or of the worst gain over a set, with a perturbation for the lower bound.

For a system the upper bound is proved at all frequencies, and the peak of the lower bound is
searched (`robust.mu.skewed`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import control
import numpy as np

from nlfrf._base.arguments import random_generator
from nlfrf._base.types import Seed
from nlfrf._base.values import value
from robust._base.types import AnySystem, Blocks
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.lti.realisation import multivariable
from robust.mu.blocks import blocks_with_kinds, structure_for, with_performance_block
from robust.mu.gain import gain_bound, search_worst_case
from robust.mu.intervals import certify_intervals
from robust.mu.perturbations import lower
from robust.mu.scalings import response_matrices, upper
from robust.mu.skewed import SkewedMargin, scaled_system, skewed_margin
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.intervals import SLACK
from robust.proofs.search.stability import decide_stability

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_N_STARTS = 6  # random starts of `lower`
# relative distance of both bounds of a system at which the box of real parameters is cut no more
_GAP = 0.05
_EXACT_INTERVALS = 60  # largest number of intervals for a proof over the rationals: a second


@value(copy=False)
class StructuredBounds:
    """Lower and upper bound of mu or of the worst gain, with a perturbation that attains the lower
    bound.

    Fields
    ------
    omega : (W,) ndarray or None
        Frequencies [rad/s]; None for an array without frequencies. For a system without `omega=`
        they are chosen automatically and contain the peak.
    lower, upper : (W,) ndarray
        Bounds of the structured singular value, or of the worst gain over the set. With
        `certificates` the largest value of `upper` is proved to be a bound at every frequency.
    delta : (n_in, n_out, W) ndarray
        For mu: the smallest perturbation found with det(I - N delta) = 0; its size is 1/lower; nan
        if none was found. For a gain: a perturbation of size at most one with which the gain is
        `lower`. If `lower` is inf, this perturbation makes the loop singular.
    quantity : str
        "mu" or "worst gain".
    certificates : tuple of Certificate
        The proof, one certificate for every part of the box of real parameters. Each proves
        mu < 1 for a scaled system: its outputs to all blocks (for a gain: its performance outputs)
        are divided by the largest `upper`. Empty if there is no proof.
    reason : str
        Reason why there is no proof for a system, or why the bounds are more than 5 % apart.

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
    certificates: tuple[Certificate, ...] = ()
    reason: str = ""

    def __str__(self) -> str:
        k, W = int(np.argmax(self.upper)), self.upper.size
        attained = np.isinf(self.lower.max())  # true at any number of frequencies
        where = ""
        if self.certificates:
            where = " at every frequency"
        elif W > 1 and not attained:
            where = f" on {W} lines"
        if self.omega is None:
            at = ""
        else:
            at = f", largest at {self.omega[k]:.4g} rad/s"
        text = f"{self.quantity} between {self.lower.max():.4g} and {self.upper[k]:.4g}{where}{at}"
        return "; ".join(filter(None, (text, self.reason)))


def bounds(
    N: AnySystem | np.ndarray, blocks: Blocks, omega: ArrayLike | None = None, *, rng: Seed = 0
) -> StructuredBounds:
    """Bound the structured singular value of a system from both sides.

    Use this for the size of the smallest structured perturbation that makes a loop unstable, which
    is 1/mu. For the largest gain over a set of perturbations use `worst_gain`.

    Parameters
    ----------
    N : control.StateSpace, TransferFunction, FrequencyResponseData or (n_out, n_in, W) ndarray
        System to which the perturbation is connected; a single matrix may be (n_out, n_in).
    blocks : list
        Blocks of the perturbation as for `upper`: (rows, cols), (n, n, "repeated") or (n, n,
        "real").
    omega : (W,) array_like, optional
        Frequencies [rad/s]; the system is then evaluated at these frequencies only. By default
        those of an FRF, and automatic ones for a system. For an array they are labels.
    rng : Generator, int or None
        For the random starts of the lower bound.

    Returns
    -------
    StructuredBounds
        The bounds of `robust.mu.upper` and `robust.mu.lower`. For a system without `omega=` the
        largest values refer to all frequencies. The largest upper bound is then proved, and the
        largest lower bound belongs to a perturbation that moves a pole to the stability boundary.

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

    A real parameter d in s^2 + (1 + 1.2 d) s + 1, which can destabilise at one frequency only:

    >>> N = control.ss([[0, 1], [-1, -1]], [[0], [-1.2]], [[0, 1]], [[0]])
    >>> print(bounds(N, [(1, 1, "real")]))
    mu between 1.2 and 1.204 at every frequency, largest at 1 rad/s
    """
    omega, M, system = _sampled_response(N, omega)
    s = structure_for("blocks", blocks, M.shape[:2])
    found = lower(M, blocks, n_starts=_N_STARTS, rng=rng)
    assert found.delta is not None  # of a lower bound
    above = np.maximum(upper(M, blocks).value, found.value)  # if they meet, rounding may cross them
    on_lines = StructuredBounds(omega=omega, lower=found.value, upper=above, delta=found.delta)
    if system is None:
        return on_lines
    return _at_every_frequency(on_lines, system, blocks, growing=np.ones(len(s.kinds), bool))


def worst_gain(
    N: AnySystem | np.ndarray, blocks: Blocks, omega: ArrayLike | None = None, *, rng: Seed = 0
) -> StructuredBounds:
    """Bound the worst gain over a set of perturbations from both sides, with a worst perturbation.

    Parameters
    ----------
    N : control.StateSpace, TransferFunction, FrequencyResponseData or (n_out, n_in, W) ndarray
        System whose first outputs and inputs are connected to the perturbations; the others are the
        performance channel.
    blocks : list
        The perturbations, of size at most one, as for `upper`.
    omega : (W,) array_like, optional
        Frequencies [rad/s]; as for `bounds`.
    rng : Generator, int or None
        For the random starts of the lower bound.

    Returns
    -------
    StructuredBounds
        `upper` is skewed mu, from scalings. `lower` is the gain with the perturbation `delta`,
        whose size is at most one. Both are inf if a perturbation of the set makes the loop
        singular.

    Raises
    ------
    ValueError
        Blocks that leave nothing for the performance, frequencies that N does not have.

    References
    ----------
    SP 8.10.3 (skewed mu); Packard & Doyle 1993; Seiler, Packard & Balas 2010.

    Examples
    --------
    The sensitivity of L = 1 with a gain that is uncertain by 50 %. The worst case is 1/(1 + 0.5),
    with the smallest gain.

    >>> N = np.array([[-0.5 * 0.5, 0.5], [-0.5 * 0.5, 0.5]])
    >>> found = worst_gain(N, [(1, 1)])
    >>> found.lower.round(4).item(), found.upper.round(4).item(), found.delta.real.round(4).item()
    (0.6667, 0.6667, -1.0)
    """
    omega, M, system = _sampled_response(N, omega)
    bound = gain_bound(M, blocks)
    reached, delta = search_worst_case(
        response_matrices("N", M), blocks, upper=bound, rng=random_generator("rng", rng)
    )
    on_lines = StructuredBounds(
        omega=omega,
        lower=reached,
        upper=np.maximum(bound, reached),  # if they meet, rounding may cross them
        delta=np.moveaxis(delta, 0, 2),
        quantity="worst gain",
    )
    if system is None:
        return on_lines
    whole, growing = with_performance_block(blocks, M.shape[:2])
    return _at_every_frequency(on_lines, system, whole, growing=growing)


def _at_every_frequency(
    found: StructuredBounds, N: control.StateSpace, blocks: Blocks, *, growing: np.ndarray
) -> StructuredBounds:
    """Add the bounds over all frequencies, at the peak:

    1 over the largest size of the blocks that grow.
    """
    margin = skewed_margin(N, blocks, growing=growing, gap=_GAP)
    of_gain, nominal = not growing.all(), decide_stability(N)
    if of_gain and nominal.unstable:  # the gain of an unstable system
        at = abs(to_s_plane(np.atleast_1d(nominal.pole), timebase(N))[0].imag)
        margin = replace(
            margin,
            level=0.0,
            broken=0.0,
            omega=at,
            delta=0 * np.nan_to_num(margin.delta),
            reason="",
        )
    with np.errstate(divide="ignore"):
        reached, proved = 1 / np.array([margin.broken, margin.level])
    omega = found.omega
    assert omega is not None  # for a system with states
    upper = np.minimum(found.upper, proved)
    if reached < found.lower.max() or not reached:  # a line has the best one
        at = int(np.argmax(found.lower if reached else upper))
        upper[at] = max(proved if margin.level else upper[at], found.lower[at])
        found = replace(found, upper=upper)
    else:
        at = int(np.searchsorted(omega, margin.omega))
        cols, rows = found.delta.shape[:2]
        if margin.level or np.isinf(reached):
            above = proved
        else:
            above = float(np.max(upper))
        found = replace(
            found,
            omega=np.insert(omega, at, margin.omega),
            lower=np.insert(found.lower, at, reached),
            upper=np.insert(upper, at, max(above, reached)),
            delta=np.insert(found.delta, at, margin.delta[:cols, :rows], axis=2),
        )
    if margin.level or not margin.reason:
        reason = margin.reason
    else:
        reason = f"not proved between lines: {margin.reason}"
    return replace(found, certificates=_exact_certificates(N, blocks, margin), reason=reason)


def _exact_certificates(
    N: control.StateSpace, blocks: Blocks, margin: SkewedMargin
) -> tuple[Certificate, ...]:
    """Return the proof over the rationals if the box is whole and few intervals suffice."""
    if len(margin.certificates) == 1 and not margin.n_unstable:
        system, given = scaled_system(margin, margin.level), blocks_with_kinds(blocks)
        exact = certify_intervals(system, given, 1 - SLACK, most=_EXACT_INTERVALS)
        if exact.holds:
            return (replace(exact, level=1.0),)
        return margin.certificates
    return margin.certificates


def _sampled_response(
    N: AnySystem | np.ndarray, omega: ArrayLike | None
) -> tuple[np.ndarray | None, np.ndarray, control.StateSpace | None]:
    """Return frequencies, the response (n_out, n_in, W) at them, and the system to bound at every
    frequency: None if frequencies were given, and for an FRF, an array or a constant.
    """
    if omega is not None:
        omega = np.atleast_1d(np.asarray(omega, dtype=float))
        if omega.ndim != 1 or not np.isfinite(omega).all():
            raise ValueError(
                f"omega must be a list of finite frequencies [rad/s], got shape {omega.shape}"
            )
    if isinstance(N, control.FrequencyResponseData):
        own = np.asarray(N.omega, dtype=float)
        if omega is None:
            where = np.arange(own.size)
        else:
            where = np.searchsorted(own, omega).clip(0, own.size - 1)
        if omega is not None and not np.allclose(own[where], omega, rtol=1e-9, atol=0):
            raise ValueError(
                f"omega must hold frequencies of N, which has {own.size} from {own.min():.4g} to"
                f" {own.max():.4g} rad/s"
            )
        return own[where], np.asarray(N.frdata)[:, :, where], None
    if isinstance(N, control.lti.LTI):
        system = multivariable("N", N)
        if omega is not None:
            return omega, response_by_channel(system, omega), None
        if not system.nstates:
            return None, system.D[:, :, None], None
        omega = structure_grid(system)[1:]
        return omega, response_by_channel(system, omega), system
    M = np.asarray(N)
    if M.ndim == 2:
        M = M[:, :, None]
    if omega is not None and (M.ndim != 3 or M.shape[2] != omega.size):
        raise ValueError(
            f"omega must have one frequency for each matrix of N, got {omega.size} for shape"
            f" {M.shape}"
        )
    return omega, np.moveaxis(response_matrices("N", M), 0, 2), None
