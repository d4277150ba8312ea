"""How many poles a measured FRF asks for: a scan over orders, with a criterion."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

from nlfrf.shared.arguments import integer
from nlfrf.shared.values import value
from robust.modelling.design_warning import OUTSIDE, DesignWarning
from robust.modelling.nominal import NominalFit, fit_nominal

__all__ = ["OrderScan", "scan_orders"]


NO_SIGNIFICANCE = 0.5  # standard deviation over its size from which a pole is named


@value
class OrderScan:
    """Fits of growing order, and which of them the data ask for.

    Fields
    ------
    n_poles : (n,) ndarray
        Orders tried.
    cost, expected_cost : (n,) ndarray
        What each leaves, and what scatter alone would leave.
    criterion : (n,) ndarray
        cost (over what estimated variances make of it) + n_parameters/2 log(2 lines): the Bayesian criterion; the
        smallest is the order to take.
    best : int
        Its number of poles.
    fits : tuple of NominalFit
        All of them.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 11.3.

    Examples
    --------
    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> G = 1 / (1j * omega + 3) + 1e-3 * np.random.default_rng(0).standard_normal(40)
    >>> scan = scan_orders(control.FrequencyResponseData(G, omega), n_poles=(1, 2), std=np.full(40, 1e-3))
    >>> scan.best, scan.fit.G.nstates
    (1, 1)
    """

    n_poles: np.ndarray
    cost: np.ndarray
    expected_cost: np.ndarray
    criterion: np.ndarray
    best: int
    fits: tuple[NominalFit, ...]

    @property
    def fit(self) -> NominalFit:
        """The fit of the best order."""
        return self.fits[int(np.argmin(self.criterion))]

    def __str__(self) -> str:
        columns = zip(self.n_poles, self.cost, self.expected_cost, self.criterion, strict=True)
        return "\n".join(
            f"{n:3d} poles  cost {c:10.4g}  {c / e:9.4g} times scatter  criterion {k:10.4g}"
            + " <-" * bool(n == self.best)
            + (f"  {doubt}" if doubt else "")
            for (n, c, e, k), doubt in zip(columns, map(doubtful_poles, self.fits), strict=True)
        )


def scan_orders(
    bla: Any,
    *,
    n_poles: Iterable[int] = range(1, 9),
    relative_degree: int = 1,
    delay: float | str = 0.0,
    dt: float = 0,
    stable: bool = True,
    std: np.ndarray | None = None,
) -> OrderScan:
    """Fit nominal models of several orders and say which one the data ask for.

    Parameters
    ----------
    bla, delay, dt, stable, std
        As in `fit_nominal`.
    n_poles : iterable of int
        Orders to try.
    relative_degree : int
        Poles more than zeros.

    Returns
    -------
    OrderScan

    Raises
    ------
    ValueError
        Orders below the relative degree, or as `fit_nominal`.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 11.3 (model selection criteria).

    Examples
    --------
    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> G = 1 / (1j * omega + 3) + 1e-3 * np.random.default_rng(0).standard_normal(40)
    >>> scan_orders(control.FrequencyResponseData(G, omega), n_poles=(1, 2), std=np.full(40, 1e-3)).best
    1
    """
    orders = sorted({integer("n_poles", n, least=0) for n in n_poles})
    excess = integer("relative_degree", relative_degree, least=0)
    if not orders or orders[0] < excess:
        raise ValueError(f"n_poles must be at least the relative degree {excess}, got {orders}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DesignWarning)  # what is suspicious about an order is said in its row
        fits = tuple(
            fit_nominal(bla, n_poles=n, n_zeros=n - excess, delay=delay, dt=dt, stable=stable, std=std) for n in orders
        )
    cost = np.array([fit.cost for fit in fits])
    expected = np.array([fit.expected_cost for fit in fits])
    parameters = np.array([fit.n_parameters for fit in fits])
    lines = fits[0].omega.size
    # scatter divided by an estimated variance is larger than one on average: count in units of that
    unit = expected / (lines - parameters / 2)
    criterion = cost / np.where(np.isfinite(unit), unit, 1.0) + parameters / 2 * np.log(2 * lines)
    return OrderScan(
        n_poles=np.array(orders),
        cost=cost,
        expected_cost=expected,
        criterion=criterion,
        best=orders[int(np.argmin(criterion))],
        fits=fits,
    )


def doubtful_poles(fit: NominalFit) -> str:
    """In words, the poles of a continuous fit that the data do not carry: far outside the band, or of no significance.

    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> measured = control.FrequencyResponseData(1 / (1j * omega + 500), omega)
    >>> doubtful_poles(scan_orders(measured, n_poles=[1], std=np.full(40, 1e-5)).fit)
    'poles outside the band: 79.58 Hz'
    """
    if fit.uncertainty is None or fit.G.dt:
        return ""
    poles, std = fit.uncertainty.poles, fit.uncertainty.std_poles
    size, once = np.abs(poles), poles.imag >= 0
    outside = (size < fit.omega.min() / OUTSIDE) | (size > fit.omega.max() * OUTSIDE)
    kinds = {"outside the band": outside, "of no significance": ~outside & (std > NO_SIGNIFICANCE * size)}
    return "; ".join(
        f"poles {kind}: {', '.join(f'{w / 2 / np.pi:.4g} Hz' for w in size[here & once])}"
        for kind, here in kinds.items()
        if here.any()
    )
