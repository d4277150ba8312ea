"""`run`: any simulated machine through any signal, with or without a controller around it."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_kind, require_known, short_form
from nlfrf._base.drive_entries import PORTS
from nlfrf.rig.bench.closed_loop import as_controller, run_axes_loop, run_one_loop, steps_per_sample
from nlfrf.rig.bench.motion import run_law, run_rig
from nlfrf.rig.bench.rig import Rig
from nlfrf.rig.bench.servo import ServoAxis, run_axis
from nlfrf.rig.bench.trajectory import Trajectory
from nlfrf.rig.laws.laws import Friction


def run(
    machine: Rig | ServoAxis | Friction,
    signal: ArrayLike | Mapping[str, ArrayLike | None],
    controller: object = None,
    *,
    fs: float | None = None,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    initial: ArrayLike | None = None,
    oversampling: int | None = None,
    hold: str | None = None,
) -> Trajectory:
    """Run a machine under any signal: a force, a reference of its controller, set points of its
    drive.

    A `Rig` moves under a force [N], from rest. With a controller around it the signal is the
    reference of the measured positions [m]. A `ServoAxis` follows set points of its drive. A
    friction law alone takes a velocity [m/s], linear between samples, from rest: for hysteresis
    loops and Stribeck curves.

    Parameters
    ----------
    machine : Rig, ServoAxis or friction law
        The machine to run.
    signal : (n,) ndarray, (channels, n) for a rig of matrices, or dict of them for an axis
        One value per sample. For an axis by name: "position" [m] or [rad] is the set point of the
        position loop, "velocity" is added to the velocity set point, "force" [N] or [Nm] to the
        output of the velocity loop, before the current limit. "torque" alone opens both loops:
        torque mode. An array is the position.
    controller : Controller or state space, optional
        Sampled, around a rig: u = K (r - y), held over each sample. For several axes a controller
        matrix, full or with one loop per axis. A state space alone acts without delay and limits.
    fs : float, optional
        Sampling frequency [Hz]; needed if neither a controller nor a drive has one.
    disturbance : (n,) or (n_u, n) ndarray, optional
        Force added to that of the controller [N], held over each sample.
    noise : (n,) or (n_y, n) ndarray, optional
        Added to the measured position before quantisation [m] or [rad].
    initial : (2,) or (2, axes) ndarray, optional
        Initial position and velocity, with relaxed friction; by default zeros.
    oversampling : int, optional
        Integration steps per sample: 4 with a controller, otherwise 1. With a controller or a drive
        this is a minimum; more steps are taken if the machine needs them.
    hold : str, optional
        Force on a rig between samples: "linear", or "zoh" (held).

    Returns
    -------
    Trajectory
        A loop that runs away is a result with `diverged`, not an error.

    Raises
    ------
    ValueError
        An argument without effect on this machine; signals that do not fit each other; a controller
        that is continuous, or has other inputs and outputs than the rig; a step too long to be
        stable, with a sufficient oversampling in the message; a machine far too fast for its
        controller.

    Warns
    -----
    DataWarning
        The memory of turning points of a friction law was too short.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay),
    3.5 (anti-windup).

    Examples
    --------
    A force below the static friction moves the mass by a few micrometres; it stays stuck.

    >>> import numpy as np
    >>> from nlfrf import paper_rig, servo_axis
    >>> pushed = run(paper_rig(), np.full(4000, 0.5), fs=4000)
    >>> bool(2e-6 < pushed.x[-1] < 8e-6)
    True

    At constant velocity friction settles on the Stribeck curve plus the viscous part.

    >>> from nlfrf.friction import Leuven
    >>> round(float(run(Leuven(), np.full(2000, 0.01), fs=10e3).friction[-1]), 4)
    0.8144

    An integrator brings the position to the reference; a belt axis moves by a millimetre.

    >>> from types import SimpleNamespace
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> bool(abs(run(paper_rig(), np.full(3000, 1e-3), K).e[-1]) < 1e-5)
    True
    >>> bool(abs(run(servo_axis("belt"), np.full(4000, 1e-3)).position[-1] - 1e-3) < 2e-5)
    True
    """
    given = {"controller": controller, "fs": fs, "hold": hold, "initial": initial}
    given |= {"disturbance": disturbance, "noise": noise}
    steps = (4 if controller is not None else 1) if oversampling is None else oversampling
    begin = (0.0, 0.0) if initial is None else initial
    if isinstance(machine, ServoAxis):
        _require_unused("a servo axis", given, ("controller", "fs", "hold", "disturbance"))
        ports = dict(signal) if isinstance(signal, Mapping) else {"position": signal}
        closed = "torque" not in ports
        require_known("signal", ports, (*PORTS, "torque") if closed else ("torque",))
        ports = ports if closed else {"force": ports["torque"]}
        return run_axis(
            machine, ports, closed=closed, noise=noise, initial=begin, oversampling=steps
        )
    if isinstance(signal, Mapping):
        raise ValueError(
            f"signal must be an array if machine is no servo axis, got {short_form(signal)}"
        )
    if controller is not None:
        _require_unused("a rig with a controller", given, ("fs", "hold"))
        require_kind("machine", machine, Rig)
        assert isinstance(machine, Rig)
        law = as_controller(controller)
        finest = steps_per_sample(machine, law.fs, steps)
        loop = run_axes_loop if machine.several else run_one_loop
        signals = {"disturbance": disturbance, "noise": noise}
        return loop(machine, law, signal, signals=signals, initial=begin, steps=finest)
    if fs is None:
        raise ValueError("fs must be given, the sampling frequency of the signal [Hz], got none")
    if isinstance(machine, Rig):
        _require_unused("a rig without a controller", given, ("initial", "disturbance", "noise"))
        return run_rig(machine, signal, fs=fs, oversampling=steps, hold=hold or "linear")
    _require_unused("a friction law", given, ("hold", "initial", "disturbance", "noise"))
    return run_law(machine, signal, fs=fs, oversampling=steps)


def _require_unused(machine: str, given: Mapping[str, object], names: tuple[str, ...]) -> None:
    """Refuse arguments that would have no effect."""
    for name in names:
        if given[name] is not None:
            raise ValueError(
                f"{name} must be left out for {machine}, got {short_form(given[name])}"
            )
