"""The inequality that every Maxwell-slip friction obeys: along exact motions of elements, and as
algebra.
"""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

NODES, GAUSS = np.polynomial.legendre.leggauss(10)


class Exact:
    """One element under pieces of constant velocity: its force over time, in straight lines."""

    def __init__(self, k, W, rho, rng):
        self.k, self.W, self.rho, self.rng = k, W, rho, rng
        self.force = 0.0

    def breaks(self, v, duration):
        """[(time, force, slope)] over a piece."""
        start = self.force
        if v == 0:
            return [(0.0, start, 0.0)]
        d = np.sign(v)
        # a slider may vary: a force it no longer holds drops at once, one it holds again has to be
        # loaded up to it
        limit = max(self.W * self.rng.uniform(1 / self.rho, 1), d * start)
        when = (limit - d * start) / (self.k * abs(v))
        if when >= duration:
            self.force = start + self.k * v * duration
            return [(0.0, start, self.k * v)]
        self.force = d * self.rng.uniform(self.W / self.rho, limit)
        return [(0.0, start, self.k * v), (when, self.force, 0.0)]


def least_supply(elements, pieces, a, rho, K0):
    """The least of int (f - fh/rho) v - fh'^2/(rho a K0) over the motion, and its largest part."""
    filtered, total, least, size = 0.0, 0.0, 0.0, 1e-300
    for v, duration in pieces:
        lines = [element.breaks(v, duration) for element in elements]
        cuts = sorted({t for line in lines for t, _, _ in line} | {duration})
        for t0, t1 in pairwise(cuts):
            f0 = slope = 0.0
            for line in lines:
                t, force, rate = [part for part in line if part[0] <= t0][-1]
                f0, slope = f0 + force + rate * (t0 - t), slope + rate
            s = (t1 - t0) * (NODES + 1) / 2
            lag = filtered - f0 + slope / a
            fh = f0 - slope / a + slope * s + lag * np.exp(-a * s)
            rate = slope - a * lag * np.exp(-a * s)
            supply = (f0 + slope * s - fh / rho) * v - rate**2 / (rho * a * K0)
            part = (t1 - t0) / 2 * GAUSS @ supply
            filtered = f0 - slope / a + slope * (t1 - t0) + lag * np.exp(-a * (t1 - t0))
            total += part
            least, size = min(least, total), max(size, abs(part))
    return least, size


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    n=st.integers(1, 4),
    rho=st.floats(1.0, 3.0),
    a=st.floats(0.5, 50.0),
    seed=st.integers(0, 2**32 - 1),
    spare=st.floats(1.0, 2.0),
)
def test_no_stack_of_elements_gives_back_more_than_it_stored(n, rho, a, seed, spare):
    rng = np.random.default_rng(seed)
    k, W = 10 ** rng.uniform(-1, 1, n), 10 ** rng.uniform(-1, 1, n)
    elements = [Exact(*pair, rho, rng) for pair in zip(k, W, strict=True)]
    pieces = [
        (rng.choice([0.0, 1.0], p=[0.1, 0.9]) * rng.normal() * 5, 0.05 * rng.exponential())
        for _ in range(60)
    ]
    least, size = least_supply(elements, pieces, a, rho, spare * k.sum())
    assert least >= -1e-9 * size * 60


def test_the_inequality_notices_a_slider_outside_the_class():
    """Sliders that hold three times what they slip at, said to hold 1.05 times: the inequality must
    break somewhere.
    """
    broken = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        element = Exact(1.0, 1.0, 3.0, rng)
        pieces = [(rng.normal() * 5, 0.2 * rng.exponential()) for _ in range(60)]
        least, size = least_supply([element], pieces, 80.0, 1.05, 1.0)
        broken += least < -1e-3 * size
    assert broken > 0


@settings(max_examples=200, deadline=None, derandomize=True)
@given(rho=st.floats(1.0, 10.0), share=st.floats(1e-3, 0.999), a=st.floats(0.1, 100.0))
def test_a_damper_across_the_spring_loses_energy(rho, share, a):
    """With f = F + tau F' what is left of the inequality is a form in (F', F - fh), never negative
    where a tau < 1.
    """
    tau = share / a
    g = a * tau / (rho * (1 - a * tau))
    form = np.array([[tau * (1 - a * tau / rho), -a * tau / rho], [-a * tau / rho, g * a]])
    rng = np.random.default_rng(0)
    for F, rate, fh in rng.normal(
        size=(20, 3)
    ):  # that this is the form: (f - fh/rho) F' - fh'^2/(rho a) - dS/dt
        f = F + tau * rate
        fh_rate = a * (f - fh)
        stored = (
            F * rate
            - (rate * fh + F * fh_rate) / rho
            + fh * fh_rate / rho
            + g * (F - fh) * (rate - fh_rate)
        )
        left = (f - fh / rho) * rate - fh_rate**2 / (rho * a) - stored
        e = np.array([rate, F - fh])
        assert np.isclose(left, e @ form @ e, rtol=1e-9, atol=1e-9 * (1 + abs(left) + abs(stored)))
    assert np.linalg.eigvalsh(form)[0] >= -1e-12 * np.linalg.norm(form)
