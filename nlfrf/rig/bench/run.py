"""`run`: simulate any machine under any signal, with or without a controller."""

from __future__ import annotations

from collections.abc import Mapping
from functools import singledispatch
from typing import NamedTuple, cast

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
    if oversampling is None:
        steps = 1 if controller is None else 4
    else:
        steps = oversampling
    return _run_machine(
        machine,
        _Task(
            signal=signal,
            controller=controller,
            fs=fs,
            disturbance=disturbance,
            noise=noise,
            initial=initial,
            steps=steps,
            hold=hold,
        ),
    )


class _Task(NamedTuple):
    """The arguments of `run` for any machine."""

    signal: ArrayLike | Mapping[str, ArrayLike | None]
    controller: object
    fs: float | None
    disturbance: ArrayLike | None
    noise: ArrayLike | None
    initial: ArrayLike | None
    steps: int
    hold: str | None

    @property
    def begin(self) -> ArrayLike:
        """Initial position and velocity."""
        if self.initial is None:
            return (0.0, 0.0)
        return self.initial

    def require_samples(self) -> ArrayLike:
        """Return the signal; refuse named set points."""
        if isinstance(self.signal, Mapping):
            raise ValueError(
                "signal must be an array if machine is no servo axis, got"
                f" {short_form(self.signal)}"
            )
        return self.signal

    def require_fs(self) -> float:
        """Return the sampling frequency, which no controller and no drive states."""
        if self.fs is None:
            raise ValueError(
                "fs must be given, the sampling frequency of the signal [Hz], got none"
            )
        return self.fs

    def require_unused(self, machine: str, names: tuple[str, ...]) -> None:
        """Refuse arguments that would have no effect."""
        for name in names:
            if getattr(self, name) is not None:
                raise ValueError(
                    f"{name} must be left out for {machine}, got {short_form(getattr(self, name))}"
                )


@singledispatch
def _run_machine(machine: Rig | ServoAxis | Friction, task: _Task) -> Trajectory:
    """Run a friction law; other machines are registered below."""
    signal = task.require_samples()
    if task.controller is not None:
        require_kind("machine", machine, Rig)
    fs = task.require_fs()
    task.require_unused("a friction law", ("hold", "initial", "disturbance", "noise"))
    return run_law(cast("Friction", machine), signal, fs=fs, oversampling=task.steps)


@_run_machine.register(Rig)
def _run_rig(machine: Rig, task: _Task) -> Trajectory:
    signal = task.require_samples()
    if task.controller is not None:
        task.require_unused("a rig with a controller", ("fs", "hold"))
        law = as_controller(task.controller)
        finest = steps_per_sample(machine, law.fs, task.steps)
        loop = run_axes_loop if machine.several else run_one_loop
        signals = {"disturbance": task.disturbance, "noise": task.noise}
        return loop(machine, law, signal, signals=signals, initial=task.begin, steps=finest)
    fs = task.require_fs()
    task.require_unused("a rig without a controller", ("initial", "disturbance", "noise"))
    return run_rig(machine, signal, fs=fs, oversampling=task.steps, hold=task.hold or "linear")


@_run_machine.register(ServoAxis)
def _run_servo_axis(machine: ServoAxis, task: _Task) -> Trajectory:
    task.require_unused("a servo axis", ("controller", "fs", "hold", "disturbance"))
    if isinstance(task.signal, Mapping):
        ports = dict(task.signal)
    else:
        ports = {"position": task.signal}
    closed = "torque" not in ports
    require_known("signal", ports, (*PORTS, "torque") if closed else ("torque",))
    if not closed:
        ports = {"force": ports["torque"]}
    return run_axis(
        machine,
        ports,
        closed=closed,
        noise=task.noise,
        initial=task.begin,
        oversampling=task.steps,
    )
