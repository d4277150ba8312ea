"""What a loop around the rig did, and what became of it."""

from __future__ import annotations

import numpy as np

from nlfrf.shared.arguments import positive
from nlfrf.shared.values import value

__all__ = ["LoopResponse"]

#: Of the swing while disturbed: what is smaller is rest.
SMALLEST_SWING = 1e-6
#: Of the swing while disturbed, and of the usual friction then: what has settled swings, and its friction drifts, less.
SETTLED = 1e-2


@value
class LoopResponse:
    """What a loop did, sample by sample.

    Fields
    ------
    t : (n,) ndarray
        Time [s].
    r : (n,) or (n_y, n) ndarray
        Reference [m].
    u : (n,) or (n_u, n) ndarray
        What the controller asked for at each sample, saturated [N]; it reaches the rig after the delay.
    x, v : (n,) or (n_y, n) ndarray
        Position [m] and velocity [m/s] of the rig at the samples, where it is measured.
    y : (n,) or (n_y, n) ndarray
        Position as the controller saw it: with noise, quantised [m].
    friction : (n,) or (axes, n) ndarray
        Friction force [N].
    diverged : bool
        Whether the loop ran away; the arrays end there.

    Examples
    --------
    >>> import control
    >>> from nlfrf import paper_rig, simulate_loop
    >>> K = control.ss(control.tf([2e3, 0], [1, -1], 1e-3))                 # an integrator
    >>> response = simulate_loop(paper_rig(), K, np.full(500, 1e-6), fs=1000)
    >>> response.diverged, bool(abs(response.e[-1]) < 1e-7)
    (False, True)
    """

    t: np.ndarray
    r: np.ndarray
    u: np.ndarray
    x: np.ndarray
    v: np.ndarray
    y: np.ndarray
    friction: np.ndarray
    diverged: bool

    @property
    def e(self) -> np.ndarray:
        """(n,) or (n_y, n) error r - x [m]."""
        return self.r - self.x

    def residual(self, calm: float) -> float:
        """Swing in the last quarter of the time after `calm` [s], over the swing before; inf where it ran away.

        For a loop that was disturbed until then and left alone afterwards. The swing is between the largest and the
        smallest error: a loop at rest has none, wherever it rests. Of several channels the one that is left with most
        of its own counts, be it small beside that of another.
        """
        before, after = self.disturbed_and_left_alone(calm)
        if self.diverged:
            return np.inf
        return float(np.max(swing(after[..., -(after.shape[-1] // 4) :]) / usual_swing(before)))

    def outcome(self, calm: float) -> str:
        """What became of a loop that was disturbed until `calm` [s] and left alone afterwards, judged by its swing.

        "limit cycle": the swing of some channel in the last quarter of what follows is within 5 % of, or larger than,
        that of the quarter before, however small, down to a millionth of the swing before. "settled": less than a
        hundredth of it in every channel, and the friction no longer drifts: what sticks while an integrator winds up is
        not at rest. "stable": on its way there, creeping, or about to slip. "ran away": the simulation had to stop.
        """
        if self.diverged:
            return "ran away"
        before, after = self.disturbed_and_left_alone(calm)
        n = after.shape[-1] // 4
        last, earlier = swing(after[..., -n:]), swing(after[..., -2 * n : -n])
        if np.any(last > np.maximum(0.95 * earlier, SMALLEST_SWING * usual_swing(before))):
            return "limit cycle"
        held = self.friction[..., -2 * n :]
        usual = np.median(np.abs(self.friction[..., self.t < calm]), axis=-1)
        waits = np.any(np.abs(held[..., n:].mean(axis=-1) - held[..., :n].mean(axis=-1)) > SETTLED * usual)
        return "settled" if self.residual(calm) < SETTLED and not waits else "stable"

    def disturbed_and_left_alone(self, calm: float) -> tuple[np.ndarray, np.ndarray]:
        """The error before and after `calm` [s]."""
        positive("calm", calm)
        before, after = self.e[..., self.t < calm], self.e[..., self.t >= calm]
        if not self.diverged and after.shape[-1] < 8:
            raise ValueError(f"calm must leave at least 8 samples before the end at {self.t[-1]:g} s, got {calm:g} s")
        return before, after


def swing(x: np.ndarray) -> np.ndarray:
    """() or (channels,) largest less smallest."""
    return np.ptp(x, axis=-1) if x.size else np.zeros(x.shape[:-1])


def usual_swing(before: np.ndarray) -> np.ndarray:
    """The swing of each channel while disturbed; of one that hardly moved what is rest beside the others."""
    found = swing(before)
    return np.maximum(found, max(SMALLEST_SWING * found.max(), np.finfo(float).tiny))
