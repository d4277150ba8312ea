"""Choice of the number of poles of a nominal model: a scan over orders, with a criterion."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import format_count, require_integer
from nlfrf._base.values import value
from robust._base.warnings import DesignWarning
from robust.models.fit.nominal import (
    OUTSIDE_FACTOR,
    Measurement,
    NominalFit,
    checked_orders,
    fit_nominal,
    matrices_given,
    nominal_of_roots,
    start_search,
)
from robust.models.fit.rational import Roots
from robust.models.fit.search import FitSearch

UNLIKELY_COST = 0.01  # probability of a cost under which scatter does not explain it
#: Misfit, over that of the best order, from which an order explains less.
TWICE = 2.0
MAX_RELATIVE_STD = 0.5  # standard deviation over its size from which a pole is named
MIN_SEPARATION = 2.0  # standard deviations between a pole and a zero at least, or they are named
OUTSIDE, UNDAMPED = "poles outside the band", "undamped poles above the band"
UNSURE = "poles of no significance"
LEAST_DAMPING = 1e-4  # of a pair above the band
#: Last line of a scan that is printed.
CRITERION_TEXT = (
    "criterion: cost in units of what scatter leaves on a line (more than one where variances are estimated), plus "
    "ln(2 lines)/2 for each parameter; taken is the lowest of the fits that scatter explains and the data carry, where "
    "there are any"
)


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
        Number of poles to take: of the smallest criterion among the fits that scatter explains and whose roots the data
        carry; where there is none, among those that it explains without cancelled poles and far zeros, then those that
        it explains, then those whose roots are carried, then all.
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
            doubt = describe_doubts(fit)
            rows.append(
                f"{row}  criterion {self.criterion[i]:10.4g}" + " (taken)" * (i == best) + f"  {doubt}" * bool(doubt)
            )
        return "\n".join([*rows, CRITERION_TEXT])


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

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DesignWarning)  # what is suspicious about an order is said in its row
        if several:
            zeros = [n if not excess else None for n in orders]
            tau = 0.0 if delay == "auto" else delay
            fits = [
                fit_nominal(bla, n_poles=n, n_zeros=m, delay=tau, dt=dt, stable=stable, std=std)
                for n, m in zip(orders, zeros, strict=True)
            ]
            tried = list(zip(orders, fits, strict=True))
        else:
            search = start_search(bla, std, dt=dt, stable=stable, delay=0.0 if delay == "auto" else delay)
            fits = fit_orders(search, bla, orders, excess)
            tried = list(zip(orders, fits, strict=True))
            if delay == "auto" and needs_delay(fits):
                free = replace(search, delay=None, found={})
                delayed = list(zip(orders, fit_orders(free, bla, orders, excess, also=search), strict=True))
                tried = sorted([*tried, *((n, fit) for n, fit in delayed if fit.delay)], key=lambda one: one[0])
    numbers, fits = [n for n, _ in tried], [fit for _, fit in tried]
    cost, expected = np.array([[fit.cost, fit.expected_cost] for fit in fits]).T
    criterion = np.array([criterion_of(fit) for fit in fits])
    return OrderScan(
        n_poles=np.array(numbers),
        cost=cost,
        expected_cost=expected,
        criterion=criterion,
        best=numbers[choose_order(criterion, fits)],
        fits=tuple(fits),
    )


def fit_orders(
    search: FitSearch, bla: Measurement, orders: Sequence[int], excess: int, also: FitSearch | None = None
) -> list[NominalFit]:
    """Return the fits of growing order, each from those of its neighbours, and from those of another search.

    Zeros above the band are left out where the criterion is lower without them.
    """
    highest = np.inf if search.dt else OUTSIDE_FACTOR * search.lines.omega.max()
    without: dict[int, list[Roots]] = {}
    for n in orders:
        asked = checked_orders(search, n, n - excess)
        same = also.found.get(asked) if also is not None else None
        without[n] = search.without_zeros_above(search.best(asked, starts=(same,) if same is not None else ()), highest)
        for fewer in without[n]:
            search.offer(asked, fewer)
    search.improve_from_above()
    tried = [(search.best((n, n - excess)), *without[n]) for n in orders]
    return [min((nominal_of_roots(search, bla, one) for one in fits), key=criterion_of) for fits in tried]


def criterion_of(fit: NominalFit) -> float:
    """Return the Bayesian criterion of a fit."""
    lines = fit.response.size
    # scatter divided by an estimated variance is larger than one on average: count in units of that
    unit = fit.expected_cost / (lines - fit.n_parameters / 2)
    return float(fit.cost / (unit if np.isfinite(unit) else 1.0) + fit.n_parameters / 2 * np.log(2 * lines))


def choose_order(criterion: np.ndarray, fits: Sequence[NominalFit]) -> int:
    """The smallest criterion of the fits that scatter explains by roots that the data carry; then of those that it
    explains without cancelled poles and far zeros, of those that it explains, of those of carried roots, of all.
    Undamped poles above the band are taken last: what a machine does not have explains a lead in time, and no more.
    Where scatter explains none, those count that leave at most twice the misfit of the best: an order too low by a mode
    has roots that the data carry, too."""
    explained = np.array([fit.p_value > UNLIKELY_COST for fit in fits])
    if not explained.any():
        cost = np.array([fit.cost for fit in fits])
        explained = cost <= TWICE**2 * cost.min()
    doubts = [doubtful_roots(fit) for fit in fits]
    carried = np.array([not kinds for kinds in doubts])
    within = np.array([set(kinds) <= {OUTSIDE, UNSURE} for kinds in doubts])
    damped = np.array([UNDAMPED not in kinds for kinds in doubts])
    groups = (explained & carried, explained & within, explained & damped, carried, damped, np.full(len(fits), True))
    group = next(g for g in groups if g.any())
    return int(np.argmin(np.where(group, criterion, np.inf)))


def needs_delay(fits: Sequence[NominalFit]) -> bool:
    """Return whether no fit without a delay is one that scatter explains, of poles and zeros that the data carry."""
    return not any(
        fit.p_value > UNLIKELY_COST and not describe_doubts(fit) and not np.any(np.real(fit.G.zeros()) > 0)
        for fit in fits
    )


def describe_order(fit: NominalFit) -> str:
    """Describe the order of a fit, and its delay where it has one."""
    zeros = "" if fit.inputs else f" and {format_count(fit.G.zeros().size, 'zero')}"
    return f"{format_count(fit.G.nstates, 'pole')}{zeros}" + (f", a delay of {fit.delay:.3g} s" if fit.delay else "")


def describe_doubts(fit: NominalFit) -> str:
    """Describe what the data do not carry of a continuous fit.

    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> measured = control.FrequencyResponseData(1 / (1j * omega + 500), omega)
    >>> describe_doubts(scan_orders(measured, n_poles=[1], std=np.full(40, 1e-5)).fit)
    'poles outside the band: 79.58 Hz'
    """
    return "; ".join(
        f"{kind}: {', '.join(f'{abs(root) / 2 / np.pi:.4g} Hz' for root in roots if root.imag >= 0)}"
        for kind, roots in doubtful_roots(fit).items()
    )


def doubtful_roots(fit: NominalFit) -> dict[str, np.ndarray]:
    """Return roots that the data do not carry, by kind: poles far outside the band, undamped ones above it, poles
    of no significance or that a zero cancels but for scatter, and zeros far above the band that they do not place."""
    if fit.uncertainty is None or fit.G.dt:
        return {}
    poles, zeros = fit.uncertainty.poles, fit.uncertainty.zeros
    size, high = np.abs(poles), fit.omega.max() * OUTSIDE_FACTOR
    outside = (size < fit.omega.min() / OUTSIDE_FACTOR) | (size > high)
    undamped = (size > high) & (poles.imag != 0) & (-poles.real < LEAST_DAMPING * size)
    unsure = ~outside & (fit.uncertainty.std_poles > MAX_RELATIVE_STD * size)
    cancelled = ~outside & ~unsure & (fit.uncertainty.separation < MIN_SEPARATION)
    far = (np.abs(zeros) > high) & (fit.uncertainty.std_zeros > np.abs(zeros))
    kinds = {
        OUTSIDE: poles[outside & ~undamped],
        UNDAMPED: poles[undamped],
        UNSURE: poles[unsure],
        "poles that zeros cancel but for scatter": poles[cancelled],
        "zeros above the band of no significance": zeros[far],
    }
    return {kind: roots for kind, roots in kinds.items() if roots.size}
