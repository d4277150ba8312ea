"""Random loops with a known worst case, to attack the check with: nothing here uses the package
under test.
"""

from __future__ import annotations

import control
import numpy as np

from tests.support.sampled_sets import largest_factor

FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")


def roots(rng, n, low=-1.0, high=2.0, lightest=-4.0, unstable=0.0):
    """n roots, conjugate pairs with dampings down to 10^lightest, some of them on the wrong
    side.
    """
    out = []
    while len(out) < n:
        w = 10 ** rng.uniform(low, high)
        side = 1.0 if rng.random() < unstable else -1.0
        if n - len(out) >= 2 and rng.random() < 0.6:
            zeta = 10 ** rng.uniform(lightest, 0)
            p = w * (side * zeta + 1j * np.sqrt(max(1 - zeta**2, 0)))
            out += [p, np.conj(p)]
        else:
            out.append(complex(side * w))
    return np.array(out)


def zpk(zeros, poles, gain, dt=0.0):
    """State space of a random zpk, built by modes of a companion of pairs through python-control's
    series.
    """
    system = control.ss([], [], [], [[gain]], dt) if dt else control.ss([], [], [], [[gain]])
    zeros, poles = list(zeros), list(poles)
    while poles:
        take = 2 if poles[0].imag != 0 else 1
        den = np.poly(poles[:take]).real
        poles = poles[take:]
        num = np.array([1.0])
        if zeros and (zeros[0].imag == 0 or take == 2):
            many = 2 if zeros[0].imag != 0 else 1
            num = np.poly(zeros[:many]).real
            zeros = zeros[many:]
        n = take
        num = np.concatenate([np.zeros(n + 1 - num.size), num])
        A = np.zeros((n, n))
        A[0] = -den[1:]
        A[1:, :-1] = np.eye(n - 1)
        B = np.zeros((n, 1))
        B[0, 0] = 1
        C = (num[1:] - num[0] * den[1:])[None, :]
        section = control.StateSpace(A, B, C, [[num[0]]], dt)
        system = system * section
    return system


def tf_response(system, omega):
    """Response by one dense solve a frequency, without scaling or balancing; of sections in series
    by one section after the other.
    """
    dt, n = system.dt or 0.0, system.A.shape[0]
    s = np.exp(1j * omega * dt) if dt else 1j * omega
    groups = _groups(system.A)
    if all(len(group) <= 2 for group in groups):
        x = np.zeros((n, omega.size), complex)
        for group in groups:
            x[group] = _section(
                s, system.A[np.ix_(group, group)], system.B[group] + system.A[group] @ x
            )
        return (system.C @ x)[0] + system.D[0, 0]
    pencil = s[:, None, None] * np.eye(n) - system.A
    x = np.linalg.solve(pencil, np.broadcast_to(system.B.astype(complex), (omega.size, n, 1)))
    return (system.C @ x)[:, 0, 0] + system.D[0, 0]


def _groups(A):
    """States that act on each other, each group behind those that act on it."""
    acts = (A != 0) | np.eye(len(A), dtype=bool)
    for _ in range(len(A).bit_length()):
        acts = acts @ acts
    groups = {tuple(np.flatnonzero(row & column)) for row, column in zip(acts, acts.T, strict=True)}
    return [list(group) for group in sorted(groups, key=lambda group: acts[group[0]].sum())]


def _section(s, A, right):
    """(s - A)^-1 right (n, W), of one state or two."""
    if len(A) == 1:
        return right / (s - A)
    (a, b), (c, d) = A
    solved = np.array([(s - d) * right[0] + b * right[1], c * right[0] + (s - a) * right[1]])
    return solved / ((s - a) * (s - d) - b * c)


def sampled_response(G, T, delay, omega, n_alias=400):
    """Response of the sampled plant by the sum over its aliases: hold, delay, sampler."""
    total = np.zeros(omega.size, dtype=complex)
    for k in range(-n_alias, n_alias + 1):
        w = omega + 2 * np.pi * k / T
        w = np.where(w == 0, 1e-12, w)
        total += (
            tf_response(G, w) * (1 - np.exp(-1j * w * T)) / (1j * w * T) * np.exp(-1j * w * delay)
        )
    return total


def closed_loop_poles(G, K):
    """Poles of 1/(1 + G K) with all states kept."""
    k = 1 / (1 + G.D[0, 0] * K.D[0, 0])
    A = np.block([[G.A, np.zeros((G.nstates, K.nstates))], [np.zeros((K.nstates, G.nstates)), K.A]])
    # e = k (r - C x - D Ck xk), u = Ck xk + Dk e
    e = k * np.hstack([-G.C, -G.D @ K.C])
    u = np.hstack([np.zeros((1, G.nstates)), K.C]) + K.D @ e
    return np.linalg.eigvals(A + np.vstack([G.B @ u, K.B @ e]))


def dense_grid(dt, *root_sets, n=4000):
    """A log grid of n points, and a fine one around every root."""
    top = np.pi / dt if dt else 1e7
    s = np.concatenate(
        [np.log(np.where(r == 0, 1e-12, r).astype(complex)) / dt if dt else r for r in root_sets]
    )
    grid = [np.geomspace(1e-6, top * (1 - 1e-9), n)]
    for p in s:
        w, half = abs(p.imag), max(abs(p.real), 1e-9 * abs(p))
        grid.append(
            w
            + half * np.concatenate([-np.geomspace(1e-3, 30, 60), [0], np.geomspace(1e-3, 30, 60)])
        )
        grid.append(abs(p) * np.linspace(0.9, 1.1, 41))
    omega = np.unique(np.concatenate(grid))
    return omega[(omega > 0) & (omega < top)]


def curves(form, G, K, w):
    """rs = |b| and the terms of S_p, from responses."""
    S = 1 / (1 + G * K)
    b = {
        "multiplicative": w * G * K * S,
        "additive": w * K * S,
        "inverse-multiplicative": w * S,
        "inverse-additive": w * G * S,
    }
    a = {
        "multiplicative": 0 * S,
        "additive": 0 * S,
        "inverse-multiplicative": w + 0 * S,
        "inverse-additive": w * G,
    }
    return S, a[form], b[form]


def random_case(rng, kinds=("continuous", "discrete", "sampled")):
    """A random loop with its worst value by brute force: dict of what `check` is to be given and
    what is true.
    """
    kind = str(rng.choice(kinds))
    form, T = str(rng.choice(FORMS)), 10 ** rng.uniform(-3, -1.5)
    n, light = int(rng.integers(1, 7)), rng.choice([-1.0, -3.0, -6.0])
    loop_dt, delay = (0.0 if kind == "continuous" else T), 0.0
    if kind == "discrete":
        poles = np.exp(roots(rng, n, high=1.8, lightest=light, unstable=0.1) * T)
        G = zpk(np.exp(roots(rng, int(rng.integers(0, n + 1))) * T), poles, 1.0, T)
    else:
        poles = roots(rng, n, lightest=light, unstable=0.1)
        if rng.random() < 0.3 and poles[-1].imag == 0:
            poles[-1] = 0
        G = zpk(roots(rng, int(rng.integers(0, n)), unstable=0.2), poles, 1.0)
    size = np.abs(tf_response(G, np.array([10 ** rng.uniform(-1, 1.5)])))[0]
    G = control.StateSpace(G.A, G.B, G.C / size, G.D / size, T if kind == "discrete" else 0)
    in_loop = G
    if kind == "sampled":
        delay = float(rng.choice([0, 0.3 * T, T, 1.7 * T]))
        in_loop = hold_and_delay(G, T, delay)
    K = random_controller(rng, in_loop, loop_dt)
    nw = int(rng.integers(0, 4))
    if kind == "discrete":
        w = zpk(
            np.exp(roots(rng, nw, lightest=-2) * T),
            np.exp(roots(rng, nw, lightest=light) * T),
            1.0,
            T,
        )
    else:
        w = zpk(roots(rng, nw, lightest=-2), roots(rng, nw, lightest=light), 1.0)
    if (
        kind == "sampled" and form == "additive"
    ):  # what does not roll off reaches the sampler without a bound
        w = w * zpk([], roots(rng, 1), 10.0)
    loop_poles = closed_loop_poles(in_loop, K)
    w_poles = np.exp(w.poles() * T) if kind == "sampled" else w.poles()
    n = 800 if kind == "sampled" else 4000
    omega = dense_grid(loop_dt, loop_poles, in_loop.poles(), K.poles(), w_poles, n=n)
    k = tf_response(K, omega)
    S, a, b = curves(form, tf_response(in_loop, omega), k, tf_response(w, omega))
    peak = float(np.abs(b).max())
    if kind == "sampled":
        peak = 1 / largest_factor(tf_response, G, w, form, T, delay, omega, S, k * S)
    target = float(rng.choice([0.9, 0.99, 0.99, 0.999, 1.0005, 1.01, 1.5]))
    if (
        kind == "sampled" and target == 1.0005
    ):  # the tail of the brute-force sum is known to about 1e-3
        target = 1.01
    w = control.StateSpace(w.A, w.B, w.C * target / peak, w.D * target / peak, w.dt)
    excess = np.max(np.abs(loop_poles) - 1 if loop_dt else loop_poles.real)
    margin = 1e-9 * max(1.0, np.abs(loop_poles).max())
    return {
        "kind": kind,
        "G": G,
        "in_loop": in_loop,
        "K": K,
        "w": w,
        "form": form,
        "delay": delay,
        "target": target,
        "omega": omega,
        "S": S,
        "a": a * target / peak,
        "b": b * target / peak,
        "unstable": excess > margin,
        "stable": excess < -margin,
    }


def random_controller(rng, G, dt):
    """Mostly one that stabilises: a scaled LQG-like compensator; else a gain or an integrator."""
    draw = rng.random()
    if draw < 0.6 and G.nstates:
        return observer_controller(rng, G, dt)
    gain = 10 ** rng.uniform(-2, 1)
    if draw < 0.8:
        pole = np.array([1.0 + 0j]) if dt else np.array([0j])
        zero = roots(rng, 1)
        return zpk(np.exp(zero * dt) if dt else zero, pole, gain, dt)
    return control.StateSpace([], [], [], [[gain]], dt)


def observer_controller(rng, G, dt):
    """Observer and state feedback by Riccati equations, its gain then scaled off."""
    from scipy.linalg import solve_continuous_are, solve_discrete_are

    solve = solve_discrete_are if dt else solve_continuous_are
    A, B, C, D = G.A, G.B, G.C, G.D
    rho = 10 ** rng.uniform(-2, 1)
    try:
        X = solve(A, B, C.T @ C + 1e-9 * np.eye(len(A)), rho * np.eye(1))
        Y = solve(A.T, C.T, B @ B.T + 1e-9 * np.eye(len(A)), rho * np.eye(1))
    except (np.linalg.LinAlgError, ValueError):
        return control.StateSpace([], [], [], [[rho]], dt)
    if dt:
        F = np.linalg.solve(rho * np.eye(1) + B.T @ X @ B, B.T @ X @ A)
        H = A @ Y @ C.T / (rho + C @ Y @ C.T)
    else:
        F, H = B.T @ X / rho, Y @ C.T / rho
    # u = -F x^, x^+ = A x^ + B u + H (y - C x^ - D u): from y to u, then u = K (r - y)
    return control.StateSpace(
        A - B @ F - H @ (C - D @ F), H, F * rng.uniform(0.7, 1.4), np.zeros((1, 1)), dt
    )


def hold_and_delay(G, T, delay):
    """Sampled plant with hold and fractional delay, by one long matrix exponential of plant, hold
    and delay line.
    """
    from scipy.linalg import expm

    n = G.nstates
    whole, rest = divmod(delay, T)
    whole = round(whole) + (rest >= T * (1 - 1e-9))
    rest = 0.0 if rest < 1e-9 * T or rest > T * (1 - 1e-9) else rest
    # over one sample: the input is u[k-whole-1] for `rest`, then u[k-whole]
    M = np.zeros((n + 2, n + 2))
    M[:n, :n], M[:n, n : n + 1] = G.A, G.B
    first = expm(M * rest)  # states x, held input, input to come
    swap = np.eye(n + 2)
    swap[n, n], swap[n, n + 1] = 0.0, 1.0
    step = expm(M * (T - rest)) @ swap @ first
    Phi, old, new = step[:n, :n], step[:n, n : n + 1], step[:n, n + 1 :]
    size = n + whole + 1
    A, B, C = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    A[:n, :n] = Phi
    B[n, 0] = 1.0  # u[k-1], then u[k-2], ...
    for k in range(whole):
        A[n + 1 + k, n + k] = 1.0
    A[:n, n + whole : n + whole + 1] += old
    if whole:
        A[:n, n + whole - 1 : n + whole] += new
    else:
        B[:n] += new
    C[:, :n] = G.C
    return control.StateSpace(A, B, C, [[0.0]], T)
