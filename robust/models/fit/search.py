"""Starts for the fit of a rational function with a delay: scanned delays, vector fitting, fits with
fewer poles.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from nlfrf._base.values import value
from robust.lti.realisation import order_roots, pair_roots
from robust.models.fit.class_error import most_likely_size
from robust.models.fit.fit_uncertainty import expected_ratio, probability_of_cost
from robust.models.fit.rational import (
    Roots,
    fit_numerator,
    known_factor,
    partial_fractions,
    s_plane_points,
    stack_real_imaginary,
    starting_poles,
    vector_fit,
    zpk_response,
)
from robust.models.fit.refinement import CONVERGED, refine

_N_TRIALS = 41  # delays of a scan in continuous time; half as many again in samples
_N_PLACES = 128  # frequencies at which a further pole and zero are tried
_DAMPINGS = 0.01, 0.05, 0.25  # dampings tried for a further pair
_MIN_LOG_DISTANCE = 0.2  # between two frequencies that are tried
_SHARES = (
    1.0,
    0.3,
    0.1,
    0.0,
)  # fractions of the linear least squares step; at 0 the cost is that of the smaller fit
_ZERO_FAR = 1e6  # a zero at this multiple of the highest line has no effect
_N_DELAYS = 3  # delays of a scan that are refined
_N_RELOCATIONS, _N_ROUGH = 12, 4  # iterations of vector fitting; those to compare delays
_SAME_COST = 1e-6  # relative difference of the costs of equal starts
_LIKELY_COST = 0.05  # probability of a cost above which the search stops
UNLIKELY_COST = (
    0.01  # probability of a cost below which scatter does not explain it: the class has an error
)
#: Starting sizes of the error of the class, over |G| in mid band: from the largest possible misfit
#: to one that has no effect on any loop. On the machines of benchmarks.nominal three starts found
#: the same as seven.
START_SIZES = 1.0, 1e-2, 1e-4
_ROUGH = 1e-3  # relative change of a cost, enough to compare starts
# change of the log likelihood that ends the rounds of fit and size; their number
SETTLED = 1e-3
MAX_ROUNDS = 30


@value
class FrfData:
    """Measured lines of one or several concatenated records, and the tolerance for the error of the
    class on each.
    """

    # omega, G, var, dof: (F,) lines [rad/s], FRF, its variance and the degrees of freedom of that
    # variance
    omega: np.ndarray
    G: np.ndarray
    var: np.ndarray
    dof: np.ndarray
    # (F,) m of `loop_tolerance` [unit of G], the relative size of the error of the class on each
    # line
    tolerance: np.ndarray
    omega_c: float  # crossover [rad/s] of the loop behind the tolerance, nan for none
    epsilon: float = 0.0  # size of the error of the class, in units of the tolerance
    hold: str = "unknown"  # hold of the records
    n_records: int = 0  # records of a Bla behind the lines; 0 for an FRF of another program

    @property
    def total_var(self) -> np.ndarray:
        """Return (F,) the variance of a line about the model: scatter plus error of the class."""
        return self.var + (self.epsilon * self.tolerance) ** 2


@value(copy=False)
class FitSearch:
    """The search for the best rational function of any order through measured lines; it keeps what
    it found.
    """

    lines: FrfData  # the measured lines
    dt: float  # sampling time of the model [s], 0 for a continuous one
    stable: bool  # True if every pole is kept stable
    delay: float | None  # delay in series [s]; estimated if None
    # found, begun: the best fit so far for each (n_poles, n_zeros), and the best one from scratch
    found: dict[tuple[int, int], Roots] = field(default_factory=dict)
    begun: dict[tuple[int, int], Roots] = field(default_factory=dict)

    def begin(self, orders: tuple[int, int], *, tolerance: float = CONVERGED) -> Roots:
        """Return the best fit with (n_poles, n_zeros) from scratch."""
        if orders not in self.begun:
            self.begun[orders] = self.best_of(self.fresh(orders), tolerance=tolerance)
        return self.begun[orders]

    def best(self, orders: tuple[int, int], *, starts: tuple[Roots, ...] = ()) -> Roots:
        """Return the best fit with (n_poles, n_zeros): from given starts, from scratch, and grown.

        If scatter does not explain the fit from scratch, it is also grown from the fit with two
        poles and two zeros fewer, and cut from vector fitting with two more. No fit costs more than
        an earlier one with fewer poles and as many fewer zeros.
        """
        if orders not in self.found:
            n, m = orders
            best = self.best_of(list(starts), self.begin(orders))
            for k in (1, 2):
                fewer = (n - k, m - k)
                if min(fewer) < 0 or (fewer not in self.found and (k == 1 or self.explained(best))):
                    continue
                smaller = self.best(fewer)
                if not self.explained(best) or smaller[4] < best[4]:
                    best = self.best_of(_further_roots(self, smaller, k), best)
            if not self.explained(best) and n and 2 * self.lines.omega.size > n + m + 7:
                larger = [
                    _vector_fitted(self, (n + 2, m + 2), best[3], spacing)
                    for spacing in ("log", "linear")
                ]
                best = self.best_of(
                    [start for roots in larger for start in _fewer_roots(self, roots, 2)], best
                )
            self.found[orders] = best
        return self.found[orders]

    def without_zeros_above(self, roots: Roots, highest: float) -> list[Roots]:
        """Return the fits without the largest zeros, as many as lie above a frequency [rad/s]."""
        zeros, poles, gain, tau, _ = roots
        zeros = zeros[np.argsort(np.abs(zeros), kind="stable")]
        fits = []
        for n in range(int(np.sum(np.abs(zeros) <= highest)), zeros.size):
            kept, gone = zeros[:n], zeros[n:]
            if np.sum(gone.imag > 0) == np.sum(gone.imag < 0):  # only whole pairs
                start = self.with_cost(
                    order_roots(kept), poles, gain * float(np.prod(-gone).real), tau
                )
                fits.append(self.refine(start))
        return fits

    def offer(self, orders: tuple[int, int], fewer: Roots) -> None:
        """Replace a fit by one with fewer zeros, padded with zeros far above the band, if that
        costs less.
        """
        zeros, poles, gain, tau, _ = fewer
        n, far = orders[1] - zeros.size, _ZERO_FAR * self.lines.omega.max()
        padded = self.with_cost(
            np.concatenate([zeros, np.full(n, -far)]), poles, gain / far**n, tau
        )
        self.found[orders] = min(padded, self.found[orders], key=lambda roots: roots[4])

    def n_parameters(self, roots: Roots) -> int:
        return roots[0].size + roots[1].size + 1 + (self.delay is None)

    def improve_from_above(self) -> None:
        """Start every fit that scatter does not explain from those with more poles and zeros,
        without their weakest.

        A fit that becomes cheaper than one with more poles is the start to grow the larger one
        again.
        """
        for n, m in sorted(self.found, reverse=True):
            for k in (1, 2):
                larger = self.found.get((n + k, m + k))
                if larger is not None and not self.explained(self.found[n, m]):
                    self.found[n, m] = self.best_of(_fewer_roots(self, larger, k), self.found[n, m])
        for n, m in sorted(self.found):
            for k in (1, 2):
                smaller = self.found.get((n - k, m - k))
                if smaller is not None and smaller[4] < self.found[n, m][4]:
                    self.found[n, m] = self.best_of(
                        _further_roots(self, smaller, k), self.found[n, m]
                    )

    def best_of(
        self, starts: list[Roots], best: Roots | None = None, *, tolerance: float = CONVERGED
    ) -> Roots:
        """Return the best of the refined starts and a given fit; equal starts are refined once."""
        tried: list[float] = []
        for start in sorted(starts, key=lambda roots: roots[4]):
            if all(abs(start[4] - cost) > _SAME_COST * cost for cost in tried):
                refined = self.refine(start, tolerance)
                if best is None or refined[4] < best[4]:
                    best = refined
            tried.append(start[4])
        if best is None:
            raise RuntimeError("a search without a start")
        return best

    def probability(self, roots: Roots) -> float:
        """Return the probability of at least this cost by scatter and model error."""
        return probability_of_cost(roots[4], self.lines.dof, self.n_parameters(roots))

    def explained(self, roots: Roots) -> bool:
        """Return True if scatter explains the residual of a fit."""
        return self.probability(roots) > _LIKELY_COST

    def with_class_error(self, epsilon: float, delay: float | None) -> FitSearch:
        """Return a search with an error of the class in the weights of the lines; `delay` [s] is
        fixed unless None.
        """
        return replace(
            self, lines=replace(self.lines, epsilon=epsilon), delay=delay, found={}, begun={}
        )

    def best_with_class_error(self, orders: tuple[int, int]) -> tuple[FitSearch, Roots]:
        """Return the best fit and the search that weighed its lines: this one if scatter explains
        the residual.

        Otherwise the error of the class is estimated with the model, from the fit to the scatter
        alone and from scratch at several sizes of that error. If that leads to a fit that scatter
        explains, the class has no error after all.
        """
        if orders in self.found:
            roots = self.found[orders]
        else:
            roots = self.begin(orders)
        if (
            not self.probability(roots) < UNLIKELY_COST
        ):  # without variances the error of the class is not separable
            return self, self.best(orders)
        begun = [roots]
        for k, epsilon in enumerate(START_SIZES):
            # the delay is searched for once: at the size at which the scatter matters least
            weighted = self.with_class_error(epsilon, self.delay if k == 0 else begun[-1][3])
            begun.append(weighted.begin(orders, tolerance=_ROUGH))
        settled = [self.settle(start, _ROUGH) for start in begun]
        weighted, roots = min(settled, key=lambda found: found[0].unlikelihood(found[1]))
        alone = self.refine(self.with_cost(*roots[:4]))
        if self.probability(alone) < UNLIKELY_COST:
            return self.settle(roots)
        return self, self.best(orders, starts=(alone,))

    def settle(self, roots: Roots, tolerance: float = CONVERGED) -> tuple[FitSearch, Roots]:
        """Return the most likely fit near a start, with the search at the most likely size of the
        class error.

        Size and model are optimised in turn; no step lowers the likelihood of both together.
        """
        weighted, last = self, np.inf
        for _ in range(MAX_ROUNDS):
            square = np.abs(self.lines.G - self.response(roots)) ** 2
            epsilon, unlikely = most_likely_size(square, self.lines.var, self.lines.tolerance)
            weighted = self.with_class_error(epsilon, self.delay)
            roots = weighted.with_cost(*roots[:4])
            if not unlikely < last - max(SETTLED, tolerance * roots[4]):
                break
            last, roots = unlikely, weighted.refine(roots, tolerance)
        return weighted, roots

    def unlikelihood(self, roots: Roots) -> float:
        """Return the negative log likelihood of a fit minus that of its scatter alone.

        The cost is in units of its expectation for estimated variances; without variances the
        likeliest one is used.
        """
        cost, dof = roots[4], self.lines.dof
        if np.isnan(dof).any():
            return float(dof.size * np.log(max(cost, np.finfo(float).tiny) / dof.size))
        if self.lines.epsilon:
            unit = 1.0
        else:
            unit = float(np.mean(expected_ratio(dof)))
        return cost / unit + float(np.sum(np.log(self.lines.total_var / self.lines.var)))

    def response(self, roots: Roots) -> np.ndarray:
        zeros, poles, gain, tau, _ = roots
        return zpk_response(
            self.lines.omega,
            zeros,
            poles=poles,
            gain=gain,
            delay=tau,
            dt=self.dt,
            excess=poles.size - zeros.size,
        )

    def with_cost(self, zeros: np.ndarray, poles: np.ndarray, gain: float, tau: float) -> Roots:
        model = self.response((zeros, poles, gain, tau, np.nan))
        return (
            zeros,
            poles,
            gain,
            tau,
            float(np.sum(np.abs(self.lines.G - model) ** 2 / self.lines.total_var)),
        )

    def refine(self, start: Roots, tolerance: float = CONVERGED) -> Roots:
        """Return the fit refined from a start by Levenberg and Marquardt's method; a delay in
        samples stays.
        """
        excess = start[1].size - start[0].size

        def factor(tau: float) -> np.ndarray:
            return known_factor(self.lines.omega, tau, dt=self.dt, excess=excess)

        return refine(
            s_plane_points(self.lines.omega, self.dt),
            self.lines.G,
            weight=1 / np.sqrt(self.lines.total_var),
            start=start,
            factor=factor,
            omega=self.lines.omega if self.delay is None and not self.dt else None,
            stable=self.stable,
            tolerance=tolerance,
        )

    def fresh(self, orders: tuple[int, int]) -> list[Roots]:
        """Return starts from scratch, at the given delay or at those of the smallest cost."""
        if self.delay is None:
            delays = _trial_delays(self.lines, self.dt)
            rough = [
                _vector_fitted(self, orders, float(tau), "log", n_iterations=_N_ROUGH)
                for tau in delays
            ]
            best = sorted(rough, key=lambda roots: roots[4])[:_N_DELAYS]
            starts = [_vector_fitted(self, orders, roots[3], "log") for roots in best]
            starts.sort(key=lambda roots: roots[4])
        else:
            starts = [_vector_fitted(self, orders, self.delay, "log")]
        return starts + [
            _vector_fitted(self, orders, starts[0][3], spacing) for spacing in ("linear", "peaks")
        ]


def _trial_delays(lines: FrfData, dt: float) -> np.ndarray:
    """Return delays [s] from zero to twice the mean group delay, or one turn at the last line."""
    order = np.argsort(lines.omega, kind="stable")
    phase = np.unwrap(np.angle(lines.G[order]))
    omega = lines.omega[order]
    slope = max(0.0, -np.polyfit(omega, phase, 1)[0])
    longest = max(2 * slope, 2 * np.pi / omega[-1])
    if not dt:
        return np.linspace(0.0, longest, _N_TRIALS)
    trials = np.arange(int(np.ceil(longest / dt)) + 1) * dt
    return trials[:: max(1, trials.size // 60)]


def _vector_fitted(
    search: FitSearch,
    orders: tuple[int, int],
    tau: float,
    spacing: str,
    *,
    n_iterations: int = _N_RELOCATIONS,
) -> Roots:
    """Return a fit by vector fitting behind a delay [s], or with poles on the peaks."""
    lines, (n_poles, n_zeros) = search.lines, orders
    s = s_plane_points(lines.omega, search.dt)
    q = known_factor(lines.omega, tau, dt=search.dt, excess=n_poles - n_zeros)
    data, weight = lines.G / q, np.abs(q) / np.sqrt(lines.total_var)
    low, high = np.abs(s).min(), np.abs(s).max()
    if spacing == "peaks":
        poles = _poles_on_peaks(s, data, n_poles)
    else:
        poles = starting_poles(n_poles, low, high, spacing=spacing)
    if n_poles and spacing != "peaks":
        # an extreme variance ratio stalls the relocation; the refinement uses the true one
        tame = np.maximum(weight, 1e-3 * weight.max())
        poles = vector_fit(
            s,
            data,
            weight=tame,
            poles=poles,
            n_zeros=n_zeros,
            n_iterations=n_iterations,
            stable=search.stable,
        )
        poles = np.where(np.abs(poles) < 1e-6 * low, -1e-6 * low, poles)
    return _with_numerator(search, poles, n_zeros, tau)


def _with_numerator(search: FitSearch, poles: np.ndarray, n_zeros: int, tau: float) -> Roots:
    """Return the fit with the best numerator over given poles and a given delay [s]."""
    lines = search.lines
    q = known_factor(lines.omega, tau, dt=search.dt, excess=poles.size - n_zeros)
    data, weight = lines.G / q, np.abs(q) / np.sqrt(lines.total_var)
    s = s_plane_points(lines.omega, search.dt)
    zeros, gain = fit_numerator(s, data, weight=weight, poles=poles, n_zeros=n_zeros)
    return search.with_cost(zeros, poles, gain, tau)


def _poles_on_peaks(s: np.ndarray, data: np.ndarray, n: int) -> np.ndarray:
    """Return (n,) lightly damped poles on the highest peaks, at least a fifth of their frequency
    apart.
    """
    x, size = np.abs(s), np.abs(data)
    poles: list[complex] = [-np.exp(np.mean(np.log(x)))] if n % 2 else []
    while len(poles) < n:
        peak = x[np.argmax(size)]
        poles += [peak * (-0.05 + 1j), peak * (-0.05 - 1j)]
        size = np.where(np.abs(x - peak) < 0.2 * peak, size * 1e-6, size)
    return order_roots(np.array(poles))


def _further_roots(search: FitSearch, roots: Roots, k: int) -> list[Roots]:
    """Return starts with one (k = 1) or two further poles and as many zeros, at the largest effect
    on the residual.

    A factor 1 + (a s + b)/(s^2 + 2 zeta w s + w^2), or 1 + b/(s + w), is linear in a and b. The
    value of a place is the reduction of the residual by a, b and small steps of all fitted
    parameters, in least squares.
    """
    lines, (zeros, poles, gain, tau, _) = search.lines, roots
    s, model = s_plane_points(lines.omega, search.dt), search.response(roots)
    weight = model / np.sqrt(lines.total_var)
    columns = [np.ones(s.size), partial_fractions(s, zeros), partial_fractions(s, poles)]
    if search.delay is None and not search.dt:
        columns.append(-1j * lines.omega)
    known = stack_real_imaginary(np.column_stack(columns) * weight[:, None])
    q = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), np.finfo(float).tiny))[0]
    e = stack_real_imaginary((lines.G - model) / np.sqrt(lines.total_var))

    def left(part: np.ndarray) -> np.ndarray:
        """Return the part that small steps of all fitted parameters do not reach."""
        stacked = stack_real_imaginary(part * weight[:, None])
        return np.asarray(stacked - q @ (q.T @ stacked))

    places = np.sort(np.abs(s))
    w = places[np.unique(np.linspace(0, places.size - 1, _N_PLACES).astype(int))]
    worth, dampings = [], _DAMPINGS if k == 2 else (1.0,)
    for zeta in dampings:
        if k == 2:
            below = s[:, None] ** 2 + 2 * zeta * w * s[:, None] + w**2
        else:
            below = s[:, None] + w
        one = left(w / below)
        size = np.maximum(np.sum(one**2, axis=0), np.finfo(float).tiny)
        by, gain_of = np.stack([(e @ one) / size, np.zeros(w.size)], axis=1), (e @ one) ** 2 / size
        if k == 2:
            two = left(s[:, None] / below)
            across = np.sum(one * two, axis=0) / size
            two = two - across * one
            size = np.maximum(np.sum(two**2, axis=0), np.finfo(float).tiny)
            by[:, 1] = (e @ two) / size
            by[:, 0] -= across * by[:, 1]
            gain_of = gain_of + (e @ two) ** 2 / size
        worth += list(zip(gain_of, w, [zeta] * w.size, by, strict=True))
    worth.sort(key=lambda place: -place[0])
    distant = [place for place in worth if abs(np.log(place[1] / worth[0][1])) > _MIN_LOG_DISTANCE]
    starts = []
    for _, at, zeta, (b, a) in worth[:1] + distant[: k - 1]:
        below = np.array([1, 2 * zeta * at, at**2] if k == 2 else [1, at])
        above = np.array([0, a, b * at] if k == 2 else [0, b * at])
        shares = [
            search.with_cost(
                order_roots(
                    np.concatenate([zeros, np.roots(below + share * above)]).astype(complex)
                ),
                order_roots(np.concatenate([poles, np.roots(below)]).astype(complex)),
                gain,
                tau,
            )
            for share in _SHARES
        ]
        starts.append(min(shares, key=lambda one: one[4]))
    return starts


def _fewer_roots(search: FitSearch, roots: Roots, k: int) -> list[Roots]:
    """Return the cheapest start without one real pole (k = 1) or one pair, and with as many zeros
    fewer.
    """
    zeros, poles, _, tau, _ = roots
    pairs, rest = pair_roots(poles)
    real = np.array([*rest, *(p for pair in pairs for p in pair if p.imag == 0)])
    starts = []
    for gone in pairs if k == 2 else [(p,) for p in real]:
        kept = list(poles)
        for p in gone:
            kept.pop(int(np.argmin(np.abs(np.array(kept) - p))))
        starts.append(_with_numerator(search, np.array(kept, dtype=complex), zeros.size - k, tau))
    return sorted(starts, key=lambda one: one[4])[:1]
