"""Random rational functions with a delay, measured with scatter, and what a fit that starts from
the truth costs.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from scipy.optimize import least_squares

TOP = 2000.0  # highest line [Hz]


@dataclass(frozen=True)
class RandomRational:
    """Roots [rad/s], gain and delay [s] that the lines (omega, G, std) were made of."""

    zeros: np.ndarray
    poles: np.ndarray
    gain: float
    delay: float
    omega: np.ndarray
    std: np.ndarray
    G: np.ndarray

    @property
    def frd(self) -> control.FrequencyResponseData:
        """The lines."""
        return control.FrequencyResponseData(self.G, self.omega)

    def cost_from_truth(self, free_delay: bool) -> float:
        """What is left after SciPy's Levenberg-Marquardt, started from the truth: over factors of
        first and second order, the gain and the delay.
        """
        unit = np.exp(np.mean(np.log(self.omega)))
        s, n = 1j * self.omega / unit, self.zeros.size
        zeros, poles = (factors_of(roots / unit) for roots in (self.zeros, self.poles))

        def residual(theta):
            factors = [np.polyval([1.0, *one], s) for one in split_like(theta[2:], zeros + poles)]
            G = theta[0] * np.prod(factors[: len(zeros)], axis=0, initial=1.0)
            G = G / np.prod(factors[len(zeros) :], axis=0, initial=1.0)
            delay = theta[1] / self.omega[-1] if free_delay else self.delay
            e = (self.G - G * np.exp(-1j * self.omega * delay)) / self.std
            return np.concatenate([e.real, e.imag])

        gain = self.gain * unit ** (n - self.poles.size)
        start = np.concatenate([[gain, self.delay * self.omega[-1]], *zeros, *poles])
        found = least_squares(residual, start, method="lm", x_scale="jac", xtol=1e-12)
        return 2 * found.cost


def factors_of(roots):
    """Coefficients after the leading one of a factor for each pair and each real root."""
    return [np.poly([r, r.conjugate()])[1:].real for r in roots if r.imag > 0] + [
        np.array([-r.real]) for r in roots if r.imag == 0
    ]


def split_like(theta, factors):
    return np.split(theta, np.cumsum([one.size for one in factors])[:-1])


def random_root_pair(rng, w):
    zeta = np.exp(rng.uniform(np.log(0.003), np.log(0.5)))
    root = w * (-zeta + 1j * np.sqrt(1 - zeta**2))
    return [root, root.conjugate()]


def random_rational(seed):
    """1 to 6 poles, light modes, up to two integrators, zeros near modes, 0 to 3 samples of delay,
    0.3 to 3 % scatter; 50 to 250 lines, log or linear, over 1.3 to 2.6 decades."""
    rng = np.random.default_rng(seed)
    low, n_lines = TOP / 10 ** rng.uniform(1.3, 2.6), int(rng.integers(50, 250))
    f = (np.geomspace if rng.random() < 0.5 else np.linspace)(low, TOP, n_lines)
    omega, n = 2 * np.pi * f, int(rng.integers(1, 7))

    def somewhere():
        return 2 * np.pi * np.exp(rng.uniform(np.log(1.2 * low), np.log(0.8 * TOP)))

    poles = [0.0] * min(int(rng.choice([0, 1, 2], p=[0.6, 0.25, 0.15])), n - 1)
    while len(poles) < n:
        w = somewhere()
        poles += random_root_pair(rng, w) if n - len(poles) >= 2 and rng.random() < 0.75 else [-w]
    modes, zeros, m = [abs(p) for p in poles if np.imag(p) > 0], [], int(rng.integers(0, n))
    while len(zeros) < m:
        w = somewhere()
        if m - len(zeros) >= 2 and rng.random() < 0.75:
            if modes and rng.random() < 0.5:
                w = rng.choice(modes) * (1 + rng.choice([0.03, 0.1, 0.3]) * rng.uniform(-1, 1))
            zeros += random_root_pair(rng, w)
        else:
            zeros.append(-w if rng.random() < 0.7 else w)
    zeros, poles = np.array(zeros, dtype=complex), np.array(poles, dtype=complex)
    delay = rng.uniform(0, 3) / (2 * TOP * rng.uniform(1.05, 2)) * (rng.random() < 0.8)
    s = 1j * omega[:, None]
    G = np.prod(s - zeros, axis=1) / np.prod(s - poles, axis=1) * np.exp(-1j * omega * delay)
    gain = 1 / np.exp(np.mean(np.log(np.abs(G))))
    G = G * gain
    level = np.exp(rng.uniform(np.log(0.003), np.log(0.03)))
    std = level * np.abs(G) if rng.random() < 0.6 else np.full(n_lines, level)
    G = G + std / np.sqrt(2) * (rng.standard_normal(n_lines) + 1j * rng.standard_normal(n_lines))
    return RandomRational(
        zeros=zeros, poles=poles, gain=gain, delay=delay, omega=omega, std=std, G=G
    )
