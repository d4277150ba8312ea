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
    """Run a machine through any signal: a force, a reference of the controller around it, set points of its drive.

    A `Rig` moves under a force [N], from rest. With a controller around it the signal is the reference of the measured
    positions [m]. A `ServoAxis` follows set points of its drive. A friction law alone takes a velocity [m/s], straight
    between samples, from rest: hysteresis loops, Stribeck curves.

    Parameters
    ----------
    machine : Rig, ServoAxis or friction law
        What is run.
    signal : (n,) ndarray, (channels, n) for a rig of matrices, or dict of them for an axis
        One value a sample. Of an axis by name: "position" [m] or [rad] is the set point of the position loop,
        "velocity" is added to the velocity set point, "force" [N] or [Nm] to what the velocity loop asks for, in front
        of the current limit. "torque" alone opens both loops: torque mode. An array is the position.
    controller : Controller or state space, optional
        Sampled, around a rig: u = K (r - y), held over each sample. Around a rig of matrices a controller matrix, full
        or one loop an axis. A state space alone acts at once, without limits.
    fs : float, optional
        Sampling frequency [Hz], where neither a controller nor a drive has one.
    disturbance : (n,) or (n_u, n) ndarray, optional
        Force added to the controller's [N], held over each sample.
    noise : (n,) or (n_y, n) ndarray, optional
        Added to the position that controller or drive measure, before it is quantised [m] or [rad].
    initial : (2,) or (2, axes) ndarray, optional
        Position and velocity at the begin, the friction relaxed; zeros when not given.
    oversampling : int, optional
        Integration steps a sample: 4 with a controller, otherwise 1. With a controller or a drive these at least; more
        are taken where the machine needs them.
    hold : str, optional
        The force on a rig between samples: "linear", or "zoh" (held).

    Returns
    -------
    Trajectory
        A loop that runs away is a result, not an error: `diverged` says so.

    Raises
    ------
    ValueError
        An argument that this machine has no use for; signals that do not fit one another; a controller that is
        continuous, or of other inputs and outputs than the rig; a step too long to be stable, with the oversampling
        that would do; a machine far too fast for its controller.

    Warns
    -----
    DataWarning
        Where the memory of turning points of a friction law was too short.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay), 3.5 (anti-windup).

    Examples
    --------
    A force below the static friction moves the mass by a few micrometres and does not set it free.

    >>> import numpy as np
    >>> from nlfrf import paper_rig, servo_axis
    >>> pushed = run(paper_rig(), np.full(4000, 0.5), fs=4000)
    >>> bool(2e-6 < pushed.x[-1] < 8e-6)
    True

    At constant velocity friction settles on the Stribeck curve, with the viscous part on top.

    >>> from nlfrf.friction import Leuven
    >>> round(float(run(Leuven(), np.full(2000, 0.01), fs=10e3).friction[-1]), 4)
    0.8144

    An integrator brings the position to the reference; a belt axis goes a millimetre.

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
        return run_axis(machine, ports, closed=closed, noise=noise, initial=begin, oversampling=steps)
    if isinstance(signal, Mapping):
        raise ValueError(f"signal must be an array where machine is no servo axis, got {short_form(signal)}")
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
            raise ValueError(f"{name} must be left out for {machine}, got {short_form(given[name])}")
