"""``Design``: a controller and the norm that it achieves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust._base.states import Stability
from robust.lti.grids import Peak
from robust.proofs.search.certificate import Certificate


def describe_controller(K: control.StateSpace) -> str:
    """Describe the order and the sampling of a controller."""
    return (
        f"controller of order {K.nstates},"
        f" {f'sampled at {1 / K.dt:g} Hz' if K.dt else 'continuous'}"
    )


class Unpacked:
    """Base of results that unpack as in MATLAB and python-control:

    K, CL, gamma, info = ..., info the whole result.
    """

    K: control.StateSpace
    CL: control.StateSpace | None
    LEVEL: ClassVar[str] = "gamma"

    def __iter__(self) -> Iterator[Any]:
        return iter((self.K, self.CL, getattr(self, self.LEVEL), self))


@value
class DesignedLoop:
    """The nominal loop of a design, as its lines show it; of a family every loop.

    Fields
    ------
    crossovers : tuple of float
        Frequencies with |L| = 1 [rad/s], in order.
    peak_S, peak_T : Peak
        Largest |S| and |T| on the lines, and where [rad/s].
    """

    crossovers: tuple[float, ...]
    peak_S: Peak
    peak_T: Peak


@value
class Design(Unpacked):
    """A controller and the norm that it achieves; unpacks as K, CL, gamma, info = ncfsyn(G).

    Fields
    ------
    K : control.StateSpace
        Controller for the unweighted plant, negative feedback: u = K (r - y).
    gamma : float
        Achieved norm, recomputed from the closed loop; inf if the loop is not stable, nan if the
        design has no weight. If `certificate` holds, the norm is proved to be below gamma.
        Otherwise gamma is only computed.
    gamma_min : float
        Lower bound of gamma over all controllers; nan if no lower bound is known.
    met : bool
        True if K meets every hard demand, recomputed from the closed loop. `design_frf` accepts an
        excess of 0.1 %. It checks the demands on the lines (frequencies of the FRF), and between
        two lines where the controller or its loop has a mode; see `n_lines`.
    reason : str
        Reason why the design ended, or the demand that is not met and its frequency.
    certificate : Certificate or None
        The proof of gamma for plant and controller as given, or the reason why there is no proof.
        None if gamma refers to the lines of an FRF.
    CL : control.StateSpace or None
        The closed loop with the norm gamma: for `mixsyn` from r to the weighted e, u and y, for
        `ncfsyn` from the perturbations (p_out, p_in) of the shaped plant to its (u, y). None for a
        design on the lines of an FRF.
    loop : DesignedLoop or None
        Crossovers and largest |S| and |T| of the nominal and of every plant of a family, from
        `design_frf` for one loop. None from other designs, and if no controller was found.
    omega_c : tuple of float
        Requested crossover of `design_frf` [rad/s]: at least the first, at most the second; empty
        if none was requested.
    stability : Stability or None
        Stability of the loop with every plant, from `design_frf`; undecided if the FRF does not
        determine it. None from other designs.
    n_lines : int
        0 if no mode between two lines can violate the demands. Otherwise the number of lines;
        demands or gamma then hold on these lines only.
    K_free : control.StateSpace or None
        From `design_frf` for one loop with a factor `fixed` that is not a constant: K without it,
        such as the PID in front of a notch. None elsewhere.
    history : tuple of float
        gamma after every iteration, or the worst demand as long as one was not met.

    References
    ----------
    SP 9.4.1.

    Examples
    --------
    >>> from robust import ncfsyn
    >>> design = ncfsyn(control.tf([1], [1, 1]), 10)
    >>> bool(design.gamma_min < design.gamma < 4)
    True
    >>> print(design)
    controller of order 1, continuous: gamma 1.469 proved, at best 1.349
    """

    K: control.StateSpace
    gamma: float
    gamma_min: float = float("nan")
    met: bool = True
    reason: str = ""
    loop: DesignedLoop | None = None
    omega_c: tuple[float, ...] = ()
    stability: Stability | None = None
    n_lines: int = 0
    K_free: control.StateSpace | None = None
    history: tuple[float, ...] = ()
    certificate: Certificate | None = None
    CL: control.StateSpace | None = None

    def __str__(self) -> str:
        if np.isnan(self.gamma):
            found = []
        else:
            found = [f"gamma {self.gamma:.4g}{' proved' if self.certified else ''}"]
        found += [f"at best {self.gamma_min:.4g}"] if np.isfinite(self.gamma_min) else []
        limits = "" if self.met and found else self.limits_in_words
        text = (
            f"{describe_controller(self.K)}: {'; '.join(filter(None, (', '.join(found), limits)))}"
        )
        return "\n  ".join(filter(None, (text, self.loop_in_words, self.reason)))

    @property
    def limits_in_words(self) -> str:
        """Describe whether the limits are met."""
        if self.stability is Stability.UNDECIDED:
            return "STABILITY NOT DECIDED"
        if self.met:
            return f"every limit met{f' on {self.n_lines} lines' * (self.n_lines > 0)}"
        return "LIMITS NOT MET"

    @property
    def loop_in_words(self) -> str:
        """Describe the crossover of the nominal loop, and its largest |S| and |T|; empty if not
        computed.
        """
        if self.loop is None:
            return ""
        crossovers = self.loop.crossovers
        at = [format_hertz(omega) for omega in crossovers]
        if len(at) > 4:
            most = f"{at[0]} to {at[-1]} ({len(at)} of them)"
        else:
            most = ", ".join(at)
        asked = " to ".join(map(format_hertz, self.omega_c)) + " or above" * (
            len(self.omega_c) == 1
        )
        text = (
            f"crossover{'s' * (len(at) > 1)}"
            f" {most or 'nowhere on the lines'}{f', asked {asked}' * bool(self.omega_c)}"
        )
        if self.omega_c and crossovers and crossovers[0] < 0.98 * self.omega_c[0]:
            text += f" (|L| crosses one at {at[0]} already: a mode may reach the crossover asked)"
        S, T = self.loop.peak_S.value, self.loop.peak_T.value
        return f"{text}; nominal max |S| {S:.3g}, max |T| {T:.3g}"

    @property
    def certified(self) -> bool:
        """True if gamma is proved to be a bound on the norm."""
        return self.certificate is not None and self.certificate.holds
