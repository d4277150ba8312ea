"""Plants with a known answer: many steady-state realisations of one multisine through each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import nlfrf

ZETA, F_N = 0.02, 30.0  # the mode of the linear plant and of the Duffing oscillator


def linear(u, fs):
    """A mode of 2 % damping, in steady state."""
    n = u.shape[-1]
    s = 2j * np.pi * np.fft.rfftfreq(n, 1 / fs)
    w = 2 * np.pi * F_N
    return np.fft.irfft(np.fft.rfft(u, axis=-1) * w**2 / (s**2 + 2 * ZETA * w * s + w**2), n, axis=-1)


def cubic(u, fs):
    """y = u + 0.1 u^3."""
    return u + 0.1 * u**3


def duffing(u, fs, hardening=0.001, n_discard=3):
    """The same mode with a hardening spring, by RK4 on the band-limited input, all realisations at once."""
    n = u.shape[-1]
    fine = np.fft.irfft(np.fft.rfft(u, axis=-1), 4 * n, axis=-1) * 4  # four input samples a step: begin, middle, end
    h, w = 1 / (2 * fs), 2 * np.pi * F_N
    x, v = np.zeros(u.shape[0]), np.zeros(u.shape[0])
    y = np.empty_like(u)

    def slope(x, v, force):
        return v, w**2 * (force - x - hardening * x**3) - 2 * ZETA * w * v

    for period in range(n_discard + 1):
        for i in range(2 * n):
            if period == n_discard and i % 2 == 0:
                y[:, i // 2] = x
            f0, f1, f2 = fine[:, 2 * i], fine[:, 2 * i + 1], fine[:, (2 * i + 2) % (4 * n)]
            a = slope(x, v, f0)
            b = slope(x + h / 2 * a[0], v + h / 2 * a[1], f1)
            c = slope(x + h / 2 * b[0], v + h / 2 * b[1], f1)
            d = slope(x + h * c[0], v + h * c[1], f2)
            x = x + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            v = v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    return y


STATIC = {"linear": linear, "cubic": cubic, "Duffing": duffing}
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


def resonance(plant, bla_lines, G):
    """Frequency index of the resonance, where there is one."""
    return None if plant == "cubic" else int(np.argmax(np.abs(G)))


def subset(ms, rows):
    """Some realisations of a multisine."""
    return replace(ms, phase=ms.phase[rows])
