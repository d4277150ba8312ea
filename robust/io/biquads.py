"""A discrete controller as second-order sections, the form in which it is implemented."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import data_warning
from robust._base.types import LinearSystem
from robust.lti.lti import axis_offset, axis_points, poles, response, timebase, zeros
from robust.lti.realisation import multivariable, order_roots, pair_roots, split_diagonal

_SLOW_ANGLE = 1e-2  # angle per sample [rad] below which coefficients lose digits near z = 1
_RESPONSE_TOLERANCE, _SLOW_RESPONSE_TOLERANCE = 1e-6, 1e-3


def controller_sections(K: LinearSystem) -> np.ndarray | tuple[np.ndarray, ...]:
    """Return a discrete controller as second-order sections (biquads) in series.

    Use this to run a controller in code of your own; `export_c` writes the code.

    Parameters
    ----------
    K : control.StateSpace or TransferFunction
        Discrete controller. For several channels it must be diagonal, one controller for each loop.

    Returns
    -------
    (n, 6) ndarray, or for several channels a tuple of them, one for each loop
        One row b0 b1 b2 1 a1 a2 for each section: y[k] = b0 u[k] + b1 u[k-1] + b2 u[k-2] - a1
        y[k-1] - a2 y[k-2]. The output of each section is the input of the next one.

    Raises
    ------
    ValueError
        A continuous controller, a controller with coupled channels, or a controller whose sections
        do not reproduce its response to 1e-6 (to 1e-3 below 0.01 rad per sample, where rounded
        coefficients are less accurate).

    Examples
    --------
    >>> controller_sections(control.tf([1, -0.5], [1, -0.9], 0.01)).tolist()
    [[1.0, -0.5, 0.0, 1.0, -0.9, 0.0]]
    """
    K = multivariable("K", K)
    if (K.ninputs, K.noutputs) != (1, 1):
        return tuple(map(loop_sections, split_diagonal("K", K)))
    return loop_sections(K)


def loop_sections(K: control.StateSpace) -> np.ndarray:
    """Return (n, 6) the sections of a discrete controller for one loop."""
    dt = timebase(K)
    if not dt:
        raise ValueError(
            "K must be discrete to have sections, got a continuous controller: sample it first"
        )
    z, p, gain = roots_and_gain(K)
    sections = _chain_sections(z, p, gain)
    angles = comparison_angles(np.concatenate([z, p]))
    wanted = response(K, angles / dt)
    error = np.abs(_chain_response(sections, angles) - wanted) / np.maximum(np.abs(wanted), 1e-300)
    wrong = error / np.where(angles < _SLOW_ANGLE, _SLOW_RESPONSE_TOLERANCE, _RESPONSE_TOLERANCE)
    if not wrong.max() < 1:
        k = int(wrong.argmax())
        raise ValueError(
            f"K must be accurate as second-order sections, got an error of {error[k]:.2g} at"
            f" {angles[k] / dt:.3g} rad/s"
        )
    return sections


def sections_by_name(K: control.StateSpace) -> dict[str, np.ndarray]:
    """Return the sections of a discrete controller by name; with a warning, none if they are
    inaccurate.

    The matrices define the controller: a file without sections is complete.
    """
    if not K.dt or K.ninputs != 1 or K.noutputs != 1:
        return {}
    try:
        return {"sections": loop_sections(K)}
    except ValueError as error:
        data_warning(f"the file contains A, B, C and D only, without sections: {error}")
        return {}


def comparison_angles(offsets: np.ndarray) -> np.ndarray:
    """Return angles (W,) per sample [rad] for the comparison of two systems: down to the slowest
    root.

    offsets : roots minus one.
    """
    away = np.abs(offsets)
    slowest = np.min(away[away > 1e-12], initial=_SLOW_ANGLE)
    return np.concatenate(
        [
            np.geomspace(0.1 * slowest, _SLOW_ANGLE, 60, endpoint=False),
            np.geomspace(_SLOW_ANGLE, 0.99 * np.pi, 60),
        ]
    )


def _chain_response(sections: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return (W,) response of sections at angles per sample, from z^-1 - 1, so that no digits are
    lost near z = 1.
    """
    w = np.expm1(-1j * angles)
    top, bottom = (
        c[:, :1] + c[:, 1:2] + c[:, 2:] + (c[:, 1:2] + 2 * c[:, 2:]) * w + c[:, 2:] * w**2
        for c in (sections[:, :3], sections[:, 3:])
    )
    return np.asarray(np.prod(top / bottom, axis=0))


def _pair_slow_with_fast(offsets: np.ndarray) -> tuple[list[tuple[complex, ...]], list[complex]]:
    """Pair roots minus one, the slowest real one with the fastest: two at z = 1 would cancel twice
    in one section.
    """
    pairs, rest = pair_roots(offsets)
    alone = sorted([r for pair in pairs if pair[0].imag == 0 for r in pair] + rest, key=abs)
    pairs = [pair for pair in pairs if pair[0].imag != 0]
    half = len(alone) // 2
    pairs += list(zip(alone[:half], alone[::-1][:half], strict=True))
    return pairs, alone[half : len(alone) - half]


def _polynomial_coefficients(offsets: tuple[complex, ...]) -> np.ndarray:
    """Return coefficients from the highest power down; their sum, the value at z = 1, is as exact
    as doubles allow.
    """
    roots = np.array(offsets) + 1
    if len(roots) < 2:
        return np.poly(roots).real
    last = 1 + np.prod(roots).real  # a number whose last digit both coefficients share
    at_one = np.prod(offsets).real
    return np.array([1.0, at_one - last, last - 1])


def _chain_sections(z: np.ndarray, p: np.ndarray, gain: float) -> np.ndarray:
    """Return (n, 6) sections in z^-1 for the roots minus one."""
    rows = []
    for mine, group in group_roots(z, p):
        top = np.concatenate(
            [np.zeros(len(group) - len(mine)), _polynomial_coefficients(mine) if mine else [1.0]]
        )
        rows.append(
            [
                *top,
                *np.zeros(3 - top.size),
                *_polynomial_coefficients(group),
                *np.zeros(2 - len(group)),
            ]
        )
    sections = np.array(rows or [[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
    sections[0, :3] *= gain
    return sections


def group_roots(
    z: np.ndarray, p: np.ndarray
) -> list[tuple[tuple[complex, ...], tuple[complex, ...]]]:
    """Return zeros and poles of each section, all minus one: poles nearest the circle last, zeros
    nearest to them.
    """
    pole_pairs, pole_rest = _pair_slow_with_fast(p)
    zero_pairs, zero_rest = _pair_slow_with_fast(z)
    groups: list[tuple[complex, ...]] = [*pole_pairs, *((r,) for r in pole_rest)]
    free: list[tuple[complex, ...]] = [*zero_pairs, *((r,) for r in zero_rest)]
    sections = []
    for group in sorted(groups, key=lambda g: abs(abs(g[0] + 1) - 1)):
        mine: tuple[complex, ...] = ()
        fitting = [zs for zs in free if len(zs) <= len(group)]
        # pairs of zeros must all find a pair of poles
        if len(group) == 2 and any(len(zs) == 2 for zs in free):
            fitting = [zs for zs in fitting if len(zs) == 2]
        if fitting:
            mine = min(fitting, key=lambda zs: abs(zs[0] - group[0]))
            free.remove(mine)
        sections.append((mine, group))
    return sections[::-1]


def roots_and_gain(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray, float]:
    """Return zeros, poles and gain; the gain is fitted where the response is neither very large nor
    very small.

    The roots of a sampled system are returned minus one: slow ones are then small numbers with all
    their digits.
    """
    dt = timebase(system)
    if dt:
        shifted = control.StateSpace(
            system.A - np.eye(system.nstates), system.B, system.C, system.D, dt
        )
    else:
        shifted = system
    z, p = (order_roots(roots(shifted)) for roots in (zeros, poles))
    size = np.concatenate(
        [np.abs(np.log1p(r[r != -1].astype(complex)) / dt if dt else r) for r in (z, p)]
    )
    if np.any(size > 0):
        centre = float(np.exp(np.median(np.log(size[size > 0]))))
    else:
        centre = 1.0
    omega = centre * np.geomspace(0.1, 10, 21)
    if dt:
        omega = np.minimum(omega, 0.99 * np.pi / dt)
    s = axis_offset(omega, dt)
    ratio = (
        response(system, omega) * np.prod(s[:, None] - p, axis=1) / np.prod(s[:, None] - z, axis=1)
    )
    return z, p, float(np.median(ratio.real))


def transfer_polynomials(system: control.StateSpace) -> dict[str, np.ndarray]:
    """Return numerator and denominator by name, highest power first; none if doubles cannot
    represent them.

    A polynomial of order n with all roots near z = 1 loses n times the digits between the roots and
    one.
    """
    z, p, gain = roots_and_gain(system)
    dt = timebase(system)
    one = 1.0 if dt else 0.0
    num, den = gain * np.atleast_1d(np.poly(z + one)).real, np.atleast_1d(np.poly(p + one)).real
    size = np.abs(np.concatenate([z, p]))
    size = size[size > 1e-12] / (dt or 1.0)
    if size.size:
        ends = 0.1 * size.min(initial=np.inf), 10 * size.max(initial=0.0)
    else:
        ends = 0.1, 10.0
    omega = np.geomspace(ends[0], min(ends[1], 0.99 * np.pi / dt) if dt else ends[1], 120)
    s, wanted = axis_points(omega, dt), response(system, omega)
    with np.errstate(all="ignore"):
        error = np.abs(np.polyval(num, s) / np.polyval(den, s) - wanted)
    if np.all(error <= _SLOW_RESPONSE_TOLERANCE * np.abs(wanted)):
        return {"num": num, "den": den}
    return {}
