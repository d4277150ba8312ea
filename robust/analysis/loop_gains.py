"""Principal gains of a loop over frequency: singular values of L, S, T and K S."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import (
    require_real_array,
)
from nlfrf._base.values import value
from robust._base.types import Controller
from robust.lti.connections import lower_lft
from robust.lti.grids import BELOW_NYQUIST, structure_grid
from robust.lti.lti import (
    is_stable,
    response_by_channel,
    timebase,
)
from robust.lti.realisation import multivariable


@value
class LoopGains:
    """Singular values of the transfer functions of a nominal loop over frequency, largest first.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    L, S, T : (n_y, W) ndarray
        Singular values of L = G K at the plant outputs, of the sensitivity S = (I + L)^-1 and of T
        = I - S.
    K_S : (n, W) ndarray
        Singular values of K S, from the reference to the plant inputs; n is the smaller of n_y and
        n_u.
    stable : bool
        Whether the loop is stable. For an unstable loop the singular values are no amplifications
        of signals.
    band : (2,) ndarray or None
        Lowest and highest of the measured frequencies [rad/s], if any were given.

    References
    ----------
    SP 3.3 (directions), 9.1 (demands on the singular values of a loop).

    Examples
    --------
    >>> lags = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> gains = loop_gains(lags, np.diag([1.0, 3.0]))
    >>> np.round(gains.S[:, 0], 2)                                            # 1/2 and 1/4 at low frequency
    array([0.5 , 0.25])
    """

    omega: np.ndarray
    L: np.ndarray
    S: np.ndarray
    T: np.ndarray
    K_S: np.ndarray
    stable: bool
    band: np.ndarray | None


def loop_gains(G: Controller, K: Controller, *, omega: np.ndarray | None = None) -> LoopGains:
    """Return the singular values of L, S, T and K S of the loop u = K (r - y) over frequency.

    Use this for a loop with several channels, where the gain depends on the direction of the
    signal.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction or (n_y, n_u) ndarray
        Plant.
    K : control.StateSpace, TransferFunction, float or (n_u, n_y) ndarray
        Controller, negative feedback, on the same time base.
    omega : (W,) ndarray, optional
        Measured frequencies [rad/s], which become part of the grid.

    Returns
    -------
    LoopGains
        The singular values on a frequency grid that is dense around every pole of the loop. For a
        sampled loop the grid ends at the Nyquist frequency.

    Raises
    ------
    ValueError
        A K whose channels or sampling time do not fit G.

    References
    ----------
    SP 3.3, 9.1.

    Examples
    --------
    >>> loop_gains(np.eye(2), np.ones((1, 2)))
    Traceback (most recent call last):
        ...
    ValueError: K must have 2 inputs and 2 outputs, one for each output and input of the plant, got 2 and 1
    """
    G, K = multivariable("G", G), multivariable("K", K)
    n_y, n_u = G.noutputs, G.ninputs
    if (K.ninputs, K.noutputs) != (n_y, n_u):
        raise ValueError(
            f"K must have {n_y} inputs and {n_u} outputs, one for each output and input of the"
            f" plant, got {K.ninputs} and {K.noutputs}"
        )
    if G.nstates and K.nstates and timebase(K) != timebase(G):
        raise ValueError(
            f"K must have the sampling time of G, {timebase(G):g} s, got {timebase(K):g} s"
        )
    one = np.eye(n_y)
    e = control.StateSpace(
        G.A,
        np.hstack([np.zeros((G.nstates, n_y)), G.B]),
        np.vstack([-G.C] * 2),
        np.block([[one, -G.D]] * 2),
        G.dt,
    )
    closed = lower_lft(e, K)  # the sensitivity, with all states
    if omega is None:
        lines = np.zeros(0)
    else:
        lines = require_real_array("omega", omega, ndim=1)
    at = np.union1d(structure_grid(closed)[1:], lines)
    if timebase(closed):
        at = at[at * timebase(closed) < np.pi * BELOW_NYQUIST]
    plant, controller = (np.moveaxis(response_by_channel(part, at), 2, 0) for part in (G, K))
    L = plant @ controller
    S = np.linalg.inv(one + L)
    sizes = (np.linalg.svd(part, compute_uv=False).T for part in (L, S, one - S, controller @ S))
    return LoopGains(
        omega=at,
        **dict(zip(("L", "S", "T", "K_S"), sizes, strict=True)),
        stable=is_stable(closed),
        band=lines[[0, -1]] if lines.size else None,
    )
