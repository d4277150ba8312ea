"""A PID controller as its gains, and as parameters for a programmable controller."""

from __future__ import annotations

from contextlib import suppress

import control
import numpy as np

from nlfrf._base.arguments import inverse_unit, join_names, require_kind, require_positive
from nlfrf._base.values import value, wrap_lines
from robust._base.types import Controller
from robust.lti.lti import poles, response, timebase
from robust.lti.norms import continuous_image
from robust.lti.realisation import multivariable, split_diagonal

# |s| dt, or |s| over the other pole, below which a pole is an integrator
_INTEGRATOR_TOLERANCE = 1e-7
_RESPONSE_TOLERANCE = 1e-6
_NOTHING_IN_SAMPLES = 1e6  # Ti in samples, from which an integral is lost in single precision
_LONGEST_TIME = 2**31 * 1e-3  # largest TIME of IEC 61131-3 in S7 blocks [s]
_NEGLIGIBLE = 0.01  # share of |K| below which a part of it has no effect
_ROUNDING_TOLERANCE = 64 * np.finfo(float).eps  # share of its terms below which a gain is rounding


@value
class PidGains:
    """Gains of the PID controller Kp + Ki/s + Kd s/(Tf s + 1), also in other forms.

    Fields
    ------
    kp, ki, kd : float
        Gains of the parallel form: kp in the unit of u over y, ki in this unit per second, kd in
        this unit times seconds.
    filter_time : float
        Tf, time constant of the derivative filter [s]; zero without a derivative.
    dt : float
        Sampling time of the difference equation [s]; 0 if there is none.
    unit : str
        Unit of kp, if known.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.

    Examples
    --------
    >>> gains = PidGains(kp=2.0, ki=4.0, kd=0.1, filter_time=0.01)
    >>> gains.integral_time, gains.derivative_time
    (0.5, 0.05)
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    filter_time: float = 0.0
    dt: float = 0.0
    unit: str = ""

    @property
    def integral_time(self) -> float:
        """Return Ti = Kp/Ki of the ideal form Kp (1 + 1/(Ti s) + Td s/(Tf s + 1)) [s]; inf without
        integral action.
        """
        if self.ki:
            return self.kp / self.ki
        return float("inf")

    @property
    def derivative_time(self) -> float:
        """Return Td = Kd/Kp of the ideal form [s]; nan if kp is zero."""
        if self.kp:
            return self.kd / self.kp
        return float("nan")

    @property
    def has_ideal_form(self) -> bool:
        """Return True if a PLC block accepts the ideal form: its times are at least one sample.

        Ti and Td are positive only if all gains have the sign of kp. The manual of the block CONT_C
        requires TI and TD of at least one cycle.
        """
        return self.kp != 0 and not self._unusable_times

    @property
    def _unusable_times(self) -> str:
        """Describe the times of the ideal form that no block accepts; empty without any."""
        times = [("Ti", self.integral_time)] * bool(self.ki) + [
            ("Td", self.derivative_time)
        ] * bool(self.kd)
        for low, high, what in (
            (-np.inf, 0, "negative"),
            (0, self.dt, f"shorter than a sample of {1e3 * self.dt:g} ms"),
        ):
            if named := [f"{name} = {time:.4g} s" for name, time in times if low <= time < high]:
                return f"{' and '.join(named)} would be {what}"
        return ""

    def plc_parameters(self) -> list[str]:
        """Return the parameters of Siemens and TwinCAT blocks, one line a block; [] without ideal
        form.

        In each block a time of zero switches that part of the PID off. The blocks discretise the
        PID themselves. The loop is therefore the one that was checked only if their cycle is short
        compared with Ti, Td and Tf.

        References
        ----------
        Siemens, *SIMATIC S7-1200, S7-1500 PID control* (A5E35300227), 9.1 (PID_Compact); *Standard
        software for S7-300 and S7-400 PID control* (C79000-G7076-C516) (CONT_C). Beckhoff,
        *Tc2_ControllerToolbox* (FB_CTRL_PID).

        Examples
        --------
        >>> for row in PidGains(kp=2.0, ki=4.0, kd=0.1, filter_time=0.01).plc_parameters():
        ...     print(row)
        Siemens PID_Compact: Gain = 2, Ti = 0.5 s, Td = 0.05 s, TdFiltRatio = 0.2, PWeighting = 1, DWeighting = 1
        Siemens CONT_C: GAIN = 2, TI = 0.5 s, TD = 0.05 s, TM_LAG = 0.01 s
        TwinCAT FB_CTRL_PID: fKp = 2, tTn = 0.5 s, tTv = 0.05 s, tTd = 0.01 s
        """
        if not self.has_ideal_form:
            return []
        gain = f"{self.kp:.6g}"
        integral = f"{self.integral_time if self.ki else 0.0:.6g} s"
        derivative = f"{self.derivative_time if self.kd else 0.0:.6g} s"
        lag = f"{self.filter_time:.6g} s"
        ratio = f"{self.filter_time / self.derivative_time if self.kd else 0.0:.6g}"
        return [
            (
                f"Siemens PID_Compact: Gain = {gain}, Ti = {integral}, Td = {derivative},"
                f" TdFiltRatio = {ratio}, PWeighting = 1, DWeighting = 1"
            ),
            f"Siemens CONT_C: GAIN = {gain}, TI = {integral}, TD = {derivative}, TM_LAG = {lag}",
            f"TwinCAT FB_CTRL_PID: fKp = {gain}, tTn = {integral}, tTv = {derivative}, tTd = {lag}",
        ]

    def difference_equation(self) -> list[str]:
        """Return the statements, in order, that compute u[k] from the error e[k] = r[k] - y[k].

        The trapezoidal rule (Tustin) gives exactly the transfer function of the sampled controller.
        The integral i and the derivative are separate states. So rounded coefficients do not
        destroy the integral action, and i can be held while u is at its limit.
        """
        if not self.dt:
            raise ValueError(
                "dt must be given to pid_gains for a difference equation [s], got a continuous"
                " controller"
            )
        rows, terms = [], [f"{self.kp:.10g} e[k]"] if self.kp else []
        if self.ki:
            rows.append(f"i[k] = i[k-1] + {self.ki * self.dt / 2:.10g} (e[k] + e[k-1])")
            terms.append("i[k]")
        if self.kd:
            long = 2 * self.filter_time + self.dt
            keep = (2 * self.filter_time - self.dt) / long
            rows.append(f"d[k] = {keep:.10g} d[k-1] + {2 * self.kd / long:.10g} (e[k] - e[k-1])")
            terms.append("d[k]")
        return [*rows, f"u[k] = {' + '.join(terms) or '0'}"]

    @property
    def forms(self) -> list[str]:
        """Return the parallel form, the ideal form and the difference equation, one line each."""
        if self.unit:
            per_s, times_s = f" {self.unit}/s", f" {self.unit} s"
        else:
            per_s, times_s = "", ""
        parts = [f"Kp = {self.kp:.6g}{f' {self.unit}' if self.unit else ''}"]
        parts += [f"Ki = {self.ki:.6g}{per_s or ' 1/s'}"] if self.ki else []
        parts += (
            [f"Kd = {self.kd:.6g}{times_s or ' s'}", f"Tf = {self.filter_time:.6g} s"]
            if self.kd
            else []
        )
        form = "Kp" + " + Ki/s" * bool(self.ki) + " + Kd s/(Tf s + 1)" * bool(self.kd)
        rows = [f"parallel, {form}: {', '.join(parts)}"]
        if self.kp and not self.has_ideal_form:
            rows.append(
                f"ideal: none that a PLC takes, as {self._unusable_times}; use the parallel form"
            )
        elif self.kp and (self.ki or self.kd):
            times = [parts[0]]
            times += [f"Ti = {self.integral_time:.6g} s"] if self.ki else []
            times += (
                [f"Td = {self.derivative_time:.6g} s", f"Tf = {self.filter_time:.6g} s"]
                if self.kd
                else []
            )
            form = "1" + " + 1/(Ti s)" * bool(self.ki) + " + Td s/(Tf s + 1)" * bool(self.kd)
            rows.append(f"ideal, Kp ({form}): {', '.join(times)}")
        elif self.ki or self.kd:
            rows.append("ideal: none, as Kp is zero")
        if self.dt:
            rows.append(
                f"once a sample, at {1 / self.dt:.6g} Hz, e = r - y:"
                f" {'; '.join(self.difference_equation())}"
            )
        return rows

    def __str__(self) -> str:
        return "\n".join(self.forms)


def pid_gains(
    K: Controller, *, dt: float | None = None, unit: str = ""
) -> PidGains | tuple[PidGains, ...]:
    """Return the gains of a PID, PI, PD, P or I controller, to enter in a drive or a PLC.

    Use this to enter a designed controller by hand; `print` shows all forms.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or float
        Controller. For several channels it must be diagonal, one PID for each loop. The gains of a
        sampled controller are those of a PID discretised by the trapezoidal rule (Tustin), which
        reproduces the controller exactly.
    dt : float, optional
        Sampling time [s] of the difference equation of a continuous K.
    unit : str
        Unit of the plant, y over u, as in `UncertaintyModel.origin`. The unit of Kp is its inverse.

    Returns
    -------
    PidGains, or for several channels a tuple of them, one for each loop
        A gain is returned as zero if it is below about 1e-14 of the terms to which it is added (for
        Kp: Ki dt/2, Kd/Tf and Kd/dt), because rounding in K has already destroyed it.

    Raises
    ------
    ValueError
        A controller with more poles than one integrator and one stable real pole, or with coupled
        channels.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3 and 13.

    Examples
    --------
    >>> import robust
    >>> gains = pid_gains(robust.shaping.pid(2.0, 3.0, 0.1, filter_time=0.01, dt=1e-3))
    >>> [round(gain, 9) for gain in (gains.kp, gains.ki, gains.kd, gains.filter_time)]
    [2.0, 3.0, 0.1, 0.01]
    >>> print(pid_gains(robust.shaping.pid(2.0, 3.0), dt=0.1))
    parallel, Kp + Ki/s: Kp = 2, Ki = 3 1/s
    ideal, Kp (1 + 1/(Ti s)): Kp = 2, Ti = 0.666667 s
    once a sample, at 10 Hz, e = r - y: i[k] = i[k-1] + 0.15 (e[k] + e[k-1]); u[k] = 2 e[k] + i[k]
    """
    require_kind("unit", unit, str)
    K = multivariable("K", K)
    if (K.ninputs, K.noutputs) != (1, 1):
        return tuple(_loop_gains(loop, dt, unit) for loop in split_diagonal("K", K))
    return _loop_gains(K, dt, unit)


def _loop_gains(K: control.StateSpace, dt: float | None, unit: str) -> PidGains:
    sampled = timebase(K)
    integrates, filter_time = _pid_structure(K, sampled)
    kp, ki, kd = _pid_coefficients(K, sampled, integrates=integrates, filter_time=filter_time)
    _require_same_response(K, sampled, kp=kp, ki=ki, kd=kd, filter_time=filter_time)
    step = sampled
    if not sampled and dt is not None:
        step = require_positive("dt", dt)
    if sampled and dt is not None and abs(dt / sampled - 1) > 1e-9:
        raise ValueError(f"dt must be the sampling time of K, {sampled:g} s, got {dt:g} s")
    return PidGains(
        kp=kp,
        ki=ki,
        kd=kd,
        filter_time=filter_time if kd else 0.0,
        dt=step,
        unit=inverse_unit(unit) if unit else "",
    )


def format_gains(K: Controller, unit: str, *, plc: bool = False) -> str:
    """Format the gains of a PID, one row each, also by names of a PLC; else empty."""
    with suppress(ValueError):
        found = pid_gains(K, unit=unit)
        if isinstance(found, tuple):
            loops = found
        else:
            loops = (found,)
        return wrap_lines(
            "".join(
                f"\nPID{f' {k + 1}' * (len(loops) > 1)} {row}"
                for k, gains in enumerate(loops)
                for row in [*gains.forms, *gains.plc_parameters() * plc]
            )
        )
    return ""


def reason_for_unusual_gains(K: Controller) -> str:
    """Return the reason why gains of a controller cannot be built, with the remedy; empty if they
    can, or no PID.

    >>> reason_for_unusual_gains(control.tf([-2.0, 30.0], [1.0, 0.0]))
    'the PID has Kp = -2 and Ki = 30: no PLC takes gains of different signs; --positive keeps them positive'
    >>> reason_for_unusual_gains(control.tf([3.75e9, 1.0], [3.75e9, 0.0]))
    'Ti = 3.75e+09 s: the integral is negligible; --structure P leaves it out'
    >>> reason_for_unusual_gains(2.0)
    ''
    """
    with suppress(ValueError):
        found = pid_gains(K)
        for gains in found if isinstance(found, tuple) else (found,):
            if reason := _unusual_signs(gains) or _unusual_integral(gains):
                return reason
    return ""


def _unusual_signs(gains: PidGains) -> str:
    """Describe gains with different signs; empty if they have the same."""
    named = {"Kp": gains.kp, "Ki": gains.ki, "Kd": gains.kd}
    if len({gain > 0 for gain in named.values() if gain}) < 2:
        return ""
    parts = join_names([f"{name} = {gain:.4g}" for name, gain in named.items() if gain])
    return (
        f"the PID has {parts}: no PLC takes gains of different signs; --positive keeps them"
        " positive"
    )


def _unusual_integral(gains: PidGains) -> str:
    """Describe an integral without effect; empty if it has one or there is none."""
    Ti = abs(gains.integral_time)
    if (
        gains.kp
        and gains.ki
        and (_NOTHING_IN_SAMPLES * gains.dt if gains.dt else _LONGEST_TIME) < Ti
    ):
        return (
            f"Ti = {Ti:.4g} s: the integral is negligible; --structure {'PD' if gains.kd else 'P'}"
            " leaves it out"
        )
    return ""


def advice_on_structure(K: Controller, omega: np.ndarray) -> str:
    """Return a proposal if Kp has no effect at the frequencies omega [rad/s]; empty if it has one,
    or no PID.

    >>> advice_on_structure(control.tf([1e-6, 20.0], [1.0, 0.0]), np.array([1.0, 100.0]))
    'Kp = 1e-06 is at most 0.0005 % of |K| on the lines: K is an integrator. Use --structure I'
    >>> advice_on_structure(control.tf([1.0, 20.0], [1.0, 0.0]), np.array([1.0, 100.0]))
    ''
    """
    with suppress(ValueError):
        gains = pid_gains(K)
        if isinstance(gains, tuple) or not gains.ki:
            return ""
        if gains.dt:
            s = 2j / gains.dt * np.tan(omega * gains.dt / 2)
        else:
            s = 1j * omega
        slope = gains.kd * s / (gains.filter_time * s + 1)
        size = np.abs(gains.kp + gains.ki / s + slope)
        share = float(np.max(abs(gains.kp) / size))
        if share <= _NEGLIGIBLE:
            found = f"Kp = {gains.kp:.3g} is at most {100 * share:.2g} % of |K| on the lines"
            if np.all(np.abs(slope) <= _NEGLIGIBLE * size):
                return f"{found}: K is an integrator. Use --structure I"
            return (
                f"{found}: K is an integrator and a derivative, for which no PLC has Ti and Td. Use"
                " the parallel form, or --structure PI or I"
            )
    return ""


def _pid_coefficients(
    K: control.StateSpace, dt: float, *, integrates: bool, filter_time: float
) -> tuple[float, float, float]:
    """Return Kp, Ki and Kd from the value at infinity and the residues at the poles; zero if they
    are rounding.

    K = Kp + Kd/Tf + Ki/s - Kd/Tf^2/(s + 1/Tf), in the s of the trapezoidal rule if K is sampled.
    """
    if dt:
        unit = 2 / dt
    else:
        unit = 1.0
    if K.nstates:
        A, B, C, D = continuous_image(K)
        p, V = np.linalg.eig(A)
    else:
        A, B, C, D = K.A, K.B, K.C, K.D
        p, V = np.zeros(0), np.zeros((0, 0))
    left, right = C @ V, np.linalg.solve(V, B)
    residues = unit * (left[0] * right[:, 0]).real
    sure = (
        _ROUNDING_TOLERANCE
        * unit
        * (np.abs(C) @ np.abs(V))[0]
        * (np.abs(np.linalg.inv(V)) @ np.abs(B))[:, 0]
    )
    residues = np.where(np.abs(residues) > sure, residues, 0.0)
    slow = np.argsort(np.abs(p))  # the integrator first
    if integrates:
        ki = float(residues[slow[0]])
    else:
        ki = 0.0
    if filter_time:
        kd = float(-residues[slow[-1]] * filter_time**2)
    else:
        kd = 0.0
    # for a sampled one D is the value at z = -1, from that at infinity and the rest
    terms = (
        abs(K.D[0, 0]) + abs(D[0, 0] - K.D[0, 0]) + (abs(kd) / filter_time if filter_time else 0.0)
    )
    terms += (
        abs(kd) / dt if dt else 0.0
    )  # a slow filter at a fast sampling rate shows in 1 - z alone
    kp = float(D[0, 0] - (kd / filter_time if filter_time else 0.0))
    return kp if abs(kp) > _ROUNDING_TOLERANCE * terms else 0.0, ki, kd


def _require_same_response(
    K: control.StateSpace, dt: float, *, kp: float, ki: float, kd: float, filter_time: float
) -> None:
    """Refuse a controller that the gains do not reproduce, for example a leaky integrator."""
    size = 1.0
    if filter_time:
        size = 1 / filter_time
    elif kp and ki:
        size = abs(ki / kp)
    omega = (min(size, 1 / dt) if dt else size) * np.geomspace(1e-3, 1.0, 24)
    s = 2j / dt * np.tan(omega * dt / 2) if dt else 1j * omega
    wanted = response(K, omega)
    error = np.abs(kp + ki / s + kd * s / (filter_time * s + 1) - wanted)
    if not np.all(error <= _RESPONSE_TOLERANCE * np.abs(wanted)):
        worst = np.max(error / np.abs(wanted))
        raise ValueError(
            f"K must be a PID, got one that differs from the nearest by {worst:.2g} of its size"
        )


def _pid_structure(K: control.StateSpace, dt: float) -> tuple[bool, float]:
    """Return whether a PID integrates, and its filter time [s]; raise for anything else."""
    p = poles(K).astype(complex)
    if dt:
        s = 2 / dt * (p - 1) / (p + 1)
    else:
        s = p
    size = np.abs(s)
    if dt:
        zero = size * dt < _INTEGRATOR_TOLERANCE
    else:
        zero = size <= _INTEGRATOR_TOLERANCE * np.max(size, initial=0.0)
    other = s[~zero]
    if (
        zero.sum() > 1
        or other.size > 1
        or np.any(other.real >= 0)
        or np.any(np.abs(other.imag) > 1e-6 * np.abs(other))
    ):
        raise ValueError(
            f"K must be a PID (at most one integrator and one stable real pole), got {K.nstates}"
            f" states with poles {', '.join(f'{root:.4g}' for root in p)}"
        )
    return bool(zero.any()), float(-1 / other[0].real) if other.size else 0.0
