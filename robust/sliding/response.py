"""The sliding loop over frequency: what the friction at its port makes of the velocity there."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from robust.sliding.loop import SlidingLoop

__all__ = ["driven", "frequencies", "mobility"]


def frequencies(loop: SlidingLoop, n: int = 900) -> np.ndarray:
    """(W,) frequencies [rad/s] up to Nyquist: log, linear, and in clusters at the poles of the sliding loop."""
    poles = loop.poles()
    if loop.T:
        poles = np.log(np.where(poles == 0, 1e-300, poles).astype(complex)) / loop.T
    sizes = np.abs(poles[np.abs(poles) > 0])
    top = np.pi / loop.T if loop.T else 100 * sizes.max(initial=1.0)
    points = [np.geomspace(1e-5 * top, top, n // 2), np.linspace(top / n, top, n // 4)]
    for pole in poles[(poles.imag > 0) & (np.abs(poles) < top)]:
        width = max(abs(pole.real), 1e-6 * abs(pole))
        points.append(pole.imag + width * np.sinh(np.linspace(-3, 3, 31)))
    points.append(sizes)
    omega = np.unique(np.concatenate(points))
    return omega[(omega > 1e-6 * top) & (omega <= top)]


def mobility(loop: SlidingLoop, omega: np.ndarray) -> np.ndarray:
    """(W,) velocity at the port over friction at the same frequency; what the sampler folds elsewhere is left out."""
    return np.asarray(driven(loop, omega, loop.B, np.zeros(loop.B.size))[0] @ loop.v)


def driven(loop: SlidingLoop, omega: np.ndarray, flow: np.ndarray, struck: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(W, n) state at the frequency at which it is driven, and (W, n) state just before a sample, over its phase there.

    flow, struck : (n,) how exp(j w t) enters the flow, and how it enters at the first jump of a period (sampled only).

    With f = exp(j w t) the state repeats but for its phase. Its part at w follows from the flow by partial
    integration: (j w - F) xi_1 = B + (1/T) sum of the jumps, each with its phase.
    """
    n = loop.F.shape[0]
    # an undamped machine has its poles on the axis, where the two sides of that equation vanish together
    s = 1j * omega * (1 + 1e-9)
    pencil = s[:, None, None] * np.eye(n) - loop.F
    forced = np.linalg.solve(pencil, np.broadcast_to(flow.astype(complex)[:, None], (s.size, n, 1)))[..., 0]
    if not loop.T:
        return forced, forced
    flows = [expm(span * loop.F) for span in loop.spans]
    strikes = [struck, *[np.zeros(n)] * (len(flows) - 1)]
    # state before each jump as (matrix) start + (forced part)
    total, offset = np.eye(n), np.zeros((s.size, n), complex)
    before = []
    t = 0.0
    for phi, jump, hit, span in zip(flows, loop.jumps, strikes, loop.spans, strict=True):
        before.append((total, offset, t))
        total, offset = phi @ jump @ total, (offset @ jump.T + hit) @ phi.T
        offset = offset + np.exp(s * (t + span))[:, None] * forced - (np.exp(s * t)[:, None] * forced) @ phi.T
        t += span
    start = np.linalg.solve(np.exp(s * t)[:, None, None] * np.eye(n) - total, offset[..., None])[..., 0]
    jumped = np.zeros((s.size, n), complex)
    for (matrix, part, when), jump, hit in zip(before, loop.jumps, strikes, strict=True):
        jumped += np.exp(-s * when)[:, None] * ((start @ matrix.T + part) @ (jump - np.eye(n)).T + hit)
    answer = np.linalg.solve(pencil, jumped[..., None] / loop.T)[..., 0]
    return forced + answer, start
