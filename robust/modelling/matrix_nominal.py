"""The nominal model of a measured matrix: what is asked for, checked, fitted, and what the fit leaves."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf import Frm
from nlfrf.shared.arguments import integer, nonnegative
from robust.modelling.shared_poles import fit_shared_poles, whitening
from robust.systems.sampling import discretize

__all__ = ["MAX_POLES", "fit_matrix"]


MAX_POLES = 40


def fit_matrix(
    frm: Frm, n_poles: int, n_zeros: int | None, delay: Any, dt: float, stable: bool, rank: int
) -> dict[str, Any]:
    """The fields of the `NominalFit` of a matrix."""
    n_poles, rank = integer("n_poles", n_poles, least=0), integer("rank", rank, least=1)
    delay = nonnegative("delay", delay)
    if n_poles > MAX_POLES:
        raise ValueError(f"n_poles must be at most {MAX_POLES}, got {n_poles}")
    if n_zeros not in (None, n_poles):
        raise ValueError(f"n_zeros must be None or n_poles = {n_poles} for an Frm, got {n_zeros}")
    if dt and frm.omega.max() * dt >= np.pi:
        raise ValueError(
            f"dt must put the Nyquist frequency above the last line, {frm.f.max():g} Hz, got dt = {dt:g} s with "
            f"Nyquist {0.5 / dt:g} Hz"
        )
    size = frm.n_outputs * frm.n_inputs * frm.f.size
    # j omega, or its bilinear image: both kinds of model are fitted in the s plane
    points = 2 / dt * np.tan(frm.omega * dt / 2) if dt else frm.omega
    left, right = whitening(frm)
    turn = np.exp(1j * frm.omega * delay)
    model = fit_shared_poles(
        points,
        np.moveaxis(frm.G * turn, 2, 0),
        left,
        right,
        n_poles=n_poles,
        rank=rank,
        direct=n_zeros is not None or dt > 0,
        stable=stable,
    )
    if 2 * size < model.n_parameters:
        raise ValueError(f"n_poles must leave at most {2 * size} parameters, got {model.n_parameters}")
    response = np.moveaxis(model.response(points), 0, 2) / turn
    residual = frm.G - response
    weighted = left @ np.moveaxis(residual, 2, 0) @ right
    L = np.minimum(frm.dof, 1e12)
    expected = frm.n_outputs * frm.n_inputs * np.sum(L / np.maximum(L - frm.n_outputs, np.finfo(float).tiny))
    G = model.state_space()
    return dict(
        G=discretize(G, dt) if dt else G,
        delay=float(delay),
        omega=frm.omega,
        response=response,
        residual=residual,
        std=np.sqrt(frm.entries(frm.cov_bound)),
        cost=float(np.sum(np.abs(weighted) ** 2)),
        expected_cost=float(expected * (1 - model.n_parameters / (2 * size))),
        n_parameters=model.n_parameters,
    )
