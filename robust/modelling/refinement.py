"""A rational function through complex data, refined by Levenberg and Marquardt's method."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robust.modelling.rational import Roots, stacked
from robust.systems.realisation import in_order, paired

__all__ = ["refine", "roots_from"]


def refine(
    s: np.ndarray,
    data: np.ndarray,
    weight: np.ndarray,
    start: Roots,
    factor: Callable[[float], np.ndarray],
    *,
    omega: np.ndarray | None = None,
    stable: bool = True,
) -> Roots:
    """Levenberg-Marquardt on the weighted error, over coefficients of second-order sections in scaled frequency.

    factor(delay) is what multiplies the rational function; the delay itself is refined where omega is given.
    """
    zeros, poles, gain, delay, _ = start
    free_delay = omega is not None
    unit = float(np.exp(np.mean(np.log(np.abs(s)))))
    x = s / unit
    theta = np.concatenate(
        [[1.0], coefficients(zeros / unit), coefficients(poles / unit, log=stable), [0.0] * free_delay]
    )
    n_zero, n_pole = zeros.size, poles.size
    base = gain * unit ** float(n_zero - n_pole)
    slope = -1j * omega / omega.max() if omega is not None else x
    delay_unit = 1 / omega.max() if omega is not None else 0.0

    def model(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        tau = delay + (theta[-1] * delay_unit if free_delay else 0.0)
        out = base * theta[0] * factor(tau)
        top, d_top = sections(x, theta[1 : 1 + n_zero], n_zero)
        bottom, d_bottom = sections(x, theta[1 + n_zero : 1 + n_zero + n_pole], n_pole, log=stable)
        for k in range(max(len(top), len(bottom))):
            out = out * (top[k] if k < len(top) else 1.0) / (bottom[k] if k < len(bottom) else 1.0)
        relative = [np.full(x.size, 1 / theta[0] if theta[0] else 1.0, dtype=complex), *d_top, *(-d for d in d_bottom)]
        if free_delay:
            relative.append(slope)
        return out, np.column_stack(relative) * out[:, None]

    def error(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        with np.errstate(all="ignore"):
            out, jacobian = model(theta)
            e = stacked((data - out) * weight)
            cost = float(e @ e)
        return e, stacked(jacobian * weight[:, None]), cost if np.isfinite(cost) else np.inf

    e, J, cost = error(theta)
    damping = 1e-3
    for _ in range(80):
        scale = np.linalg.norm(J, axis=0)
        scale[~(scale > 0)] = 1.0
        left, sv, right = np.linalg.svd(J / scale, full_matrices=False)
        if sv[0] == 0:  # a gain of zero, which no step of roots changes
            break
        before = cost
        for _ in range(12):
            step = right.T @ (sv / (sv**2 + damping * sv[0] ** 2) * (left.T @ e)) / scale
            trial = theta + step
            if free_delay and delay + trial[-1] * delay_unit < 0:
                trial[-1] = -delay / delay_unit
            e_new, J_new, cost_new = error(trial)
            if cost_new < cost and np.isfinite(J_new).all():
                theta, e, J, cost, damping = trial, e_new, J_new, cost_new, max(damping / 10, 1e-15)
                break
            damping *= 6
        if not cost < before * (1 - 1e-8):
            break
    zeros = in_order(roots_from(theta[1 : 1 + n_zero], n_zero) * unit)
    poles = in_order(roots_from(theta[1 + n_zero : 1 + n_zero + n_pole], n_pole, log=stable) * unit)
    tau = delay + (theta[-1] * delay_unit if free_delay else 0.0)
    return zeros, poles, base * theta[0] * unit ** float(n_pole - n_zero), tau, cost


def coefficients(roots: np.ndarray, *, log: bool = False) -> np.ndarray:
    """Section coefficients (c1, c0) of s^2 + c1 s + c0 for each pair, then c0 of a single s + c0.

    With log, the logarithms of natural frequency and damping instead: stable whatever their values.
    """
    pairs, rest = paired(roots)
    out: list[float] = []
    for a, b in pairs:
        c1, c0 = -(a + b).real, (a * b).real
        if log:
            w = np.sqrt(max(c0, 1e-24))
            out += [np.log(w), np.log(max(c1 / (2 * w), 1e-9))]
        else:
            out += [c1, c0]
    return np.array(out + [np.log(max(-r.real, 1e-12)) if log else -r.real for r in rest])


def sections(
    x: np.ndarray, theta: np.ndarray, n: int, *, log: bool = False
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Value of each section at x, and the relative derivative by each parameter."""
    out, slopes = [], []
    for k in range(0, n - n % 2, 2):
        c1, c0 = (2 * np.exp(theta[k] + theta[k + 1]), np.exp(2 * theta[k])) if log else (theta[k], theta[k + 1])
        out.append(x * x + c1 * x + c0)
        if log:
            slopes += [(c1 * x + 2 * c0) / out[-1], c1 * x / out[-1]]
        else:
            slopes += [x / out[-1], 1 / out[-1]]
    if n % 2:
        c0 = np.exp(theta[-1]) if log else theta[-1]
        out.append(x + c0)
        slopes.append((c0 if log else 1.0) / out[-1])
    return out, slopes


def roots_from(theta: np.ndarray, n: int, *, log: bool = False) -> np.ndarray:
    """The roots of all sections."""
    found: list[complex] = []
    for k in range(0, n - n % 2, 2):
        c1, c0 = (2 * np.exp(theta[k] + theta[k + 1]), np.exp(2 * theta[k])) if log else (theta[k], theta[k + 1])
        inner = complex(c1 * c1 / 4 - c0)
        if inner.real < 0:
            half = np.sqrt(inner)
            found += [-c1 / 2 + half, -c1 / 2 - half]
        else:
            # the larger root first, the other from their product: no cancellation
            far = -c1 / 2 - np.copysign(np.sqrt(inner.real), c1)
            found += [complex(far), complex(c0 / far if far else 0.0)]
    if n % 2:
        found.append(complex(-np.exp(theta[-1]) if log else -theta[-1]))
    roots = np.array(found, dtype=complex)
    # an exponential underflows to zero, and what is stable has to be strictly so
    return np.minimum(roots.real, -1e-12) + 1j * roots.imag if log else roots
