"""Choice of the number of poles of a nominal model: by the loop that its set allows, or by the
data.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    as_list,
    format_count,
    format_hertz,
    require_integer,
    require_nonnegative,
)
from nlfrf._base.values import value
from robust._base.warnings import DesignWarning
from robust.lti.lti import response, timebase, to_s_plane
from robust.models.fit.class_error import balance, mean_size, smooth_size, target_loop
from robust.models.fit.doubts import OUTSIDE_FACTOR
from robust.models.fit.measurement import Measurement, bla_behind_hold, matrices_given
from robust.models.fit.nominal import checked_orders, fit_nominal, likeliest_fit, start_search
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.rational import Roots
from robust.models.fit.search import UNLIKELY_COST, FitSearch
from robust.models.sets.radius import (
    RadiusSpec,
    element_parts,
    larger_neighbour,
    record_radius_parts,
    sum_of_parts,
)

_MAX_RELATIVE_STD = 0.5  # relative standard deviation above which a pole is reported
_MIN_SEPARATION = (
    2.0  # standard deviations between a pole and a zero, below which they are reported
)
_OUTSIDE, UNDAMPED = "poles outside the band", "undamped poles above the band"
_UNSURE = "insignificant poles"
_LEAST_DAMPING = 1e-4  # damping of a pair above the band, below which it is undamped
#: Largest |T_c| times radius that leaves a loop its margins: rs of a loop like T_c is half its
#: limit.
_ENOUGH = 0.5
NEAR_BEST = 1.1  # the smallest order within this factor of the best is taken
# cost over the least one at the same reach: the misfit is 10 times as large. Three simulated machines
# with two modes on log-spaced lines had costs of 2.6e4 to 8.7e5 with 4 poles, and 3 with 6
_MAX_COST_RATIO = 100.0
#: Last line of a scan that is printed, by whether a crossover was named.
_CRITERION_TEXT = (
    "criterion: negative log likelihood, in units of its expected value from scatter on one line,"
    " plus ln(2 lines)/2 for each parameter. Taken is the lowest criterion among the fits that"
    " scatter explains and whose roots are significant. If scatter explains none: the smallest"
    f" order whose crossover reaches the highest one, within {NEAR_BEST - 1:.0%}, at no more than"
    f" {_MAX_COST_RATIO:g} times the least cost; lines on which scatter alone limits the crossover"
    f" do not count. Up to the crossover |T_c| times the radius of the set stays below {_ENOUGH:g}"
)
_CROSSOVER_TEXT = (
    "radius: largest radius of the set over |G| below the crossover; |T_c| x radius: its largest"
    " value, with T_c of a loop with that crossover. Taken is the smallest order below"
    f" {_ENOUGH:g}, or within {NEAR_BEST - 1:.0%} of the best; fits with significant roots come"
    " first if they stay below one. Higher orders are not tried if no nominal could be better"
)


@value
class OrderScan:
    """Fits of increasing order, the loops that their sets allow, and the recommended fit.

    Fields
    ------
    fits : (n,) tuple of NominalFit
        One for each order, or two if a delay was tried, too.
    sizes : (n,) tuple of SetSizes
        The size of the set around each fit, and the loop that this set allows.
    omega_c : float
        Requested crossover [rad/s]; nan if none was requested.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 11.3; SP 7.5.1 (the condition on |T| times the radius).

    Examples
    --------
    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> G = 1 / (1j * omega + 3) + 1e-3 * np.random.default_rng(0).standard_normal(40)
    >>> scan = scan_orders(control.FrequencyResponseData(G, omega), n_poles=(1, 2), std=np.full(40, 1e-3))
    >>> scan.best, scan.fit.G.nstates
    (1, 1)
    """

    fits: tuple[NominalFit, ...]
    sizes: tuple[_SetSizes, ...]
    omega_c: float

    @property
    def n_poles(self) -> np.ndarray:
        """Return (n,) number of poles of each fit."""
        return np.array([fit.G.nstates for fit in self.fits])

    @property
    def cost(self) -> np.ndarray:
        """Return (n,) weighted sum of squares of each residual."""
        return np.array([fit.cost for fit in self.fits])

    @property
    def expected_cost(self) -> np.ndarray:
        """Return (n,) expected weighted sum of squares, from the scatter alone."""
        return np.array([fit.expected_cost for fit in self.fits])

    @property
    def criterion(self) -> np.ndarray:
        """Return (n,) `NominalFit.criterion`, the Bayesian one."""
        return np.array([fit.criterion for fit in self.fits])

    @property
    def delay(self) -> np.ndarray:
        """Return (n,) delay of each fit [s]."""
        return np.array([fit.delay for fit in self.fits])

    @property
    def loop_radius(self) -> np.ndarray:
        """Return (n,) max of |T_c| radius / |G| for each set; nan without a crossover."""
        return np.array([size.loop_radius for size in self.sizes])

    @property
    def reach(self) -> np.ndarray:
        """Return (n,) highest crossover [rad/s] with |T_c| times the radius below one half on every
        line.
        """
        return np.array([size.reach for size in self.sizes])

    @property
    def chosen(self) -> int:
        """Return the index of the recommended fit.

        With a crossover: the fit with the fewest poles for which |T_c| times the relative radius is
        below one half on every line, or within 10 % of the value of the best fit. Fits with roots
        that the data do not support are left out if another fit allows a robust loop, with |T_c|
        times the radius below one.

        Without a crossover: the fit with the smallest criterion among the fits whose residual the
        scatter explains and whose roots the data support. If there is none, the roots are only
        required to be without cancelled poles and far zeros, and then not at all. If the scatter
        explains no residual: the fit with the fewest poles among those with a `reach` within 10 %
        of the highest and with at most 100 times the least cost. Lines on which scatter alone
        limits the reach do not count, because no order improves them.
        """
        if np.isnan(self.omega_c):
            reach = np.array([size.reach_by_misfit for size in self.sizes])
            return _choose_by_data(self.criterion, self.fits, reach)
        shown = ~np.array([_has_unseen_pair(fit) for fit in self.fits])
        shown |= not shown.any()
        carried = shown & np.array([set(doubtful_roots(fit)) <= {_OUTSIDE} for fit in self.fits])
        if np.any(
            carried & (self.loop_radius < 1)
        ):  # roots that follow the scatter of a line lower its radius too
            shown = carried
        best = int(np.argmin(np.where(shown, self.loop_radius, np.inf)))
        limits = [
            np.maximum(NEAR_BEST * self.sizes[best].loop_lines, _ENOUGH),
            max(NEAR_BEST * self.loop_radius[best], _ENOUGH),
        ]
        serves = [
            np.all(size.loop_lines <= limits[0]) and size.loop_radius <= limits[1]
            for size in self.sizes
        ]
        return _smallest_order(self.fits, shown & np.array(serves), self.loop_radius)

    @property
    def fit(self) -> NominalFit:
        """Return the recommended fit, of the best order."""
        return self.fits[self.chosen]

    @property
    def best(self) -> int:
        """Return the recommended number of poles."""
        return int(self.n_poles[self.chosen])

    def __str__(self) -> str:
        chosen, delayed, asked = self.chosen, np.any(self.delay), not np.isnan(self.omega_c)
        rows = []
        for i, fit in enumerate(self.fits):
            row = f"{self.n_poles[i]:3d} poles" + (
                f"  delay {1e3 * fit.delay:8.4g} ms" if delayed else ""
            )
            if asked:
                row += (
                    f"  radius {self.sizes[i].radius:9.3g}  |T_c| x radius"
                    f" {self.loop_radius[i]:9.3g}"
                )
            else:
                row += (
                    f"  crossover up to {format_hertz(self.reach[i]):>10s}  criterion"
                    f" {self.criterion[i]:10.4g}"
                )
            row += (
                f"  cost {self.cost[i] / self.expected_cost[i]:9.4g} times scatter"
                + " (taken)" * (i == chosen)
            )
            doubt = _describe_doubts(fit)
            rows.append(row + f"  {doubt}" * bool(doubt))
        return "\n".join([*rows, _CROSSOVER_TEXT if asked else _CRITERION_TEXT])


def scan_orders(
    bla: Measurement,
    *,
    n_poles: Iterable[int] = range(1, 9),
    relative_degree: int | None = None,
    delay: float | str = "auto",
    dt: float = 0,
    stable: bool = True,
    std: np.ndarray | None = None,
    omega_c: float | None = None,
) -> OrderScan:
    """Fit nominal models of increasing order and choose one of them.

    Use this before `fit_nominal` if you do not know the number of poles. Without `omega_c` the
    order is the one that the data support. With `omega_c` it is the lowest order that suffices for
    a loop with this crossover.

    Parameters
    ----------
    bla, dt, stable, std, omega_c
        As in `fit_nominal`.
    n_poles : iterable of int
        Orders to try, smallest first. With `omega_c` the scan stops at the first order that
        suffices.
    relative_degree : int, optional
        Number of poles minus number of zeros. By default 1, or a likelier number as in
        `fit_nominal`. For several channels 1, or 0 with a direct term.
    delay : float or str
        Delay [s], as in `fit_nominal`, or "auto". "auto" tries models without delay first, and
        estimates a delay if they fail. With `omega_c` they fail if no order suffices and the best
        model has zeros in the right half plane. Otherwise they fail if no order explains the data
        by poles and zeros that the data support.

    Returns
    -------
    OrderScan

    Raises
    ------
    ValueError
        Orders below the relative degree, or as `fit_nominal`.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 11.3 (model selection criteria); Schrama 1992 (models for a
    loop).

    Examples
    --------
    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> G = 1 / (1j * omega + 3) + 1e-3 * np.random.default_rng(0).standard_normal(40)
    >>> scan_orders(control.FrequencyResponseData(G, omega), n_poles=(1, 2), std=np.full(40, 1e-3)).best
    1
    """
    orders = sorted({require_integer("n_poles", n, least=0) for n in n_poles})
    if relative_degree is None:
        excess = 1
    else:
        excess = require_integer("relative_degree", relative_degree, least=0)
    if not orders or orders[0] < excess:
        raise ValueError(f"n_poles must be at least the relative degree {excess}, got {orders}")
    several = bool(matrices_given(bla))
    if several and excess > 1:
        raise ValueError(f"relative_degree must be 0 or 1 for several channels, got {excess}")

    many = _records_of(bla, require_nonnegative("dt", dt))
    fits: list[NominalFit] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DesignWarning)  # the row of an order contains its warnings
        if several:
            for n in orders:
                tau, direct = 0.0 if delay == "auto" else delay, None if excess else n
                fits.append(
                    fit_nominal(
                        bla,
                        n_poles=n,
                        n_zeros=direct,
                        delay=tau,
                        dt=dt,
                        stable=stable,
                        omega_c=omega_c,
                    )
                )
                if _set_sizes(fits[-1], many).suffices:
                    break
        else:
            search = start_search(
                bla,
                std,
                dt=dt,
                stable=stable,
                delay=0.0 if delay == "auto" else delay,
                omega_c=omega_c,
            )
            if delay == "auto":
                free = replace(search, delay=None, found={}, begun={})
            else:
                free = None
            zeros_of = {n: None if relative_degree is None else n - excess for n in orders}
            if omega_c is None:
                fits = _scan_for_data(search, bla, zeros_of)
                if free is not None and _needs_delay(fits):
                    fits += [
                        fit for fit in _scan_for_data(free, bla, zeros_of, also=search) if fit.delay
                    ]
            else:
                fits = _scan_for_loop(search, bla, zeros_of, free=free, many=many)
    fits.sort(key=lambda fit: fit.G.nstates)
    if omega_c is None:
        asked = float("nan")
    else:
        asked = float(omega_c)
    return OrderScan(
        fits=tuple(fits), sizes=tuple(_set_sizes(fit, many) for fit in fits), omega_c=asked
    )


def _scan_for_loop(
    search: FitSearch,
    bla: Measurement,
    zeros_of: dict[int, int | None],
    *,
    free: FitSearch | None,
    many: Sequence[Bla],
) -> list[NominalFit]:
    """Return fits of growing order until the set of one allows the loop: first without a delay,
    then with one.

    A delay is tried if the best fit without one has zeros in the right half plane, which stand for
    a delay.
    """
    fits: list[NominalFit] = []
    for one in (search,) if free is None else (search, free):
        if fits:
            best = min(fits, key=lambda fit: _set_sizes(fit, many).loop_radius)
            if not np.any(to_s_plane(best.G.zeros(), timebase(best.G)).real > 0):
                break
        for n, n_zeros in zeros_of.items():
            fit = likeliest_fit(one, bla, n, n_zeros)
            if one is search or fit.delay:
                fits.append(fit)
            if _set_sizes(fit, many).suffices:
                return fits
    return fits


def _scan_for_data(
    search: FitSearch,
    bla: Measurement,
    zeros_of: dict[int, int | None],
    also: FitSearch | None = None,
) -> list[NominalFit]:
    """Return the fits of growing order, each started from its neighbours and from those of another
    search.

    Zeros above the band are left out where the criterion is lower without them.
    """
    if search.dt:
        highest = np.inf
    else:
        highest = OUTSIDE_FACTOR * search.lines.omega.max()
    without: dict[int, list[Roots]] = {}
    for n, n_zeros in zeros_of.items():
        asked = checked_orders(search, n, n_zeros)
        if also is not None:
            same = also.found.get(asked)
        else:
            same = None
        without[n] = search.without_zeros_above(
            search.best(asked, starts=(same,) if same is not None else ()), highest
        )
        for fewer in without[n]:
            search.offer(asked, fewer)
    search.improve_from_above()
    return [
        likeliest_fit(search, bla, n, n_zeros, fewer=without[n]) for n, n_zeros in zeros_of.items()
    ]


# ---- The loop that the set about a fit allows.


def _records_of(bla: Measurement, dt: float) -> list[Bla]:
    """Return the records behind a set, with the hold of a model of dt; none for a bare FRF."""
    return [bla_behind_hold(one, dt) for one in as_list(bla) if isinstance(one, Bla)]


@value
class _SetSizes:
    """The size of the set about a fit, and the loop that it allows."""

    # radius, loop_radius: largest radius over |G| below the crossover, and largest |T_c| times it;
    # nan without a crossover
    radius: float
    loop_radius: float
    loop_lines: np.ndarray  # (F,) |T_c| times the radius over |G| on the lines of the fit
    reach: (
        float  # highest crossover [rad/s] with |T_c| times the radius below `_ENOUGH` on every line
    )
    reach_by_misfit: float  # the same without the lines on which the scatter alone limits it
    # True if the loop has its margins, or if no other nominal could improve it: on every line |T_c|
    # times the radius is below `_ENOUGH` or near that of the scatter alone, with poles and zeros
    # that the data show
    suffices: bool


def _set_sizes(fit: NominalFit, many: Sequence[Bla]) -> _SetSizes:
    """Return the size of the set about a fit that is made from these records."""
    parts = list(_parts_of_records(fit, many))
    rows = [_radii_of_record(fit, one, at) for one, at in parts]
    line = np.concatenate(
        [
            np.arange(row.shape[1]) < fit.omega[at].size
            for row, (_, at) in zip(rows, parts, strict=True)
        ]
    )
    omega, relative, scatter, shape, smooth = np.concatenate(rows, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = omega / 2 / (shape**2 * ((relative / _ENOUGH) ** 2 - 1)) ** 0.25
    limiting = relative > _ENOUGH
    reach, by_misfit = (
        min(float(np.min(allowed[lines], initial=np.inf)), float(fit.omega.max()))
        for lines in (limiting, limiting & (relative > NEAR_BEST * scatter))
    )
    target = target_loop(omega, fit.omega_c, smooth, shape)
    loop, least, asked = relative * target, scatter * target, not np.isnan(fit.omega_c)
    return _SetSizes(
        radius=float(np.max(relative[omega <= fit.omega_c])) if asked else np.nan,
        loop_radius=float(loop.max()) if asked else np.nan,
        loop_lines=loop[line],
        reach=reach,
        reach_by_misfit=by_misfit,
        suffices=asked
        and not _has_unseen_pair(fit)
        and bool(np.all(loop < np.maximum(_ENOUGH, NEAR_BEST * least))),
    )


def _parts_of_records(fit: NominalFit, many: Sequence[Bla]) -> Iterator[tuple[Bla | None, slice]]:
    """Return each record with the slice of its lines in a fit to all of them; no record for a bare
    FRF.
    """
    start = 0
    for one in many:
        yield one, slice(start, start + one.omega.size)
        start += one.omega.size
    if not many:
        yield None, slice(None)


def _radii_of_record(fit: NominalFit, record: Bla | None, at: slice) -> np.ndarray:
    """Return (5, W) frequencies, radius over |G|, its part for any nominal, |G| over smoothed |G|,
    and smoothed |G|.

    On the lines of the record, and for one channel at the modes of the nominal between them, where
    the radius is the larger neighbour. For a bare FRF the radius is the misfit. For several
    channels it is the largest gain of the radii over that of |G|, rows and columns balanced.
    """
    omega = fit.omega[at]
    G = fit.response[..., at]
    measured = (fit.response + fit.residual)[..., at]
    smooth = smooth_size(omega, measured)
    with np.errstate(divide="ignore", invalid="ignore"):
        if G.ndim == 3:
            n_y, n_u, F = G.shape
            assert record is not None  # a bare FRF with several channels was made a Bla
            _, parts, total = element_parts([record], [G], RadiusSpec())
            radii = [part.reshape(n_u, n_y, F).T for part in (total, total - parts["misfit"])]
            sizes = [np.abs(np.moveaxis(X, 2, 0)) for X in (G, smooth)]
            rows, columns = balance(sizes[1])
            *gains, whole, around = (
                np.linalg.norm(part / rows[:, :, None] / columns[:, None], 2, axis=(1, 2))
                for part in (*radii, *sizes)
            )
            return np.array(
                [
                    omega,
                    *(gain / whole for gain in gains),
                    whole / around,
                    mean_size(omega, measured),
                ]
            )
        radius, scatter = np.abs(fit.residual[at]), np.zeros(omega.size)
        if record is not None:
            parts = record_radius_parts(record, control.frd(G, omega), RadiusSpec())
            radius = sum_of_parts(parts)
            scatter = (radius - parts["misfit"]) / np.maximum(np.abs(measured), np.abs(G))
        size = np.abs(G)
        on_lines = np.array([omega, radius / size, scatter, size / smooth, smooth])
    modes = np.abs(to_s_plane(fit.G.poles(), timebase(fit.G)))
    modes = np.unique(modes[(modes > omega[0]) & (modes < omega[-1])])
    between = [larger_neighbour(modes, omega, row) for row in on_lines[1:3]]
    around = np.interp(modes, omega, smooth)
    return np.hstack([on_lines, [modes, *between, np.abs(response(fit.G, modes)) / around, around]])


def _has_unseen_pair(fit: NominalFit) -> bool:
    """Return True if a pole and a zero lie below the band, where they cancel on every line: the
    data show neither.
    """
    lowest, dt = fit.omega.min() / OUTSIDE_FACTOR, timebase(fit.G)
    return all(
        np.any(np.abs(to_s_plane(roots, dt)) < lowest) for roots in (fit.G.poles(), fit.G.zeros())
    )


def _smallest_order(fits: Sequence[NominalFit], good: np.ndarray, measure: np.ndarray) -> int:
    """Return the index of the good fit with the fewest poles, among equal ones with the smallest
    measure.
    """
    least = min(fit.G.nstates for fit, ok in zip(fits, good, strict=True) if ok)
    same = np.array([fit.G.nstates == least for fit in fits])
    return int(np.argmin(np.where(good & same, measure, np.inf)))


# ---- Evidence in the data.


def _choose_by_data(criterion: np.ndarray, fits: Sequence[NominalFit], reach: np.ndarray) -> int:
    """Return the index of the fit to take without a crossover.

    The smallest criterion among the fits that scatter explains with roots that the data support;
    then among those that it explains without cancelled poles and far zeros, then among those that
    it explains. A fit with undamped poles above the band is excluded: such poles only imitate a
    lead in time. If scatter explains no fit, the set decides: the smallest order that lets a loop
    reach as high as any, unless another one with that reach has a far lower cost.
    """
    doubts = [doubtful_roots(fit) for fit in fits]
    damped = np.array([UNDAMPED not in kinds for kinds in doubts])
    explained = damped & np.array([not fit.p_value <= UNLIKELY_COST for fit in fits])
    if not explained.any():
        some = damped if damped.any() else ~damped
        near = some & (reach >= np.max(reach[some]) / NEAR_BEST)
        cost = np.array([fit.cost / fit.expected_cost for fit in fits])
        return _smallest_order(fits, near & (cost <= _MAX_COST_RATIO * cost[near].min()), -reach)
    carried = np.array([not kinds for kinds in doubts])
    within = np.array([set(kinds) <= {_OUTSIDE, _UNSURE} for kinds in doubts])
    groups = (explained & carried, explained & within, explained)
    group = next(g for g in groups if g.any())
    return int(np.argmin(np.where(group, criterion, np.inf)))


def _needs_delay(fits: Sequence[NominalFit]) -> bool:
    """Return True if no supported fit without a delay explains the data."""
    return not any(
        fit.p_value > UNLIKELY_COST
        and not _describe_doubts(fit)
        and not np.any(np.real(fit.G.zeros()) > 0)
        for fit in fits
    )


def describe_order(fit: NominalFit) -> str:
    """Describe the order of a fit, and its delay if it has one."""
    if fit.inputs:
        zeros = ""
    else:
        zeros = f" and {format_count(fit.G.zeros().size, 'zero')}"
    return f"{format_count(fit.G.nstates, 'pole')}{zeros}" + (
        f", a delay of {fit.delay:.3g} s" if fit.delay else ""
    )


def _describe_doubts(fit: NominalFit) -> str:
    """Describe the roots of a continuous fit that the data do not support.

    >>> import control
    >>> omega = np.linspace(1, 20, 40)
    >>> measured = control.FrequencyResponseData(1 / (1j * omega + 500), omega)
    >>> _describe_doubts(scan_orders(measured, n_poles=[1], std=np.full(40, 1e-5)).fit)
    'poles outside the band: 79.58 Hz'
    """
    return "; ".join(
        f"{kind}:"
        f" {', '.join(f'{abs(root) / 2 / np.pi:.4g} Hz' for root in roots if root.imag >= 0)}"
        for kind, roots in doubtful_roots(fit).items()
    )


def doubtful_roots(fit: NominalFit) -> dict[str, np.ndarray]:
    """Return roots that the data do not support, by kind: poles far outside the band, undamped ones
    above it, poles that are not significant or that a zero cancels within the scatter, and far
    zeros above the band."""
    if fit.uncertainty is None or fit.G.dt:
        return {}
    poles, zeros = fit.uncertainty.poles, fit.uncertainty.zeros
    size, high = np.abs(poles), fit.omega.max() * OUTSIDE_FACTOR
    outside = (size < fit.omega.min() / OUTSIDE_FACTOR) | (size > high)
    undamped = (size > high) & (poles.imag != 0) & (-poles.real < _LEAST_DAMPING * size)
    unsure = ~outside & (fit.uncertainty.std_poles > _MAX_RELATIVE_STD * size)
    cancelled = ~outside & ~unsure & (fit.uncertainty.separation < _MIN_SEPARATION)
    far = (np.abs(zeros) > high) & (fit.uncertainty.std_zeros > np.abs(zeros))
    kinds = {
        _OUTSIDE: poles[outside & ~undamped],
        UNDAMPED: poles[undamped],
        _UNSURE: poles[unsure],
        "poles cancelled by zeros within scatter": poles[cancelled],
        "insignificant zeros above the band": zeros[far],
    }
    return {kind: roots for kind, roots in kinds.items() if roots.size}
