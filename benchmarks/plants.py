"""Plants with a known answer: many steady-state realisations of one multisine through each."""

from __future__ import annotations

import warnings
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
    return np.fft.irfft(
        np.fft.rfft(u, axis=-1) * w**2 / (s**2 + 2 * zeta * w * s + w**2), n, axis=-1
    )


def even(u, fs):
    """A cubic with an even part."""
    return u + 0.2 * u**2 + 0.05 * u**3


def quintic(u, fs):
    """y = u + 0.02 u^5: part of its distortion is the same gain on all lines, which no roughness
    shows.
    """
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


def spring(u, fs, law, zeta, f_n, n_discard):
    """A mass on a spring, by RK4 on the band-limited input; of its law the parts x, x^3, max(x, 0)
    and tanh(x).
    """
    from benchmarks.stepping import step_spring

    n = u.shape[-1]
    # four input samples for two steps a sample: begin, middle, end
    fine = np.fft.irfft(np.fft.rfft(u, axis=-1), 4 * n, axis=-1) * 4
    return step_spring(fine, 1 / (2 * fs), 2 * np.pi * f_n, zeta, law, n_discard)


def duffing(u, fs, hardening=0.001):
    """The same mode as the linear one, with a hardening spring."""
    return spring(u, fs, (1.0, hardening, 0.0, 0.0), ZETA, F_N, 3)


def one_sided(u, fs):
    """A mode at 10 Hz whose spring is twice as stiff one way: even and odd distortion at a
    resonance.
    """
    return spring(u, fs, (1.0, 0.0, 1.0, 0.0), 0.05, 10.0, 2)


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
    from benchmarks.stepping import step_backlash

    return step_backlash(u, half_width)


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
    from benchmarks.stepping import step_bilinear

    return step_bilinear(u)


def softening(u, fs):
    """A mode whose spring gives way."""
    return spring(u, fs, (0.5, 0.0, 0.0, 0.5), 0.08, 22.0, 2)


def one_way(u, fs):
    """A mode whose spring is three times as stiff one way."""
    return spring(u, fs, (1.0, 0.0, 2.0, 0.0), 0.03, 37.0, 3)


def slipping(u, fs, n_steps=8):
    """A mode held by six springs that slip (Maxwell), by small symplectic steps on the band-limited
    input.
    """
    from benchmarks.stepping import step_slipping

    n = u.shape[1]
    fine = np.fft.irfft(np.fft.rfft(u, axis=-1), n_steps * n, axis=-1) * n_steps
    return step_slipping(
        fine, 1 / (fs * n_steps), n_steps, 2 * np.pi * 33.0, 0.02, 0.2, 0.05 * 2.0 ** np.arange(6)
    )


# ten plants invented after the model of the distortion was finished, run once as its last judge


def hard_limit(u, fs):
    """Clipped at 1.2 times its rms, before a mode of 8 %."""
    return mode(np.clip(u, -1.2, 1.2), fs, 0.08, 70.0)


def rectified_sensor(u, fs):
    """A sensor behind a damped mode that reads one sign by 30 % more."""
    x = mode(u, fs, 0.25, 35.0)
    return x + 0.3 * np.maximum(x, 0)


def quantiser(u, fs):
    """Steps of half the rms, before a low-pass."""
    return mode(0.5 * np.round(u / 0.5), fs, 0.7, 90.0)


def two_modes(u, fs):
    """A cubic spring effect behind one mode, before another."""
    x = mode(u, fs, 0.04, 28.0)
    return x + mode(0.004 * x**3, fs, 0.1, 80.0)


def delayed_cubic(u, fs):
    """A cubic whose output comes five samples late, beside the linear path."""
    return u + 0.08 * np.roll(u**3, 5, axis=-1)


def product(u, fs):
    """The input times a slow version of its square: a gain that drifts with its own level."""
    slow = mode(u**2, fs, 0.7, 6.0)
    return mode(u * (1 + 0.3 * slow), fs, 0.1, 45.0)


def sine_law(u, fs):
    """A sine behind a mode, as of a crank."""
    return np.sin(0.8 * mode(u, fs, 0.12, 50.0))


def square_root(u, fs):
    """A valve: the root of the input, before a mode."""
    return mode(np.sign(u) * np.sqrt(np.abs(u)), fs, 0.3, 30.0)


def stiff_both_ways(u, fs):
    """A mass on a spring that hardens and is half as stiff one way."""
    return spring(u, fs, (0.7, 0.01, 0.5, 0.0), 0.06, 27.0, 4)


def play_before(u, fs):
    """A gear with play before a mode."""
    return mode(backlash(u, fs, 0.3), fs, 0.05, 48.0)


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
INVENTED = {
    "limit": hard_limit,
    "rectified": rectified_sensor,
    "quantiser": quantiser,
    "two modes": two_modes,
    "delayed": delayed_cubic,
    "product": product,
    "sine": sine_law,
    "root": square_root,
    "both ways": stiff_both_ways,
    "play": play_before,
}
PLANTS = STATIC | OTHERS | FRESH | INVENTED
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
    with warnings.catch_warnings():
        # the first period is far from the second, the second within 4e-6 of the third, 7e-5 of the
        # scatter of the FRF
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=1, n_discard=1)
    return ms, record.u[:, 0], record.y[:, 0]


def played(ms, plant, n, rng):
    """(u, y): n realisations of a multisine, of phases of their own, and what a plant of u and fs
    makes of them.
    """
    phase = rng.uniform(0, 2 * np.pi, (n, ms.f.size))
    u = replace(ms, phase=phase).u
    return u, plant(u, ms.fs)


def resonance(plant, bla_lines, G):
    """Frequency index of the resonance, where there is one."""
    return None if plant == "cubic" else int(np.argmax(np.abs(G)))


def subset(ms, rows):
    """Some realisations of a multisine."""
    return replace(ms, phase=ms.phase[rows])
