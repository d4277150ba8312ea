"""Simulate a sampled controller around a nonlinear machine.

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
from dataclasses import replace
from functools import partial
from typing import Any, TypedDict, TypeVar, Unpack, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    as_list,
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    require_real_array,
)
from nlfrf._base.values import value
from nlfrf.rig.bench.machine import (
    pack_laws,
    stack_matrices,
)
from nlfrf.rig.bench.rig import Rig, initial_memory, require_one_axis
from nlfrf.rig.bench.simulate import Arrays, Progress, run_each
from nlfrf.rig.bench.trajectory import Trajectory, require_samples
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.hysteresis import warn_of_forgotten_loops
from nlfrf.rig.laws.laws import pack_law
from nlfrf.rig.laws.own import UserLawData

#: Halvings of the step after which a loop that still runs away counts as diverged.
MAX_HALVINGS = 6
# integration steps per sample; more means an error in mass or stiffness
_MAX_STEPS_PER_SAMPLE = 10_000
_MAX_BATCH_SAMPLES = 250_000  # samples in one task of an executor: 10 MB, a second or less
_UNITS = {"r": "m", "u": "N", "x": "m", "v": "m/s", "y": "m", "friction": "N"}


@value(kw_only=False)
class Controller:
    """A sampled controller u = K (r - y), with its delay, force limit and sensor resolution.

    Parameters
    ----------
    K : state space
        Any object with A, B, C, D and the sampling time dt [s]. Its n_y inputs are the errors [m],
        its n_u outputs the forces [N].
    delay : float
        Delay from the sampling of y to the change of the force [s]; it need not be a multiple of
        dt.
    saturation : float or (n_u,) ndarray
        Largest force of the actuators in either direction [N].
    resolution : float or (n_y,) ndarray
        Quantisation step of the position sensors [m]; zero for none.

    Raises
    ------
    ValueError
        The controller is continuous, or its matrices are not finite, not real or of wrong shapes;
        or delay, limit or resolution is negative.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay).

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> Controller(K, delay=5e-4, saturation=40.0).fs
    1000.0
    """

    K: Any  # a state space of any library
    delay: float = 0.0
    saturation: ArrayLike = np.inf
    resolution: ArrayLike = 0.0

    def __post_init__(self) -> None:
        missing = [name for name in ("A", "B", "C", "D", "dt") if not hasattr(self.K, name)]
        if missing:
            raise ValueError(
                f"K must have A, B, C, D and dt, got {type(self.K).__name__} without"
                f" {', '.join(missing)}"
            )
        dt = self.K.dt
        if isinstance(dt, (bool, np.bool_)) or dt is None or dt == 0:
            raise ValueError(
                f"K must be sampled with a time dt in seconds, got dt = {dt}. Discretise it first"
            )
        require_positive("dt of K", dt)
        require_nonnegative("delay", self.delay)

    @property
    def fs(self) -> float:
        """Sampling frequency [Hz]."""
        return 1 / float(self.K.dt)

    def matrices(self, n_inputs: int = 1, n_outputs: int = 1) -> tuple[np.ndarray, ...]:
        """Return A (s, s), B (s, n_inputs), C (n_outputs, s) and D, checked."""
        given = {name: np.asarray(getattr(self.K, name)) for name in ("A", "B", "C", "D")}
        for name, matrix in given.items():
            if matrix.dtype.kind not in "fiu":
                raise ValueError(f"K must have real matrices, got {name} of dtype {matrix.dtype}")
            if not np.isfinite(matrix).all():
                raise ValueError(f"K must have finite matrices, got a nonfinite number in {name}")
        A, B, C, D = (matrix.astype(float) for matrix in given.values())
        D = np.atleast_2d(D)
        if D.shape != (n_outputs, n_inputs):
            if (n_inputs, n_outputs) == (1, 1):
                wanted = "one input and one output"
            else:
                wanted = f"{n_inputs} inputs and {n_outputs} outputs"
            raise ValueError(f"K must have {wanted}, got {D.shape[1]} and {D.shape[0]}")
        size = int(np.sqrt(A.size))
        if A.size != size**2 or B.size != size * n_inputs or C.size != size * n_outputs:
            raise ValueError(
                f"K must have A (s, s), B (s, {n_inputs}) and C ({n_outputs}, s), got shapes "
                f"{given['A'].shape}, {given['B'].shape} and {given['C'].shape}"
            )
        return A.reshape(size, size), B.reshape(size, n_inputs), C.reshape(n_outputs, size), D

    def limits(self, n_inputs: int = 1, n_outputs: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Return (n_outputs,) saturations and (n_inputs,) resolutions, checked."""
        return _broadcast_limit("saturation", self.saturation, n_outputs), _broadcast_limit(
            "resolution", self.resolution, n_inputs
        )


def as_controller(given: object) -> Controller:
    """Return a `Controller` unchanged; a state space alone acts without delay and limits."""
    if isinstance(given, Controller):
        return given
    return Controller(given)


def run_axes_loop(
    rig: Rig,
    controller: Controller,
    r: ArrayLike,
    *,
    signals: dict[str, ArrayLike | None],
    initial: ArrayLike,
    steps: int,
) -> Trajectory:
    """Simulate a sampled controller matrix around a rig with several axes; arguments as in
    `run`.
    """
    r = require_samples("signal", r, channels=rig.n_outputs)
    n, fs = r.shape[1], controller.fs
    K = [np.ascontiguousarray(part) for part in controller.matrices(rig.n_outputs, rig.n_inputs)]
    channels = {"disturbance": rig.n_inputs, "noise": rig.n_outputs}
    rows = [signal_rows(name, signals[name], n, n_rows=width) for name, width in channels.items()]
    samples = [np.ascontiguousarray(one.T) for one in rows]
    begin = initial_axes(initial, rig.n_axes)
    late = min(controller.delay * fs, n)  # a longer delay ends behind the last sample
    for halving in range(
        MAX_HALVINGS + 1
    ):  # a run that does not reach the end is repeated with shorter steps
        numbers = fs, *controller.limits(rig.n_outputs, rig.n_inputs), late, steps * 2**halving
        length, found, lost = _run_axes_once(
            rig, K, r=np.ascontiguousarray(r.T), signals=samples, begin=begin, numbers=numbers
        )
        if length == n:
            break
    warn_of_forgotten_loops(lost)
    traces = {"r": r[:, :length].copy()} | {
        name: found[name][:, :length] for name in _UNITS if name != "r"
    }
    return Trajectory(t=np.arange(length) / fs, signals=traces, units=_UNITS, diverged=length < n)


def _run_axes_once(
    rig: Rig,
    controller: list[np.ndarray],
    *,
    r: np.ndarray,
    signals: list[np.ndarray],
    begin: np.ndarray,
    numbers: tuple[float | np.ndarray, ...],
) -> tuple[int, dict[str, np.ndarray], float]:
    """Call the compiled code once; return the samples reached, the signals (.., n), and the loops
    forgotten.
    """
    from nlfrf.rig.kernels.coupled import run_axes_loop as run_compiled

    laws, grids = pack_laws(rig.friction)
    memory = memory_at(rig, laws, begin)
    rows = np.zeros((len(r), 4, rig.n_axes))
    y, u = np.zeros((len(r), rig.n_outputs)), np.zeros((len(r), rig.n_inputs))
    machine = stack_matrices(rig.mass, rig.stiffness, damping=rig.damping, cubic=rig.cubic)
    places = np.array(rig.sensors), np.array(rig.actuators)
    length = run_compiled(
        machine,
        laws,
        grids,
        memory.state,
        memory.stack,
        *places,
        *controller,
        r,
        *signals,
        *numbers,
        rows,
        y,
        u,
    )
    x, v = rig.sensors @ rows[:, 0].T, rig.sensors @ rows[:, 1].T
    found = {"x": x, "v": v, "friction": rows[:, 3].T, "y": y.T, "u": u.T}
    return int(length), found, float(memory.state[:, packing.LOST].sum())


def memory_at(rig: Rig, laws: np.ndarray, begin: np.ndarray) -> packing.Memory:
    """Return the memory of axes with initial positions and velocities (2, n) and relaxed
    friction.
    """
    memory = initial_memory(rig)
    memory.state[:, packing.X], memory.state[:, packing.V] = begin
    dry = laws[:, 0] == packing.COULOMB
    memory.state[dry, packing.DIRECTION] = np.sign(begin[1, dry])
    return memory


def _broadcast_limit(name: str, given: ArrayLike, n: int) -> np.ndarray:
    """Return (n,) limits from one number or one per channel; a saturation may be infinite, a
    resolution zero.
    """
    if np.ndim(given) > 0 and np.shape(given) != (n,):
        raise ValueError(
            f"{name} must be one number or {n}, one per channel, got shape {np.shape(given)}"
        )
    check = require_nonnegative if name == "resolution" else require_positive
    found = np.broadcast_to(np.asarray(given, dtype=float), (n,)).tolist()
    return np.array(
        [one if name == "saturation" and one == np.inf else check(name, one) for one in found]
    )


def signal_rows(
    name: str, signal: ArrayLike | None, n: int, *, n_rows: int | None = None
) -> np.ndarray:
    """Return (rows, n) signals, one per run or per channel, with `n_rows` required; zeros if not
    given.
    """
    if signal is None:
        return np.zeros((n_rows or 1, n))
    rows = require_real_array(name, np.atleast_2d(signal), ndim=2)
    if rows.shape[1] != n:
        raise ValueError(
            f"{name} must have one value for each of the {n} samples of r, got {rows.shape[1]}"
        )
    if n_rows is not None and len(rows) != n_rows:
        raise ValueError(f"{name} must have {n_rows} channels, like the rig, got {len(rows)}")
    return rows


def initial_axes(initial: ArrayLike, n: int) -> np.ndarray:
    """Return (2, n) positions and velocities of the axes; a single pair holds for every axis."""
    initial = np.asarray(initial, dtype=float)
    if initial.shape == (2,):
        initial = np.repeat(initial[:, None], n, axis=1)
    if initial.shape != (2, n):
        raise ValueError(
            f"initial must hold positions and velocities, shape (2, {n}), got shape {initial.shape}"
        )
    return require_real_array("initial", initial, ndim=2)


Result = TypeVar("Result")


@value(copy=False)
class _LoopRuns:
    """Runs of sampled loops around one rig."""

    rig: Rig
    fs: float
    steps: int  # integration steps per sample
    # one row per run, or one for all: A (R, s, s), B (R, s), C (R, s) and D (R,) of the
    # controllers; r, disturbance, noise (R, n); delay in samples, saturation, resolution (R,);
    # initial (R, 2), position and velocity
    rows: dict[str, np.ndarray]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of runs, and of samples in each."""
        return max(map(len, self.rows.values())), self.rows["r"].shape[1]

    def select_runs(self, chosen: np.ndarray | slice, steps: int) -> _LoopRuns:
        """Return some of the runs, with other steps."""
        rows = {name: part if len(part) == 1 else part[chosen] for name, part in self.rows.items()}
        return replace(self, steps=steps, rows=rows)


def _simulate_runs(runs: _LoopRuns) -> dict[str, np.ndarray]:
    """Return rows (R, n, 5) of x, v, y, u and friction per sample, the length of each run, and the
    loops forgotten.

    A run that does not reach the end is repeated with shorter steps.
    """
    found = _attempt(runs)
    for halving in range(1, MAX_HALVINGS + 1):
        short = np.flatnonzero(found["lengths"] < runs.shape[1])
        if not short.size:
            break
        again = _attempt(runs.select_runs(short, runs.steps * 2**halving))
        for name, part in again.items():
            found[name][short] = part
    return found


def _attempt(runs: _LoopRuns) -> dict[str, np.ndarray]:
    """Call the compiled code once for all runs."""
    n_runs, n = runs.shape
    law, grid = pack_law(runs.rig.friction)
    body = packing.Body(
        False, float(runs.rig.mass), float(runs.rig.stiffness), float(runs.rig.damping)
    )
    memory = packing.initial_memory(law.curve, grid)
    states = np.tile(memory.state, (n_runs, 1))
    stacks = np.tile(memory.stack, (n_runs, 1, 1))
    # copies, because the code is compiled for writable arrays
    given = {
        name: np.array(np.broadcast_to(part, (n_runs, *part.shape[1:])), order="C")
        for name, part in runs.rows.items()
    }
    initial = given.pop("initial")
    states[:, packing.X], states[:, packing.V] = initial.T
    if law.form == packing.COULOMB:
        states[:, packing.DIRECTION] = np.sign(initial[:, 1])
    if isinstance(law, UserLawData):
        stacks[:, 0, : law.functions.rest.size] = law.functions.rest
    rows, lengths = np.zeros((n_runs, n, 5)), np.zeros(n_runs, dtype=np.int64)
    _loops_kernel(law)(
        body,
        packing.Law(*law),
        np.array(grid),
        states,
        stacks,
        *given.values(),
        float(runs.fs),
        int(runs.steps),
        rows,
        lengths,
    )
    return {"rows": rows, "lengths": lengths, "lost": states[:, packing.LOST].copy()}


def _loops_kernel(law: packing.Law) -> Callable[..., None]:
    """Return the compiled loops around a law."""
    if isinstance(law, UserLawData):
        from nlfrf.rig.kernels.loops import user_law_loops

        return user_law_loops(
            law.functions.derivative, law.functions.force, law.functions.rest.size
        )
    from nlfrf.rig.kernels.loops import run_loops

    return run_loops


def _reduce_runs(of: Callable[[Trajectory], object], runs: _LoopRuns) -> dict[str, Any]:
    """Simulate loops and return `of(response)` of each, so that little data is sent between
    processes.
    """
    out = _simulate_runs(runs)
    try:
        return {"found": _collect_results(runs, out, of), "lost": out["lost"]}
    except (
        Exception
    ) as error:  # an error of the function, not of the executor: raised in `_collect_results`
        return {"refused": error, "lost": out["lost"]}


def _collect_results(
    runs: _LoopRuns, out: dict[str, Any], of: Callable[[Trajectory], object] | None
) -> list[object]:
    """Return the trajectories of computed runs, or `of(response)` of each."""
    if "refused" in out:
        raise out["refused"]
    if "found" in out:
        return out["found"]
    return [one if of is None else of(one) for one in _to_trajectories(runs, out)]


def _to_trajectories(runs: _LoopRuns, out: Arrays) -> list[Trajectory]:
    """Return the output of the compiled code as trajectories; arrays end where a loop diverged."""
    found, t = [], np.arange(runs.shape[1]) / runs.fs
    for r, rows, n in zip(
        np.broadcast_to(runs.rows["r"], runs.shape), out["rows"], out["lengths"], strict=True
    ):
        x, v, y, u, friction = rows[:n].T.copy()
        signals = {"r": r[:n], "u": u, "x": x, "v": v, "y": y, "friction": friction}
        found.append(Trajectory(t=t[:n], signals=signals, units=_UNITS, diverged=bool(n < r.size)))
    return found


def _can_pickle(of: Callable[[Trajectory], object]) -> bool:
    """Return whether a function can be pickled to another process: not a lambda, nor a function of
    a notebook.
    """
    try:
        sent = pickle.dumps(of)
    except Exception:  # pickle raises anything
        return False
    return b"__main__" not in sent or hasattr(sys.modules["__main__"], "__file__")


def run_one_loop(
    rig: Rig,
    controller: Controller,
    r: ArrayLike,
    *,
    signals: dict[str, ArrayLike | None],
    initial: ArrayLike,
    steps: int,
) -> Trajectory:
    """Simulate a sampled controller around a rig with one axis; arguments as in `run`."""
    r = require_samples("signal", r)
    rows = {name: signal_rows(name, signal, r.size, n_rows=1) for name, signal in signals.items()}
    begin = initial_axes(initial, 1).T
    runs = _stack_runs(rig, [controller], {"r": r[None], **rows, "initial": begin}, steps=steps)
    out = _simulate_runs(runs)
    warn_of_forgotten_loops(float(out["lost"].max()))
    return _to_trajectories(runs, out)[0]


class _StackOptions(TypedDict, total=False):
    """Options of a stack of loops; the names are arguments of `run_loops`."""

    disturbance: ArrayLike | None
    noise: ArrayLike | None
    initial: ArrayLike
    oversampling: int
    executor: Executor | None
    progress: Progress | None
    resume: str | os.PathLike[str] | None


@overload
def run_loops(
    rig: Rig, r: ArrayLike, controllers: object, **options: Unpack[_StackOptions]
) -> list[Trajectory]: ...


@overload
def run_loops(
    rig: Rig,
    r: ArrayLike,
    controllers: object,
    *,
    of: Callable[[Trajectory], Result],
    **options: Unpack[_StackOptions],
) -> list[Result]: ...


def run_loops(
    rig: Rig,
    r: ArrayLike,
    controllers: object,
    *,
    of: Callable[[Trajectory], Result] | None = None,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    initial: ArrayLike = (0.0, 0.0),
    oversampling: int = 4,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> list[Trajectory] | list[Result]:
    """Simulate many closed loops around one machine, with another controller, disturbance or
    initial state in each run.

    Use this to compare many gains or random cases; for a single loop use `run`.

    Parameters
    ----------
    rig : Rig
        The machine, with one axis.
    r, disturbance, noise : (n,) or (R, n) ndarray
        As in `run`: (n,) for all runs, or one row per run.
    controllers : sequence of Controller or state space
        One per run, or a single one for all runs. All must have the same sampling time.
    of : callable, optional
        Function of the `Trajectory` of a run, for example ``lambda moved: moved.outcome(0.2)``.
        Only its results are returned, so thousands of runs need little memory. With worker
        processes, a function that is defined in a module is called in the worker. A lambda is
        called in the main process, and so is any function if `resume` is given.
    initial : (2,) or (R, 2) ndarray
        Position [m] and velocity [m/s] at the start, for all runs or one row per run.
    oversampling : int
        As in `run`.
    executor : concurrent.futures.Executor, optional
        Executor that runs the simulations; by default one thread per core.
    progress : callable, optional
        Function called with the number of finished parts and their total.
    resume : path, optional
        Folder for finished parts, 40 bytes per sample. After an interruption, a call with the same
        arguments computes only the missing parts.

    Returns
    -------
    list of Trajectory, or of results of `of`
        One for each run, in the order of the runs.

    Raises
    ------
    ValueError
        As in `run`; also if the arguments have different numbers of runs.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay).

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from nlfrf.rig.bench.rig import paper_rig
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> rest, kicked = run_loops(paper_rig(), np.zeros(400), [K], initial=[[0.0, 0.0], [0.0, 0.05]])
    >>> bool(abs(rest.x).max() == 0), bool(abs(kicked.x).max() > 1e-5)
    (True, True)
    """
    require_kind("rig", rig, Rig)
    require_one_axis(rig, "in a stack of loops")
    listed = as_list(controllers)
    reference = require_real_array("r", np.atleast_2d(r), ndim=2)
    if reference.size == 0:
        raise ValueError("r must hold at least one sample, got none")
    n = reference.shape[1]
    runs = _stack_runs(
        rig,
        [as_controller(K) for K in listed],
        {
            "r": reference.copy(),
            "disturbance": signal_rows("disturbance", disturbance, n),
            "noise": signal_rows("noise", noise, n),
            "initial": np.atleast_2d(initial),
        },
        steps=oversampling,
    )
    most = max(1, _MAX_BATCH_SAMPLES // n)
    batches = [
        runs.select_runs(slice(i, i + most), runs.steps) for i in range(0, runs.shape[0], most)
    ]
    # a folder keeps the runs themselves, whatever `of` is
    there = of is not None and executor is not None and resume is None and _can_pickle(of)
    task = partial(_reduce_runs, of) if of is not None and there else _simulate_runs
    found: dict[int, list[object]] = {}
    for i, out in run_each(task, batches, executor=executor, progress=progress, resume=resume):
        warn_of_forgotten_loops(float(out["lost"].max()))
        found[i] = _collect_results(batches[i], out, of)
    return cast("list[Result]", [one for i in range(len(batches)) for one in found[i]])


def _stack_runs(
    rig: Rig, controllers: list[Controller], given: dict[str, np.ndarray], *, steps: int
) -> _LoopRuns:
    """Check the arguments and stack them with one row per run; controllers with fewer states are
    padded by zeros.

    given holds rows of r, disturbance, noise and initial, each once or one per run.
    """
    counts = {name: len(part) for name, part in given.items()} | {"controllers": len(controllers)}
    n_runs, fs = max(counts.values()), controllers[0].fs
    for name, count in counts.items():
        if count not in (1, n_runs):
            raise ValueError(
                f"{name} must be given once or for each of the {n_runs} runs, got {count}"
            )
    for one in controllers:
        if abs(one.fs / fs - 1) > 1e-6:
            raise ValueError(
                f"controllers must have one sampling time, got {1 / fs:g} s and {1 / one.fs:g} s"
            )
    initial = require_real_array("initial", given["initial"], ndim=2)
    if initial.shape[1] != 2:
        raise ValueError(f"initial must hold a position and a velocity, got shape {initial.shape}")
    A, B, C, D = zip(*(one.matrices() for one in controllers), strict=True)
    size = max(len(one) for one in A)
    limits = np.array([one.limits() for one in controllers])[:, :, 0]
    rows: dict[str, np.ndarray] = {
        "A": _stack_padded(A, (size, size)),
        "B": _stack_padded([one[:, 0] for one in B], (size,)),
        "C": _stack_padded([one[0] for one in C], (size,)),
        "D": np.array([one[0, 0] for one in D]),
        "r": given["r"],
        "disturbance": given["disturbance"],
        "noise": given["noise"],
        "delay": np.minimum(
            [one.delay * fs for one in controllers], given["r"].shape[1]
        ),  # at most the whole run
        "saturation": limits[:, 0],
        "resolution": limits[:, 1],
        "initial": initial,
    }
    return _LoopRuns(rig=rig, fs=fs, steps=steps_per_sample(rig, fs, steps), rows=rows)


def _stack_padded(parts: Sequence[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Stack arrays to (n, *shape), smaller ones padded by zeros at their ends."""
    rows = np.zeros((len(parts), *shape))
    for row, part in zip(rows, parts, strict=True):
        row[tuple(slice(n) for n in part.shape)] = part
    return rows


def steps_per_sample(rig: Rig, fs: float, oversampling: int) -> int:
    """Return the integration steps per sample: `oversampling`, or more if the rig needs them."""
    needed = int(np.ceil(1 / (fs * rig.stable_step)))
    if needed > _MAX_STEPS_PER_SAMPLE:
        raise ValueError(
            f"fs must leave the rig at most {_MAX_STEPS_PER_SAMPLE} integration steps per sample,"
            f" got {fs:g} Hz with {needed}: its stable step is {rig.stable_step:.2g} s"
        )
    return max(require_integer("oversampling", oversampling, least=1), needed)
