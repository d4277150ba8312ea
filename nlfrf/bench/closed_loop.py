"""A sampled controller around the rig: a design tried on the nonlinear machine.

                                 disturbance
r ---o--- K(z) --- delay --- [/] ---o--- hold --- rig ---+--- x
    -|                   saturation                      |
     +---------------- quantisation ---o-----------------+
                                     noise
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

import numpy as np

from nlfrf.bench.axes_loop import loop_of_axes
from nlfrf.bench.controllers import matrices
from nlfrf.bench.loop_response import LoopResponse
from nlfrf.bench.loop_results import Wanted, results, told, travels
from nlfrf.bench.loop_runs import LoopRuns, Parts, respond
from nlfrf.bench.motion import some_samples
from nlfrf.bench.rig import Rig, one_axis
from nlfrf.bench.runs import Progress, run_each
from nlfrf.friction.hysteresis import warn_lost
from nlfrf.shared.arguments import integer, nonnegative, of_kind, positive, real, real_array

__all__ = ["simulate_loop", "simulate_loops"]


MOST_STEPS = 10_000  # integration steps per sample; what needs more is a mistake in mass or stiffness
CHUNK = 250_000  # samples that one task of an executor holds: 10 MB, a second or less


def simulate_loop(
    rig: Rig,
    K: Any,
    r: Any,
    *,
    fs: float,
    saturation: Any = np.inf,
    resolution: Any = 0.0,
    delay: float = 0.0,
    disturbance: Any = None,
    noise: Any = None,
    initial: Any = (0.0, 0.0),
    oversampling: int = 4,
) -> LoopResponse:
    """Put a sampled controller around the rig, u = K (r - y), with a zero-order hold, and let it follow a reference.

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
    >>> from nlfrf.bench.rig import paper_rig
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> response = simulate_loop(paper_rig(), K, np.full(3000, 1e-3), fs=1000)
    >>> bool(abs(response.e[-1]) < 1e-5)
    True
    """
    of_kind("rig", rig, Rig)
    if rig.several:
        fs = positive("fs", fs)
        steps = steps_of(rig, fs, oversampling)
        return loop_of_axes(rig, K, r, fs, saturation, resolution, delay, disturbance, noise, initial, steps)
    r = some_samples("r", r)
    runs = stack(
        rig,
        [K],
        r[None],
        fs,
        saturation,
        resolution,
        delay,
        np.atleast_2d(initial),
        oversampling,
        disturbance=fitted("disturbance", disturbance, r.size)[None],
        noise=fitted("noise", noise, r.size)[None],
    )
    out = respond(runs)
    warn_lost(float(out["lost"].max()))
    return told(runs, out)[0]


def simulate_loops(
    rig: Rig,
    controllers: Any,
    r: Any,
    *,
    fs: float,
    saturation: float = np.inf,
    resolution: float = 0.0,
    delay: Any = 0.0,
    disturbance: Any = None,
    noise: Any = None,
    initial: Any = (0.0, 0.0),
    oversampling: int = 4,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: Any = None,
    of: Callable[[LoopResponse], Any] | None = None,
) -> list[Any]:
    """Many loops around one rig, in compiled code: controllers, disturbances and initial states, one a run.

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
    >>> from nlfrf.bench.rig import paper_rig
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> kicks = [[0.0, 0.0], [0.0, 0.05]]
    >>> rest, kicked = simulate_loops(paper_rig(), [K], np.zeros(400), fs=1000, initial=kicks)
    >>> bool(abs(rest.x).max() == 0), bool(abs(kicked.x).max() > 1e-5)
    (True, True)
    """
    of_kind("rig", rig, Rig)
    one_axis(rig, "in a stack of loops")
    controllers = list(controllers) if isinstance(controllers, (list, tuple)) else [controllers]
    shapes = {
        "r": np.ndim(r),
        "initial": np.ndim(initial),
        "disturbance": np.ndim(disturbance),
        "noise": np.ndim(noise),
    }
    given = {"r": r, "initial": initial, "disturbance": disturbance, "noise": noise}
    counts = {name: np.shape(given[name])[0] for name, ndim in shapes.items() if ndim == 2}
    counts |= {"controllers": len(controllers), "delay": np.size(delay)}
    n_runs = max(counts.values())
    for name, count in counts.items():
        if count not in (1, n_runs):
            raise ValueError(f"{name} must be given once or for each of the {n_runs} runs, got {count}")
    r = real_array("r", np.atleast_2d(r), ndim=2)
    if r.size == 0:
        raise ValueError("r must hold at least one sample, got none")
    parts = {name: many(name, given[name], r.shape[1]) for name in ("disturbance", "noise")}
    runs = stack(
        rig, controllers, r, fs, saturation, resolution, delay, np.atleast_2d(initial), oversampling, **parts, n=n_runs
    )
    parts_of_runs = Parts(runs, max(1, CHUNK // r.shape[1]))
    # what a folder keeps are the runs themselves, whatever is wanted of them
    there = of is not None and executor is not None and resume is None and travels(of)
    task = Wanted(of) if of is not None and there else respond
    found: dict[int, list[Any]] = {}
    for i, out in run_each(task, parts_of_runs, executor=executor, progress=progress, resume=resume):
        warn_lost(float(out["lost"].max()))
        found[i] = results(parts_of_runs[i], out, of)
    return [one for i in range(len(parts_of_runs)) for one in found[i]]


def stack(
    rig: Rig,
    controllers: list[Any],
    r: np.ndarray,
    fs: float,
    saturation: float,
    resolution: float,
    delay: Any,
    initial: np.ndarray,
    oversampling: int,
    *,
    disturbance: np.ndarray,
    noise: np.ndarray,
    n: int = 1,
) -> LoopRuns:
    """Checked arguments as arrays with one row a run; controllers of fewer states get some that do nothing."""
    fs = positive("fs", fs)
    given = [matrices(K, fs) for K in controllers]
    if not np.isposinf(real_or_infinite("saturation", saturation)):
        positive("saturation", saturation)
    resolution = nonnegative("resolution", resolution)
    delays = np.array([nonnegative("delay", one) for one in np.atleast_1d(delay).tolist()])
    steps = steps_of(rig, fs, oversampling)
    initial = real_array("initial", initial, ndim=2)
    if initial.shape not in ((1, 2), (n, 2)):
        raise ValueError(f"initial must hold a position and a velocity, got shape {initial.shape}")
    size = max(A.shape[0] for A, _, _, _ in given)

    def each(rows: Any) -> np.ndarray:
        rows = np.asarray(rows, dtype=float)
        return np.broadcast_to(rows, (n, *rows.shape[1:]))  # a view: what all runs share is not copied for each

    return LoopRuns(
        rig=rig,
        fs=fs,
        saturation=float(saturation),
        resolution=resolution,
        steps=steps,
        A=each(padded([A for A, _, _, _ in given], (size, size))),
        B=each(padded([B[:, 0] for _, B, _, _ in given], (size,))),
        C=each(padded([C[0] for _, _, C, _ in given], (size,))),
        D=each([D[0, 0] for _, _, _, D in given]),
        r=each(r),
        disturbance=each(disturbance),
        noise=each(noise),
        delays=np.minimum(each(delays) * fs, r.shape[1]),  # all later is after the end
        initial=each(initial),
    )


def padded(parts: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """(n, *shape) arrays in a stack, zeros behind the smaller ones."""
    rows = np.zeros((len(parts), *shape))
    for row, part in zip(rows, parts, strict=True):
        row[tuple(slice(n) for n in part.shape)] = part
    return rows


def steps_of(rig: Rig, fs: float, oversampling: int) -> int:
    """Integration steps a sample: those that are asked for, or those that the rig needs."""
    needed = int(np.ceil(1 / (fs * rig.stable_step)))
    if needed > MOST_STEPS:
        raise ValueError(
            f"fs must leave the rig at most {MOST_STEPS} integration steps a sample, got {fs:g} Hz with {needed}: "
            f"its stable step is {rig.stable_step:.2g} s"
        )
    return max(integer("oversampling", oversampling, least=1), needed)


def many(name: str, signal: Any, n: int) -> np.ndarray:
    """(R, n) signals, one a run; zeros when not given."""
    if signal is None:
        return np.zeros((1, n))
    signal = real_array(name, np.atleast_2d(signal), ndim=2)
    if signal.shape[1] != n:
        raise ValueError(f"{name} must have one value for each of the {n} samples of r, got {signal.shape[1]}")
    return signal


def fitted(name: str, signal: Any, n: int) -> np.ndarray:
    """A signal of n samples; zeros when not given."""
    if signal is None:
        return np.zeros(n)
    signal = real_array(name, signal, ndim=1)
    if signal.size != n:
        raise ValueError(f"{name} must have one value for each of the {n} samples of r, got {signal.size}")
    return signal


def real_or_infinite(name: str, number: Any) -> float:
    """A real number that may be infinite."""
    return np.inf if isinstance(number, (float, np.floating)) and np.isposinf(number) else real(name, number)
