"""A controller as the gains of a drive: the P-PI cascade that equals a given PID.

With q = z^-1, p = 1 - q and a = Ts/tn, a cascade that computes the velocity by differences, with a
low-pass with pole b and further filters F, is

    K = F kp (p + a q)/p ((1 - b) p/(Ts (1 - b q)) + kv) = F (n0 + n1 p + n2 p^2)/(p (1 - b q)),

a PID with filtered derivative. Conversely, every such PID with two real zeros is a cascade. One
zero belongs to the velocity loop and is 1 - a. The other, z, belongs to the position loop and gives

    kv = (1 - b)(1 - z)/(Ts (z - b)).

In continuous time: (Kp Tf + Kd) s^2 + (Kp + Ki Tf) s + Ki = kp (1 + kv Tf)(s + 1/tn)(s + kv/(1 + kv
Tf)). Real zeros need (Kp + Ki Tf)^2 >= 4 Ki (Kp Tf + Kd). Either zero may be assigned to either
loop; the controller is the same.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust._base.types import LinearSystem
from robust.lti.lti import response_by_channel, timebase
from robust.lti.realisation import multivariable
from robust.lti.sampling import discretize
from robust.servo.gains.p_pi import hold_mean, realise_section, velocity_section

#: Largest error of a cascade over frequency, relative to K, that counts as zero. An exact cascade
#: has 1e-12.
_MISFIT = 1e-6
#: Frequencies [rad/sample] at which K is compared. A zero below the slowest one counts as an
#: integrator.
_SLOWEST, _FASTEST, _N_FREQUENCIES = 1e-6, 0.95 * np.pi, 200
#: A zero, relative to the slowest frequency, below which it cancels the pole at zero: there is no
#: integral part.
_NO_INTEGRATOR = 1e-6
#: A zero and the pole of the filter cancel below this distance, relative to the distance of the
#: pole from 1.
_CANCELS = 1e-6


@value
class _DriveReading:
    """Gains of a drive that equal a controller K, with the largest error over frequency relative to
    K.

    If there are two solutions, `settings` has the slower position loop. `alternative` is exactly
    the same controller, with the zeros of position loop and velocity loop exchanged.

    >>> from nlfrf.rig import Drive
    >>> from robust.servo import cascade
    >>> settings = Drive(fs=4000, kv=60, kp=143, kp_unit="A/(m/s)", tn=0.01)
    >>> found = gains_from_controller(cascade(settings), like=settings)
    >>> round(found.settings.kv, 6), round(found.settings.kp, 6), round(found.settings.tn, 9), found.misfit < 1e-9
    (60.0, 143.0, 0.01, True)
    """

    settings: Drive
    alternative: Drive | None
    misfit: float

    def __str__(self) -> str:
        other = self.alternative
        if other is None:
            more = ""
        else:
            more = f"\nthe same controller: kv = {other.kv:.6g} 1/s, tn = {1e3 * other.tn:.6g} ms"
        return f"{self.settings}{more}\nerror at most {self.misfit:.1e} of K"


def gains_from_controller(K: LinearSystem, *, like: Drive, output_unit: str = "") -> _DriveReading:
    """Convert a controller to the gains kv, kp, tn and the velocity low-pass filter of a drive.

    Use this to enter a designed controller in a drive. A PID with a filtered derivative can be
    written as a cascade if its two zeros are real and slow compared with its filter. A controller
    that is no such cascade raises an error with the misfit.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or float
        Controller with one position as input, or two if `like` has two encoders; for example from
        `cascade`, `design_frf` or `tune`. A continuous K is first discretised at `like.fs` by the
        bilinear map.
    like : Drive
        Drive that defines sampling, units, filters and encoders. Its `kv`, `kp` and `tn` are not
        used. If it has one encoder and computes the velocity by differences, `velocity_lag` is also
        determined from K.
    output_unit : str
        Unit of the output of K, as for `cascade`.

    Returns
    -------
    DriveReading

    Raises
    ------
    ValueError
        A controller that is no such cascade: complex zeros, a derivative filter that is too slow or
        too fast, gains of both signs, or a misfit. The message contains the number.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.2: series and parallel form.

    Examples
    --------
    A PID of kp (s + 1/tn)(s + kv)/s, with kp = 2 A/(m/s), tn = 10 ms, kv = 40 1/s, and with a
    derivative filter.

    >>> from nlfrf.rig import Drive
    >>> from robust.shaping import pid
    >>> drive = Drive(fs=4000, kv=1, kp=1, kp_unit="A/(m/s)")
    >>> found = gains_from_controller(pid(280.0, 8000.0, 2.0, filter_time=0.5e-3), like=drive).settings
    >>> [round(number, 2) for number in (found.kv, 1e3 * found.tn, found.kp, 1e3 * found.velocity_lag)]
    [41.41, 10.98, 2.12, 0.38]
    """
    require_kind("like", like, Drive)
    K = multivariable("K", K)
    n_inputs = 2 if like.encoder == "both" else 1
    if (K.ninputs, K.noutputs) != (n_inputs, 1):
        raise ValueError(
            f"K must have one output and {n_inputs} position{'s' * (n_inputs > 1)} for a drive with"
            " encoder "
            f'"{like.encoder}", got {K.noutputs} and {K.ninputs}'
        )
    if not timebase(K) and K.nstates:
        K = discretize(K, like.dt)
    if timebase(K) and abs(timebase(K) / like.dt - 1) > 1e-9:
        raise ValueError(f"K must be sampled as the drive is, {like.dt:g} s, got {timebase(K):g} s")
    angles = np.geomspace(_SLOWEST, _FASTEST, _N_FREQUENCIES)
    behind = np.ones(angles.size, dtype=complex)
    for section in like.sections:
        behind *= _response_at(realise_section(section, like.dt), angles)[0]
    measured = _response_at(K, angles) / (
        behind * like.output_factor(output_unit or like.output_unit)
    )
    if not np.all(np.abs(measured) > 0):
        raise ValueError(
            "K must depend on every position that the drive measures, got a response of zero"
        )
    p = -np.expm1(-1j * angles)
    if like.encoder == "both" or like.velocity_from == "observer" or like.position_every > 1:
        solutions = [_read_known_velocity(measured, p, angles=angles, like=like)]
    else:
        solutions = _read_pid(measured[0], p, like)
    found = [_settings_of(like, *map(float, solution)) for solution in solutions]
    misfit = _misfit_of(found[0], measured, p=p, angles=angles)
    if not misfit <= _MISFIT:
        raise ValueError(
            "K must be a P-PI cascade of this drive, got a controller with a relative error of"
            f" {misfit:.2g} to the nearest such cascade: its filters differ from those of like, or"
            " its structure does"
        )
    return _DriveReading(
        settings=found[0], alternative=found[1] if len(found) > 1 else None, misfit=misfit
    )


def _read_pid(K: np.ndarray, p: np.ndarray, like: Drive) -> list[tuple[float, float, float, float]]:
    """Return (kp, kv, a, b) of K p (1 - b q) = n0 + n1 p + n2 p^2, both solutions; q = 1 - p."""
    R = K * p
    columns = np.stack([(1 - p) * R, np.ones_like(p), p, p**2])
    b, n0, n1, n2 = solve_relative(columns, R)
    if not abs(n1) + abs(n2) > 0:
        raise ValueError(
            "K must depend on the velocity, got a controller whose gain is zero except at zero"
            " frequency"
        )
    if abs(n0) <= _NO_INTEGRATOR * _SLOWEST * abs(n1):
        n0 = 0.0
    if not -1e-9 <= b < 1:
        raise ValueError(
            "K must have a derivative filter that is a low-pass of the velocity, of pole 0 to 1,"
            f" got a pole at {b:.4g}"
            + (": take a filter time above half the sampling time" if b < 0 else "")
        )
    b = max(b, 0.0)
    square = n1**2 - 4 * n0 * n2
    if square < -1e-9 * n1**2:
        raise ValueError(
            "K must have two real zeros to be a cascade, one for the position loop and one for the"
            " reset of the velocity loop: n1^2 >= 4 n0 n2, with K p (1 - b q) = n0 + n1 p + n2"
            " p^2, p = 1 - q, q = 1/z (for a PID (Kp + Ki Tf)^2 >= 4 Ki (Kp Tf + Kd)), got 4 n0 n2"
            f" at {4 * n0 * n2 / n1**2:.4g} times n1^2. Lower the integral gain, or design a PD"
            " with a fixed PI in series, which has real zeros"
        )
    # zeros in p, the smaller one without cancellation
    big = -0.5 * (n1 + np.copysign(np.sqrt(max(square, 0.0)), n1))
    roots = sorted(
        (abs(root), root) for root in ((n0 / big if big else 0.0), big / n2 if n2 else np.inf)
    )
    slow, fast = (root for _, root in roots)
    # of the position loop, of the velocity loop
    if n0:
        pairs = [(slow, fast), (fast, slow)]
    else:
        pairs = [(fast, 0.0)]
    found, refusals = [], []
    for position, velocity in pairs:
        z, a = 1 / (1 - position) if np.isfinite(position) else 0.0, -velocity / (1 - velocity)
        if z - b > _CANCELS * (1 - b):
            kv = (1 - b) * (1 - z) * like.fs / (z - b)
        else:
            kv = -1.0
        if not (kv >= 0 and a >= 0 and z <= 1 and abs(1 - a - b) > _CANCELS * (1 - b)):
            refusals.append((z, a))
            continue
        # K(z = infinity), where p = 1 and q = 0
        kp = (n0 + n1 + n2) / ((1 - b) * like.fs + kv) / like.position_scale.factor
        found.append((kp, kv, a, b))
    if not found:
        z, a = refusals[0]
        raise ValueError(
            f"K must have zeros between the pole of its derivative filter, {b:.4g}, and 1 to be a"
            f" cascade, got zeros at {z:.6g} and {1 - a:.6g}"
        )
    return found


def _read_known_velocity(
    K: np.ndarray, p: np.ndarray, *, angles: np.ndarray, like: Drive
) -> tuple[float, float, float, float]:
    """Return (kp, kv, a, nan) for the velocity filter of `like`:

    K p is linear in kp, kp a, kp kv and kp kv a.

    With two encoders the velocity loop uses the motor, and the position loop uses the load.
    """
    (V, H), both = _parts_of(like, angles), like.encoder == "both"
    velocity = like.position_scale.factor * np.stack([p * V, (1 - p) * V])
    position = (like.load_scale if both else like.position_scale).factor * np.stack(
        [p * H, (1 - p) * H]
    )
    if both:
        kp, by_reset = solve_relative(velocity, K[0] * p)
        by_position, _ = solve_relative(position, K[1] * p)
    else:
        kp, by_reset, by_position, _ = solve_relative(
            np.concatenate([velocity, position]), K[0] * p
        )
    if not kp:
        raise ValueError("K must depend on the velocity, got a controller with zero gain for it")
    return kp, by_position / kp, by_reset / kp, np.nan


def _settings_of(like: Drive, kp: float, kv: float, a: float, b: float) -> Drive:
    """Return the settings of a drive from kp, kv, a = Ts/tn and the pole b of the velocity
    low-pass.
    """
    if not (kp > 0 and kv > -1e-12 and a > -1e-12):
        raise ValueError(
            f"K must have gains of one sign to be a cascade, got kp = {kp:.4g}"
            f" {like.output_unit}/({like.base_unit}/s), kv = {kv:.4g} 1/s and 1/tn ="
            f" {a * like.fs:.4g} 1/s"
        )
    if np.isnan(b):
        lag = like.velocity_lag
    else:
        lag = b / (1 - b) * like.dt
    return replace(
        like,
        kp=kp * like.kp / like.gain,
        kv=max(kv, 0.0),
        tn=like.dt / a if a > 0 else np.inf,
        velocity_lag=lag,
    )


def _misfit_of(settings: Drive, K: np.ndarray, *, p: np.ndarray, angles: np.ndarray) -> float:
    """Return the largest error of a cascade over frequency relative to K, which has no filters and
    output factor.
    """
    V, H = _parts_of(settings, angles)
    pi = settings.gain * (1 + settings.dt / settings.tn * (1 - p) / p)
    if settings.encoder == "both":
        paths = np.stack(
            [settings.position_scale.factor * V, settings.kv * settings.load_scale.factor * H]
        )
    else:
        paths = settings.position_scale.factor * (V + settings.kv * H)[None]
    with np.errstate(all="ignore"):
        return float(np.max(np.abs(pi * paths - K) / np.abs(K)))


def _parts_of(settings: Drive, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (W,) responses from a position to its velocity, and to the position that its loop
    holds.
    """
    velocity = realise_section(velocity_section(settings), settings.dt)
    return _response_at(velocity, angles)[0], _response_at(hold_mean(settings), angles)[0]


def _response_at(system: control.StateSpace, angles: np.ndarray) -> np.ndarray:
    """Return (inputs, W) response of a sampled system with one output at angles [rad/sample]."""
    if system.nstates:
        found = response_by_channel(system, angles / timebase(system))
    else:
        found = system.D[:, :, None]
    return np.asarray(np.broadcast_to(found[0], (system.ninputs, angles.size)))


def solve_relative(columns: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return (J,) real coefficients of columns (J, W) for a response (W,), by least squares of the
    relative error.
    """
    weighted = columns / np.abs(wanted)
    size = np.sqrt(np.mean(np.abs(weighted) ** 2, axis=1))
    rows = np.concatenate(
        [(weighted / size[:, None]).real, (weighted / size[:, None]).imag], axis=1
    )
    turned = wanted / np.abs(wanted)
    found = np.linalg.lstsq(rows.T, np.concatenate([turned.real, turned.imag]), rcond=None)[0]
    return np.asarray(found / size)
