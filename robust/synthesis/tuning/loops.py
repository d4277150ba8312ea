"""The loop around one plant with its fixed parts, and every limit on it: gains over frequency,
peaks, slopes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.grids import cluster_at_modes, mode_lines
from robust.lti.lti import Matrices, poles, timebase, to_s_plane, zeros
from robust.lti.norms import continuous_matrices, crossings, largest_gain, well_conditioned
from robust.synthesis.tuning.closing import ClosedLoop, StatePlant
from robust.synthesis.tuning.friction import FrictionChannel, Multipliers
from robust.synthesis.tuning.limits import Channel
from robust.synthesis.tuning.plants import ModelledPlant, is_bounded
from robust.synthesis.tuning.worst import Perturbation, Scalings

_N_LINES, _N_PEAKS, _N_ROUNDS = 70, 6, 4
#: Frequencies of the final evaluation for a limit that is not a norm, and around each lightly
#: damped pole.
_N_DENSE, _N_AROUND, _N_BAND = 1500, 41, 300
#: Least height of a local maximum over the highest one.
_NEAR_PEAK_RATIO = 0.7
#: Relative excess of the exact norm over a value, above which a frequency is added.
_NORM_TOLERANCE = 1e-8
#: Steps above a value at which the exact norm is tried, the first ones for a value close to a
#: singular value of D.
_DIFFERENCE_STEPS = (1e-3, 1e-5, 1e-7)
_MAX_KEPT = 24
AnyChannel = Channel | FrictionChannel
#: For the scalings of a worst case: rounds that insert lines, and the relative level above the best
#: that causes one.
_N_SCALING_ROUNDS, _SCALING_TOLERANCE = 3, 1e-3
#: Number of frequencies whose best scalings are computed together.
_N_TOGETHER = 60


def bilinear_frequency(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return frequencies in the plane of the bilinear map, 2/T tan(omega T/2) [rad/s]."""
    if not dt:
        return np.asarray(omega, dtype=float)
    half = np.minimum(np.asarray(omega, dtype=float) * dt / 2, np.pi / 2)
    return np.where(half >= np.pi / 2 * (1 - 1e-15), np.inf, 2 / dt * np.tan(half))


def true_frequency(image: np.ndarray, dt: float) -> np.ndarray:
    """Return true frequencies [rad/s] for those in the plane of the bilinear map."""
    if dt:
        return 2 / dt * np.arctan(np.asarray(image) * dt / 2)
    return np.asarray(image, dtype=float)


@value(copy=False)
class Peak:
    """A local maximum of a limit on the loop around one plant."""

    limit: int
    plant: int
    hard: bool
    omega: float  # frequency in the plane of the bilinear map [rad/s]
    level: float  # log of gain times weight over bound
    gradient: np.ndarray  # (p,) derivative of the level by the coordinates


@value(copy=False)
class CloseLook:
    """Final value of a limit on one plant, from its norm or from dense lines."""

    # ratio, omega: largest gain times weight over bound, and its frequency in the plane of the
    # bilinear map [rad/s]
    ratio: float
    omega: float
    n_lines: int  # number of frequencies; 0 if no frequency has a larger ratio


class ModelledLoop:
    """The loop of a plant that is known at every frequency."""

    def __init__(
        self,
        index: int,
        fixed: StatePlant,
        plant: ModelledPlant,
        channels: Sequence[AnyChannel],
        dt: float,
    ) -> None:
        self.index, self.fixed, self.plant, self.channels, self.dt = (
            index,
            fixed,
            plant,
            channels,
            dt,
        )
        #: Frequencies at which a limit exceeded its value on the grid, kept for the rest of the
        #: search, by limit.
        self.added: dict[int, list[float]] = {channel.index: [] for channel in channels}
        #: Scalings of worst cases and multipliers of friction limits, by limit.
        self.scalings: dict[int, Scalings] = {}
        self.multipliers: dict[int, Multipliers] = {}
        self.has_friction = any(isinstance(channel, FrictionChannel) for channel in channels)
        lines = plant.lines[(plant.lines > 0)]
        lines = np.concatenate(
            [lines[lines * dt < np.pi] if dt else lines, self.lines_of_systems()]
        )
        self.lines = bilinear_frequency(lines, dt)

    def lines_of_systems(self) -> np.ndarray:
        """Return frequencies [rad/s] around the poles and zeros of weights, bounds and set, folded
        below Nyquist.
        """
        systems = [
            *self.plant.set_systems,
            *(
                part
                for one in self.channels
                if isinstance(one, Channel)
                for part in one.limit.systems
            ),
        ]
        roots = [
            to_s_plane(np.append(poles(one), zeros(one)), timebase(one))
            for one in systems
            if one.nstates
        ]
        s = np.concatenate([np.zeros(0, complex), *roots])
        found = np.concatenate([np.abs(s), mode_lines(s, (0.0, np.inf))])
        found = found[np.isfinite(found) & (found > 0)]
        if self.dt:
            top = np.pi / self.dt
            return np.abs((found + top) % (2 * top) - top)
        return found

    def close(self, M: np.ndarray) -> ClosedLoop | None:
        """Return the loop with the blocks M; None if it has no solution, or one that is not
        finite.
        """
        loop = self.fixed.close(M)
        if loop is not None and np.isfinite(loop.A).all():
            return loop
        return None

    def band(self, channel: AnyChannel) -> tuple[float, float]:
        """Return the band of a limit in the plane of the bilinear map [rad/s]."""
        if channel.limit.band is None:
            return 0.0, np.inf
        low, high = bilinear_frequency(np.array(channel.limit.band), self.dt)
        return float(low), float(high)

    def levels(
        self, channel: AnyChannel, omega: np.ndarray, H: np.ndarray, *, exact: bool = False
    ) -> np.ndarray:
        """Return (W,) gain times weight over bound at frequencies of the plane, of the search or
        exact.
        """
        true = true_frequency(omega, self.dt)
        if isinstance(channel, FrictionChannel):
            return channel.levels(true, H, self.multipliers[channel.index])
        factor = channel.limit.factor(np.minimum(true, 1e12))
        if channel.perturbation is None:
            return channel.exact_gain(H, None) * factor
        perturbation = self.perturbation(true)
        known = is_bounded(perturbation)
        perturbation = replace(
            perturbation, drives=np.where(known[:, None, None], perturbation.drives, 0)
        )
        if exact:
            gain = channel.exact_gain(H, perturbation)
        else:
            gain = channel.gain(H, perturbation, self.scalings_at(channel, omega))
        return np.where(known, gain * factor, 0.0)

    def perturbation(self, true: np.ndarray) -> Perturbation:
        """Return the ports of the perturbation of the set."""
        assert self.plant.perturbation is not None
        return self.plant.perturbation(true)

    def scalings_at(self, channel: AnyChannel, omega: np.ndarray) -> np.ndarray | None:
        """Return the scalings (W, K) of the search; None if the limit has none."""
        if channel.is_scaled:
            return self.scalings[channel.index].at(omega)
        return None

    def refit_scalings(self, loop: ClosedLoop) -> None:
        """Fit the scalings of the worst cases to a loop again, on more lines where these are too
        sparse.
        """
        for channel in self.channels:
            if isinstance(channel, FrictionChannel):
                true = channel.lines(loop.poles)
                H = loop.responses_by_elimination(bilinear_frequency(true, self.dt))
                self.multipliers[channel.index] = channel.best_multipliers(true, H)
                continue
            if not channel.is_scaled:
                continue
            omega = self.grid(loop)
            omega = omega[(omega > 0) & np.isfinite(omega)]
            for _ in range(_N_SCALING_ROUNDS):
                true = true_frequency(omega, self.dt)
                level = 1 / np.maximum(channel.limit.factor(true), 1e-300)
                H = loop.responses_by_elimination(omega)
                self.scalings[channel.index] = channel.best_scalings(
                    omega, H, self.perturbation(true), level
                )
                level = self.levels(channel, omega, H)
                tops, heights = self.refine_maxima(loop, channel, omega, level)
                if not heights.max(initial=0.0) > level.max() * (1 + _SCALING_TOLERANCE):
                    break
                omega = np.union1d(omega, tops)

    def respond(self, loop: ClosedLoop) -> Callable[[np.ndarray], np.ndarray]:
        """Return the function for responses: from the modes, or without their rounding for a
        friction limit.
        """
        if self.has_friction:
            return loop.responses_by_elimination
        return loop.responses

    def grid(self, loop: ClosedLoop) -> np.ndarray:
        """Return frequencies that resolve every mode of the loop [rad/s], with zero and
        infinity.
        """
        poles = loop.poles
        size = np.abs(poles)
        if size.size:
            size = size[size > 1e-12 * size.max(initial=0.0)]
        else:
            size = np.ones(1)
        wide = np.geomspace(0.05 * size.min(), 20 * size.max(), _N_LINES)
        kept = [frequency for frequencies in self.added.values() for frequency in frequencies]
        return np.unique(
            np.concatenate(
                [[0.0, 1e-4 * size.min(), np.inf], wide, size, np.abs(poles.imag), self.lines, kept]
            )
        )

    def highest_maxima(self, loop: ClosedLoop) -> list[tuple[AnyChannel, np.ndarray, np.ndarray]]:
        """Return for each limit the frequencies of its highest local maxima, and the levels there,
        highest first.
        """
        omega = self.grid(loop)
        respond = self.respond(loop)
        H = respond(omega)
        known = {*self.scalings, *self.multipliers}
        if any(channel.is_scaled and channel.index not in known for channel in self.channels):
            self.refit_scalings(loop)
        found = []
        for channel in self.channels:
            low, high = self.band(channel)
            inside = (omega >= low) & (omega <= high)
            at, values = omega[inside], H[inside]
            if low > 0 or np.isfinite(high):
                edges = np.array([edge for edge in (low, high) if np.isfinite(edge)])
                at, values = np.concatenate([at, edges]), np.concatenate([values, respond(edges)])
                at, first = np.unique(at, return_index=True)
                values = values[first]
            level = self.levels(channel, at, values)
            found.append((channel, *self.refine_maxima(loop, channel, at, level)))
        return found

    def refine_maxima(
        self,
        loop: ClosedLoop,
        channel: AnyChannel,
        omega: np.ndarray,
        level: np.ndarray,
        *,
        rounds: int = _N_ROUNDS,
        exact: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Refine local maxima: brackets shrink to a quarter in each of `rounds`; exact: as in the
        report.
        """
        respond = loop.responses_by_elimination if exact else self.respond(loop)
        places = highest_places(level)
        best, value_ = omega[places], level[places]
        left = omega[np.maximum(places - 1, 0)]
        right = omega[np.minimum(places + 1, omega.size - 1)]
        inner = np.isfinite(best) & np.isfinite(right) & (left < best) & (best < right)
        best, value_ = best.copy(), value_.copy()
        x, lo, hi = best[inner], left[inner], right[inner]
        y = value_[inner]
        if x.size:
            shares = np.array([0.25, 0.5, 0.75])
            for _ in range(rounds):
                points = np.concatenate(
                    [lo + (x - lo) * shares[:, None], x + (hi - x) * shares[:, None]]
                )
                values = self.levels(channel, points.ravel(), respond(points.ravel()), exact=exact)
                values = values.reshape(points.shape)
                every = np.concatenate([lo[None], points[:3], x[None], points[3:], hi[None]])
                heights = np.concatenate(
                    [np.full((1, x.size), -np.inf), values[:3], y[None], values[3:]]
                )
                k = heights.argmax(axis=0)
                column = np.arange(x.size)
                x, y = every[k, column], heights[k, column]
                lo, hi = every[np.maximum(k - 1, 0), column], every[k + 1, column]
            best[inner], value_[inner] = x, y
        order = np.argsort(-value_, kind="stable")
        return best[order], value_[order]

    def peaks(self, loop: ClosedLoop, slopes: np.ndarray) -> list[Peak]:
        """Return the peaks of every limit with their gradients."""
        found = []
        sides: dict[float, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        for channel, omega, _ in self.highest_maxima(loop):
            for w in omega:
                if w not in sides:
                    sides[float(w)] = loop.sensitivity_factors(float(w))
                found += self.peaks_at(channel, float(w), sides[float(w)], slopes)
        return found

    def peaks_at(
        self,
        channel: AnyChannel,
        omega: float,
        sides: tuple[np.ndarray, np.ndarray, np.ndarray],
        slopes: np.ndarray,
    ) -> list[Peak]:
        """Return the level and the slope of a limit at one frequency, and those of a second
        singular value.
        """
        H, L, R = sides
        true = true_frequency(np.array([omega]), self.dt)
        factor = float(channel.limit.factor(np.minimum(true, 1e12))[0])
        if isinstance(channel, FrictionChannel):
            gains = channel.slopes(float(true[0]), H, self.multipliers[channel.index])
            return peaks_of_gains(
                channel,
                self.index,
                omega=omega,
                factor=factor,
                found=gains,
                sides=(L, R),
                slopes=slopes,
            )
        if channel.perturbation is not None:
            perturbation = self.perturbation(true)
        else:
            perturbation = None
        d = self.scalings_at(channel, np.array([omega]))
        gains = channel.slopes(H, perturbation, None if d is None else d[0])
        return peaks_of_gains(
            channel,
            self.index,
            omega=omega,
            factor=factor,
            found=gains,
            sides=(L, R),
            slopes=slopes,
        )

    def raise_norms(self, loop: ClosedLoop) -> dict[int, tuple[float, float, bool]]:
        """Find the largest level of each limit, its frequency, and if none is higher (Bruinsma &
        Steinbuch 1990).

        Frequencies found above the grid are kept for the rest of the search.
        """
        found = {}
        for channel, omega, _ in self.highest_maxima(loop):
            exact = self.levels(
                channel, omega, loop.responses_by_elimination(omega), exact=not channel.is_scaled
            )
            k = int(np.argmax(exact))
            best, where = float(exact[k]), float(omega[k])
            certain = False
            if channel.perturbation is None:
                weighting = channel.limit.weighting(self.dt)
            else:
                weighting = None
            if weighting is not None and best > 0:
                matrices = _weighted_channel(loop, channel, weighting=weighting, dt=self.dt)
                best, where, certain = _norm_over_band(
                    matrices, best, where=where, band=self.band(channel)
                )
            self.keep(channel.index, where)
            found[channel.index] = (best, where, certain)
        return found

    def look_closely(self, loop: ClosedLoop) -> dict[int, CloseLook]:
        """Return every limit: as a norm if it is one, otherwise on lines much denser than those of
        the search.
        """
        norms, looks = self.raise_norms(loop), {}
        for channel in self.channels:
            level, omega, certain = norms[channel.index]
            norm = CloseLook(ratio=level, omega=omega, n_lines=0)
            looks[channel.index] = (
                norm if certain else self.look_densely(loop, channel, level, omega)
            )
        return looks

    def look_densely(
        self, loop: ClosedLoop, channel: AnyChannel, level: float, where: float
    ) -> CloseLook:
        """Return a limit that is not a norm, because of a weight over frequency or a set, on a
        dense grid.
        """
        poles, (low, high) = loop.poles, self.band(channel)
        if poles.size:
            size = np.abs(poles)[np.abs(poles) > 0]
        else:
            size = np.ones(1)
        light = poles[(poles.imag > 0) & (np.abs(poles.real) < 0.3 * poles.imag)]
        if light.size:
            near = cluster_at_modes(light, _N_AROUND)
        else:
            near = np.zeros(0)
        edges = np.array([edge for edge in (low, high) if np.isfinite(edge)])
        omega = [
            np.geomspace(1e-3 * size.min(), 1e3 * size.max(), _N_DENSE),
            near[near > 0],
            self.grid(loop),
            edges,
        ]
        if np.isfinite(high):
            omega.append(np.geomspace(max(low, 1e-3 * high), high, _N_BAND))
        at = np.unique(np.concatenate([*omega, [where]]))
        at = at[(at >= low) & (at <= high)]
        levels = self.highest_levels(loop, channel, at)
        k = int(np.argmax(levels))
        if channel.is_scaled:
            level, where = float(levels[k]), float(at[k])
        if levels[k] > level * (1 - 1e-3):  # the maximum between two lines of the grid
            peak = slice(max(k - 1, 0), k + 2)
            tops, heights = self.refine_maxima(
                loop, channel, at[peak], levels[peak], rounds=3 * _N_ROUNDS, exact=True
            )
            if heights[0] > level:
                level, where = float(heights[0]), float(tops[0])
                self.keep(channel.index, where)
        return CloseLook(ratio=level, omega=where, n_lines=int(at.size))

    def highest_levels(
        self, loop: ClosedLoop, channel: AnyChannel, omega: np.ndarray
    ) -> np.ndarray:
        """Return (W,) exact levels; with scalings only where they may be the highest, zero
        elsewhere.

        The scalings of the search prove a bound at every frequency: where it is below an exact
        level found, no exact level is higher.
        """
        H = loop.responses_by_elimination(omega)
        if not channel.is_scaled:
            return self.levels(channel, omega, H, exact=True)
        bound = self.levels(channel, omega, H)
        found = np.zeros(omega.size)
        order = np.argsort(-bound, kind="stable")
        for part in np.array_split(order, max(1, omega.size // _N_TOGETHER)):
            if found.max() >= bound[part[0]]:
                break
            found[part] = self.levels(channel, omega[part], H[part], exact=True)
        return found

    def curve(self, channel: AnyChannel, loop: ClosedLoop, omega: np.ndarray) -> np.ndarray:
        """Return (W,) ratio of a limit over frequencies of the plane."""
        return self.levels(channel, omega, loop.responses_by_elimination(omega), exact=True)

    def frequencies(self, channel: AnyChannel, loop: ClosedLoop) -> np.ndarray:
        """Return frequencies of the plane [rad/s] that show the curve of a limit, within its
        band.
        """
        if loop.poles.size:
            size = np.abs(loop.poles)[np.abs(loop.poles) > 0]
        else:
            size = np.ones(1)
        low, high = self.band(channel)
        high = min(high, 20 * float(size.max()))
        low = max(low, min(0.05 * float(size.min()), 1e-2 * high))
        grid = self.grid(loop)
        return np.union1d(np.geomspace(low, high, _N_BAND), grid[(grid >= low) & (grid <= high)])

    def keep(self, limit: int, omega: float) -> None:
        """Keep a frequency; of many, the latest are kept."""
        kept = self.added[limit]
        if (
            np.isfinite(omega)
            and omega > 0
            and not any(abs(omega - one) <= 1e-6 * omega for one in kept)
        ):
            kept.append(omega)
            del kept[:-_MAX_KEPT]


def highest_places(level: np.ndarray) -> np.ndarray:
    """Return the indices of the highest local maxima of a level (W,), the highest first."""
    padded = np.concatenate([[-np.inf], level, [-np.inf]])
    top = (
        (level >= padded[:-2])
        & (level >= padded[2:])
        & (level >= _NEAR_PEAK_RATIO * level.max(initial=0.0))
    )
    places = np.flatnonzero(top)
    return places[np.argsort(-level[places], kind="stable")][:_N_PEAKS]


def _weighted_channel(
    loop: ClosedLoop, channel: AnyChannel, *, weighting: control.StateSpace, dt: float
) -> Matrices:
    """Return the matrices of a channel with its weight on each output."""
    A = loop.A
    B = loop.B[:, channel.columns]
    C = loop.C[channel.rows]
    D = loop.D[np.ix_(channel.rows, channel.columns)]
    Aw, Bw, Cw, Dw = continuous_matrices(weighting, dt)
    p = len(channel.rows)
    Aw, Bw, Cw, Dw = (np.kron(np.eye(p), part) for part in (Aw, Bw, Cw, Dw))
    zero = np.zeros((A.shape[0], Aw.shape[0]))
    return (
        np.block([[A, zero], [Bw @ C, Aw]]),
        np.vstack([B, Bw @ D]),
        np.hstack([Dw @ C, Cw]),
        Dw @ D,
    )


def _norm_over_band(
    matrices: Matrices, best: float, *, where: float, band: tuple[float, float]
) -> tuple[float, float, bool]:
    """Return the norm over a band, its frequency, and True if the Hamiltonian has no crossing above
    it.
    """
    system, certain = well_conditioned(matrices), False
    for _ in range(20):
        raised = False
        for step in _DIFFERENCE_STEPS:
            found = crossings(system, best * (1 + step))
            if found is None:
                continue
            omega = np.unique(found[0])
            omega = omega[(omega >= band[0]) & (omega <= band[1])]
            certain = step == _DIFFERENCE_STEPS[-1]
            if not omega.size:
                continue
            points = np.concatenate([omega, (omega[1:] + omega[:-1]) / 2])
            gains = largest_gain(matrices, points)
            k = int(np.argmax(gains))
            if gains[k] > best * (1 + _NORM_TOLERANCE):
                best, where, raised = float(gains[k]), float(points[k]), True
                break
        if not raised:
            break
    return best, where, certain and not raised


def peaks_of_gains(
    channel: AnyChannel,
    plant: int,
    *,
    omega: float,
    factor: float,
    found: list[tuple[float, np.ndarray]],
    sides: tuple[np.ndarray, np.ndarray],
    slopes: np.ndarray,
) -> list[Peak]:
    """Return peaks from gains and their adjoints: gradient of log gain = Re tr(R Q* L
    dM_k)/gain.
    """
    L, R = sides
    peaks = []
    for gain, Q in found:
        if gain * factor <= 0:
            continue
        across = R @ Q.conj().T @ L  # (columns, rows) of M
        gradient = (slopes.reshape(len(slopes), -1) @ across.T.ravel()).real / gain
        peaks.append(
            Peak(
                limit=channel.index,
                plant=plant,
                hard=channel.hard,
                omega=omega,
                level=float(np.log(gain * factor)),
                gradient=gradient,
            )
        )
    return peaks
