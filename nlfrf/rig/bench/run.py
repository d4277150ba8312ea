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

    - A `Rig` takes the force [N], with a controller the reference [m] of the measured positions.
    - A `ServoAxis` takes set points of its drive.
    - A friction law takes a velocity [m/s], linear between samples, and gives its friction force.

    Parameters
    ----------
    machine : Rig, ServoAxis or friction law
        The machine to run.
    signal : (n,) ndarray, (channels, n) for a `Rig` with several axes, or dict for a `ServoAxis`
        One value per sample. For a `ServoAxis` an array is the position set point, and a dict has
        these names: "position" [m] or [rad], the set point; "velocity" [m/s] or [rad/s], added to
        that of the velocity; "force" [N] or [Nm], added to the output of the velocity controller
        before the current limit; or "torque" alone, with both loops open.
    controller : Controller or state space, optional
        Sampled controller around a `Rig`, u = K (r - y), whose force is held over each sample; a
        matrix for several axes. A state space acts without delay and limits.
    fs : float, optional
        Sampling frequency [Hz]; needed without a controller and without a drive.
    disturbance : (n,) or (n_u, n) ndarray, optional
        Force added to that of the controller or drive [N], held over each sample.
    noise : (n,) or (n_y, n) ndarray, optional
        Noise added to the measured position before quantisation [m] or [rad].
    initial : (2,) or (2, axes) ndarray, optional
        Initial position and velocity; by default zeros. The friction has no initial force.
    oversampling : int, optional
        Integration steps per sample; by default 4 with a controller and 1 otherwise. A machine with
        a controller or a drive takes more if it needs them.
    hold : str, optional
        Force on a `Rig` between samples: "linear", or "zoh" (held).

    Returns
    -------
    Trajectory
        The motion, sample by sample. For an unstable loop its field `diverged` is True.

    Raises
    ------
    ValueError
        An argument has no effect on this machine; signals do not fit each other; the controller is
        continuous, or its inputs and outputs are not those of the rig; the integration step is too
        long to be stable; or the machine is far too fast for its controller.

    Warns
    -----
    DataWarning
        The force is approximate: the motion had more turning points than the friction law stores.

    References
    ----------
    Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 2.3 (hold), 3.5 (anti-windup).

    Examples
    --------
    A force below the static friction moves the mass by a few micrometres only.

    >>> import numpy as np
    >>> from nlfrf import paper_rig, servo_axis
    >>> pushed = run(paper_rig(), np.full(4000, 0.5), fs=4000)
    >>> bool(2e-6 < pushed.x[-1] < 8e-6)
    True

    At constant velocity the friction force is that of the Stribeck curve plus viscous friction.

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
    if oversampling is None:
        steps = 1 if controller is None else 4
    else:
        steps = oversampling
    begin = (0.0, 0.0) if initial is None else initial
    if isinstance(machine, ServoAxis):
        _require_unused("a servo axis", given, ("controller", "fs", "hold", "disturbance"))
        ports, closed = _ports_of(signal)
        return run_axis(
            machine, ports, closed=closed, noise=noise, initial=begin, oversampling=steps
        )
    if isinstance(signal, Mapping):
        raise ValueError(
            f"signal must be an array if machine is no servo axis, got {short_form(signal)}"
        )
    if controller is not None:
        _require_unused("a rig with a controller", given, ("fs", "hold"))
        signals = {"disturbance": disturbance, "noise": noise}
        return _run_loop(machine, controller, signal, signals=signals, initial=begin, steps=steps)
    if fs is None:
        raise ValueError("fs must be given, the sampling frequency of the signal [Hz], got none")
    if isinstance(machine, Rig):
        _require_unused("a rig without a controller", given, ("initial", "disturbance", "noise"))
        return run_rig(machine, signal, fs=fs, oversampling=steps, hold=hold or "linear")
    _require_unused("a friction law", given, ("hold", "initial", "disturbance", "noise"))
    return run_law(machine, signal, fs=fs, oversampling=steps)


def _ports_of(
    signal: ArrayLike | Mapping[str, ArrayLike | None],
) -> tuple[dict[str, ArrayLike | None], bool]:
    """Return the set points of a drive by their names, and whether its loops are closed."""
    if isinstance(signal, Mapping):
        ports = dict(signal)
    else:
        ports = {"position": signal}
    closed = "torque" not in ports
    require_known("signal", ports, (*PORTS, "torque") if closed else ("torque",))
    if not closed:
        ports = {"force": ports["torque"]}
    return ports, closed


def _run_loop(
    machine: Rig | Friction,
    controller: object,
    signal: ArrayLike,
    *,
    signals: dict[str, ArrayLike | None],
    initial: ArrayLike,
    steps: int,
) -> Trajectory:
    """Run a rig with its controller, in as many steps as the machine needs."""
    require_kind("machine", machine, Rig)
    assert isinstance(machine, Rig)
    law = as_controller(controller)
    finest = steps_per_sample(machine, law.fs, steps)
    loop = run_axes_loop if machine.several else run_one_loop
    return loop(machine, law, signal, signals=signals, initial=initial, steps=finest)


def _require_unused(machine: str, given: Mapping[str, object], names: tuple[str, ...]) -> None:
    """Refuse arguments that would have no effect."""
    for name in names:
        if given[name] is not None:
            raise ValueError(
                f"{name} must be left out for {machine}, got {short_form(given[name])}"
            )
