"""A plant below the first line of its FRF: its number of integrators, its sign, and its response
there.

Gain and phase of a plant with real coefficients belong together (Bode): log G is a sum over lags,
modes and right-half-plane zeros, from the first line up,

    log k + j alpha - nu log s - s tau - sum c log(1 + s/p) - sum m log(1 + 2 zeta s/q + s^2/q^2)
                                       + sum a log((1 - s/z)/(1 + s/z))

which is linear in its coefficients. Least squares with a prior for each gives nu, the slope below
the first line, and alpha, the phase that the gain does not explain, with their covariance. The sign
of the plant is positive for alpha zero, and negative for alpha of pi. It has at most nu
integrators, because a corner below the first line reduces the slope. Every pair (nu, alpha) within
the bound is possible. A loop counts as stable if it is stable with each possible pair.

References
----------
Bode, *Network Analysis and Feedback Amplifier Design*, 1945, ch. XIV; SP 2.2.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value

#: Highest frequency relative to the first line that is used, and logarithmic width of a bin.
_READ_UP_TO, _BIN = 30.0, 0.15
#: Spacing of lags and zeros [log], damping of the modes, and standard deviations of the prior:
#: slope (around one), lags, modes, right-half-plane zeros, delay over the first line [rad], and
#: free parameters. On 2000 machines of benchmarks.attack_met alpha is then 0.1 rad off (median) and
#: 0.9 (99 %), at most 3.3 of its standard deviations.
_SPACING, _DAMPING = 0.5, (0.3, 0.1)
_SLOPE, _LAGS, _MODES, _ZEROS, _DELAY, _FREE = 2.0, 0.5, 0.3, 0.1, 1.0, 1e3
#: Error of the model of log G without noise.
_LEFT_OVER = 0.05
#: Contribution of each unstable pole, whose phase rises as that of a zero falls.
_UNSTABLE = 0.4
#: Rounds of weighting by Student's t with one degree of freedom: a mode too sharp for the model is
#: an outlier. After 15 rounds both signs are within the bound for 4 of 500 of those machines, after
#: 5 rounds for 17.
_ROUNDS, _FREEDOM = 15, 1.0
#: Largest squared distance from the likeliest reading within the bound: odds of 500 to 1. The true
#: integrators and sign of those 2000 machines are always within it; both signs are for 24.
_FARTHEST = 2 * np.log(500.0)
_DECADES_BELOW, _POINTS_BELOW = 5.0, 160


@value
class Reading:
    """One continuation of an FRF below its first line."""

    # n_integrators, sign: number of integrators, and sign of the gain at zero frequency without the
    # integrators
    n_integrators: int
    sign: int
    omega: np.ndarray  # (P,) frequencies below the first line [rad/s]
    G: np.ndarray  # (P,) complex response there

    def __str__(self) -> str:
        count = f"{self.n_integrators or 'no'} integrator{'s' * (self.n_integrators != 1)}"
        return f"with {count} whose output {'rises' if self.sign > 0 else 'falls'} with its input"


def read_below(
    omega: np.ndarray,
    G: np.ndarray,
    radius: np.ndarray | float = 0.0,
    *,
    n_unstable: int = 0,
    n_integrators: int | None = None,
) -> tuple[Reading, ...]:
    """Return the readings of an FRF (W,) within its bound, the likeliest first.

    radius : of the discs around G, at 95 %. n_unstable : number of unstable poles of the plant,
    whose phase rises. n_integrators : number of integrators, if it is known.
    """
    at, g, scatter = _average_lines(omega, G, radius)
    theta, C = _fit_phase_and_gain(
        at / omega[0], g, scatter, zeros=float(np.hypot(_ZEROS, _UNSTABLE * n_unstable))
    )
    first = _model_columns(np.ones(1), at[-1] / omega[0])[0].imag
    low = omega[0] * np.geomspace(10**-_DECADES_BELOW, 1, _POINTS_BELOW + 1)[:-1]
    slope_variance = float(C[0, 0] - C[0, 1] ** 2 / C[1, 1])
    found = []
    for sign in (1, -1):
        away = np.angle(sign * np.exp(-1j * theta[1]))  # of alpha
        given_sign = theta + C[:, 1] / C[1, 1] * away
        slope, lag = float(given_sign[0]), float(first @ given_sign - given_sign[1])
        lag += float(
            np.angle(sign * G[0] * np.exp(-1j * lag))
        )  # the lag of the first line, with turns as in the model
        most = max(0, int(slope + np.sqrt(slope_variance * _FARTHEST)))
        for n in range(most + 1) if n_integrators is None else [n_integrators]:
            distance = away**2 / C[1, 1] + max(0.0, n - slope) ** 2 / slope_variance
            turned = -n * np.pi / 2 + (lag + n * np.pi / 2) * low / omega[0]
            below = sign * np.abs(G[0]) * (omega[0] / low) ** n * np.exp(1j * turned)
            reading = Reading(n_integrators=n, sign=sign, omega=low, G=below)
            found.append((distance, (away**2, abs(n - slope)), reading))
    nearest = min(distance for distance, _, _ in found)
    within = [one for one in found if one[0] <= nearest + _FARTHEST]
    return tuple(reading for _, _, reading in sorted(within, key=lambda one: one[1]))


def radius_below(omega: np.ndarray, w: np.ndarray) -> float:
    """Return the relative radius below the first line: the least of the first lines, because one
    may scatter low.
    """
    return float(w[omega <= omega[0] * np.exp(_BIN)].min())


def _average_lines(
    omega: np.ndarray, G: np.ndarray, radius: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frequency, mean response and relative standard deviation of the lines of every bin,
    the lowest first.
    """
    near = omega <= _READ_UP_TO * omega[0]
    omega, G = omega[near], np.where(G[near] == 0, 1e-300, G[near])
    scatter = np.broadcast_to(radius, near.shape)[near] / np.abs(G) / np.sqrt(-np.log(0.05))
    weight = 1 / (scatter**2 + _LEFT_OVER**2)
    bins = np.unique(np.floor(np.log(omega / omega[0]) / _BIN), return_inverse=True)[1]

    def total(x: np.ndarray) -> np.ndarray:
        return np.bincount(bins, x)

    size = np.exp(total(weight * np.log(np.abs(G))) / total(weight))[bins]
    mean = (total(weight * (G / size).real) + 1j * total(weight * (G / size).imag)) / total(weight)
    at = np.exp(total(weight * np.log(omega)) / total(weight))
    first = np.unique(bins, return_index=True)[1]
    spread = (
        np.sqrt(total((weight * scatter) ** 2)) / total(weight) / np.maximum(np.abs(mean), 1e-3)
    )
    return at, mean * size[first], spread


def _model_columns(x: np.ndarray, top: float) -> np.ndarray:
    """Return (W, m) columns of log G at frequencies x over the first line: nu, alpha, log k, tau,
    c, a and m.
    """
    s = 1j * x[:, None]
    corners, modes = _places(top)
    one = np.ones_like(s)
    return np.hstack(
        [
            -np.log(s),
            1j * one,
            one,
            -s,
            -np.log(1 + s / corners),
            np.log((1 - s / corners) / (1 + s / corners)),
            *(-np.log(1 + 2 * zeta * s / modes + (s / modes) ** 2) for zeta in _DAMPING),
        ]
    )


def _places(top: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequencies of lags, zeros and modes relative to the first line."""
    return np.exp(np.arange(0, np.log(3 * top), _SPACING)), np.exp(
        np.arange(0, np.log(1.5 * top), 2 * _BIN)
    )


def _fit_phase_and_gain(
    x: np.ndarray, g: np.ndarray, scatter: np.ndarray, *, zeros: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients (m,) of the model of log g and their covariance; the phase is unwrapped
    along the gain.
    """
    columns, (corners, modes) = _model_columns(x, x[-1]), _places(x[-1])
    each = ((_LAGS, corners.size), (zeros, corners.size), (_MODES, len(_DAMPING) * modes.size))
    deviations = np.concatenate(
        [[_SLOPE, _FREE, _FREE, _DELAY], *(np.full(count, size) for size, count in each)]
    )
    mean = np.zeros(deviations.size)
    mean[0] = 1.0
    weight = 1 / np.sqrt(scatter**2 / 2 + _LEFT_OVER**2)
    log_gain = np.log(np.abs(g))

    def solve(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        trust = np.ones(len(y))
        for _ in range(
            _ROUNDS
        ):  # by Student's t: a mode too sharp for the model is an outlier, with a small effect
            of_data = A.T @ (trust[:, None] * A)
            C = np.linalg.inv(of_data + np.diag(deviations**-2.0))
            theta = C @ (A.T @ (trust * y) + mean / deviations**2)
            left = (A @ theta - y) ** 2
            scale = max(1.0, float(np.sum(trust * left) / (len(y) - np.trace(C @ of_data))))
            trust = (_FREEDOM + 1) / (_FREEDOM + left / scale)
        return theta, C * scale

    by_gain, _ = solve(columns.real * weight[:, None], log_gain * weight)
    expected = columns.imag @ by_gain
    phase = expected + np.unwrap(np.angle(g * np.exp(-1j * expected)))
    both = np.vstack([columns.real, columns.imag]) * np.tile(weight, 2)[:, None]
    return solve(both, np.concatenate([log_gain, phase]) * np.tile(weight, 2))
