"""Frequency grids that resolve every mode, and the peaks of curves on them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from robust.lti.lti import poles, timebase, to_s_plane, zeros

#: Largest distance of a frequency of a loop from their median [as a factor] at which it still
#: widens the common grid.
_MAX_MODE_RATIO = 1e9
#: Frequencies at which a mode farther away is examined, relative to it.
_MODE_OFFSETS = np.array([0.1, 0.3, 0.7, 1.0, 1.4, 3.0, 10.0])
#: Number of ripples of a delay that are resolved, and of points on each.
_RIPPLES, _POINTS = 150, 8
#: Maxima that are refined: all within this factor of the largest, and at most so many.
_NEARLY, _MOST_MAXIMA = 0.9, 40
#: Distance of the first point from the peak of a mode in half-widths; points a decade; least
#: half-width [relative].
_FROM_PEAK, _A_DECADE, _NARROWEST = 0.1, 8, 1e-12
#: Last frequency of the grid of a sampled loop, relative to Nyquist: the response there is real
#: within about 1e-9.
BELOW_NYQUIST = 1 - 1e-9
#: Number of refinements of the brackets of maxima, each to a fourth or less.
_N_ZOOMS = 5


def loop_grid(
    lines: np.ndarray,
    loop_poles: np.ndarray,
    *,
    systems: list[control.StateSpace],
    dt: float,
    delay: float = 0.0,
    folded: np.ndarray | tuple[()] = (),
) -> np.ndarray:
    """Return frequencies [rad/s] that resolve a loop: the lines, a log grid, every mode of loop and
    systems.

    The poles of the loop are given on its time base dt, each system has its own. A delay [s] makes
    ripples. `folded` : poles in the s plane at the alias frequencies of modes above Nyquist. The
    grid of a sampled loop ends just below Nyquist, where its gain is real: a gain margin may stand
    there and nowhere else.
    """
    if dt:
        top = np.pi / dt
        ends = [top * BELOW_NYQUIST]
    else:
        top, ends = np.inf, []
    roots = [to_s_plane(loop_poles, dt)]
    for system in systems:
        if system.nstates:
            roots += [
                to_s_plane(poles(system), timebase(system)),
                to_s_plane(zeros(system), timebase(system)),
            ]
    s = np.concatenate([*roots, np.asarray(folded, dtype=complex)])
    s = s[np.isfinite(s) & (np.abs(s) > 0)]
    size = np.concatenate([np.abs(lines), np.abs(s)])
    centre = np.median(size)
    size = size[(size > centre / _MAX_MODE_RATIO) & (size < _MAX_MODE_RATIO * centre)]
    low, high = size.min() / 100, min(size.max() * 100, top)
    sharp = s[(np.abs(s.real) < 0.5 * np.abs(s)) & (s.imag > 0)]
    if lines.size <= 2000:
        keep = lines
    else:
        keep = lines[:: lines.size // 2000 + 1]
    if delay:
        ripples = np.arange(1, _RIPPLES * _POINTS) * (2 * np.pi / (_POINTS * delay))
    else:
        ripples = np.zeros(0)
    omega = np.concatenate(
        [keep, np.geomspace(low, high, 500), cluster_at_modes(sharp, 41), ripples]
    )
    far = np.abs(s)[
        (np.abs(s) <= centre / _MAX_MODE_RATIO) | (np.abs(s) >= _MAX_MODE_RATIO * centre)
    ]
    omega = np.concatenate(
        [omega[(omega >= low) & (omega <= high)], np.outer(far, _MODE_OFFSETS).ravel(), ends]
    )
    return np.unique(omega[(omega > 1e-150) & (omega <= min(1e150, top * BELOW_NYQUIST))])


def structure_grid(N: control.StateSpace) -> np.ndarray:
    """Return frequencies [rad/s] for mu: zero, and around every pole, dense for light damping; up
    to Nyquist.
    """
    dt = timebase(N)
    if N.nstates:
        p = N.poles().astype(complex)
    else:
        p = np.ones(1, complex)
    s = to_s_plane(p, dt)
    s = s[np.isfinite(s) & (np.abs(s) > 0)]
    if s.size:
        size = np.abs(s)
    else:
        size = np.ones(1)
    near = (size > np.median(size) / _MAX_MODE_RATIO) & (size < np.median(size) * _MAX_MODE_RATIO)
    if dt:
        top = np.pi / dt
    else:
        top = np.inf
    low, high = size[near].min() / 30, min(size[near].max() * 30, top)
    sharp = s[(np.abs(s.real) < 0.3 * np.abs(s)) & (s.imag > 0)]
    omega = np.concatenate([np.geomspace(low, high, 120), cluster_at_modes(sharp, 21)])
    # a mode far away, as of a weight with almost integral action, is looked at by itself
    far = np.outer(size[~near], _MODE_OFFSETS).ravel()
    omega = np.unique(
        np.concatenate(
            [omega[(omega >= low) & (omega <= high)], far[(far > 1e-150) & (far < min(1e150, top))]]
        )
    )
    # at zero frequency (and at Nyquist) N is real, and real perturbations have effects that they
    # have nowhere nearby
    return np.concatenate([[0.0], omega, [top] if dt else []])


def cluster_at_modes(sharp: np.ndarray, n: int) -> np.ndarray:
    """Return n frequencies [rad/s] around each lightly damped root of the upper half plane, densest
    at its peak.
    """
    return (
        sharp.imag[:, None] + np.abs(sharp.real)[:, None] * np.tan(np.linspace(-1.4, 1.4, n))
    ).ravel()


def controller_mode_lines(K: control.StateSpace, band: tuple[float, float]) -> np.ndarray:
    """Return frequencies [rad/s] of a band around every lightly damped pole and zero of a controller,
    out to where it fades.

    An FRF is unknown between its lines, but the controller is known there: no resonance of it may
    fall between, and no antiresonance, where |S| rises to one.
    """
    roots = np.concatenate([poles(K), zeros(K) if K.ninputs == K.noutputs else np.zeros(0)])
    return mode_lines(to_s_plane(roots, timebase(K)), band)


def lines_with_modes(
    omega: np.ndarray, G: np.ndarray, K: control.StateSpace
) -> tuple[np.ndarray, np.ndarray]:
    """Return lines and FRF (n_y, n_u, W), with lines at the modes of a controller, where every
    channel of the FRF is interpolated.
    """
    at = np.union1d(omega, controller_mode_lines(K, (float(omega[0]), float(omega[-1]))))
    if at.size == omega.size:
        return omega, G
    return at, np.array([[interpolate_frf(at, omega, one) for one in row] for row in G])


def mode_lines(s: np.ndarray, band: tuple[float, float]) -> np.ndarray:
    """Return frequencies [rad/s] of a band around every lightly damped root in s."""
    s = s[np.isfinite(s) & (np.abs(s.real) < 0.5 * np.abs(s)) & (s.imag > 0)]
    found = [np.zeros(0)]
    for mode in s:
        half = max(abs(mode.real), _NARROWEST * abs(mode))
        n = int(np.ceil(_A_DECADE * np.log10(mode.imag / (_FROM_PEAK * half)))) + 1
        away = np.geomspace(_FROM_PEAK * half, 0.9 * mode.imag, max(n, 2))
        found += [mode.imag - away, mode.imag + away]
    omega = np.unique(np.concatenate(found))
    return np.asarray(omega[(omega > band[0]) & (omega < band[1])])


def interpolate_frf(omega: np.ndarray, known: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (W,) an FRF interpolated in log magnitude and phase, constant outside."""
    log = np.log(np.maximum(np.abs(G), 1e-300)) + 1j * np.unwrap(np.angle(G))
    return np.exp(np.interp(omega, known, log))


def plant_features(G: control.StateSpace, dt: float, otherwise: tuple[float, ...]) -> np.ndarray:
    """Return frequencies [rad/s] of the poles and zeros of a plant below Nyquist; `otherwise` if it
    has none.
    """
    if otherwise:
        lines = np.array(otherwise)
    else:
        lines = np.array([0.1 / dt if dt else 1.0])
    if G.nstates:
        s = to_s_plane(np.concatenate([poles(G), zeros(G)]), dt)
        size = np.abs(s[np.isfinite(s) & (np.abs(s) > 0)])
        below = size < (np.pi / dt if dt else np.inf) * 0.999
        if np.any(below):
            lines = size[below]
    return np.unique(lines)


class Peak(NamedTuple):
    """An extreme value over frequency, and its frequency [rad/s]."""

    value: float
    omega: float

    def __str__(self) -> str:
        return f"{self.value:.4g} at {format_hertz(self.omega)}"


#: Numbers of a peak that does not exist.
NO_PEAK = Peak(np.nan, np.nan)


def peak_of(omega: np.ndarray, values: np.ndarray) -> Peak:
    """Return the largest of values (W,) and its frequency."""
    k = int(np.argmax(values))
    return Peak(float(values[k]), float(omega[k]))


def find_peak(
    curve: Callable[[np.ndarray], np.ndarray],
    omega: np.ndarray,
    *,
    band: tuple[float, float],
    top: float,
) -> Peak:
    """Return the largest value of a curve and its frequency: on the grid, far outside it up to
    `top`, and refined.

    If the curve is flat, the frequency is the one nearest to the band.
    """
    points = extend_grid(omega, top)
    return refine_peaks(lambda at: curve(at)[None], points, values=curve(points)[None], band=band)[
        0
    ]


def extend_grid(omega: np.ndarray, top: float) -> np.ndarray:
    """Return a grid with one point far below it and one far above, at most `top`."""
    return np.unique(
        np.concatenate([omega, [omega[0] * 1e-5, min(omega[-1] * 1e5, top * (1 - 1e-12))]])
    )


def refine_peaks(
    curves: Callable[[np.ndarray], np.ndarray],
    points: np.ndarray,
    *,
    values: np.ndarray,
    band: tuple[float, float],
) -> list[Peak]:
    """Return the largest values of several curves and their frequencies, from values (k, W) on
    points (W,).

    The brackets of all maxima that may be the largest are refined together. Each time the best is
    taken of points that divide a bracket, and of the vertex of a parabola, which a smooth maximum
    resembles from near.
    """
    values = np.where(np.isnan(values), np.inf, values)
    best, where = values.max(axis=1), points[values.argmax(axis=1)]
    owner, inner = _local_maxima(values, best)
    each = np.arange(inner.size)
    x = np.log(
        points[inner + np.array([-1, 0, 1])[:, None]]
    )  # (3, m): a bracket, its best point in the middle
    y = values[owner, inner + np.array([-1, 0, 1])[:, None]]
    for _ in range(_N_ZOOMS if inner.size else 0):
        near = _subdivide_brackets(x, y)
        zoom = curves(np.exp(near.ravel())).reshape(len(values), *near.shape)[owner, :, each].T
        x = np.concatenate([x, near])
        y = np.concatenate([y, np.where(np.isnan(zoom), np.inf, zoom)])
        order = np.argsort(x, axis=0)
        x, y = (np.take_along_axis(one, order, axis=0) for one in (x, y))
        bracket = np.clip(y.argmax(axis=0), 1, len(y) - 2) + np.array([-1, 0, 1])[:, None]
        x, y = x[bracket, each], y[bracket, each]
    for k in each[np.argsort(y.max(axis=0))]:
        if y[:, k].max() > best[owner[k]]:
            best[owner[k]], where[owner[k]] = y[:, k].max(), np.exp(x[y[:, k].argmax(), k])
    return [
        _peak_nearest_band(best[k], where[k], points=points, values=row, band=band)
        for k, row in enumerate(values)
    ]


def _local_maxima(values: np.ndarray, best: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (m,) the curve and (m,) the point of each local maximum that is refined."""
    there = (values[:, 1:-1] >= values[:, :-2]) & (values[:, 1:-1] >= values[:, 2:])
    owner, inner = [], []
    for k, row in enumerate(values):
        own = np.flatnonzero(there[k]) + 1
        own = own[np.argsort(-row[own])][:_MOST_MAXIMA]
        own = np.concatenate([own[:5], own[5:][row[own[5:]] > _NEARLY * best[k]]])
        owner.append(np.full(own.size, k))
        inner.append(own)
    return np.concatenate(owner), np.concatenate(inner)


def _subdivide_brackets(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return (7, m) points inside brackets x (3, m): each half in four, and the vertex of the
    parabola through y.
    """
    left, right = x[1] - x[0], x[2] - x[1]
    with np.errstate(all="ignore"):
        fall, rise = (y[0] - y[1]) * right, (y[2] - y[1]) * left
        vertex = x[1] + (fall * right - rise * left) / (2 * (fall + rise))
    quarters = np.array([0.25, 0.5, 0.75])[:, None]
    inside = (vertex > x[0]) & (vertex < x[2])
    return np.concatenate(
        [x[0] + quarters * left, np.where(inside, vertex, x[1])[None], x[1] + quarters * right]
    )


def _peak_nearest_band(
    best: float, where: float, *, points: np.ndarray, values: np.ndarray, band: tuple[float, float]
) -> Peak:
    """Return a largest value and its frequency; on a flat top the frequency nearest to the band."""
    flat = points[values >= best * (1 - 1e-4)]
    if flat.size:
        away = np.abs(np.log(np.clip(flat, *band) / flat))
        if away.min() < abs(np.log(np.clip(where, *band) / where)):
            where = float(flat[away.argmin()])
    return Peak(float(best), float(where))
