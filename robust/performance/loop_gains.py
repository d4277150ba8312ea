"""Principal gains of a loop of several inputs and outputs: singular values of L, S, T and K S over frequency."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import real_array
from nlfrf.shared.cards import Sketch
from nlfrf.shared.values import value
from robust.systems.grids import structure_grid
from robust.systems.lft import lower
from robust.systems.lti import along, timebase
from robust.systems.realisation import multivariable
from robust.systems.stability import stable

__all__ = ["LoopGains", "loop_gains"]


@value
class LoopGains:
    """Singular values of the transfer functions of a nominal loop, largest first: gains between its directions.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    L, S, T : (n_y, W) ndarray
        Of L = G K at the outputs, the sensitivity S = (I + L)^-1 and T = I - S.
    K_S : (n, W) ndarray
        Of K S, from the reference to the inputs of the plant; n the smaller number of channels.
    stable : bool
        Whether the loop is stable: the gains of one that is not mean nothing but where it turns.
    band : (2,) ndarray or None
        Lowest and highest measured frequency [rad/s], where they were given.

    References
    ----------
    SP 3.3 (directions), 9.1 (what is asked of singular values of a loop).

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
    band: Any

    def _sketch_(self) -> Sketch:
        """Largest S and T, for a notebook."""
        curves = [(name, self.omega / 2 / np.pi, 20 * np.log10(one[0])) for name, one in (("S", self.S), ("T", self.T))]
        return Sketch("Hz", "dB", curves, log=True)


def loop_gains(G: Any, K: Any, *, omega: Any = None) -> LoopGains:
    """Singular values of the nominal loop u = K (r - y) over frequency.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction or (n_y, n_u) ndarray
        Plant.
    K : control.StateSpace, TransferFunction, float or (n_u, n_y) ndarray
        Controller, negative feedback, on the same time base.
    omega : (W,) ndarray, optional
        Measured frequencies [rad/s], to be among those that are looked at.

    Returns
    -------
    LoopGains
        On frequencies around every pole of the loop, up to Nyquist where it is sampled.

    Raises
    ------
    ValueError
        A K that does not fit G: its channels, its sampling time.

    References
    ----------
    SP 3.3, 9.1.

    Examples
    --------
    >>> loop_gains(np.eye(2), np.ones((1, 2)))
    Traceback (most recent call last):
        ...
    ValueError: K must have 2 inputs and 2 outputs, one an output and an input of the plant, got 2 and 1
    """
    G, K = multivariable("G", G), multivariable("K", K)
    n_y, n_u = G.noutputs, G.ninputs
    if (K.ninputs, K.noutputs) != (n_y, n_u):
        raise ValueError(
            f"K must have {n_y} inputs and {n_u} outputs, one an output and an input of the plant, "
            f"got {K.ninputs} and {K.noutputs}"
        )
    if G.nstates and K.nstates and timebase(K) != timebase(G):
        raise ValueError(f"K must have the sampling time of G, {timebase(G):g} s, got {timebase(K):g} s")
    one = np.eye(n_y)
    e = control.StateSpace(
        G.A, np.hstack([np.zeros((G.nstates, n_y)), G.B]), np.vstack([-G.C] * 2), np.block([[one, -G.D]] * 2), G.dt
    )
    closed = lower(e, K)  # the sensitivity, with all states
    lines = np.zeros(0) if omega is None else real_array("omega", omega, ndim=1)
    at = np.union1d(structure_grid(closed)[1:], lines)
    if timebase(closed):
        at = at[at * timebase(closed) < np.pi * (1 - 1e-9)]
    plant, controller = (np.moveaxis(along(part, at), 2, 0) for part in (G, K))
    L = plant @ controller
    S = np.linalg.inv(one + L)
    sizes = (np.linalg.svd(part, compute_uv=False).T for part in (L, S, one - S, controller @ S))
    return LoopGains(
        omega=at,
        **dict(zip(("L", "S", "T", "K_S"), sizes, strict=True)),
        stable=stable(closed),
        band=lines[[0, -1]] if lines.size else None,
    )
