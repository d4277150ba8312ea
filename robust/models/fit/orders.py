"""Choice of the number of poles of a nominal model: a scan over orders, with a criterion."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence

import numpy as np

from nlfrf._base.arguments import format_count, require_integer
from nlfrf._base.values import value
from robust._base.warnings import DesignWarning
from robust.models.fit.nominal import OUTSIDE_FACTOR, Measurement, NominalFit, fit_nominal, matrices_given

UNLIKELY_COST = 0.01  # probability of a cost under which scatter does not explain it
MAX_RELATIVE_STD = 0.5  # standard deviation over its size from which a pole is named


@value
class OrderScan:
    """Fits of growing order, and which of them the data ask for.

    Fields
    ------
    n_poles : (n,) ndarray
        Orders tried; twice where a delay was tried too.
    cost, expected_cost : (n,) ndarray
        What each leaves, and what scatter alone would leave.
    criterion : (n,) ndarray
        cost (over what estimated variances make of it) + n_parameters/2 log(2 lines): the Bayesian criterion.
    best : int
        Number of poles to take: of the smallest criterion among the fits that scatter explains and whose poles the data
        carry; where there is none, among those that it explains, then among those whose poles are carried, then all.
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
        """Return the fit to take, of the best order."""
        return self.fits[choose_order(self.criterion, self.fits)]

    @property
    def delay(self) -> np.ndarray:
        """Return (n,) delay of each fit [s]."""
        return np.array([fit.delay for fit in self.fits])

    def __str__(self) -> str:
        best, delayed = choose_order(self.criterion, self.fits), np.any(self.delay)
        rows = []
        for i, fit in enumerate(self.fits):
            row = f"{self.n_poles[i]:3d} poles" + (f"  delay {1e3 * fit.delay:8.4g} ms" if delayed else "")
            row += f"  cost {self.cost[i]:10.4g}  {self.cost[i] / self.expected_cost[i]:9.4g} times scatter"
            doubt = describe_doubtful_poles(fit)
            rows.append(
                f"{row}  criterion {self.criterion[i]:10.4g}" + " (lowest)" * (i == best) + f"  {doubt}" * bool(doubt)
            )
        return "\n".join(rows)


def scan_orders(
    bla: Measurement,
    *,
    n_poles: Iterable[int] = range(1, 9),
    relative_degree: int = 1,
    delay: float | str = "auto",
    dt: float = 0,
    stable: bool = True,
    std: np.ndarray | None = None,
) -> OrderScan:
    """Fit nominal models of several orders and say which one the data ask for.

    Parameters
    ----------
    bla, dt, stable, std
        As in `fit_nominal`.
    n_poles : iterable of int
        Orders to try.
    relative_degree : int
        Poles more than zeros. The model of several channels takes 1 (residues) or 0 (with a direct term).
    delay : float or str
        As in `fit_nominal` [s], or "auto": none, and beside each order a fit with "estimate" where the phase asks for a
        delay, which it does when no order without one explains the data by poles and zeros that they carry.

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
    orders = sorted({require_integer("n_poles", n, least=0) for n in n_poles})
    excess = require_integer("relative_degree", relative_degree, least=0)
    if not orders or orders[0] < excess:
        raise ValueError(f"n_poles must be at least the relative degree {excess}, got {orders}")
    several = bool(matrices_given(bla))
    if several and excess > 1:
        raise ValueError(f"relative_degree must be 0 or 1 for several channels, got {excess}")

    def fitted(n: int, tau: float | str) -> NominalFit:
        zeros = (n if not excess else None) if several else n - excess
        return fit_nominal(bla, n_poles=n, n_zeros=zeros, delay=tau, dt=dt, stable=stable, std=std)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DesignWarning)  # what is suspicious about an order is said in its row
        fits = [fitted(n, 0.0 if delay == "auto" else delay) for n in orders]
        tried = list(zip(orders, fits, strict=True))
        if delay == "auto" and not several and needs_delay(fits):
            delayed = [(n, fitted(n, "estimate")) for n in orders]
            tried = sorted([*tried, *((n, fit) for n, fit in delayed if fit.delay)], key=lambda one: one[0])
    numbers, fits = [n for n, _ in tried], [fit for _, fit in tried]
    cost, expected = np.array([[fit.cost, fit.expected_cost] for fit in fits]).T
    parameters = np.array([fit.n_parameters for fit in fits])
    lines = fits[0].response.size
    # scatter divided by an estimated variance is larger than one on average: count in units of that
    unit = expected / (lines - parameters / 2)
    criterion = cost / np.where(np.isfinite(unit), unit, 1.0) + parameters / 2 * np.log(2 * lines)
    return OrderScan(
        n_poles=np.array(numbers),
        cost=cost,
        expected_cost=expected,
        criterion=criterion,
        best=numbers[choose_order(criterion, fits)],
        fits=tuple(fits),
    )


def choose_order(criterion: np.ndarray, fits: Sequence[NominalFit]) -> int:
    """The smallest criterion of the fits that scatter explains by poles that the data carry; then of those that it
    explains, of those whose poles the data carry, of all."""
    explained = np.array([fit.p_value > UNLIKELY_COST for fit in fits])
    carried = np.array([not describe_doubtful_poles(fit) for fit in fits])
    group = next(g for g in (explained & carried, explained, carried, np.ones(len(fits), dtype=bool)) if g.any())
    return int(np.argmin(np.where(group, criterion, np.inf)))


def needs_delay(fits: Sequence[NominalFit]) -> bool:
    """Return whether no fit without a delay is one that scatter explains, of poles and zeros that the data carry."""
    return not any(
        fit.p_value > UNLIKELY_COST and not describe_doubtful_poles(fit) and not np.any(np.real(fit.G.zeros()) > 0)
        for fit in fits
    )


def describe_order(fit: NominalFit) -> str:
    """Describe the order of a fit, and its delay where it has one."""
    zeros = "" if fit.inputs else f" and {format_count(fit.G.zeros().size, 'zero')}"
    return f"{format_count(fit.G.nstates, 'pole')}{zeros}" + (f", a delay of {fit.delay:.3g} s" if fit.delay else "")


def describe_doubtful_poles(fit: NominalFit) -> str:
    """Describe the poles of a continuous fit that the data do not support: far outside the band, or of no significance.

    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> measured = control.FrequencyResponseData(1 / (1j * omega + 500), omega)
    >>> describe_doubtful_poles(scan_orders(measured, n_poles=[1], std=np.full(40, 1e-5)).fit)
    'poles outside the band: 79.58 Hz'
    """
    if fit.uncertainty is None or fit.G.dt:
        return ""
    poles, std = fit.uncertainty.poles, fit.uncertainty.std_poles
    size, once = np.abs(poles), poles.imag >= 0
    outside = (size < fit.omega.min() / OUTSIDE_FACTOR) | (size > fit.omega.max() * OUTSIDE_FACTOR)
    kinds = {"outside the band": outside, "of no significance": ~outside & (std > MAX_RELATIVE_STD * size)}
    return "; ".join(
        f"poles {kind}: {', '.join(f'{w / 2 / np.pi:.4g} Hz' for w in size[here & once])}"
        for kind, here in kinds.items()
        if here.any()
    )
