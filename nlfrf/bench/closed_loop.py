"""A sampled controller around the rig: a design tried on the nonlinear machine.

                                 disturbance
r ---o--- K(z) --- delay --- [/] ---o--- hold --- rig ---+--- x
    -|                   saturation                      |
     +---------------- quantisation ---o-----------------+
                                     noise
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.bench.rig import Rig, some_samples
from nlfrf.friction import kernel_data as packing
from nlfrf.friction.hysteresis import warn_lost
from nlfrf.friction.integration import integrate
from nlfrf.friction.laws import packed_law
from nlfrf.shared.arguments import integer, nonnegative, positive, real, real_array
from nlfrf.shared.values import value

__all__ = ["LoopResponse", "simulate_loop"]


#: How often the step is halved before a loop that runs away is called diverged.
MOST_HALVINGS = 6
MOST_STEPS = 10_000  # integration steps per sample; what needs more is a mistake in mass or stiffness


@value
class LoopResponse:
    """What a loop did, sample by sample.

    Fields
    ------
    t : (n,) ndarray
        Time [s].
    r : (n,) ndarray
        Reference [m].
    u : (n,) ndarray
        What the controller asked for at each sample, saturated [N]; it reaches the rig after the delay.
    x, v : (n,) ndarray
        Position [m] and velocity [m/s] of the rig at the samples.
    y : (n,) ndarray
        Position as the controller saw it: with noise, quantised [m].
    friction : (n,) ndarray
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
        """(n,) error r - x [m]."""
        return self.r - self.x

    def residual(self, calm: float) -> float:
        """Rms error in the last quarter of the time after `calm` [s], over the rms error before; inf where it ran away.

        For a loop that was disturbed until then and left alone afterwards.
        """
        before, after = self.disturbed_and_left_alone(calm)
        return np.inf if self.diverged else rms(after[-(after.size // 4) :]) / max(rms(before), np.finfo(float).tiny)

    def outcome(self, calm: float) -> str:
        """What became of a loop that was disturbed until `calm` [s] and left alone afterwards.

        "settled": the last quarter of what follows has less than a hundredth of the rms error of before. "stable": on
        its way there, or creeping. "limit cycle": the error of that quarter is within 5 % of, or larger than, that of
        the quarter before. "ran away": the simulation had to stop.
        """
        if self.diverged:
            return "ran away"
        if self.residual(calm) < 1e-2:
            return "settled"
        _, after = self.disturbed_and_left_alone(calm)
        n = after.size // 4
        return "limit cycle" if rms(after[-n:]) > 0.95 * rms(after[-2 * n : -n]) else "stable"

    def disturbed_and_left_alone(self, calm: float) -> tuple[np.ndarray, np.ndarray]:
        """The error before and after `calm` [s]."""
        positive("calm", calm)
        before, after = self.e[self.t < calm], self.e[self.t >= calm]
        if not self.diverged and after.size < 8:
            raise ValueError(f"calm must leave at least 8 samples before the end at {self.t[-1]:g} s, got {calm:g} s")
        return before, after


def simulate_loop(
    rig: Rig,
    K: Any,
    r: Any,
    *,
    fs: float,
    saturation: float = np.inf,
    resolution: float = 0.0,
    delay: float = 0.0,
    disturbance: Any = None,
    noise: Any = None,
    oversampling: int = 4,
) -> LoopResponse:
    """Put a sampled controller around the rig, u = K (r - y), with a zero-order hold, and let it follow a reference.

    Parameters
    ----------
    rig : Rig
        The machine; it starts at rest.
    K : state space
        Anything with A, B, C, D and dt, one input and one output: force [N] from error [m]. Sampled, dt = 1/fs.
    r : (n,) ndarray
        Reference of the position [m], one value per sample.
    fs : float
        Sampling frequency of the controller [Hz].
    saturation : float
        Largest force the actuator gives, either way [N].
    resolution : float
        Step of the position sensor [m]; zero for none.
    delay : float
        From sampling to the force changing [s]; any part of a sample, or several.
    disturbance : (n,) ndarray, optional
        Force added to the controller's [N], held over each sample.
    noise : (n,) ndarray, optional
        Added to the measured position [m], before it is quantised.
    oversampling : int
        Integration steps per sample at least; more are taken where the rig needs them.

    Returns
    -------
    LoopResponse
        A loop that runs away is a result, not an error: `diverged` says so.

    Raises
    ------
    ValueError
        A controller that is continuous, of another sampling time, or not single-input single-output; arrays that do
        not fit; a rig that is far too fast for fs.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay).

    Examples
    --------
    An integrator brings the position to the reference; friction makes it take its time over the last of it.

    >>> from types import SimpleNamespace
    >>> from nlfrf.bench.rig import paper_rig
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> response = simulate_loop(paper_rig(), K, np.full(3000, 1e-3), fs=1000)
    >>> bool(abs(response.e[-1]) < 1e-5)
    True
    """
    fs = positive("fs", fs)
    controller = matrices(K, fs)
    r = some_samples("r", r)
    disturbance = fitted("disturbance", disturbance, r.size)
    noise = fitted("noise", noise, r.size)
    if not np.isposinf(real_or_infinite("saturation", saturation)):
        positive("saturation", saturation)
    resolution, delay = nonnegative("resolution", resolution), nonnegative("delay", delay)
    needed = int(np.ceil(1 / (fs * rig.stable_step)))
    if needed > MOST_STEPS:
        raise ValueError(
            f"fs must leave the rig at most {MOST_STEPS} integration steps a sample, got {fs:g} Hz with {needed}: "
            f"its stable step is {rig.stable_step:.2g} s"
        )
    steps = max(integer("oversampling", oversampling, least=1), needed)
    for halving in range(MOST_HALVINGS + 1):
        rows, lost = run_loop(rig, controller, r, fs, saturation, resolution, delay * fs, disturbance, noise, steps)
        if rows.shape[0] == r.size or halving == MOST_HALVINGS:
            break
        steps *= 2
    warn_lost(lost)
    n = rows.shape[0]
    x, v, y, u, friction = rows.T
    return LoopResponse(t=np.arange(n) / fs, r=r[:n], u=u, x=x, v=v, y=y, friction=friction, diverged=bool(n < r.size))


def run_loop(
    rig: Rig,
    controller: tuple[np.ndarray, np.ndarray, np.ndarray, float],
    r: np.ndarray,
    fs: float,
    saturation: float,
    resolution: float,
    delay: float,
    disturbance: np.ndarray,
    noise: np.ndarray,
    steps: int,
) -> tuple[np.ndarray, float]:
    """(n, 5) x, v, y, u and friction at each sample, up to where the rig ran away, and the turning points lost."""
    A, B, C, D = controller
    law, grid = packed_law(rig.friction)
    body = packing.Body(False, float(rig.mass), float(rig.stiffness), float(rig.damping))
    memory = packing.at_rest(law.curve, grid)
    delay = min(delay, r.size)  # all later is after the end
    whole, part = int(delay), delay - int(delay)
    state = np.zeros(A.shape[0])
    asked = np.zeros(r.size + whole + 1)  # the force from sample k - whole on stands at k
    rows = np.empty((r.size, 5))
    for k in range(r.size):
        y = memory.state[packing.X] + noise[k]
        if resolution > 0:
            y = resolution * np.round(y / resolution)
        e = r[k] - y
        with np.errstate(over="ignore", invalid="ignore"):  # of a loop that is running away
            u = float(np.clip(C @ state + D * e, -saturation, saturation))
            state = A @ state + B * e
        asked[k + whole] = u
        begin = None
        for span, force in ((part, asked[k - 1] if k > 0 else 0.0), (1 - part, asked[k])):
            if span > 0:
                n = int(np.ceil(span * steps))
                drive = np.full((n, 3), force + disturbance[k])
                out = integrate(body, law, grid, memory, drive, span / (n * fs), n)
                if out is None:
                    return rows[:k], memory.state[packing.LOST]
                begin = out[0] if begin is None else begin
        if begin is not None:
            rows[k] = begin[0], begin[1], y, u, begin[3]
    return rows, memory.state[packing.LOST]


def matrices(K: Any, fs: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """A (s, s), B (s,), C (s,) and D of a sampled controller with one input and one output."""
    missing = [name for name in ("A", "B", "C", "D", "dt") if not hasattr(K, name)]
    if missing:
        raise ValueError(f"K must have A, B, C, D and dt, got {type(K).__name__} without {', '.join(missing)}")
    dt = K.dt
    if isinstance(dt, (bool, np.bool_)) or dt is None or dt == 0:
        raise ValueError(f"K must be sampled with dt = 1/fs = {1 / fs:g} s, got dt = {dt}. Discretise it first")
    if abs(float(dt) * fs - 1) > 1e-6:
        raise ValueError(f"K must be sampled with dt = 1/fs = {1 / fs:g} s, got dt = {float(dt):g} s")
    given = {name: np.asarray(getattr(K, name)) for name in ("A", "B", "C", "D")}
    for name, matrix in given.items():
        if matrix.dtype.kind not in "fiu":
            raise ValueError(f"K must have real matrices, got {name} of dtype {matrix.dtype}")
        if not np.isfinite(matrix).all():
            raise ValueError(f"K must have finite matrices, got a number in {name} that is not")
    A, B, C, D = (matrix.astype(float) for matrix in given.values())
    D = np.atleast_2d(D)
    if D.shape != (1, 1):
        raise ValueError(f"K must have one input and one output, got {D.shape[1]} and {D.shape[0]}")
    size = B.size
    if A.size != size**2 or C.size != size:
        raise ValueError(
            f"K must have A (s, s), B (s, 1) and C (1, s), got shapes "
            f"{given['A'].shape}, {given['B'].shape} and {given['C'].shape}"
        )
    return A.reshape(size, size), B.reshape(size), C.reshape(size), float(D[0, 0])


def fitted(name: str, signal: Any, n: int) -> np.ndarray:
    """A signal of n samples; zeros when not given."""
    if signal is None:
        return np.zeros(n)
    signal = real_array(name, signal, ndim=1)
    if signal.size != n:
        raise ValueError(f"{name} must have one value for each of the {n} samples of r, got {signal.size}")
    return signal


def rms(x: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(x**2)))


def real_or_infinite(name: str, number: Any) -> float:
    """A real number that may be infinite."""
    return np.inf if isinstance(number, float) and np.isposinf(number) else real(name, number)
