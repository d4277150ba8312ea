"""An FRF of python-control as a `Bla`, with the names of its signals: the inverse of
`robust.frd`.
"""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np
from numpy.typing import ArrayLike

import nlfrf
from nlfrf._base.arguments import require_kind


def bla_from_frd(
    frf: control.FrequencyResponseData,
    *,
    std: ArrayLike | None = None,
    coherence: ArrayLike | None = None,
    n_averages: float | None = None,
    hold: str = "unknown",
    input_units: Sequence[str] = (),
    output_units: Sequence[str] = (),
) -> nlfrf.Bla:
    """Make a `Bla` from an FRF of python-control and its standard deviation or coherence.

    Use this to get an uncertainty set with a stated probability from an FRF of another program.

    Parameters
    ----------
    frf : control.FrequencyResponseData
        The FRF, with one channel or several; the names of its signals are kept if they were given.
    std, coherence : float, or (F,) or (n_y, n_u, F) ndarray, optional
        Standard deviation in the unit of the FRF, or coherence of `n_averages` averages, as in
        `nlfrf.bla_from_frf`.
    n_averages : float, optional
        Number of independent averages behind the coherence.
    hold : str
        Behaviour of the input between the samples: "zoh" (zero-order hold with the sampling time of
        the FRF), "band-limited" or "unknown".
    input_units, output_units : sequence of str
        Units of the channels, which an FRF of python-control does not contain.

    Returns
    -------
    nlfrf.Bla

    Raises
    ------
    ValueError
        A value that is not an FRF of python-control; otherwise as `nlfrf.bla_from_frf`.

    References
    ----------
    Bendat & Piersol, *Random Data*, 4th ed., 9.2.

    Examples
    --------
    >>> import robust
    >>> omega = 2 * np.pi * np.geomspace(1, 100, 30)
    >>> frf = control.frd(1 / (1 + 0.1j * omega), omega, inputs=["force"], outputs=["position"])
    >>> bla = bla_from_frd(frf, std=0.01, input_units=["N"], output_units=["m"])
    >>> bla.inputs, bla.outputs, bla.unit
    (('force',), ('position',), 'm/N')
    >>> again = robust.frd(bla)
    >>> bool(np.allclose(again.frdata, frf.frdata)), bool(np.allclose(again.omega, frf.omega))
    (True, True)
    """
    require_kind("frf", frf, control.FrequencyResponseData)
    G = np.asarray(frf.frdata, dtype=complex)
    return nlfrf.bla_from_frf(
        np.asarray(frf.omega) / (2 * np.pi),
        G[0, 0] if G.shape[:2] == (1, 1) else G,
        std=std,
        coherence=coherence,
        n_averages=n_averages,
        fs=1 / frf.dt if frf.dt and frf.dt is not True else None,
        hold=hold,
        inputs=_given_names(frf.input_labels, "u"),
        outputs=_given_names(frf.output_labels, "y"),
        input_units=input_units,
        output_units=output_units,
    )


def _given_names(labels: Sequence[str], letter: str) -> tuple[str, ...]:
    """Return names of signals; none if they are the defaults of python-control.

    >>> _given_names(["force", "torque"], "u"), _given_names(["u[0]", "u[1]"], "u")
    (('force', 'torque'), ())
    """
    if list(labels) == [f"{letter}[{k}]" for k in range(len(labels))]:
        return ()
    return tuple(labels)
