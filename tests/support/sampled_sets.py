"""Sets of continuous plants under a sampled controller, by brute force over aliases: nothing here
uses the package.
"""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import expm

N_ALIASES = 30


def all_pass_through(frequencies, phases, narrow=1e-4):
    """(zeros, poles, sign) of a real stable all-pass that has given phases at given frequencies,
    one section each.

    A narrow section turns by a whole turn around its own frequency and leaves the others nearly
    alone; what it leaves them is taken off by setting each again in turn.
    """
    frequencies = np.asarray(frequencies, dtype=float)
    half = narrow * frequencies
    centre = frequencies.copy()

    def phase(k, w):  # of (s^2 - 2 h s + c^2 + h^2)/(s^2 + 2 h s + ...) at w
        p = -half[k] + 1j * centre[k]
        s = 1j * w
        return np.angle((s + p) * (s + np.conj(p)) / ((s - p) * (s - np.conj(p))))

    for _ in range(30):
        for k, w in enumerate(frequencies):
            others = sum(phase(j, w) for j in range(frequencies.size) if j != k)
            wanted = (phases[k] - others) % (2 * np.pi)
            # near its pole the section has the phase 2 atan(h/(w - c)) in all, from 0 to 2 pi
            t = np.clip(wanted / 2, 1e-6, np.pi - 1e-6)
            centre[k] = w - half[k] / np.tan(t)
    poles = -half + 1j * centre
    return np.concatenate([poles, poles.conj()])


def with_phases(frequencies, phases, narrow=1e-4):
    """That all-pass as a state space, mode after mode."""
    system = control.ss([], [], [], [[1.0]])
    poles = all_pass_through(frequencies, phases, narrow)
    for p in poles[: len(frequencies)]:
        b, c = -2 * p.real, abs(p) ** 2
        A = np.array([[0.0, np.sqrt(c)], [-np.sqrt(c), -b]])
        section = control.StateSpace(A, [[0.0], [1.0]], [[0.0, -2 * b]], [[1.0]], 0)
        system = system * section
    return system


def alias_terms(response, G, w, form, T, delay, omega, n=N_ALIASES):
    """(W,) aliases k = 0, 1, -1, 2, ...: h_k G_k (W, 1 + 2 n) and |F_k|."""
    k = np.array([0] + [sign * j for j in range(1, n + 1) for sign in (1, -1)])
    at = omega[:, None] + 2 * np.pi / T * k
    size = np.abs(at).ravel()
    g, weight = (response(X, size).reshape(at.shape) for X in (G, w))
    g = np.where(at < 0, np.conj(g), g)
    hold = (1 - np.exp(-1j * at * T)) / (1j * at * T) * np.exp(-1j * at * delay)
    through = form in ("multiplicative", "inverse-additive")
    return hold, hold * g, np.abs(g * weight) if through else np.abs(weight)


def with_tail(terms):
    """(W,) the sum of terms (W, 1 + 2 n), the rest by the power of k that the last ones fall
    with.
    """
    pairs = terms[:, 1::2] + terms[:, 2::2]
    n = pairs.shape[1]
    last, before = np.nanmax(pairs[:, -1]), np.nanmax(pairs[:, n // 2 - 1])
    power = np.log(before / last) / np.log(n / (n // 2)) if last > 0 else np.inf
    tail = pairs[:, -1] * n / (power - 1) * (1 - 0.5 * power / n) if 1.2 < power < np.inf else 0.0
    return terms.sum(axis=1) + (np.inf if power <= 1.2 else tail)


def smallest_distance(m, KS, hG, F):
    """(W,) smallest |1 + K G_p|/|1 + K G_d| over an LTI inverse set grown by m: a sum of discs."""
    u = (m * F) ** 2
    if np.nanmax(u[:, 1:]) >= 1:
        return np.full(KS.size, -np.inf)
    with np.errstate(all="ignore"):
        centre = (hG * u / (1 - u))[:, 1:].sum(1)
        radius = with_tail(
            np.hstack([np.zeros((KS.size, 1)), (np.abs(hG) * np.sqrt(u) / (1 - u))[:, 1:]])
        )
        X = 1 + KS * (centre - hG[:, 0])
        g, u0 = KS * hG[:, 0], u[:, 0]
        inside = np.abs(X + g / (1 - u0)) - np.abs(g) * np.sqrt(u0) / np.abs(1 - u0)
        outside = np.abs(g) * np.sqrt(u0) / np.abs(u0 - 1) - np.abs(X - g / (u0 - 1))
    return np.where(u0 < 1, inside, outside) - np.abs(KS) * radius


def largest_factor(response, G, w, form, T, delay, omega, S, KS, perturbation="LTI"):
    """The factor on w at which the set is just not stable, by the exact conditions (of an operator:
    sufficient).
    """
    hold, hG, F = alias_terms(response, G, w, form, T, delay, omega)
    # beside a pole on the axis rounding moves that of G and that of the sampled plant apart: one
    # from the other
    others = hG[:, 1:].sum(1)
    rules = np.abs(hG[:, 0]) > 1e4 * np.abs(hG[:, 1:]).sum(1)
    first = np.where(rules, (1 - S) / KS - others, hG[:, 0])
    if form in ("multiplicative", "inverse-additive"):
        F[:, 0] *= np.abs(first / hG[:, 0])
    hG[:, 0] = first
    size = np.abs(KS)
    if form in ("multiplicative", "additive"):
        if perturbation == "operator":
            return 1 / np.nanmax(size * np.sqrt(with_tail(F**2)))
        return 1 / np.nanmax(size * with_tail(np.abs(hold) * F))
    low, high = -25.0, 25.0
    for _ in range(32):  # to 1e-8
        middle = (low + high) / 2
        fine = np.nanmin(smallest_distance(np.exp(middle), KS, hG, F)) > 0
        low, high = (middle, high) if fine else (low, middle)
    return np.exp(low)


def worst_member(response, G, w, form, T, delay, omega, KS, n=3, narrow=1e-4):
    """An LTI perturbation that is in phase at the frequency itself and its n nearest aliases either
    side, at omega.
    """
    hold, hG, _ = alias_terms(response, G, w, form, T, delay, np.array([omega]), n)
    k = np.array([0] + [sign * j for j in range(1, n + 1) for sign in (1, -1)])
    at = omega + 2 * np.pi / T * k
    weight = response(w, np.abs(at))
    weight = np.where(at < 0, np.conj(weight), weight)
    acts = KS * (hG[0] if form == "multiplicative" else hold[0]) * weight
    phases = np.pi - np.angle(acts)  # K S h F Delta negative
    return with_phases(np.abs(at), np.where(at < 0, -phases, phases), narrow)


def period_map(G, w, form, K, T, delta):
    """The loop over one sample with the memoryless operator delta(t), constant on pieces of the
    sample; no delay.

    Multiplicative and additive only: the perturbation is delta(t) times the held input, seen
    through w (and G).
    """
    pieces = len(delta)
    if form == "multiplicative":  # w reads delta u and adds to u
        A = np.block([[G.A, G.B @ w.C], [np.zeros((w.nstates, G.nstates)), w.A]])
        B = [np.vstack([G.B * (1 + w.D[0, 0] * d), w.B * d]) for d in delta]
        C = np.hstack([G.C, np.zeros((1, w.nstates))])
    else:
        A = np.block(
            [[G.A, np.zeros((G.nstates, w.nstates))], [np.zeros((w.nstates, G.nstates)), w.A]]
        )
        B = [np.vstack([G.B, w.B * d]) for d in delta]
        C = np.hstack([G.C, w.C])
    n = len(A)
    Phi, Gam, known = np.eye(n), np.zeros((n, 1)), {}
    for d, b in zip(delta, B, strict=True):
        if d not in known:
            known[d] = expm(np.block([[A, b], [np.zeros((1, n + 1))]]) * (T / pieces))
        both = known[d]
        Phi, Gam = both[:n, :n] @ Phi, both[:n, :n] @ Gam + both[:n, n:]
    top = np.hstack([Phi - Gam @ K.D @ C, Gam @ K.C])
    return np.vstack([top, np.hstack([-K.B @ C, K.A])])


def worst_period_map(G, w, form, K, T, pieces=8):
    """The largest spectral radius over delta(t) = +-1 on the pieces of a sample, the same in each
    sample, or turned.
    """
    worst = 0.0
    for code in range(2 ** (pieces - 1)):
        delta = np.array([1.0 if code >> j & 1 else -1.0 for j in range(pieces)])
        for sign in (1.0, -1.0):
            worst = max(
                worst, np.abs(np.linalg.eigvals(period_map(G, w, form, K, T, sign * delta))).max()
            )
        # another sign every other sample: at the Nyquist frequency
        both = period_map(G, w, form, K, T, -delta) @ period_map(G, w, form, K, T, delta)
        worst = max(worst, np.sqrt(np.abs(np.linalg.eigvals(both)).max()))
    return worst
