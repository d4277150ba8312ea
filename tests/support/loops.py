"""Loops whose truth is known, each written once: stable or not, margin of the set, largest |S|.

The truth is a closed form, or brute force over frequency with the poles of plant and controller
multiplied out, so that nothing is infinite at them. None of it uses the package under test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import control
import numpy as np

from tests.support.forms import FORMS, UNSCALED
from tests.support.random_loops import closed_loop_poles, dense_grid, hold_and_delay, tf_response
from tests.support.sampled_sets import alias_terms, largest_factor, with_tail

System = control.StateSpace | control.TransferFunction


@dataclass(frozen=True)
class Truth:
    """What is true of a loop; None where no oracle tells it."""

    stable: bool
    rs: float | None = None  # factor on the set at which it is just not stable
    S: float | None = None  # largest |S| over the set; inf if a plant of it is not stable
    rp: float | None = None  # largest |w_P S| over the set
    disk: float | None = None  # disk margin
    at: float | None = None  # frequency [rad/s] where the margin is taken
    worst: Mapping[str, float] | None = None  # the smallest parameters that break the loop, over rs
    words: str = ""  # what a reason for an unstable loop has to say
    tolerance: float = 1e-5  # to which these numbers are known


@dataclass(frozen=True)
class Loop:
    """A plant of one channel in its set, under u = K (r - y)."""

    G: System
    K: System
    w: System
    form: str = "multiplicative"
    delay: float = 0.0
    w_P: System | None = None
    perturbation: str = "LTI"
    stable: bool = True
    peak: float | None = None  # the weight is scaled to this largest rs
    reach: float | None = None  # and the demand to this largest |w_P S|
    tolerance: float = 1e-5
    known: Truth | None = None  # in closed form; else by brute force
    unclocked: Loop | None = None  # of a clock so fast that nothing differs: the loop without it

    @property
    def dt(self) -> float:
        return float(self.K.dt or 0.0)

    @property
    def kind(self) -> str:
        return "continuous" if not self.dt else "discrete" if self.G.dt else "sampled"

    @cached_property
    def weight(self) -> System:
        """The weight at its size."""
        if self.peak is None:
            return self.w
        return self.peak * _margin(replace(self, peak=None)) * self.w

    @cached_property
    def demand(self) -> System | None:
        """The performance weight at its size."""
        if self.w_P is None or self.reach is None:
            return self.w_P
        found = _largest(lambda at: self.curve("rp", at, demand=self.w_P), self.omega)[0]
        return self.reach / found * self.w_P

    def with_plant(self, plant: System) -> Loop:
        """The same loop around another plant."""
        return replace(self, G=plant)

    @property
    def rounds(self) -> bool:
        """Whether G and K joined in doubles have another pole than the loop: near z = 1."""
        return self.dt > 0 and self.stable and np.abs(self.poles).max() > 1 - 1e-12

    def grown(self, factor: float) -> Loop:
        """The loop with a set larger by a factor."""
        return replace(self, w=factor * self.weight, peak=None, known=None)

    @cached_property
    def in_loop(self) -> System:
        """The plant with hold and delay, for a sampled controller."""
        if self.kind != "sampled":
            return self.G
        return hold_and_delay(control.ss(self.G), self.dt, self.delay)

    @cached_property
    def poles(self) -> np.ndarray:
        """Those of the loop without the delay of a continuous one, with hidden modes."""
        return closed_loop_poles(control.ss(self.in_loop), control.ss(self.K))

    @cached_property
    def omega(self) -> np.ndarray:
        """Frequencies that show every peak."""
        dt, w = self.dt, control.ss(self.w).poles()
        places = [self.poles, self.in_loop.poles(), self.K.poles(), w]
        if self.kind == "sampled":
            places[3] = np.exp(w * dt)
        grid = dense_grid(dt, *places, n=800 if dt else 4000)
        if self.delay and not dt:
            grid = np.union1d(grid, np.linspace(1e-6, 400 / self.delay, 20_001))
        return grid

    def curve(self, name: str, omega: np.ndarray, *, demand: System | None = None) -> np.ndarray:
        """(W,) S, T, rs, or the largest |S_p| ("worst") or |w_P S_p| ("rp") over the set."""
        s = np.exp(1j * omega * self.dt) if self.dt else 1j * omega
        (n, d), (k, h) = _quotient(self.in_loop, s), _quotient(self.K, s)
        if self.delay and not self.dt:
            n = n * np.exp(-s * self.delay)
        total = d * h + n * k
        S = d * h / total
        if name in "ST":
            return S if name == "S" else n * k / total
        if self.kind == "sampled":
            b, q = self._folded(omega, k * d / total), 0 * S
            rs = b
        else:
            w = np.divide(*_quotient(self.weight, s))
            b, q, rs = _perturbed(self.form, (n, d, k, h), total, w)
        if name == "rs":
            return rs
        with np.errstate(divide="ignore"):
            worst = (np.abs(S - q * b.conj()) + np.abs(q - S * b)) / (1 - np.abs(b) ** 2)
        worst = np.where(rs < 1, worst, np.inf)
        if name == "worst":
            return worst
        s = 1j * omega if demand.dt == 0 else s
        return worst * np.abs(np.divide(*_quotient(demand, s)))

    def _folded(self, omega: np.ndarray, KS: np.ndarray) -> np.ndarray:
        """(W,) rs with every alias in phase, of a form without an inverse."""
        G, w = control.ss(self.G), control.ss(self.weight)
        terms = alias_terms(tf_response, G, w, self.form, self.dt, self.delay, omega)
        return np.abs(KS) * with_tail(np.abs(terms[0]) * terms[2])

    @cached_property
    def truth(self) -> Truth:
        """In closed form, or by brute force."""
        if self.known is not None:
            return self.known
        if self.unclocked is not None:
            return replace(self.unclocked.truth, tolerance=1e-3)
        unstable = _unstable(self)
        assert (unstable == 0) == self.stable
        if unstable:
            late = self.delay and not self.dt
            return Truth(stable=False, words=f"has {unstable} unstable poles" if late else "")
        numbers = {}
        if self.kind != "sampled" or "inverse" not in self.form:
            numbers["S"] = _largest(lambda at: self.curve("worst", at), self.omega)[0]
            if self.demand is not None:
                numbers["rp"] = _largest(
                    lambda at: self.curve("rp", at, demand=self.demand), self.omega
                )[0]
        disk = 1 / _largest(lambda at: np.abs(self.curve("S", at) - 0.5), self.omega)[0]
        return Truth(
            stable=True,
            rs=_margin(self),
            disk=disk,
            tolerance=self.tolerance,
            **numbers,
        )


def _quotient(system: System, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of a response."""
    if isinstance(system, control.TransferFunction):
        return np.polyval(system.num[0][0], s), np.polyval(system.den[0][0], s)
    if system.nstates > 4:
        x = np.linalg.solve(
            s[:, None, None] * np.eye(system.nstates) - system.A, system.B + 0j * s[0]
        )
        return (system.C @ x)[:, 0, 0] + system.D[0, 0], np.ones(s.size)
    d = _determinant(s, system.A)  # det(s - A + B C) = det(s - A) (1 + C (s - A)^-1 B)
    return _determinant(s, system.A - system.B @ system.C) - d * (1 - system.D[0, 0]), d


def _determinant(s: np.ndarray, A: np.ndarray) -> np.ndarray:
    """(W,) det(s - A)."""
    return np.prod(s[:, None] - np.linalg.eigvals(A), axis=1)


def _perturbed(form, quotients, total, w):
    """S_p = (S + q Delta)/(1 + b Delta): (W,) b, q, and the measure rs."""
    n, d, k, h = quotients
    if form == "coprime":  # |[K; 1] S [1, G]|, and the plants within a chord
        rs = np.hypot(np.abs(d), np.abs(n)) * np.hypot(np.abs(h), np.abs(k)) / np.abs(total)
        t = np.abs(w) / np.sqrt(np.maximum(1 - np.abs(w) ** 2, 1e-12))
        turn = np.where(d == 0, 1, d) / np.where(d == 0, 1, d.conj())
        GS = n.conj() * h * turn / total
        return t * (k * d / total - GS), -t * GS, np.abs(w) * rs
    b = (
        w
        * {
            "multiplicative": n * k,
            "additive": k * d,
            "inverse-multiplicative": d * h,
            "inverse-additive": n * h,
        }[form]
        / total
    )
    return b, b if form.startswith("inverse") else 0 * b, np.abs(b)


def _largest(f, omega: np.ndarray) -> tuple[float, float]:
    """The largest value of a function of frequency, and where."""
    values = f(omega)
    for _ in range(5):
        k = int(np.nanargmax(values))
        if not np.isfinite(values[k]):
            return float(values[k]), float(omega[k])
        omega = np.linspace(omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)], 41)
        values = f(omega)
    k = int(np.nanargmax(values))
    return float(values[k]), float(omega[k])


def _margin(loop: Loop) -> float:
    """The factor on the set at which it is just not stable."""
    if loop.kind != "sampled" or "inverse" not in loop.form:
        return 1 / _largest(lambda at: loop.curve("rs", at), loop.omega)[0]
    omega = loop.omega[loop.curve("S", loop.omega) != 0]  # away from the poles of the plant
    S, K = loop.curve("S", omega), tf_response(control.ss(loop.K), omega)
    G, w = control.ss(loop.G), control.ss(loop.weight)
    of = (loop.form, loop.dt, loop.delay, omega, S, K * S)
    return float(largest_factor(tf_response, G, w, *of))


def _unstable(loop: Loop) -> int:
    """Number of unstable poles, of a delay by the winding of 1 + L for a stable plant and K."""
    if not loop.delay or loop.dt:
        excess = np.abs(loop.poles) - 1 if loop.dt else loop.poles.real
        return int(np.sum(excess > -1e-13))
    assert max(loop.G.poles().real.max(), loop.K.poles().real.max(initial=-1)) < 0
    S = loop.curve("S", loop.omega)
    return round(-float(np.angle(S[:-1] / S[1:]).sum()) / np.pi)


@dataclass(frozen=True)
class Structure:
    """A loop with uncertainties at several places, joined by name; its margin in closed form."""

    systems: Sequence[control.StateSpace]
    blocks: Mapping[str, tuple]  # name -> reads, drives, size, kind
    truth: Truth

    @property
    def stable(self) -> bool:
        return self.truth.stable

    @property
    def rounds(self) -> bool:
        return False

    @property
    def known(self) -> Truth:
        return self.truth


def tf(num, den=(1.0,), dt=0.0):
    return control.tf(np.atleast_1d(num), np.atleast_1d(den), dt)


def _named(A, B, C, dt=0.0, *, inputs, outputs):
    A, B, C = (np.atleast_2d(np.asarray(M, float)) for M in (A, B, C))
    zero = np.zeros((len(C), B.shape[1]))
    return control.ss(A, B, C, zero, dt, inputs=inputs, outputs=outputs)


# ---- Poles of plant or controller on the axis, in every form, with and without a clock.

LEAD, LAG = tf([0.5, 1.0], [0.05, 1.0]), tf(1.0, [1.0, 1.0])
RESONANT = tf([2.0, 1.0, 2.0], [1.0, 0.0, 1.0])
ON_AXIS = {
    "undamped": (tf(1.0, [1.0, 0.0, 1.0]), LEAD),
    "undamped, faster": (tf(1.0, [1.0, 0.0, 4.0]), LEAD),
    "two masses": (tf([1.0, 0.1, 3.0], [1.0, 0.0, 4.0, 0.0, 0.0]), tf([1.0, 0.4], [0.1, 1.0])),
    "resonant controller": (LAG, RESONANT),
    "both": (tf([1.0, 1.0], [1.0, 0.0, 4.0]), RESONANT),
}
on_axis = {
    f"{name}, {form}": Loop(G, K, tf(1.0), form, peak=0.6, w_P=tf(0.05))
    for name, (G, K) in ON_AXIS.items()
    for form in FORMS
}


def bilinear(K, dt):
    return control.tf(control.c2d(K, dt, "tustin"))


def with_clock(name, form, dt=0.02):
    """Sampled so fast, what folds down adds little; the additive set rolls off, else it would have
    no bound.
    """
    G, K = ON_AXIS[name]
    w = tf(0.03, [0.1, 1.0]) if form == "additive" else tf(0.03)
    if form == "coprime":
        G, w = hold_and_delay(control.ss(G), dt, 0.0), tf(0.03, dt=dt)
    return Loop(G, bilinear(K, dt), w, form, tolerance=2e-3)


clocked = {
    f"{name}, {form}, with a clock": with_clock(name, form)
    for name in ("undamped", "resonant controller")
    for form in FORMS
}


def in_fast_clock(dt):
    """The integrator of K stands where exp(j w T) rounds to one: T = 1 and S = 0 there."""
    slow = Loop(LAG, tf([2.0, 1.0], [1.0, 0.0]), tf(0.03))
    return Loop(LAG, bilinear(slow.K, dt), tf(0.03), unclocked=slow)


def with_mode_above_nyquist():
    """What the mode folds down makes most of the margin, with every alias in phase."""
    w1 = 2 * np.pi * 16
    G = tf(2.0, [1.0, 1.0]) + tf(0.15 * w1**2, [1.0, 0.02 * w1, w1**2])
    return Loop(G, tf(0.5, dt=0.05), tf(0.2), tolerance=2e-3)


# ---- Closed loops on the stability boundary, close to it, and unstable where the response looks fine.


ON_THE_BOUNDARY = Truth(stable=False, words="on the stability boundary or beyond it")


def beside_the_boundary(dt, inside):
    """1/(s + 1) under -1, and z - 1/2 under 1/2: the pole at `inside` from the boundary."""
    G = tf(1.0, [1.0, -0.5], dt) if dt else LAG
    limit = 0.5 if dt else 1.0
    K = -np.nextafter(limit, 0) if inside == "one ulp" else -limit * (1 - inside)
    away = float(limit + K)  # exact
    if not away:
        return Loop(G, tf(K, dt=dt), tf(1e-17, dt=dt), stable=False, known=ON_THE_BOUNDARY)
    S, w, T = limit / away, 1e-17, -K / away
    known = Truth(stable=True, rs=1 / (w * T), S=S / (1 - w * T))
    return Loop(G, tf(K, dt=dt), tf(w, dt=dt), known=known)


def oscillator(damping):
    """The plant alone, its mode on the axis or next to it."""
    G = control.ss([[0.0, 1.0], [-1.0, -damping]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    known = Truth(stable=True) if damping else ON_THE_BOUNDARY
    return Loop(G, tf(0.0), tf(1e-17), stable=known.stable, known=known)


boundary = {
    **{
        f"{'a sampled' if dt else 'a'} pole {name} the boundary": beside_the_boundary(dt, inside)
        for dt in (0.0, 0.1)
        for name, inside in (("on", 0.0), ("one ulp inside", "one ulp"), ("1e-13 inside", 1e-13))
    },
    "a sampled pole one ulp inside, its stability": replace(
        beside_the_boundary(0.1, "one ulp"), known=Truth(stable=True)
    ),
    "a mode on the axis": oscillator(0.0),
    "a mode of the least damping": oscillator(5e-324),
    "a hidden unstable pole": Loop(
        tf(1.0, [1.0, -1.0]), tf([5.0, -5.0], [1.0, 3.0]), tf(0.1), stable=False
    ),
    "one cancelled inside the plant": Loop(
        tf([1.0, -1.0], [1.0, 0.0, -1.0]), tf(0.1), tf(0.1), stable=False
    ),
    "a hidden integrator": Loop(
        tf([1.0, 0.0], [1.0, 2.0, 1.0]), tf(1.0, [1.0, 0.0]), tf(0.1), stable=False
    ),
}

# ---- Peaks that a grid or floating point does not show.


def open_peak(w):
    """|w T| reaches w at zero frequency under an integrator."""
    known = Truth(stable=True, rs=1 / w, tolerance=1e-12)
    return Loop(LAG, tf([1.0, 1.0], [1.0, 0.0]), tf(w), known=known)


def slow_weight(slow):
    """|w| peaks at 20 times its height far below the loop."""
    w = tf([0.05, 0.1 * slow, 0.05 * slow**2], [1.0, 0.1 * slow, slow**2])
    return Loop(LAG, tf([2.0, 1.0], [1.0, 0.5]), w, tolerance=1e-4)


NARROW = tf([1.0, 2e-6, 1.0], [1.0, 2e-7, 1.0])  # ten at 1 rad/s over a relative width of 1e-7
peaks = {
    "a peak of 1 - 1e-10": open_peak(1 - 1e-10),
    "a peak of one": open_peak(1.0),
    "a narrow peak above one": Loop(LAG, tf(0.25), NARROW),
    "a narrow peak below one": Loop(LAG, tf(0.1), NARROW),
    **{
        f"a weight with a mode at {slow:g} rad/s": slow_weight(slow)
        for slow in (1e-6, 1e-10, 1e-14)
    },
    **{
        f"a resonance of the plant, {form}": Loop(
            tf(1.0, [1.0, 0.0, 4.0]), tf([3.0, 1.0], [0.05, 1.0]), tf(1.0), form, peak=0.9
        )
        for form in ("multiplicative", "inverse-multiplicative")
    },
}

# ---- Delays: K/(s + 1) with the delay that its closed form bears, a light mode, ripples.

LIMIT = (np.pi - np.arctan(np.sqrt(24.0))) / np.sqrt(24.0)  # of K = 5


def late_mode(gain, delay):
    """A light mode far above 1/delay, where a rational approximation has another phase."""
    wn, zeta = 34.0, 0.006
    mode = tf([gain * 2 * zeta * wn, 0.0], [1.0, 2 * zeta * wn, wn**2])
    stable = gain < 1 or (gain, delay) in LATE_BUT_STABLE
    return Loop(tf(0.15, [1.0, 1.0]) + mode, tf(1.0), tf(1e-4), delay=delay, stable=stable)


LATE_BUT_STABLE = ((1.5, 1.124), (3.0, 1.124))


def rippled(delay, rng):
    """Many maxima of almost the same height, close together: the largest counts."""
    G = tf(rng.uniform(0.3, 0.9), [rng.uniform(0.01, 1), 1.0])
    w = tf([0.3 * rng.uniform(0.1, 1), 0.2], [1.0, 1.0])
    return Loop(G, tf(0.95), w, "additive", delay=delay, tolerance=1e-3)


DEMAND = tf([0.4, 0.5], [1.0, 0.2])
delays = {
    "a delay beyond its limit": Loop(LAG, tf(5.0), tf(0.05), delay=1.02 * LIMIT, stable=False),
    "a delay of half its limit": Loop(LAG, tf(5.0), tf(0.05), delay=0.5 * LIMIT),
    **{
        f"a delay of {share:g} of its limit, {form}": Loop(
            LAG, tf(5.0), tf([1.0, 3.0], [1.0, 30.0]), form, delay=share * LIMIT, peak=0.9
        )
        for form, share in zip(UNSCALED, (0.3, 0.4, 0.5, 0.6), strict=True)
    },
    **{
        f"a light mode of {gain} behind {delay} s": late_mode(gain, delay)
        for gain in (0.5, 1.5, 3.0, 30.0)
        for delay in (0.3, 1.124, 4.0)
    },
    **{
        f"ripples of {delay:g} s, {k}": rippled(delay, rng)
        for delay in (1.0, 10.0, 100.0)
        for rng in [np.random.default_rng(0)]
        for k in range(4)
    },
    **{
        f"a demand reached to {reach}": Loop(
            LAG, tf(3.0), tf(0.1), delay=0.05, w_P=DEMAND, reach=reach
        )
        for reach in (0.99, 1.01)
    },
    "hundreds of samples late": Loop(
        LAG, tf(0.5, dt=1e-3), tf(0.1), delay=0.3, known=Truth(stable=True, rs=30.0)
    ),
    "a demand and a delay of a sample": Loop(
        tf(10.0, [1.0, 10.0]),
        tf([0.5, -0.45], [1.0, -1.0], 0.01),
        tf(0.2),
        delay=0.01,
        w_P=tf([0.5, 0.5], [1.0, 0.005]),
        tolerance=2e-3,
    ),
}

# ---- A lag with a rising weight under an integrating controller, continuous or sampled throughout.


def rising(form, dt, gain, size, **more):
    G, w = tf(2.0, [0.3, 1.0]), size * tf([0.3, 0.2], [0.1, 1.0])
    K = tf([gain, gain], [1.0, 0.0])
    if dt:
        G, w, K = control.tf(control.c2d(G, dt)), bilinear(w, dt), bilinear(K, dt)
    return Loop(G, K, w, form, **more)


PERTURBATIONS = ("LTI", "statistical", "operator")
GAINS = ((0.05, 1.0), (0.5, 0.2), (3.0, 1.0), (60.0, 0.2), (400.0, 0.2))
rising_sets = {
    **{
        f"a lag under {gain:g}{', sampled' * bool(dt)}, {form} of {size:g}": rising(
            form, dt, gain, size, stable=not (dt and gain > 50)
        )
        for form in UNSCALED
        for dt in (0.0, 1e-2)
        for gain, size in GAINS
    },
    **{
        f"a demand on a lag under {gain:g}, {kind}": rising(
            "multiplicative", 0.0, gain, 1.0, w_P=tf([0.4, 0.1], [1.0, 1e-3]), perturbation=kind
        )
        for kind in PERTURBATIONS
        for gain in (0.2, 0.6, 0.02)
    },
}

# ---- Several uncertainties at once.


def cubic(blocks, rs, dt=0.0, **known):
    """s^3 + 3 s^2 + 2 s + 4 of three states and a force on the last; in z = 1 + dt s if sampled."""
    A, B = np.array([[0.0, 1, 0], [0, 0, 1], [-4, -2, -3]]), np.array([[0.0], [0], [1]])
    A, B = (np.eye(3) + dt * A, dt * B) if dt else (A, B)
    system = _named(A, B, np.eye(3), dt, inputs=["f"], outputs=["x1", "x2", "x3"])
    return Structure([system], blocks, Truth(stable=True, rs=rs, **known))


def sampled_limit(dt=0.05):
    """The least k at which s^3 + 3 s^2 + 2 s + 4 + k has |1 + dt s| = 1, by bisection."""
    low, high = 0.0, 2.0
    for _ in range(60):
        k = (low + high) / 2
        inside = np.abs(1 + dt * np.roots([1, 3, 2, 4 + k])).max() < 1
        low, high = (k, high) if inside else (low, k)
    return low


def turned(rng, A, B, C):
    """Other coordinates, in which doubles no longer hold the loop exactly."""
    T = rng.standard_normal(A.shape)
    back = np.linalg.inv(T)
    return T @ A @ back, T @ B, C @ back


def slow_pole(seed, share=1.0):
    """s + a - r1 d1 - r2 d2 - ..., with a = r1 + r2 + ..., with faster modes: all parameters at
    one put s = 0.
    """
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 5)), int(rng.integers(1, 4))
    r = np.round(rng.uniform(0.1, 1, m), 2)
    A, B, C = np.diag([-r.sum(), *-rng.uniform(1, 50, n - 1)]), np.zeros((n, m)), np.zeros((1, n))
    B[0], C[0, 0] = 1, 1
    names = [f"d{k}" for k in range(m)]
    plant = _named(*turned(rng, A, B, C), inputs=names, outputs=["y"])
    kinds = ["real"] * (m - 1) + [["real", "full"][seed % 2]]
    blocks = {
        d: ("y", d, share * float(size), kind)
        for d, size, kind in zip(names, r, kinds, strict=True)
    }
    return Structure([plant], blocks, Truth(stable=True, rs=1 / share, tolerance=1e-6))


def light_mode(seed):
    """s^2 + (c - c d) s + w^2: d = 1 takes all of the damping."""
    rng = np.random.default_rng(seed)
    w, c = 10 ** rng.uniform(-2, 3), float(np.round(rng.uniform(0.1, 1), 2))
    A, B, C = np.array([[0, 1], [-w * w, -c]]), np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]])
    plant = _named(*turned(rng, A, B, C), inputs=["d"], outputs=["y"])
    return Structure(
        [plant], {"d": ("y", "d", c, "real")}, Truth(stable=True, rs=1, tolerance=1e-6)
    )


def first_order_sampled():
    """z = 0.8 d."""
    lag = _named(0.5, [0.5, 1.0], 1, 0.1, inputs=["u", "p"], outputs=["y"])
    K = control.ss([], [], [], [[-1.0]], 0.1, inputs="y", outputs="u")
    return Structure([lag, K], {"pole": ("y", "p", 0.8, "real")}, Truth(stable=True, rs=1.25))


SEEDS = (*range(20), *range(100, 110))
structures = {
    **{  # of 4 + radius d, which is stable for 0 < k < 6 and swings at sqrt(2) rad/s there
        f"a real number of {radius:g}": cubic(
            {"k": ("x1", "f", -radius, "real")}, 2 / radius, at=np.sqrt(2), worst={"k": 1.0}
        )
        for radius in (1.5, 3.0)
    },
    "two real numbers": cubic(  # (3 - t) (2 - t) = 4
        {"a2": ("x3", "f", -1.0, "real"), "a1": ("x2", "f", -1.0, "real")},
        (5 - np.sqrt(17)) / 2,
        worst={"a2": -1.0, "a1": -1.0},
    ),
    "a real number of 3, sampled": cubic(
        {"k": ("x1", "f", -3.0, "real")}, sampled_limit() / 3, 0.05
    ),
    "a sampled pole": first_order_sampled(),
    **{f"slow pole {seed} on the boundary": slow_pole(seed) for seed in SEEDS},
    **{f"light mode {seed} on the boundary": light_mode(seed) for seed in SEEDS},
    **{f"slow pole {seed} inside": slow_pole(seed, 0.9999) for seed in range(6)},
}

#: Left to `make attack`: of loops that are alike, all but some.
LATER = {
    *(name for k, name in enumerate(rising_sets) if k < 40 and k % 4),
    *(f"a demand on a lag under {gain}, LTI" for gain in (0.2, 0.6)),
    *(f"a demand on a lag under {gain}, statistical" for gain in (0.2, 0.02)),
    *(f"a demand on a lag under {gain}, operator" for gain in (0.6, 0.02)),
    *(f"ripples of {delay} s, {k}" for delay in (1, 10, 100) for k in (1, 2)),
    *(
        f"{kind} {seed} on the boundary"
        for kind in ("slow pole", "light mode")
        for seed in SEEDS[1:]
    ),
    *(f"slow pole {seed} inside" for seed in range(1, 6)),
}

LOOPS: dict[str, Loop | Structure] = {
    **rising_sets,
    **on_axis,
    **clocked,
    "a mode above the Nyquist frequency": with_mode_above_nyquist(),
    **{f"an integrator in a clock of {dt:g} s": in_fast_clock(dt) for dt in (1e-6, 1e-7)},
    **boundary,
    **peaks,
    **delays,
    **structures,
}
