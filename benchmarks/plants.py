"""Plants with a known answer: many steady-state realisations of one multisine through each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import nlfrf

ZETA, F_N = 0.02, 30.0  # the mode of the linear plant and of the Duffing oscillator


def linear(u, fs):
    """A mode of 2 % damping, in steady state."""
    return mode(u, fs, ZETA, F_N)


def cubic(u, fs):
    """y = u + 0.1 u^3."""
    return u + 0.1 * u**3


def mode(u, fs, zeta, f_n):
    """Any mode, in steady state."""
    n = u.shape[-1]
    s = 2j * np.pi * np.fft.rfftfreq(n, 1 / fs)
    w = 2 * np.pi * f_n
    return np.fft.irfft(np.fft.rfft(u, axis=-1) * w**2 / (s**2 + 2 * zeta * w * s + w**2), n, axis=-1)


def even(u, fs):
    """A cubic with an even part."""
    return u + 0.2 * u**2 + 0.05 * u**3


def quintic(u, fs):
    """y = u + 0.02 u^5: part of its distortion is the same gain on all lines, which no roughness shows."""
    return u + 0.02 * u**5


def saturation(u, fs):
    """tanh."""
    return np.tanh(1.5 * u)


def weak(u, fs):
    """A cubic that noise hides."""
    return u + 0.01 * u**3


def wiener(u, fs):
    """A well damped mode, and the cubic behind it: its distortion does not follow |G|."""
    x = mode(u, fs, 0.3, 20.0)
    return x + 0.1 * x**3


def hammerstein(u, fs):
    """The cubic before a mode: its distortion follows |G|."""
    return mode(u + 0.1 * u**3, fs, 0.05, 30.0)


def spring(u, fs, force, zeta, f_n, n_discard):
    """A mass on a spring of any law, by RK4 on the band-limited input, all realisations at once."""
    n = u.shape[-1]
    # four input samples a step: begin, middle, end
    fine = np.ascontiguousarray(np.fft.irfft(np.fft.rfft(u, axis=-1), 4 * n, axis=-1).T) * 4
    h, w = 1 / (2 * fs), 2 * np.pi * f_n
    x, v = np.zeros(u.shape[0]), np.zeros(u.shape[0])
    y = np.empty((n, u.shape[0]))

    def slope(x, v, f):
        return v, w**2 * (f - force(x)) - 2 * zeta * w * v

    for period in range(n_discard + 1):
        for i in range(2 * n):
            if period == n_discard and i % 2 == 0:
                y[i // 2] = x
            f0, f1, f2 = fine[2 * i], fine[2 * i + 1], fine[(2 * i + 2) % (4 * n)]
            a = slope(x, v, f0)
            b = slope(x + h / 2 * a[0], v + h / 2 * a[1], f1)
            c = slope(x + h / 2 * b[0], v + h / 2 * b[1], f1)
            d = slope(x + h * c[0], v + h * c[1], f2)
            x = x + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            v = v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    return np.ascontiguousarray(y.T)


def duffing(u, fs, hardening=0.001):
    """The same mode as the linear one, with a hardening spring."""
    return spring(u, fs, lambda x: x + hardening * x**3, ZETA, F_N, 3)


def one_sided(u, fs):
    """A mode at 10 Hz whose spring is twice as stiff one way: even and odd distortion at a resonance."""
    return spring(u, fs, lambda x: x + np.maximum(x, 0), 0.05, 10.0, 2)


# plants that no allowance of the bound was chosen on: laws, dampings and frequencies of their own


def fifth_power(u, fs):
    """A fifth power that makes most of the gain."""
    return u + 0.3 * u**5


def dead_zone(u, fs, half_width=0.5):
    """Nothing below the half width."""
    return u - np.clip(u, -half_width, half_width)


def jump(u, fs):
    """Dry friction under a force: a jump at zero."""
    return u + 0.5 * np.sign(u)


def backlash(u, fs, half_width=0.4):
    """Play, in steady state: what follows turns back only after the whole gap was crossed."""
    x, y = np.zeros(u.shape[0]), np.empty_like(u)
    for _ in range(2):
        for i in range(u.shape[1]):
            x = np.clip(x, u[:, i] - half_width, u[:, i] + half_width)
            y[:, i] = x
    return y


def saturated_sensor(u, fs):
    """tanh behind a lightly damped mode."""
    return np.tanh(0.4 * mode(u, fs, 0.06, 42.0))


def fifth_behind(u, fs):
    """A fifth power behind a mode."""
    x = mode(u, fs, 0.15, 25.0)
    return x + 0.01 * x**5


def dead_zone_before(u, fs):
    """A dead zone before a mode of 3 % damping."""
    return mode(dead_zone(u, fs, 0.4), fs, 0.03, 55.0)


def between(u, fs):
    """A cubic between two modes."""
    x = mode(u, fs, 0.2, 15.0)
    return mode(x + 0.1 * x**3, fs, 0.05, 60.0)


def bilinear(u, fs):
    """The input times the state fed back: even and odd distortion of a low-pass."""
    x, y = np.zeros(u.shape[0]), np.empty_like(u)
    for _ in range(2):
        for i in range(u.shape[1]):
            x = (0.8 + 0.08 * u[:, i - 1]) * x + 0.2 * u[:, i - 1]
            y[:, i] = x
    return y


def softening(u, fs):
    """A mode whose spring gives way."""
    return spring(u, fs, lambda x: 0.5 * x + 0.5 * np.tanh(x), 0.08, 22.0, 2)


def one_way(u, fs):
    """A mode whose spring is three times as stiff one way."""
    return spring(u, fs, lambda x: x + 2 * np.maximum(x, 0), 0.03, 37.0, 3)


def slipping(u, fs, n_steps=8):
    """A mode held by six springs that slip (Maxwell), by small symplectic steps on the band-limited input."""
    n, h = u.shape[1], 1 / (fs * n_steps)
    fine = np.ascontiguousarray(np.fft.irfft(np.fft.rfft(u, axis=-1), n_steps * n, axis=-1).T) * n_steps
    stiff, slips = np.full((6, 1), 0.2), 0.05 * 2.0 ** np.arange(6)[:, None]
    w, zeta = 2 * np.pi * 33.0, 0.02
    x, v, held = np.zeros(u.shape[0]), np.zeros(u.shape[0]), np.zeros((6, u.shape[0]))
    y = np.empty((n, u.shape[0]))
    for period in range(3):
        for i in range(n_steps * n):
            if period == 2 and i % n_steps == 0:
                y[i // n_steps] = x
            v = v + h * (w**2 * (fine[i] - x - held.sum(axis=0)) - 2 * zeta * w * v)
            x = x + h * v
            held = np.clip(held + stiff * (h * v), -slips, slips)
    return np.ascontiguousarray(y.T)


STATIC = {"linear": linear, "cubic": cubic, "Duffing": duffing}
OTHERS = {
    "even": even,
    "quintic": quintic,
    "saturation": saturation,
    "weak": weak,
    "Wiener": wiener,
    "Hammerstein": hammerstein,
    "one-sided": one_sided,
}
FRESH = {
    "fifth": fifth_power,
    "dead zone": dead_zone,
    "jump": jump,
    "backlash": backlash,
    "sensor": saturated_sensor,
    "behind": fifth_behind,
    "before": dead_zone_before,
    "between": between,
    "bilinear": bilinear,
    "softening": softening,
    "one way": one_way,
    "slipping": slipping,
}
PLANTS = STATIC | OTHERS | FRESH
RMS = {"linear": 1.0, "cubic": 1.0, "Duffing": 1.0, "friction 1": 0.25, "friction 3": 2.5}


def realisations(plant, kind, n_realizations, rng):
    """(ms, u, y): a multisine and its (n, N) input and noise-free steady-state output."""
    if plant in STATIC:
        design = dict(fs=1024, n_samples=4096, f_min=0.25, f_max=100)
    else:
        design = dict(fs=4096, n_samples=16384, f_min=1.25, f_max=143.25)
    ms = nlfrf.multisine(kind, **design, rms=RMS[plant], n_realizations=n_realizations, rng=rng)
    if plant in STATIC:
        return ms, ms.u, STATIC[plant](ms.u, ms.fs)
    record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=1)
    return ms, record.u[:, 0], record.y[:, 0]


def played(ms, plant, n, rng):
    """(u, y): n realisations of a multisine, by phases of their own, and the steady-state output of a plant to them."""
    phase = rng.uniform(0, 2 * np.pi, (n, ms.f.size))
    u = replace(ms, phase=phase).u
    return u, PLANTS[plant](u, ms.fs)


def resonance(plant, bla_lines, G):
    """Frequency index of the resonance, where there is one."""
    return None if plant == "cubic" else int(np.argmax(np.abs(G)))


def subset(ms, rows):
    """Some realisations of a multisine."""
    return replace(ms, phase=ms.phase[rows])
