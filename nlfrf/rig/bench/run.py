"""`run`: simulate any machine under any signal, with or without a controller."""

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
    """Simulate a machine under any signal.

    The meaning of the signal depends on the machine:

    - A `Rig` takes the force [N].
    - A `Rig` with a controller takes the reference [m] of the measured positions.
    - A `ServoAxis` takes set points of its drive.
    - A friction law takes a velocity [m/s], linear between samples. The result is its friction force,
      for example a hysteresis loop or a Stribeck curve.

    Parameters
    ----------
    machine : Rig, ServoAxis or friction law
        The machine to run.
    signal : (n,) ndarray, (channels, n) for a `Rig` with several axes, or dict for a `ServoAxis`
        One value per sample. An array for a `ServoAxis` is the position set point. A dict for a
        `ServoAxis` has these names: "position" [m] or [rad], the position set point; "velocity"
        [m/s] or [rad/s], added to the velocity set point; "force" [N] or [Nm], added to the output
        of the velocity controller before the current limit. "torque" alone is torque mode, in which
        both loops are open.
    controller : Controller or state space, optional
        Sampled controller around a `Rig`, u = K (r - y). Its force is held over each sample. For
        several axes K is a matrix, full or diagonal. A state space acts without delay and limits.
    fs : float, optional
        Sampling frequency [Hz]; needed without a controller and without a drive.
    disturbance : (n,) or (n_u, n) ndarray, optional
        Force added to that of the controller or drive [N], held over each sample.
    noise : (n,) or (n_y, n) ndarray, optional
        Noise added to the measured position before quantisation [m] or [rad].
    initial : (2,) or (2, axes) ndarray, optional
        Initial position and velocity; by default zeros. The friction has no initial force.
    oversampling : int, optional
        Integration steps per sample; by default 4 with a controller and 1 otherwise. With a
        controller or a drive this is a minimum: more steps are taken if the machine needs them.
    hold : str, optional
        Force on a `Rig` between samples: "linear", or "zoh" (held).

    Returns
    -------
    Trajectory
        The motion, sample by sample. For an unstable loop its field `diverged` is True; this is no
        error.

    Raises
    ------
    ValueError
        An argument has no effect on this machine; signals do not fit each other; the controller is
        continuous, or its inputs and outputs are not those of the rig; the integration step is too
        long to be stable (the message states a sufficient oversampling); or the machine is far too
        fast for its controller.

    Warns
    -----
    DataWarning
        The motion had more turning points than the friction law stores, so its force is
        approximate.

    References
    ----------
    K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold and delay),
    3.5 (anti-windup).

    Examples
    --------
    A force below the static friction moves the mass by a few micrometres only.

    >>> import numpy as np
    >>> from nlfrf import paper_rig, servo_axis
    >>> pushed = run(paper_rig(), np.full(4000, 0.5), fs=4000)
    >>> bool(2e-6 < pushed.x[-1] < 8e-6)
    True

    At constant velocity the friction force becomes that of the Stribeck curve plus viscous
    friction.

    >>> from nlfrf.friction import Leuven
    >>> round(float(run(Leuven(), np.full(2000, 0.01), fs=10e3).friction[-1]), 4)
    0.8144

    A controller with an integrator brings the position to the reference; a belt axis moves by a
    millimetre.

    >>> from types import SimpleNamespace
    >>> K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
    >>> bool(abs(run(paper_rig(), np.full(3000, 1e-3), K).e[-1]) < 1e-5)
    True
    >>> bool(abs(run(servo_axis("belt"), np.full(4000, 1e-3)).position[-1] - 1e-3) < 2e-5)
    True
    """
    given = {"controller": controller, "fs": fs, "hold": hold, "initial": initial}
    given |= {"disturbance": disturbance, "noise": noise}
    if oversampling is None:
        steps = 1 if controller is None else 4
    else:
        steps = oversampling
    begin = (0.0, 0.0) if initial is None else initial
    if isinstance(machine, ServoAxis):
        _require_unused("a servo axis", given, ("controller", "fs", "hold", "disturbance"))
        if isinstance(signal, Mapping):
            ports = dict(signal)
        else:
            ports = {"position": signal}
        closed = "torque" not in ports
        require_known("signal", ports, (*PORTS, "torque") if closed else ("torque",))
        if not closed:
            ports = {"force": ports["torque"]}
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
