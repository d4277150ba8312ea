"""``LoopClaim``: a claim on a loop, with every number of the loop as given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from nlfrf._base.values import value

if TYPE_CHECKING:
    import control

STABILITY = "robust stability"
PERFORMANCE = "robust performance"
OPERATOR_PERFORMANCE = "robust performance with one scaling"
#: The same for a set of continuous plants under a sampled controller, whose perturbations act at
#: every alias.
ALIASED = {
    name: f"{name}, every alias included" for name in (STABILITY, PERFORMANCE, OPERATOR_PERFORMANCE)
}
_FORMS = ((("G", "K"), False), (("K",), False), ((), True), (("G",), True), (("N", "M"), True))
_CLASSES = ("LTI", "statistical", "operator")
_CLAIMS = (STABILITY, PERFORMANCE, OPERATOR_PERFORMANCE, *ALIASED.values())


@value
class Matrices:
    """A system as given: A, B, C, D, and its sampling time dt [s], 0 for continuous."""

    #: Axes in front of those of a matrix.
    LEADING: ClassVar[int] = 0

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float = 0.0

    def __post_init__(self) -> None:
        n, lead, (p, m) = (
            self.A.shape[-1],
            self.A.shape[: self.LEADING],
            self.D.shape[self.LEADING :],
        )
        for name, shape in {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}.items():
            matrix = getattr(self, name)
            shape = (*lead, *shape)
            if matrix.shape != shape or matrix.dtype != np.float64 or not np.isfinite(matrix).all():
                raise ValueError(
                    f"{name} must be finite numbers of shape {shape}, got shape {matrix.shape}"
                )
        if not (np.isfinite(self.dt) and self.dt >= 0):
            raise ValueError(f"dt must be a sampling time [s] or 0, got {self.dt}")

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.A.shape[-1])


@value
class LpvMatrices(Matrices):
    """Coefficients (d + 1, rows, cols) of A, B, C, D, lowest power of theta first; dt [s], 0 for
    continuous.
    """

    LEADING: ClassVar[int] = 1


def to_matrices(system: control.StateSpace) -> Matrices:
    """Return the matrices of an object with A, B, C, D and dt, number by number."""
    D = np.array(system.D, dtype=float, ndmin=2)
    n = int(np.size(system.A) ** 0.5 + 0.5)
    return Matrices(
        A=np.array(system.A, dtype=float).reshape(n, n),
        B=np.array(system.B, dtype=float).reshape(n, D.shape[1]),
        C=np.array(system.C, dtype=float).reshape(D.shape[0], n),
        D=D,
        dt=float(system.dt or 0.0),
    )


@value
class LoopClaim:
    """A claim on a loop u = K (r - y) around a set of plants, with all numbers as given.

    Fields
    ------
    plant, controller, weight : Matrices
        Single-input single-output.
    performance : Matrices or None
        Performance weight w_P.
    reads, inverse : tuple of str, bool
        Form of the uncertainty: the perturbed sensitivity is S (1 + a Delta)/(1 + b Delta), b = w R
        S with R the product of the transfer functions in `reads`, a = w R if inverse and 0 if not.
        ("G", "K"), False: G (1 + w Delta); ("K",), False: G + w Delta; (), True: G/(1 + w Delta);
        ("G",), True: G/(1 + w G Delta). ("N", "M"), True: normalised coprime factors of the shaped
        plant that differ by [Delta_N, Delta_M] of gain |w|; a = -t G*, b = t (K - G*) S with t =
        w/sqrt(1 - |w|^2), G and K those of the shaped loop.
    perturbation : str
        Class of the perturbations. For claims on every alias, "operator" has another condition than
        "LTI" and "statistical". For other claims the class has no effect.
    delay : float
        Delay [s] in addition to that of the plant. A continuous plant under a sampled controller is
        held (zero order) and delayed exactly. A delay within 1e-9 of a whole number of samples is
        that number (1e-6 for a discrete plant).
    claims : tuple of str
        "robust stability": the nominal loop is stable, and |b| < 1 at every frequency up to
        Nyquist. "robust performance": also |w_P| max |S_p| < 1. "robust performance with one
        scaling": the norm of the loop with both weights, scaled by d, is below one (nonlinear
        perturbations). Each also with ", every alias included": for a set of continuous plants
        under a sampled controller, the conditions of `robust.proofs.exact.aliases`.
    scaling : float
        Scaling d, for claims with one scaling.
    shaping : tuple of Matrices
        Shaping functions whose product scales the plant (and the controller inversely); for the
        last form only.
    """

    SCHEMA: ClassVar[str] = "robust-certificate"
    UNITS: ClassVar[Mapping[str, str]] = {"dt": "s", "delay": "s"}
    LOOP: ClassVar[str] = (
        "u = K (r - y), S = 1/(1 + G K); a continuous plant under a sampled K is held and delayed"
        " exactly"
    )

    plant: Matrices
    controller: Matrices
    weight: Matrices
    performance: Matrices | None
    reads: tuple[str, ...]
    inverse: bool
    perturbation: str
    delay: float
    claims: tuple[str, ...]
    scaling: float = 1.0
    shaping: tuple[Matrices, ...] = ()

    def __post_init__(self) -> None:
        for name in ("plant", "controller", "weight", "performance"):
            system = getattr(self, name)
            if system is None and name != "performance":
                raise ValueError(f"{name} must be a system, got none")
            if system is not None and system.D.shape != (1, 1):
                raise ValueError(
                    f"{name} must have one input and one output, got D of shape {system.D.shape}"
                )
        if (self.reads, self.inverse) not in _FORMS:
            raise ValueError(
                f"reads must be a form of uncertainty, got {self.reads} with inverse={self.inverse}"
            )
        if self.shaping and "M" not in self.reads:
            raise ValueError(
                f"shaping must be left out except for coprime factors, got reads {self.reads}"
            )
        if any(W.D.shape != (1, 1) for W in self.shaping):
            raise ValueError("shaping must have one input and one output")
        if not self.claims or not set(self.claims) <= set(_CLAIMS):
            raise ValueError(f"claims must be some of {', '.join(_CLAIMS)}, got {self.claims}")
        if set(self.claims) & set(ALIASED.values()) and self.perturbation not in _CLASSES:
            raise ValueError(
                f"perturbation must be one of {', '.join(_CLASSES)} for {self.claims}, got"
                f" {self.perturbation}"
            )
        proved = {ALIASED[STABILITY]}  # of operators whose perturbations act at every alias
        if not self.inverse:
            proved.add(ALIASED[OPERATOR_PERFORMANCE])
        if (
            self.perturbation == "operator"
            and not set(self.claims) & set(ALIASED.values()) <= proved
        ):
            raise ValueError(
                f"claims must be {' or '.join(sorted(proved))} for operators, because no other"
                f" condition with aliases is known, got {self.claims}"
            )
        if self.performance is None and not set(self.claims) <= {STABILITY, ALIASED[STABILITY]}:
            raise ValueError("performance must be given where performance is claimed, got none")
        if not 0 <= self.delay < np.inf:
            raise ValueError(f"delay must be nonnegative [s], got {self.delay}")
        if not 0 < self.scaling < np.inf:
            raise ValueError(f"scaling must be positive, got {self.scaling}")
