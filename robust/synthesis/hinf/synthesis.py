"""`Synthesis`, the result of `hinfsyn`: a controller, its norm and a lower bound."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.values import value
from robust.proofs.search.certificate import Certificate
from robust.synthesis.hinf.design import Unpacked, describe_controller


@value
class Synthesis(Unpacked):
    """A controller from `hinfsyn`, the norm it achieves, and a lower bound for all controllers.

    Unpacks as K, CL, gamma, info = hinfsyn(P, n_y, n_u).

    Fields
    ------
    K : control.StateSpace
        Controller u = K y (n_u outputs, n_y inputs), with positive feedback as usual for a
        generalised plant; zero if none was found.
    gamma : float
        Norm of F_l(P, K), recomputed from the closed loop; inf if the loop is not stable. If
        `certificate` holds, the norm is proved to be below gamma. Otherwise gamma is only computed,
        and `reason` states this.
    gamma_min : float
        Lower bound of gamma over all controllers: the largest gamma at which the existence
        conditions fail. They are evaluated in multiple precision if the poles are decades apart. 0
        if no lower bound is known.
    level : float
        Least gamma at which the existence conditions hold; for a singular problem gamma_min.
    n_steps : int
        Number of values of gamma that were tried.
    reason : str
        Reason why no controller or only a worse one than requested was found, or why gamma is not
        certified; otherwise empty.
    certificate : Certificate or None
        The proof of gamma for P and K as given, or the reason why there is no proof. None if no
        controller was found.
    CL : control.StateSpace or None
        F_l(P, K) from w to z; None if no controller was found.

    References
    ----------
    Doyle, Glover, Khargonekar & Francis 1989.

    Examples
    --------
    >>> from robust import hinfsyn
    >>> P = control.StateSpace([[-1.0]], [[1.0, 1.0]], [[1.0], [0.0], [1.0]], [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    >>> found = hinfsyn(P, 1, 1)
    >>> bool(found.gamma_min <= found.level <= found.gamma < np.inf), found.reason
    (True, '')
    >>> print(found)
    controller of order 1, continuous, u = K y: gamma 0.71 proved, at best 0.7071
    """

    K: control.StateSpace
    gamma: float
    gamma_min: float
    level: float
    n_steps: int
    reason: str
    certificate: Certificate | None = None
    CL: control.StateSpace | None = None

    @property
    def certified(self) -> bool:
        """True if gamma is proved to be a bound on the norm."""
        return self.certificate is not None and self.certificate.holds

    @property
    def found(self) -> bool:
        """True if K stabilises the loop by more than rounding errors."""
        return bool(np.isfinite(self.gamma))

    def __str__(self) -> str:
        best = f"at best {self.gamma_min:.4g}"
        if not self.found:
            return f"no controller found, {best}: {self.reason}"
        proved = "proved" if self.certified else "computed, not proved"
        text = f"{describe_controller(self.K)}, u = K y: gamma {self.gamma:.4g} {proved}, {best}"
        return "\n  ".join(filter(None, (text, self.reason)))
