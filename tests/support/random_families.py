"""Random loops where checks go wrong: on the axis, stiff, ill-conditioned, resonant, in fast
clocks, coprime.

Each with its worst value by brute force, and nothing here uses the package under test.
"""

from __future__ import annotations

import control
import numpy as np

from tests.support.hard_loops import modal_matrix
from tests.support.random_loops import (
    FORMS,
    closed_loop_poles,
    curves,
    dense_grid,
    hold_and_delay,
    observer_controller,
    random_case,
    random_controller,
    roots,
    tf_response,
    zpk,
)
from tests.support.sampled_sets import largest_factor

TARGETS = (0.9, 0.99, 0.99, 0.999, 1.0005, 1.01, 1.5)


def response_beside_poles(system, omega):
    """Response where it is finite: a frequency at which a pole stands exactly is left out by
    nan.
    """
    dt = system.dt or 0.0
    if not system.nstates:
        return np.full(omega.size, system.D[0, 0], dtype=complex)
    s = np.exp(1j * omega * dt) if dt else 1j * omega
    p = system.poles()
    near = np.min(np.abs(s[:, None] - p) / np.maximum(np.abs(p), 1e-12), axis=1) < 1e-11
    out = np.full(omega.size, np.nan + 0j)
    out[~near] = tf_response(system, omega[~near])
    return out


def finished(
    rng, family, G, K, w, form, delay, in_loop, response=response_beside_poles, perturbation="LTI"
):
    """The case: |b| brought to its target by the gain of the weight, and whether the loop is
    stable.
    """
    dt = float(in_loop.dt or 0.0)
    sampled = bool(dt and not G.dt)
    if sampled and form == "additive":  # what does not roll off reaches the sampler without a bound
        w = w * zpk([], roots(rng, 1), 10.0)
    loop_poles = closed_loop_poles(in_loop, K)
    w_poles = np.exp(w.poles() * dt) if dt and not w.dt else w.poles()
    folded = np.exp(G.poles() * dt) if sampled else in_loop.poles()
    omega = dense_grid(
        dt, loop_poles, in_loop.poles(), K.poles(), w_poles, folded, n=800 if sampled else 4000
    )
    g, k, size = response(in_loop, omega), response(K, omega), tf_response(w, omega)
    if form == "coprime":
        # of the unscaled plant; in proportion to |w| below one
        b = size * np.sqrt((1 + np.abs(g) ** 2) * (1 + np.abs(k) ** 2)) / np.abs(1 + g * k)
    else:
        b = curves(form, g, k, size)[2]
    peak, target = float(np.nanmax(np.abs(b))), float(rng.choice(TARGETS))
    if sampled and target == 1.0005:  # the tail of the brute-force sum is known to about 1e-3
        target = 1.01
    if sampled:
        S = 1 / (1 + g * k)
        peak = 1 / largest_factor(
            response_beside_poles, G, w, form, dt, delay, omega, S, k * S, perturbation
        )
    w = control.StateSpace(w.A, w.B, w.C * target / peak, w.D * target / peak, w.dt)
    excess = np.max(np.abs(loop_poles) - 1 if dt else loop_poles.real)
    scale = np.abs(loop_poles).max()
    margin = 1e-9 * max(1.0, scale)
    return {
        "family": family,
        "kind": "sampled" if dt and not G.dt else "discrete" if dt else "continuous",
        "G": G,
        "K": K,
        "w": w,
        "form": form,
        "delay": delay,
        "target": target,
        "unstable": bool(excess > margin),
        "stable": bool(excess < -margin),
        "omega": omega,
        "in_loop": in_loop,
        "perturbation": perturbation,
    }


def unit_gain(rng, G):
    """The plant with unit gain at a random frequency of its band."""
    size = np.abs(response_beside_poles(G, np.array([10 ** rng.uniform(-1, 1.5)])))[0]
    return control.StateSpace(G.A, G.B, G.C / size, G.D / size, G.dt)


def sometimes_sampled(rng, G):
    """As the controller sees it: continuous, or behind a hold."""
    if rng.random() < 0.5:
        return G, 0.0, 0.0
    T = 10 ** rng.uniform(-3, -1.7)
    delay = float(rng.choice([0, T, 1.7 * T]))
    return hold_and_delay(G, T, delay), T, delay


def on_axis(rng):
    """One or two integrators, or undamped modes, beside other poles."""
    draw = rng.random()
    pair = 1j * 10 ** rng.uniform(-0.5, 1.3)
    poles = (
        [0j]
        if draw < 0.3
        else [0j, 0j]
        if draw < 0.5
        else [pair, -pair]
        if draw < 0.8
        else [0j, pair, -pair]
    )
    # in the order that keeps them apart from light neighbours
    poles = np.concatenate([poles, roots(rng, int(rng.integers(0, 3)), lightest=-2)])
    zeros = roots(rng, int(rng.integers(0, poles.size)), low=0.0, lightest=-1)
    G = unit_gain(rng, zpk(zeros, poles, 1.0))
    in_loop, T, delay = sometimes_sampled(rng, G)
    K = observer_controller(rng, in_loop, T)
    n = int(rng.integers(0, 3))
    w = zpk(roots(rng, n, lightest=-2), roots(rng, n, lightest=-2), 1.0)
    return finished(rng, "poles on the axis", G, K, w, str(rng.choice(FORMS)), delay, in_loop)


def stiff(rng):
    """Poles, zeros and weights from 1e-5 to 1e5 rad/s."""
    n = int(rng.integers(2, 6))
    wide = {"low": -5.0, "high": 5.0, "lightest": -2.0}
    G = unit_gain(rng, zpk(roots(rng, int(rng.integers(0, n)), **wide), roots(rng, n, **wide), 1.0))
    draw = rng.random()
    if draw < 0.5:
        K = zpk(roots(rng, 1, **wide), np.array([0j]), 10 ** rng.uniform(-2, 1))
    else:
        K = zpk(roots(rng, 2, **wide), roots(rng, 2, **wide), 10 ** rng.uniform(-2, 1))
    m = int(rng.integers(0, 3))
    w = zpk(roots(rng, m, **wide), roots(rng, m, **wide), 1.0)
    return finished(rng, "stiff, 1e-5 to 1e5", G, K, w, str(rng.choice(FORMS)), 0.0, G)


def resonant(rng):
    """A controller with an undamped pair of poles, of a disturbance to be followed, on a damped
    plant.
    """
    n = int(rng.integers(1, 5))
    G = unit_gain(
        rng, zpk(roots(rng, int(rng.integers(0, n)), lightest=-1), roots(rng, n, lightest=-2), 1.0)
    )
    in_loop, T, delay = sometimes_sampled(rng, G)
    omega_r = 10 ** rng.uniform(-0.5, 1.2)
    at = np.exp(1j * omega_r * T) if T else 1j * omega_r
    pair = np.array([at, np.conj(at)])
    zeros = roots(rng, 2, low=-0.5, high=1.2, lightest=-0.5)
    K = zpk(np.exp(zeros * T) if T else zeros, pair, 10 ** rng.uniform(-2, 0.5), T)
    w = zpk(roots(rng, 1, lightest=-2), roots(rng, 1, lightest=-2), 1.0)
    return finished(rng, "resonant K", G, K, w, str(rng.choice(FORMS)), delay, in_loop)


def fast_clock(rng):
    """Sampled a thousand to a million times faster than the plant moves: all poles beside one."""
    n = int(rng.integers(1, 4))
    poles = roots(rng, n, -1.0, 1.0, -1.5)
    if rng.random() < 0.4 and poles[-1].imag == 0:
        poles[-1] = 0
    G = unit_gain(rng, zpk(roots(rng, int(rng.integers(0, n)), 0.0, 1.0, -1.0), poles, 1.0))
    T = 10 ** rng.uniform(-7, -4)
    zero = roots(rng, 1, -1.0, 1.0)
    K = zpk(np.exp(zero * T), np.array([1.0 + 0j]), 10 ** rng.uniform(-2, 0.5), T)
    w = zpk(roots(rng, 1, -1.0, 1.0), roots(rng, 1, -1.0, 1.0), 1.0)
    in_loop = hold_and_delay(G, T, 0.0)

    def exact(
        system, omega
    ):  # slow plants in a fast clock: from the continuous roots, as z - 1 loses its digits
        if system is K:
            z = np.expm1(1j * omega * T)
            return K_gain * (z - np.expm1(zero[0] * T)) / z
        hold = -np.expm1(-1j * omega * T) / (1j * omega * T)
        return response_beside_poles(G, omega) * hold

    K_gain = float(K.D[0, 0])
    case = finished(rng, "fast clock", G, K, w, str(rng.choice(FORMS)), 0.0, in_loop, exact)
    slow = continuous_poles(G, zero[0], K_gain, T)
    case["stable"], case["unstable"] = slow.real.max() < -1e-6, slow.real.max() > 1e-6
    return case


def continuous_poles(G, zero, gain, T):
    """Poles of the loop in s: a clock this fast moves them by a relative omega T alone."""
    # K = gain (1 - zero/s) to first order, with the half sample of hold left out
    A = np.block([[G.A - gain * G.B @ G.C, G.B], [gain * zero * G.C, np.zeros((1, 1))]])
    k = 1 / (1 + gain * G.D[0, 0])
    if G.D[0, 0]:
        e = np.hstack([-G.C, -G.D]) * k
        u = np.hstack([np.zeros((1, G.nstates)), [[1.0]]]) + gain * e
        A = np.vstack([np.hstack([G.A, np.zeros((G.nstates, 1))]) + G.B @ u, -gain * zero * e])
    return np.linalg.eigvals(A.real)


def of_high_order(rng):
    """Plant and controller of 15 to 30 states together, mixed by matrices of condition up to
    1e4.
    """
    total = int(rng.integers(15, 31))
    n = int(rng.integers(10, total - 2))
    modal = [modes(rng, n, -2.5), modes(rng, total - n, -1.0)]
    stored = [mixed(rng, system) for system in modal]
    gains = np.geomspace(1e-6, 1e3, 37)
    excess = np.array([closed_loop_poles(modal[0], times(modal[1], g)).real.max() for g in gains])
    crossing = np.flatnonzero((excess[:-1] < 0) & (excess[1:] > 0))
    gain = gains[crossing[0]] * rng.choice([0.3, 0.9, 3.0]) if crossing.size else 1e-3
    truth = {id(s): times(m, g) for s, m, g in zip(stored, modal, (1.0, gain), strict=True)}
    K = times(stored[1], gain)
    truth[id(K)] = truth[id(stored[1])]
    w = zpk(roots(rng, 1, lightest=-2), roots(rng, 1, lightest=-2), 1.0)

    def by_modes(system, omega):
        s = truth[id(system)]
        return modal_response(s, omega)

    case = finished(
        rng, "order 15 to 30", stored[0], K, w, str(rng.choice(FORMS)), 0.0, stored[0], by_modes
    )
    worst = closed_loop_poles(modal[0], times(modal[1], gain)).real.max()
    case["stable"], case["unstable"] = worst < -1e-6, worst > 1e-6
    return case


def modes(rng, n, lightest):
    """A sum of modes, block by block."""
    A = modal_matrix(roots(rng, n, -1.0, 2.0, lightest))
    return control.StateSpace(A, rng.normal(size=(n, 1)), rng.normal(size=(1, n)), [[0.0]], 0)


def modal_response(system, omega):
    """Mode after mode."""
    A, B, C = system.A, system.B[:, 0], system.C[0]
    total, k, s = np.full(omega.size, system.D[0, 0], complex), 0, 1j * omega
    while k < len(A):
        if k + 1 < len(A) and A[k, k + 1]:
            a, b = A[k, k], A[k, k + 1]
            (b0, b1), (c0, c1) = B[k : k + 2], C[k : k + 2]
            total += ((c0 * b0 + c1 * b1) * (s - a) + b * (c0 * b1 - c1 * b0)) / (
                (s - a) ** 2 + b * b
            )
            k += 2
        else:
            total += C[k] * B[k] / (s - A[k, k])
            k += 1
    return total


def mixed(rng, system):
    """The same system in coordinates of condition up to 1e4."""
    n = system.nstates
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    T = left @ np.diag(10 ** rng.uniform(-2, 2, n)) @ right
    back = np.linalg.inv(T)
    return control.StateSpace(T @ system.A @ back, T @ system.B, system.C @ back, system.D, 0)


def times(system, gain):
    """The system times a gain."""
    return control.StateSpace(system.A, system.B, system.C * gain, system.D * gain, system.dt)


def coprime(rng):
    """Any of the loops so far whose plant is not sampled on the way, with the coprime form and a
    gain as scaling.
    """
    while True:
        case = random_case(rng) if rng.random() < 0.6 else on_axis(rng)
        if case["kind"] != "sampled":
            break
    G, K, scale = case["G"], case["K"], 10 ** rng.uniform(-1, 1)
    shaped = finished(
        rng,
        "coprime",
        times(G, scale),
        times(K, 1 / scale),
        case["w"],
        "coprime",
        0.0,
        times(G, scale),
    )
    return shaped | {"G": G, "K": K, "W2": scale, "family": "coprime"}


def above_nyquist(rng, perturbation="LTI", form="", delayed=True):
    """Plants and weights with light modes from below the Nyquist frequency to ten times
    beyond it.
    """
    T = 10 ** rng.uniform(-3, -1.5)
    nyquist = np.log10(np.pi / T)
    n, m = int(rng.integers(1, 6)), int(rng.integers(0, 3))
    band = {"low": nyquist - 1.5, "high": nyquist + 1.0, "lightest": -2.5}
    poles = np.concatenate(
        [-(10 ** rng.uniform(nyquist - 2.0, nyquist - 0.5, 1)) + 0j, roots(rng, n, **band)]
    )
    zeros = roots(rng, int(rng.integers(0, n + 1)), nyquist - 1.5, nyquist + 0.5, -1.5)
    G = zpk(zeros, poles, 1.0)
    size = np.abs(tf_response(G, np.array([np.pi / T / 30])))[0]
    G = control.StateSpace(G.A, G.B, G.C / size, G.D / size, 0)
    delay = float(rng.choice([0, 0.4 * T, T, 1.7 * T])) * delayed
    in_loop = hold_and_delay(G, T, delay)
    K = random_controller(rng, in_loop, T)
    form = form or str(rng.choice(FORMS[:2] if perturbation == "operator" else FORMS))
    w = zpk(roots(rng, m, **band), roots(rng, m, **band), 1.0)
    return finished(
        rng, "modes above Nyquist", G, K, w, form, delay, in_loop, perturbation=perturbation
    )


def sampled_operators(rng, **which):
    """The same, of perturbations that may be nonlinear: judged by a condition that is
    sufficient.
    """
    return above_nyquist(rng, "operator", **which) | {"family": "sampled operators"}


FAMILIES = {
    "poles on the axis": on_axis,
    "stiff": stiff,
    "order 15 to 30": of_high_order,
    "resonant K": resonant,
    "fast clock": fast_clock,
    "coprime": coprime,
    "modes above Nyquist": above_nyquist,
    "sampled operators": sampled_operators,
}
