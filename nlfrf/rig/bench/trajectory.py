"""`Trajectory`: the motion of a simulated machine, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_positive, require_real_array
from nlfrf._base.values import value

#: Peak-to-peak error over that while disturbed, below which a channel is at rest.
_MIN_SWING = 1e-6
#: Largest peak-to-peak error, and drift of the friction, of a settled loop, over the values while
#: disturbed.
_MAX_SETTLED_SWING = 1e-2


@value(copy=False)
class Trajectory:
    """Motion of a simulated machine, sample by sample.

    Each signal is also an attribute: ``moved.x`` is ``moved.signals["x"]``.

    Fields
    ------
    t : (n,) ndarray
        Time [s].
    signals : dict of str to (n,) ndarray
        Each signal is (n,), or (channels, n) for several channels. Every machine has position `x`,
        velocity `v` and friction force `friction`. In a loop around several axes `x` and `v` are
        those of the sensors; for a servo axis they are those of motor and load. A friction law also
        has the deflection `z`.

        Without a controller `drive` is the force or the prescribed velocity. With a controller `r`
        is the reference, `u` the force of the controller after its limit, and `y` the measured
        position. A servo axis has the signals of its drive: `position_set`, `position`,
        `velocity_set`, `velocity`, `current_set`, `current`, `force_set`, `force`, and `limited`,
        which is true while the current is limited.
    units : dict of str to str
        Unit of each signal.
    diverged : bool
        True if the simulated loop was unstable and the motion grew beyond limits; the arrays end
        there.

    Examples
    --------
    >>> import control
    >>> from nlfrf import paper_rig
    >>> from nlfrf.rig import run
    >>> K = control.ss(control.tf([2e3, 0], [1, -1], 1e-3))                 # an integrator
    >>> moved = run(paper_rig(), np.full(500, 1e-6), K)
    >>> moved.diverged, bool(abs(moved.e[-1]) < 1e-7), moved.units["u"]
    (False, True, 'N')
    """

    t: np.ndarray
    signals: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    diverged: bool = False

    def __post_init__(self) -> None:
        for signal in self.signals.values():
            signal.setflags(write=False)

    def __getattr__(self, name: str) -> np.ndarray:
        signals: Mapping[str, np.ndarray] = self.__dict__.get("signals", {})
        if name not in signals:
            raise AttributeError(
                f"a Trajectory has no signal {name!r}, this one has {', '.join(signals) or 'none'}"
            )
        return signals[name]

    def __dir__(self) -> list[str]:
        """Return the attributes, signals included."""
        return sorted({*super().__dir__(), *self.signals})

    @property
    def e(self) -> np.ndarray:
        """(n,) or (n_y, n) ndarray: control error r - x."""
        return self.r - self.x

    def residual(self, calm: float) -> float:
        """Return the peak-to-peak error in the last quarter of the time after `calm` [s], divided
        by that before `calm`.

        Use it for a loop that is disturbed until `calm` and undisturbed afterwards. It is zero for
        a loop at rest at any position, and inf if the motion diverged. For several channels it is
        the largest of these ratios.
        """
        before, after = self._split_error(calm)
        if self.diverged:
            return np.inf
        return float(
            np.max(_peak_to_peak(after[..., -(after.shape[-1] // 4) :]) / _disturbed_swing(before))
        )

    def outcome(self, calm: float) -> str:
        """Classify a loop that is disturbed until `calm` [s] and undisturbed afterwards.

        The result follows from the peak-to-peak error in quarters of the time after `calm`:

        - "limit cycle": in some channel the error of the last quarter is at least 95 % of that of the
          quarter before, and more than a millionth of the error before `calm`
        - "settled": in every channel the error of the last quarter is below 1 % of the error before
          `calm`, and the friction force no longer drifts
        - "stable": neither; the motion still decays or creeps, or the mass sticks while an integrator
          winds up
        - "ran away": the motion diverged
        """
        if self.diverged:
            return "ran away"
        before, after = self._split_error(calm)
        n = after.shape[-1] // 4
        last, earlier = _peak_to_peak(after[..., -n:]), _peak_to_peak(after[..., -2 * n : -n])
        if np.any(last > np.maximum(0.95 * earlier, _MIN_SWING * _disturbed_swing(before))):
            return "limit cycle"
        held = self.friction[..., -2 * n :]
        usual = np.median(np.abs(self.friction[..., self.t < calm]), axis=-1)
        waits = np.any(
            np.abs(held[..., n:].mean(axis=-1) - held[..., :n].mean(axis=-1))
            > _MAX_SETTLED_SWING * usual
        )
        if self.residual(calm) < _MAX_SETTLED_SWING and not waits:
            return "settled"
        return "stable"

    def _split_error(self, calm: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the error before and after `calm` [s]."""
        require_positive("calm", calm)
        before, after = self.e[..., self.t < calm], self.e[..., self.t >= calm]
        if not self.diverged and after.shape[-1] < 8:
            raise ValueError(
                f"calm must leave at least 8 samples before the end at {self.t[-1]:g} s, got"
                f" {calm:g} s"
            )
        return before, after


def _peak_to_peak(x: np.ndarray) -> np.ndarray:
    """Return the difference of largest and smallest value, () or (channels,)."""
    if x.size:
        return np.ptp(x, axis=-1)
    return np.zeros(x.shape[:-1])


def _disturbed_swing(before: np.ndarray) -> np.ndarray:
    """Return the peak-to-peak error of each channel while disturbed, at least `_MIN_SWING` of the
    largest one.
    """
    found = _peak_to_peak(before)
    return np.maximum(found, max(_MIN_SWING * found.max(), np.finfo(float).tiny))


def require_samples(name: str, signal: ArrayLike, *, channels: int | None = None) -> np.ndarray:
    """Return the signal (n,), or (channels, n) if channels are given, as an array of at least one
    sample.
    """
    samples = require_real_array(name, signal, ndim=1 if channels is None else 2)
    if channels is not None and len(samples) != channels:
        raise ValueError(f"{name} must have {channels} channels, like the rig, got {len(samples)}")
    if samples.size == 0:
        raise ValueError(f"{name} must hold at least one sample, got none")
    return samples
