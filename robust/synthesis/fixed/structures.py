"""Fixed controller structures K = X/Y, with X and Y linear in their parameters.

X and Y are polynomials in s over (s + a)^n, with integrators as factors of Y: K = F x(s) / (s^m
y(s)), F a known factor. Sampled controllers have the same form in the plane of the bilinear map, s
= 2/T (z - 1)/(z + 1).
"""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import require_integer, require_nonnegative, short_form
from nlfrf._base.values import value
from robust.lti.connections import in_series
from robust.lti.lti import response
from robust.lti.realisation import from_roots, order_roots

#: The fastest pole of a free denominator over the highest frequency evaluated, and over 2/T if
#: sampled.
FASTEST, FASTEST_SAMPLED = 10.0, 5.0
_LARGEST_ORDER = 12
_CONJUGATE = 1e-9  # imaginary part over size up to which a computed root is real
# zeros, integrators, other poles
_NAMED_STRUCTURES = {
    "P": (0, 0, 0),
    "I": (0, 1, 0),
    "PI": (1, 1, 0),
    "PD": (1, 0, 1),
    "PID": (2, 1, 1),
    "lead": (1, 0, 1),
    "lead-lag": (2, 0, 2),
}
#: Structures whose parameters are gains of a PLC.
PID_PARTS = ("P", "I", "PI", "PD", "PID")


@value
class ControllerStructure:
    """A controller structure of your own:

    K = x(s) / (s^m y(s)), defined by its degrees or by a given denominator.

    The names in `design_frf` ("PID", "lead-lag", ...) are such structures, too. Give a known factor
    of K, for example a notch, to the argument `fixed` of `design_frf`.

    Fields
    ------
    n_zeros, n_integrators, n_poles : int
        Degree of x, number m of integrators, and degree of y (the number of given poles).
    poles : tuple of complex
        Roots of y [rad/s], if the denominator is given: stable, and complex roots in pairs. Empty
        if y is free. A sampled controller has its poles at z = (1 + p dt/2)/(1 - p dt/2).
    real : bool
        True if every zero and pole must be real and stable, as for "lead" and "lead-lag".
    name : str
        Name in messages.

    Raises
    ------
    ValueError
        More zeros than poles and integrators, poles that are not stable, or not in pairs.

    References
    ----------
    Karimi & Kammer, *A data-driven approach to robust control of multivariable systems by convex
    optimization*, Automatica 85 (2017), 3.

    Examples
    --------
    A PI controller with resonant poles at 50 rad/s, for a disturbance at this frequency.

    >>> from robust import design_frf
    >>> resonant = ControllerStructure(n_zeros=3, n_integrators=1, poles=(-0.5 + 50j, -0.5 - 50j))
    >>> design = design_frf(control.tf([1], [0.1, 1]), resonant, M_S=1.6, omega_c=5.0)
    >>> design.met, sorted(design.K.poles().imag.round(6).tolist())
    (True, [-50.0, 0.0, 50.0])
    """

    n_zeros: int
    n_integrators: int = 0
    n_poles: int = 0
    poles: tuple[complex, ...] = ()
    real: bool = False
    name: str = "own"

    def __post_init__(self) -> None:
        poles = np.atleast_1d(np.asarray(self.poles, dtype=complex))
        if not np.isfinite(poles).all() or np.any(poles.real >= 0):
            raise ValueError(
                f"poles must be stable, got {short_form(self.poles)}. Integrators go to"
                " n_integrators"
            )
        if np.abs(np.poly(poles).imag).max(initial=0.0) > 1e-9 * np.abs(np.poly(poles)).max(
            initial=1.0
        ):
            raise ValueError(
                f"poles must be real or in conjugate pairs, got {short_form(self.poles)}"
            )
        for field in ("n_zeros", "n_integrators", "n_poles"):
            object.__setattr__(self, field, require_integer(field, getattr(self, field), least=0))
        if poles.size and self.n_poles not in (0, poles.size):
            raise ValueError(
                f"n_poles must be the number of the given poles, {poles.size}, got {self.n_poles}"
            )
        object.__setattr__(self, "poles", tuple(complex(p) for p in poles))
        object.__setattr__(self, "n_poles", int(poles.size) or self.n_poles)
        if not self.n_zeros <= self.order <= _LARGEST_ORDER:
            raise ValueError(
                f"n_zeros must be at most the poles and integrators ({self.order}), and these at"
                f" most {_LARGEST_ORDER}, got {self.n_zeros}"
            )

    @property
    def order(self) -> int:
        """Return the number of states."""
        return self.n_integrators + self.n_poles

    @property
    def free(self) -> bool:
        """Return True if y has free parameters."""
        return self.n_poles > 0 and not self.poles


def structure_of(
    name: str | int | ControllerStructure, integrators: int, filter_time: float | None
) -> ControllerStructure:
    """Return the structure for a name or an order, or a given one; refuse others."""
    if isinstance(name, ControllerStructure):
        if integrators or filter_time is not None:
            raise ValueError(
                "integrators and filter_time must be left out with a ControllerStructure,"
                " which contains both"
            )
        return name
    text = str(name)
    if isinstance(name, (int, np.integer)) and not isinstance(name, bool):
        text = f"order-{name}"
    if text.startswith("order-") and text[6:].isdigit():
        n = int(text[6:])
        if n > _LARGEST_ORDER or integrators > n:
            raise ValueError(
                f"structure must have an order from {integrators} (its integrators) to"
                f" {_LARGEST_ORDER}, got {n}"
            )
        found = ControllerStructure(
            name=text, n_zeros=n, n_integrators=integrators, n_poles=n - integrators
        )
    elif text in _NAMED_STRUCTURES:
        if integrators:
            raise ValueError(
                f'integrators must only be given with "order-n", got {integrators} with {text!r}'
            )
        zeros, own, rest = _NAMED_STRUCTURES[text]
        found = ControllerStructure(
            n_zeros=zeros, n_integrators=own, n_poles=rest, real=text.startswith("lead"), name=text
        )
    else:
        words = ", ".join(_NAMED_STRUCTURES)
        raise ValueError(
            f'structure must be one of {words}, "order-n" or a ControllerStructure, got'
            f" {short_form(name)}"
        )
    if filter_time is None:
        return found
    if text not in ("PD", "PID"):
        raise ValueError(f"filter_time must only be given with PD or PID, got it with {text!r}")
    tau = require_nonnegative("filter_time", filter_time)
    if tau == 0:
        raise ValueError("filter_time must be positive [s]: a derivative needs a filter, got 0")
    return ControllerStructure(
        name=text,
        n_zeros=found.n_zeros,
        n_integrators=found.n_integrators,
        poles=(complex(-1 / tau),),
    )


@value
class Basis:
    """A structure on a time base: parameters theta = (y, x) to Y, X and K."""

    structure: ControllerStructure
    a: float  # pole of the basis [rad/s], in the middle of the band
    dt: float  # sampling time [s]; 0 for continuous
    # slowest, fastest: smallest and largest |pole| of a free denominator [rad/s]; if sampled, in
    # the plane of the bilinear map
    slowest: float
    fastest: float
    fixed: control.StateSpace  # the known factor F, on the same time base

    @property
    def n_y(self) -> int:
        """Return the number of parameters of Y; one, its scale, if its poles are fixed."""
        if self.structure.free:
            return self.structure.n_poles + 1
        return 1

    @property
    def n_x(self) -> int:
        """Return the number of parameters of X."""
        return self.structure.n_zeros + 1

    def plane(self, omega: np.ndarray) -> np.ndarray:
        """Return (W,) j omega, or its image under the bilinear map."""
        return 1j * (
            2 / self.dt * np.tan(np.asarray(omega) * self.dt / 2) if self.dt else np.asarray(omega)
        )

    def Y(self, s: np.ndarray) -> np.ndarray:
        """Return (W, n_y) columns of y(s) s^m/(s + a)^order without the integrators' s^m/(s + a)^m:
        see `integrals`.
        """
        if self.structure.free:
            return self.powers(s, self.structure.n_poles)
        poles = np.array(self.structure.poles, dtype=complex)
        return np.prod(
            (1 - s[:, None] / poles) * (self.a / (s + self.a))[:, None], axis=1, keepdims=True
        )

    def integrals(self, s: np.ndarray) -> np.ndarray:
        """Return (W,) (s / (s + a))^m."""
        return (s / (s + self.a)) ** self.structure.n_integrators

    def X(self, s: np.ndarray) -> np.ndarray:
        """Return (W, n_x) columns of x(s) / (s + a)^order."""
        spare = self.structure.order - self.structure.n_zeros
        return self.powers(s, self.structure.n_zeros) * ((self.a / (s + self.a)) ** spare)[:, None]

    def columns(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (W, n) columns of Y and of F X over all of theta, on the axis."""
        s = self.plane(omega)
        Y = self.Y(s) * self.integrals(s)[:, None]
        X = self.X(s) * response(self.fixed, omega)[:, None]
        return np.hstack([Y, np.zeros_like(X)]), np.hstack([np.zeros_like(Y), X])

    def powers(self, s: np.ndarray, degree: int) -> np.ndarray:
        """Return (W, degree + 1) powers of q = (s - a)/(s + a): of modulus one on the axis, so no
        column is lost.
        """
        return np.power(((s - self.a) / (s + self.a))[:, None], np.arange(degree + 1))

    def unscaled(self, s: np.ndarray, degree: int) -> np.ndarray:
        """Return (W, degree + 1) the same columns times (s + a)^degree: polynomials in s, finite
        anywhere.
        """
        k = np.arange(degree + 1)
        return ((s[:, None] - self.a) / self.a) ** k * ((s[:, None] + self.a) / self.a) ** (
            degree - k
        )

    def zero_frequency(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (n,) rows of Y without its integrators and of X at zero frequency."""
        zero = np.zeros(1, complex)
        y, x = self.Y(zero)[0].real, self.X(zero)[0].real
        return np.concatenate([y, 0 * x]), np.concatenate([0 * y, x])

    def coefficients(self, roots: np.ndarray) -> np.ndarray:
        """Return (N, degree + 1) parameters of prod (s - roots) / (s + a)^degree, scaled, for (N,
        degree) roots.
        """
        degree = roots.shape[1]
        q = np.exp(2j * np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        if degree:
            s = self.a * (1 + q) / (1 - q)
        else:
            s = np.ones(1, complex)
        factors = (
            (s[:, None, None] - roots) / (s[:, None, None] + self.a) / (1 + np.abs(roots) / self.a)
        )
        values = np.prod(factors, axis=-1)
        return np.linalg.solve(np.power(q[:, None], np.arange(degree + 1)), values).real.T

    def polynomial(self, part: np.ndarray) -> np.ndarray:
        """Return (degree + 1,) coefficients in s/a, highest power first, of the polynomial for a
        part of theta.
        """
        total = np.zeros(part.size)
        for k, c in enumerate(part):
            up, down = np.poly(np.ones(k)), np.poly(-np.ones(part.size - 1 - k))
            total = total + c * np.polymul(up, down)
        return total

    def roots(self, part: np.ndarray) -> np.ndarray:
        """Return the roots in s for a part of theta, without those at infinity."""
        if np.any(part):
            found = np.roots(part[::-1])
        else:
            found = np.zeros(0)
        missing = part.size - 1 - found.size  # at q = infinity
        far = np.abs(1 - found) < 1e-7
        s = self.a * (1 + found[~far]) / (1 - found[~far])
        return np.concatenate([s, np.full(missing, -self.a)])

    def gain_rows(self) -> np.ndarray:
        """Return (Q, n), rows @ theta are Kp, Ki and Kd, as many as the structure has, each times a
        positive number.

        K = x(s) / (s^m (Tf s + 1)) is a PID whose gains are linear in x for a given Tf: from the
        lowest power on, each coefficient of x contains the previous gain times Tf.
        """
        shape = self.structure
        if shape.name not in PID_PARTS or shape.free:
            raise ValueError(
                f"positive must be used with {', '.join(PID_PARTS)}, got {shape.name!r}"
            )
        T = np.array([self.polynomial(e) for e in np.eye(self.n_x)]).T[
            ::-1
        ]  # coefficients, lowest power first
        filter_time = self.a * sum((-1 / p).real for p in shape.poles)
        rows = [T[0]]
        for k in range(1, self.n_x):
            rows.append(T[k] - filter_time * rows[-1])
        return np.hstack([np.zeros((self.n_x, self.n_y)), np.array(rows)])

    def known_modes(self) -> control.StateSpace:
        """Return a system with the poles that every controller of the structure has, except its
        integrators.
        """
        y = np.array(self.structure.poles, dtype=complex)
        y = (1 + y * self.dt / 2) / (1 - y * self.dt / 2)
        return in_series(
            from_roots(np.zeros(0), order_roots(y, _CONJUGATE), 1.0, self.dt),
            self.fixed,
            dt=self.dt,
        )

    def zeros_and_poles(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return zeros and poles of K without its known factor, in the s plane."""
        if self.structure.free:
            y = self.roots(theta[: self.n_y])
        else:
            y = np.array(self.structure.poles, dtype=complex)
        return self.roots(theta[self.n_y :]), np.concatenate(
            [np.zeros(self.structure.n_integrators), y]
        )

    def controller(self, theta: np.ndarray) -> control.StateSpace:
        """Return K = F X / Y, realised section by section."""
        x, y = self.zeros_and_poles(theta)
        s0 = self.plane(np.array([self.omega_mid]))
        wanted = (
            self.X(s0) @ theta[self.n_y :] / (self.Y(s0) @ theta[: self.n_y] * self.integrals(s0))
        )[0]
        if self.dt:
            h = self.dt / 2
            x = np.concatenate([(1 + x * h) / (1 - x * h), np.full(y.size - x.size, -1.0)])
            y = (1 + y * h) / (1 - y * h)
        K = from_roots(order_roots(x, _CONJUGATE), order_roots(y, _CONJUGATE), 1.0, self.dt)
        ratio = wanted / response(K, np.array([self.omega_mid]))[0]
        K = control.StateSpace(K.A, K.B, K.C * ratio.real, K.D * ratio.real, self.dt)
        return in_series(K, self.fixed, dt=self.dt)

    @property
    def omega_mid(self) -> float:
        """Return the frequency [rad/s] of the basis pole."""
        if self.dt:
            return 2 / self.dt * float(np.arctan(self.a * self.dt / 2))
        return self.a
