"""A sampled controller around the rig: a design tried on the nonlinear machine.

                                 disturbance
r ---o--- K(z) --- delay --- [/] ---o--- hold --- rig ---+--- x
    -|                   saturation                      |
     +---------------- quantisation ---o-----------------+
                                     noise
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    require_real,
    require_real_array,
)
from nlfrf._base.values import value
from nlfrf.rig.bench import machine as axes
from nlfrf.rig.bench.motion import require_samples
from nlfrf.rig.bench.rig import Rig, initial_memory, require_one_axis
from nlfrf.rig.bench.simulate import Arrays, Progress, run_each
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.hysteresis import warn_of_forgotten_loops
from nlfrf.rig.laws.laws import UserLawData, pack_law


def controller_matrices(K: object, fs: float, *, n_inputs: int = 1, n_outputs: int = 1) -> tuple[np.ndarray, ...]:
    """Return A (s, s), B (s, n_inputs), C (n_outputs, s) and D of a sampled controller, checked."""
    missing = [name for name in ("A", "B", "C", "D", "dt") if not hasattr(K, name)]
    if missing:
        raise ValueError(f"K must have A, B, C, D and dt, got {type(K).__name__} without {', '.join(missing)}")
    dt = getattr(K, "dt")  # noqa: B009 - anything with these attributes is a controller
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
    if D.shape != (n_outputs, n_inputs):
        wanted = (
            "one input and one output"
            if (n_inputs, n_outputs) == (1, 1)
            else f"{n_inputs} inputs and {n_outputs} outputs"
        )
        raise ValueError(f"K must have {wanted}, got {D.shape[1]} and {D.shape[0]}")
    size = int(np.sqrt(A.size))
    if A.size != size**2 or B.size != size * n_inputs or C.size != size * n_outputs:
        raise ValueError(
            f"K must have A (s, s), B (s, {n_inputs}) and C ({n_outputs}, s), got shapes "
            f"{given['A'].shape}, {given['B'].shape} and {given['C'].shape}"
        )
    return A.reshape(size, size), B.reshape(size, n_inputs), C.reshape(n_outputs, size), D


#: Of the peak-to-peak error while disturbed: below it a channel is at rest.
MIN_SWING = 1e-6
#: Of the peak-to-peak error, and of the usual friction, while disturbed: the most that a settled loop still has.
MAX_SETTLED_SWING = 1e-2


@value
class LoopResponse:
    """Response of a loop, sample by sample.

    Fields
    ------
    t : (n,) ndarray
        Time [s].
    r : (n,) or (n_y, n) ndarray
        Reference [m].
    u : (n,) or (n_u, n) ndarray
        Force commanded by the controller at each sample, saturated [N]; it reaches the rig after the delay.
    x, v : (n,) or (n_y, n) ndarray
        Position [m] and velocity [m/s] of the rig at the samples, where it is measured.
    y : (n,) or (n_y, n) ndarray
        Position as the controller reads it: with noise, quantised [m].
    friction : (n,) or (axes, n) ndarray
        Friction force [N].
    diverged : bool
        Whether the loop diverged; the arrays end there.

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
        """Return the peak-to-peak error in the last quarter after `calm` [s] over that before; inf where it diverged.

        For a loop that is disturbed until `calm` and undisturbed afterwards. A loop at rest has zero, wherever it
        rests. With several channels the largest of these ratios counts.
        """
        before, after = self.split_error(calm)
        if self.diverged:
            return np.inf
        return float(np.max(peak_to_peak(after[..., -(after.shape[-1] // 4) :]) / disturbed_swing(before)))

    def outcome(self, calm: float) -> str:
        """Classify a loop that is disturbed until `calm` [s] and undisturbed afterwards, by its peak-to-peak error.

        "limit cycle": in some channel the peak-to-peak error of the last quarter is within 5 % of, or above, that of
        the quarter before it, down to a millionth of the error while disturbed. "settled": below a hundredth of it in
        every channel, and the friction no longer drifts: a mass that sticks while an integrator winds up is not at
        rest. "stable": still decaying, creeping, or about to slip. "ran away": the simulation diverged.
        """
        if self.diverged:
            return "ran away"
        before, after = self.split_error(calm)
        n = after.shape[-1] // 4
        last, earlier = peak_to_peak(after[..., -n:]), peak_to_peak(after[..., -2 * n : -n])
        if np.any(last > np.maximum(0.95 * earlier, MIN_SWING * disturbed_swing(before))):
            return "limit cycle"
        held = self.friction[..., -2 * n :]
        usual = np.median(np.abs(self.friction[..., self.t < calm]), axis=-1)
        waits = np.any(np.abs(held[..., n:].mean(axis=-1) - held[..., :n].mean(axis=-1)) > MAX_SETTLED_SWING * usual)
        return "settled" if self.residual(calm) < MAX_SETTLED_SWING and not waits else "stable"

    def split_error(self, calm: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the error before and after `calm` [s]."""
        require_positive("calm", calm)
        before, after = self.e[..., self.t < calm], self.e[..., self.t >= calm]
        if not self.diverged and after.shape[-1] < 8:
            raise ValueError(f"calm must leave at least 8 samples before the end at {self.t[-1]:g} s, got {calm:g} s")
        return before, after


def peak_to_peak(x: np.ndarray) -> np.ndarray:
    """Return the largest less the smallest value, () or (channels,)."""
    return np.ptp(x, axis=-1) if x.size else np.zeros(x.shape[:-1])


def disturbed_swing(before: np.ndarray) -> np.ndarray:
    """Return the peak-to-peak error of each channel while disturbed, floored at `MIN_SWING` of the largest one."""
    found = peak_to_peak(before)
    return np.maximum(found, max(MIN_SWING * found.max(), np.finfo(float).tiny))


#: Halvings of the step after which a loop that still runs away counts as diverged.
MAX_HALVINGS = 6


def simulate_axes_loop(
    rig: Rig,
    K: object,
    *,
    r: ArrayLike,
    fs: float,
    saturation: ArrayLike,
    resolution: ArrayLike,
    delay: float,
    disturbance: ArrayLike | None,
    noise: ArrayLike | None,
    initial: ArrayLike,
    steps: int,
) -> LoopResponse:
    """Simulate a sampled controller matrix around a rig of matrices; arguments as of `simulate_loop`."""
    r = require_samples("r", r, channels=rig.n_outputs)
    n = r.shape[1]
    controller = [
        np.ascontiguousarray(part)
        for part in controller_matrices(K, fs, n_inputs=rig.n_outputs, n_outputs=rig.n_inputs)
    ]
    limits = (
        broadcast_limit("saturation", saturation, rig.n_inputs),
        broadcast_limit("resolution", resolution, rig.n_outputs),
    )
    signals = [
        channel_samples("disturbance", disturbance, n_channels=rig.n_inputs, n=n),
        channel_samples("noise", noise, n_channels=rig.n_outputs, n=n),
    ]
    begin = initial_axes(initial, rig.n_axes)
    late = min(require_nonnegative("delay", delay) * fs, n)  # all later is after the end
    for halving in range(MAX_HALVINGS + 1):  # what does not reach the end is run again before it is believed
        numbers = fs, *limits, late, steps * 2**halving
        length, found, lost = run_axes_once(
            rig, controller, r=np.ascontiguousarray(r.T), signals=signals, begin=begin, numbers=numbers
        )
        if length == n:
            break
    warn_of_forgotten_loops(lost)
    x, v, friction, y, u = (part[:, :length] for part in found)
    t, ran_away = np.arange(length) / fs, length < n
    return LoopResponse(t=t, r=r[:, :length], u=u, x=x, v=v, y=y, friction=friction, diverged=ran_away)


def run_axes_once(
    rig: Rig,
    controller: list[np.ndarray],
    *,
    r: np.ndarray,
    signals: list[np.ndarray],
    begin: np.ndarray,
    numbers: tuple[float | np.ndarray, ...],
) -> tuple[int, list[np.ndarray], float]:
    """Call the compiled code once: samples reached, channels (.., n) of x, v, friction, y and u, loops forgotten."""
    from nlfrf.rig.kernels.coupled import run_axes_loop

    memory = initial_memory(rig)
    laws, grids = axes.pack_laws(rig.friction)
    memory.state[:, packing.X], memory.state[:, packing.V] = begin
    dry = laws[:, 0] == packing.COULOMB
    memory.state[dry, packing.DIRECTION] = np.sign(begin[1, dry])
    rows = np.zeros((len(r), 4, rig.n_axes))
    y, u = np.zeros((len(r), rig.n_outputs)), np.zeros((len(r), rig.n_inputs))
    machine = axes.stack_matrices(rig.mass, rig.stiffness, damping=rig.damping, cubic=rig.cubic)
    places = np.array(rig.sensors), np.array(rig.actuators)
    length = run_axes_loop(
        machine, laws, grids, memory.state, memory.stack, *places, *controller, r, *signals, *numbers, rows, y, u
    )
    x, v = rig.sensors @ rows[:, 0].T, rig.sensors @ rows[:, 1].T
    return int(length), [x, v, rows[:, 3].T, y.T, u.T], float(memory.state[:, packing.LOST].sum())


def broadcast_limit(name: str, given: ArrayLike, n: int) -> np.ndarray:
    """Return (n,) limits from one for all channels or one for each; a saturation may be infinite, a resolution zero."""
    if np.ndim(given) > 0 and np.shape(given) != (n,):
        raise ValueError(f"{name} must be one number or {n}, one a channel, got shape {np.shape(given)}")
    check = require_nonnegative if name == "resolution" else require_positive
    found = np.broadcast_to(np.asarray(given, dtype=float), (n,)).tolist()
    return np.array([one if name == "saturation" and one == np.inf else check(name, one) for one in found])


def channel_samples(name: str, signal: ArrayLike | None, *, n_channels: int, n: int) -> np.ndarray:
    """Return (n, channels) samples; zeros when not given."""
    if signal is None:
        return np.zeros((n, n_channels))
    signal = require_real_array(name, signal, ndim=2)
    if signal.shape != (n_channels, n):
        raise ValueError(f"{name} must have shape ({n_channels}, {n}), channels and samples of r, got {signal.shape}")
    return np.ascontiguousarray(signal.T)


def initial_axes(initial: ArrayLike, n: int) -> np.ndarray:
    """Return (2, n) positions and velocities of the axes; a single pair is that of every axis."""
    initial = np.asarray(initial, dtype=float)
    if initial.shape == (2,):
        initial = np.repeat(initial[:, None], n, axis=1)
    if initial.shape != (2, n):
        raise ValueError(f"initial must hold positions and velocities, shape (2, {n}), got shape {initial.shape}")
    return require_real_array("initial", initial, ndim=2)


Result = TypeVar("Result")


@value(copy=False)
class LoopRuns:
    """Runs of sampled loops around one rig.

    Fields
    ------
    rig : Rig
    fs, saturation, resolution : float
    steps : int
        Integration steps a sample.
    A, B, C, D : (R, s, s), (R, s), (R, s), (R,) ndarray
        Controllers.
    r, disturbance, noise : (R, n) ndarray
    delays : (R,) ndarray
        In samples.
    initial : (R, 2) ndarray
        Position and velocity.
    """

    rig: Rig
    fs: float
    saturation: float
    resolution: float
    steps: int
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    r: np.ndarray
    disturbance: np.ndarray
    noise: np.ndarray
    delays: np.ndarray
    initial: np.ndarray

    def select_runs(self, rows: np.ndarray, steps: int) -> LoopRuns:
        """Return some of the runs, with other steps."""
        return replace(
            self,
            steps=steps,
            A=select_rows(self.A, rows),
            B=select_rows(self.B, rows),
            C=select_rows(self.C, rows),
            D=select_rows(self.D, rows),
            r=select_rows(self.r, rows),
            disturbance=select_rows(self.disturbance, rows),
            noise=select_rows(self.noise, rows),
            delays=select_rows(self.delays, rows),
            initial=select_rows(self.initial, rows),
        )

    def __reduce__(self) -> tuple[Callable[..., LoopRuns], tuple[object, ...]]:
        """Pickle rows that all runs share once."""
        held = {field.name: getattr(self, field.name) for field in fields(self)}
        once = [name for name, part in held.items() if isinstance(part, np.ndarray) and part.strides[0] == 0]
        return rebuild_runs, (held | {name: held[name][:1] for name in once}, once, self.delays.size)


def select_rows(rows: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Select rows by index; a broadcast row stays broadcast."""
    return np.broadcast_to(rows[:1], (chosen.size, *rows.shape[1:])) if rows.strides[0] == 0 else rows[chosen]


def rebuild_runs(held: dict[str, Any], once: list[str], n: int) -> LoopRuns:
    """Return the runs from their pickled parts, of which `once` were a single row."""
    every = {name: np.broadcast_to(held[name], (n, *held[name].shape[1:])) for name in once}
    return LoopRuns(**(held | every))


class RunBatches(Sequence[LoopRuns]):
    """Runs in batches of at most `most`, each made when it is indexed."""

    def __init__(self, runs: LoopRuns, most: int) -> None:
        n = runs.delays.size
        self.runs, self.rows = runs, np.array_split(np.arange(n), -(-n // most))

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, i: int) -> LoopRuns:  # type: ignore[override]  # nobody asks for slices
        return self.runs.select_runs(self.rows[i], self.runs.steps)


def simulate_runs(runs: LoopRuns) -> dict[str, np.ndarray]:
    """rows (R, n, 5) of x, v, y, u and friction at each sample, lengths up to where a run ran away, loops lost.

    What does not reach the end is run again with shorter steps, before it is believed.
    """
    found = attempt(runs)
    for halving in range(1, MAX_HALVINGS + 1):
        short = np.flatnonzero(found["lengths"] < runs.r.shape[1])
        if not short.size:
            break
        again = attempt(runs.select_runs(short, runs.steps * 2**halving))
        for name, part in again.items():
            found[name][short] = part
    return found


def attempt(runs: LoopRuns) -> dict[str, np.ndarray]:
    """One call of the compiled code for all runs."""
    n_runs, n = runs.r.shape
    law, grid = pack_law(runs.rig.friction)
    body = packing.Body(False, float(runs.rig.mass), float(runs.rig.stiffness), float(runs.rig.damping))
    memory = packing.initial_memory(law.curve, grid)
    states = np.tile(memory.state, (n_runs, 1))
    stacks = np.tile(memory.stack, (n_runs, 1, 1))
    states[:, packing.X], states[:, packing.V] = runs.initial.T
    if law.form == packing.COULOMB:
        states[:, packing.DIRECTION] = np.sign(runs.initial[:, 1])
    run_loops = loops_kernel(law)
    if isinstance(law, UserLawData):
        stacks[:, 0, : law.functions.rest.size] = law.functions.rest
    rows, lengths = np.zeros((n_runs, n, 5)), np.zeros(n_runs, dtype=np.int64)
    # copies: the code was compiled for arrays that can be written
    controllers = [np.array(part, order="C") for part in (runs.A, runs.B, runs.C, runs.D)]
    signals = [np.array(part, order="C") for part in (runs.r, runs.disturbance, runs.noise)]
    numbers = float(runs.fs), float(runs.saturation), float(runs.resolution)
    places = np.array(grid), states, stacks
    run_loops(
        body,
        packing.Law(*law),
        *places,
        *controllers,
        *signals,
        *numbers,
        np.array(runs.delays, order="C"),
        int(runs.steps),
        rows,
        lengths,
    )
    return {"rows": rows, "lengths": lengths, "lost": states[:, packing.LOST].copy()}


def loops_kernel(law: packing.Law) -> Callable[..., None]:
    """Return the compiled loops around a law."""
    if isinstance(law, UserLawData):
        from nlfrf.rig.kernels.loops import user_law_loops

        return user_law_loops(law.functions.derivative, law.functions.force, law.functions.rest.size)
    from nlfrf.rig.kernels.loops import run_loops

    return run_loops


@dataclass(frozen=True)
class ReducedRuns:
    """A task that simulates loops and returns `of(response)` of each, so that little travels between processes."""

    of: Callable[[LoopResponse], object]

    def __call__(self, runs: LoopRuns) -> Arrays:
        out = simulate_runs(runs)
        try:
            return {"found": object_array(collect_results(runs, out, self.of)), "lost": out["lost"]}
        except Exception as error:  # an error of the function, not of the executor: raised in `collect_results`
            return {"refused": object_array([error]), "lost": out["lost"]}


def object_array(items: list[object]) -> np.ndarray:
    """Return an (n,) array of the items as objects."""
    held = np.empty(len(items), dtype=object)
    for i, item in enumerate(items):
        held[i] = item
    return held


def collect_results(runs: LoopRuns, out: Arrays, of: Callable[[LoopResponse], object] | None) -> list[Any]:
    """Return the responses of computed runs, or `of(response)` of each."""
    if "refused" in out:
        raise out["refused"][0]
    if "found" in out:
        return list(out["found"])
    responses = to_responses(runs, out)
    return responses if of is None else [of(response) for response in responses]


def to_responses(runs: LoopRuns, out: Arrays) -> list[LoopResponse]:
    """Return the output of the compiled code as responses; arrays end where a loop diverged."""
    found = []
    for r, rows, n in zip(runs.r, out["rows"], out["lengths"], strict=True):
        x, v, y, u, friction = rows[:n].T
        ran_away = bool(n < r.size)
        t = np.arange(n) / runs.fs
        found.append(LoopResponse(t=t, r=r[:n], u=u, x=x, v=v, y=y, friction=friction, diverged=ran_away))
    return found


def can_pickle(of: Callable[[LoopResponse], object]) -> bool:
    """Return whether a function can be pickled to another process: not a lambda, nor a function of a notebook."""
    try:
        sent = pickle.dumps(of)
    except Exception:  # pickle raises anything
        return False
    return b"__main__" not in sent or hasattr(sys.modules["__main__"], "__file__")


MAX_STEPS_PER_SAMPLE = 10_000  # integration steps per sample; what needs more is a mistake in mass or stiffness
MAX_BATCH_SAMPLES = 250_000  # samples that one task of an executor holds: 10 MB, a second or less


def simulate_loop(
    rig: Rig,
    K: object,
    r: ArrayLike,
    *,
    fs: float,
    saturation: ArrayLike = np.inf,
    resolution: ArrayLike = 0.0,
    delay: float = 0.0,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    initial: ArrayLike = (0.0, 0.0),
    oversampling: int = 4,
) -> LoopResponse:
    """Simulate a sampled controller around the rig, u = K (r - y), with a zero-order hold, following a reference.

    Around a rig of matrices it is a controller matrix, full or one loop an axis; signals have a channel axis in front.

    Parameters
    ----------
    rig : Rig
        The machine.
    K : state space
        Anything with A, B, C, D and dt: forces [N] from errors [m], n_y inputs and n_u outputs. Sampled, dt = 1/fs.
    r : (n,) or (n_y, n) ndarray
        Reference of the measured positions [m], one value per sample.
    fs : float
        Sampling frequency of the controller [Hz].
    saturation : float or (n_u,) ndarray
        Largest force the actuators give, either way [N].
    resolution : float or (n_y,) ndarray
        Step of the position sensors [m]; zero for none.
    delay : float
        From sampling to the force changing [s]; any part of a sample, or several.
    disturbance : (n,) or (n_u, n) ndarray, optional
        Force added to the controller's [N], held over each sample.
    noise : (n,) or (n_y, n) ndarray, optional
        Added to the measured position [m], before it is quantised.
    initial : (2,) or (2, axes) ndarray
        Position [m] and velocity [m/s] that the rig begins with, its friction relaxed.
    oversampling : int
        Integration steps per sample at least; more are taken where the rig needs them.

    Returns
    -------
    LoopResponse
        A loop that runs away is a result, not an error: `diverged` says so.

    Raises
    ------
    ValueError
        A controller that is continuous, of another sampling time, or of other inputs and outputs than the rig; arrays
        that do not fit; a rig that is far too fast for fs.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay).

    Examples
    --------
    An integrator brings the position to the reference; friction makes it take its time over the last of it.

    >>> from types import SimpleNamespace
    >>> from nlfrf.rig.bench.rig import paper_rig
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> response = simulate_loop(paper_rig(), K, np.full(3000, 1e-3), fs=1000)
    >>> bool(abs(response.e[-1]) < 1e-5)
    True
    """
    require_kind("rig", rig, Rig)
    if rig.several:
        fs = require_positive("fs", fs)
        steps = steps_per_sample(rig, fs, oversampling)
        return simulate_axes_loop(
            rig,
            K,
            r=r,
            fs=fs,
            saturation=saturation,
            resolution=resolution,
            delay=delay,
            disturbance=disturbance,
            noise=noise,
            initial=initial,
            steps=steps,
        )
    r = require_samples("r", r)
    runs = stack_runs(
        rig,
        [K],
        r=r[None],
        fs=fs,
        saturation=saturation,
        resolution=resolution,
        delay=delay,
        initial=np.atleast_2d(initial),
        oversampling=oversampling,
        disturbance=samples_or_zeros("disturbance", disturbance, r.size)[None],
        noise=samples_or_zeros("noise", noise, r.size)[None],
    )
    out = simulate_runs(runs)
    warn_of_forgotten_loops(float(out["lost"].max()))
    return to_responses(runs, out)[0]


@overload
def simulate_loops(
    rig: Rig,
    controllers: object,
    r: ArrayLike,
    *,
    fs: float,
    saturation: float = ...,
    resolution: float = ...,
    delay: ArrayLike = ...,
    disturbance: ArrayLike | None = ...,
    noise: ArrayLike | None = ...,
    initial: ArrayLike = ...,
    oversampling: int = ...,
    executor: Executor | None = ...,
    progress: Progress | None = ...,
    resume: str | os.PathLike[str] | None = ...,
    of: None = ...,
) -> list[LoopResponse]: ...


@overload
def simulate_loops(
    rig: Rig,
    controllers: object,
    r: ArrayLike,
    *,
    fs: float,
    saturation: float = ...,
    resolution: float = ...,
    delay: ArrayLike = ...,
    disturbance: ArrayLike | None = ...,
    noise: ArrayLike | None = ...,
    initial: ArrayLike = ...,
    oversampling: int = ...,
    executor: Executor | None = ...,
    progress: Progress | None = ...,
    resume: str | os.PathLike[str] | None = ...,
    of: Callable[[LoopResponse], Result],
) -> list[Result]: ...


def simulate_loops(
    rig: Rig,
    controllers: object,
    r: ArrayLike,
    *,
    fs: float,
    saturation: float = np.inf,
    resolution: float = 0.0,
    delay: ArrayLike = 0.0,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    initial: ArrayLike = (0.0, 0.0),
    oversampling: int = 4,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
    of: Callable[[LoopResponse], Result] | None = None,
) -> list[LoopResponse] | list[Result]:
    """Simulate many loops around one rig in compiled code: controllers, disturbances and initial states, one a run.

    Parameters
    ----------
    rig : Rig
        The machine.
    controllers : sequence of state spaces
        One a run, as in `simulate_loop`; a single one serves all runs.
    r, disturbance, noise : (n,) or (R, n) ndarray
        As in `simulate_loop`, for all runs or one a run.
    fs, saturation, resolution, oversampling
        As in `simulate_loop`.
    delay : float or (R,) ndarray
        From sampling to the force changing [s].
    initial : (2,) or (R, 2) ndarray
        Position [m] and velocity [m/s] at the begin.
    executor : concurrent.futures.Executor, optional
        Where the runs are computed; one thread per core when not given.
    progress : callable, optional
        Called with the number of parts done and their total.
    resume : path, optional
        Folder that keeps every finished part, 40 bytes a sample. Run again after an interruption, with the same
        arguments, only the others are computed.
    of : callable, optional
        What is wanted of each response, ``lambda response: response.outcome(0.2)`` say. The responses themselves are
        let go, so that thousands of runs take no memory. With an executor, a function that pickles (of a module, or a
        `functools.partial` of one) is called where the run is computed, and only what it gives comes back; a lambda
        is called here, and so is any function with `resume`, whose folder keeps the runs themselves.

    Returns
    -------
    list of LoopResponse, or of what `of` gives
        In the order of the runs.

    Raises
    ------
    ValueError
        As `simulate_loop`; numbers of runs that do not agree.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay).

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from nlfrf.rig.bench.rig import paper_rig
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> kicks = [[0.0, 0.0], [0.0, 0.05]]
    >>> rest, kicked = simulate_loops(paper_rig(), [K], np.zeros(400), fs=1000, initial=kicks)
    >>> bool(abs(rest.x).max() == 0), bool(abs(kicked.x).max() > 1e-5)
    (True, True)
    """
    require_kind("rig", rig, Rig)
    require_one_axis(rig, "in a stack of loops")
    controllers = list(controllers) if isinstance(controllers, (list, tuple)) else [controllers]
    given = {"r": r, "initial": initial, "disturbance": disturbance, "noise": noise}
    counts = {name: len(rows) for name, part in given.items() if (rows := np.asarray(part)).ndim == 2}
    counts |= {"controllers": len(controllers), "delay": np.size(delay)}
    n_runs = max(counts.values())
    for name, count in counts.items():
        if count not in (1, n_runs):
            raise ValueError(f"{name} must be given once or for each of the {n_runs} runs, got {count}")
    r = require_real_array("r", np.atleast_2d(r), ndim=2)
    if r.size == 0:
        raise ValueError("r must hold at least one sample, got none")
    parts = {name: signals_per_run(name, given[name], r.shape[1]) for name in ("disturbance", "noise")}
    runs = stack_runs(
        rig,
        controllers,
        r=r,
        fs=fs,
        saturation=saturation,
        resolution=resolution,
        delay=delay,
        initial=np.atleast_2d(initial),
        oversampling=oversampling,
        **parts,
        n=n_runs,
    )
    parts_of_runs = RunBatches(runs, max(1, MAX_BATCH_SAMPLES // r.shape[1]))
    # what a folder keeps are the runs themselves, whatever is wanted of them
    there = of is not None and executor is not None and resume is None and can_pickle(of)
    task = ReducedRuns(of) if of is not None and there else simulate_runs
    found: dict[int, list[Any]] = {}
    for i, out in run_each(task, parts_of_runs, executor=executor, progress=progress, resume=resume):
        warn_of_forgotten_loops(float(out["lost"].max()))
        found[i] = collect_results(parts_of_runs[i], out, of)
    return [one for i in range(len(parts_of_runs)) for one in found[i]]


def stack_runs(
    rig: Rig,
    controllers: list[object],
    *,
    r: np.ndarray,
    fs: float,
    saturation: ArrayLike,
    resolution: ArrayLike,
    delay: ArrayLike,
    initial: np.ndarray,
    oversampling: int,
    disturbance: np.ndarray,
    noise: np.ndarray,
    n: int = 1,
) -> LoopRuns:
    """Check the arguments and stack them with one row a run; controllers of fewer states are padded by zeros."""
    fs = require_positive("fs", fs)
    given = [controller_matrices(K, fs) for K in controllers]
    saturation = require_real_or_infinite("saturation", saturation)
    if not np.isposinf(saturation):
        require_positive("saturation", saturation)
    resolution = require_nonnegative("resolution", resolution)
    delays = np.array([require_nonnegative("delay", one) for one in np.atleast_1d(delay).tolist()])
    steps = steps_per_sample(rig, fs, oversampling)
    initial = require_real_array("initial", initial, ndim=2)
    if initial.shape not in ((1, 2), (n, 2)):
        raise ValueError(f"initial must hold a position and a velocity, got shape {initial.shape}")
    size = max(A.shape[0] for A, _, _, _ in given)

    def each(rows: ArrayLike) -> np.ndarray:
        rows = np.asarray(rows, dtype=float)
        return np.broadcast_to(rows, (n, *rows.shape[1:]))  # a view: what all runs share is not copied for each

    return LoopRuns(
        rig=rig,
        fs=fs,
        saturation=saturation,
        resolution=resolution,
        steps=steps,
        A=each(stack_padded([A for A, _, _, _ in given], (size, size))),
        B=each(stack_padded([B[:, 0] for _, B, _, _ in given], (size,))),
        C=each(stack_padded([C[0] for _, _, C, _ in given], (size,))),
        D=each([D[0, 0] for _, _, _, D in given]),
        r=each(r),
        disturbance=each(disturbance),
        noise=each(noise),
        delays=np.minimum(each(delays) * fs, r.shape[1]),  # all later is after the end
        initial=each(initial),
    )


def stack_padded(parts: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Stack arrays to (n, *shape), smaller ones padded by zeros at their ends."""
    rows = np.zeros((len(parts), *shape))
    for row, part in zip(rows, parts, strict=True):
        row[tuple(slice(n) for n in part.shape)] = part
    return rows


def steps_per_sample(rig: Rig, fs: float, oversampling: int) -> int:
    """Return the integration steps per sample: `oversampling`, or more where the rig needs them."""
    needed = int(np.ceil(1 / (fs * rig.stable_step)))
    if needed > MAX_STEPS_PER_SAMPLE:
        raise ValueError(
            f"fs must leave the rig at most {MAX_STEPS_PER_SAMPLE} integration steps a sample, got {fs:g} Hz with "
            f"{needed}: its stable step is {rig.stable_step:.2g} s"
        )
    return max(require_integer("oversampling", oversampling, least=1), needed)


def signals_per_run(name: str, signal: ArrayLike | None, n: int) -> np.ndarray:
    """Return (R, n) signals, one a run; zeros when not given."""
    if signal is None:
        return np.zeros((1, n))
    signal = require_real_array(name, np.atleast_2d(signal), ndim=2)
    if signal.shape[1] != n:
        raise ValueError(f"{name} must have one value for each of the {n} samples of r, got {signal.shape[1]}")
    return signal


def samples_or_zeros(name: str, signal: ArrayLike | None, n: int) -> np.ndarray:
    """Return a signal of n samples; zeros when not given."""
    if signal is None:
        return np.zeros(n)
    signal = require_real_array(name, signal, ndim=1)
    if signal.size != n:
        raise ValueError(f"{name} must have one value for each of the {n} samples of r, got {signal.size}")
    return signal


def require_real_or_infinite(name: str, number: ArrayLike) -> float:
    """Return a real number that may be infinite."""
    return np.inf if isinstance(number, (float, np.floating)) and np.isposinf(number) else require_real(name, number)
