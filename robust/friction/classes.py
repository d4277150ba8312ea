"""Sets of friction laws, described by bounds instead of parameters.

Friction is the force without its viscous part. The viscous part belongs to the machine.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nlfrf._base.arguments import require_nonnegative, require_positive, require_real
from nlfrf._base.values import value
from robust.friction.units import MechanicalUnits, format_plain, mechanical_units


@value
class AnyFriction:
    """A class of friction laws: all laws within its limits.

    Fields
    ------
    kind : str
        "Maxwell slip", "bristle", "bounded" or "passive".
    K0 : float
        Largest presliding stiffness [N/m].
    stiction : float
        Largest force that a slider holds over the smallest at which it slips. For bristles: largest creep over
        velocity.
    bristle_time : float
        Largest damping over stiffness of an element [s]. For bounded friction: of its bristles.
    microdamping : float
        Damping of a bristle while it bends, sigma1 [Ns/m]. Zero for every other class.
    Fs : float
        Largest force [N]. A limit that the class does not have is nan, here and above.
    position_unit : str
        "m", or "rad" for a machine that turns: forces are then in Nm, and N/m stands for Nm/rad.
    """

    kind: str
    K0: float = np.nan
    stiction: float = np.nan
    bristle_time: float = np.nan
    Fs: float = np.nan
    microdamping: float = 0.0
    position_unit: str = "m"

    def __post_init__(self) -> None:
        mechanical_units(self.position_unit)

    @property
    def units(self) -> MechanicalUnits:
        """Units of position, force, stiffness and damping."""
        return mechanical_units(self.position_unit)

    @property
    def description(self) -> str:
        """Noun phrase for the laws of the class, for texts."""
        if self.kind == "Maxwell slip":
            return _describe_maxwell_slip((self,), ("",))
        if self.kind == "bristle":
            return (
                f"bristle friction with a stiffness up to {self.K0 / 1e3:.4g} {self.units.stiffness} and a damping of "
                f"{self.microdamping:g} {self.units.damping}, whose bristles creep against their force (at most "
                f"{self.stiction:.4g} times as fast as the machine moves)"
            )
        if self.kind == "bounded":
            damped = f" on bristles with a damping of up to {1e3 * self.bristle_time:.3g} ms times their stiffness"
            return f"friction of at most {self.Fs:g} {self.units.force}" + damped * (self.bristle_time > 0)
        return "passive friction"


@value
class FrictionAtPorts:
    """Maxwell-slip friction at several places of a machine, one class each. `prove_friction` makes it of a tuple.

    Fields
    ------
    ports : tuple of AnyFriction
        The class at each port.
    names : tuple of str
        Place of each port, for texts.
    """

    ports: tuple[AnyFriction, ...]
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        kinds = sorted({port.kind for port in self.ports})
        if kinds != ["Maxwell slip"]:
            raise ValueError(f"friction at several ports must be any_maxwell_slip at each, got {', '.join(kinds)}")
        if len({port.position_unit for port in self.ports}) > 1:
            raise ValueError("friction must have one position unit at all ports, got m and rad")

    @property
    def kind(self) -> str:
        """ "Maxwell slip"."""
        return self.ports[0].kind

    @property
    def position_unit(self) -> str:
        """ "m", or "rad"."""
        return self.ports[0].position_unit

    @property
    def units(self) -> MechanicalUnits:
        """Units of position, force, stiffness and damping."""
        return self.ports[0].units

    @property
    def K0(self) -> np.ndarray:
        """(P,) largest presliding stiffness at each port [N/m]."""
        return np.array([port.K0 for port in self.ports])

    @property
    def stiction(self) -> np.ndarray:
        """(P,) largest over smallest force of a slider at each port."""
        return np.array([port.stiction for port in self.ports])

    @property
    def bristle_time(self) -> float:
        """Largest damping over stiffness of an element [s]."""
        return max(port.bristle_time for port in self.ports)

    @property
    def microdamping(self) -> float:
        """Damping of a sticking element without its spring [Ns/m]: zero for Maxwell slip."""
        return 0.0

    @property
    def description(self) -> str:
        """Noun phrase for the laws of the class, for texts."""
        return _describe_maxwell_slip(self.ports, [f" at {name}" for name in self.names])


def _describe_maxwell_slip(ports: Sequence[AnyFriction], places: Sequence[str]) -> str:
    """Describe Maxwell slip at each port; `places` are phrases that follow a number, such as " at the motor"."""
    units, bristle_time = ports[0].units, max(port.bristle_time for port in ports)
    at = list(zip(ports, places, strict=True))
    stiffest = " and ".join(f"{format_plain(port.K0 / 1e3)} {units.stiffness}{place}" for port, place in at)
    one_ratio = len({port.stiction for port in ports}) == 1
    ratios = [f"{port.stiction:.4g} times{'' if one_ratio else place}" for port, place in at]
    damped = f" and damping up to {1e3 * bristle_time:g} ms of it" if bristle_time else ""
    return (
        f"Maxwell-slip friction with a presliding stiffness of up to {stiffest}{damped}, in which each slider holds "
        f"at most {' and '.join(ratios[:1] if one_ratio else ratios)} its smallest slip force (anywhere, in any "
        "direction, at any speed or time)"
    )


def any_maxwell_slip(
    K0: float, stiction: float = 1.5, bristle_time: float = 0.0, *, position_unit: str = "m"
) -> AnyFriction:
    """Return the class of every friction made of elements, each a spring in series with a slider.

    f = sum f_i over any number of elements. Each element is a spring k_i, with a damper k_i tau_i across it, in series
    with a slider that holds |f_i| <= W_i and slips at no less than W_i/stiction; sum k_i <= K0.

    Use this class for friction that sticks fully below break-away. It contains Maxwell slip and Prandtl-Ishlinskii of
    any curve, Stribeck friction, stiction that grows with rest, and sliders that depend on position, load, direction or
    time. It does not contain LuGre, Dahl and Leuven (they creep below break-away), the generalised Maxwell-slip model
    with a finite attraction, or rigid stiction.

    Parameters
    ----------
    K0 : float
        Largest presliding stiffness of all elements together [N/m].
    stiction : float
        Largest force of a slider over the smallest at which it slips; at least 1. No frequency response shows it: it is
        an assumption.
    bristle_time : float
        Largest damping over stiffness of an element [s].
    position_unit : str
        "m", or "rad" with Nm.

    Returns
    -------
    AnyFriction

    Raises
    ------
    ValueError
        A stiffness that is not positive, a stiction below one, or a negative time.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements and sliders).

    Examples
    --------
    >>> any_maxwell_slip(64e3).stiction
    1.5
    """
    return AnyFriction(
        kind="Maxwell slip",
        K0=require_positive("K0", K0),
        stiction=_require_ratio(stiction),
        bristle_time=require_nonnegative("bristle_time", bristle_time),
        position_unit=position_unit,
    )


def any_bristle(
    K0: float, stiction: float = 1.5, microdamping: float = 0.0, *, position_unit: str = "m"
) -> AnyFriction:
    """Return the class of every friction of bristles that bend and creep: f = F + microdamping z', F a hysteresis of z.

    z' = v - p with F p >= 0 and |p| <= stiction |v|; F is a Masing hysteresis of z with a slope of at most K0.

    Use this class for friction that creeps below break-away. It contains LuGre (K0 = sigma0, stiction = Fs/Fc,
    microdamping = sigma1), the modified Leuven model (the slope of its curve at zero, (Fs/Fc)^n, sigma1), and Dahl's
    model with n = 1 (stiction 1).

    Parameters
    ----------
    K0 : float
        Largest stiffness of the bristles [N/m].
    stiction : float
        Largest slip velocity over velocity of the machine; at least 1.
    microdamping : float
        sigma1 [Ns/m]. The class has exactly this damping.
    position_unit : str
        "m", or "rad" with Nm.

    Returns
    -------
    AnyFriction

    Raises
    ------
    ValueError
        A stiffness that is not positive, a stiction below one, or a negative damping.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control 40, 1995 (bristles).

    Examples
    --------
    >>> any_bristle(64e3, 1 / 0.7, 13.0).microdamping              # the rig of the paper
    13.0
    """
    return AnyFriction(
        kind="bristle",
        K0=require_positive("K0", K0),
        stiction=_require_ratio(stiction),
        microdamping=require_nonnegative("microdamping", microdamping),
        position_unit=position_unit,
    )


def any_bounded(Fs: float, bristle_time: float = 0.0, *, position_unit: str = "m") -> AnyFriction:
    """Return the class of every friction up to a largest force, whatever it depends on, with or without bristles.

    f = s + tau s', with |s| <= Fs and a constant tau of 0 to `bristle_time`. It contains LuGre (s = sigma0 z, tau =
    sigma1/sigma0), Dahl, Maxwell slip of any kind, and rigid stiction.

    Use this class if only the largest force is known. It gives a distance from rest, but no proof of rest.

    Parameters
    ----------
    Fs : float
        Largest force without the viscous part [N].
    bristle_time : float
        Largest damping over stiffness of the bristles [s].
    position_unit : str
        "m", or "rad" with Nm.

    Returns
    -------
    AnyFriction

    Raises
    ------
    ValueError
        A force that is not positive, or a negative time.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, Kluwer, 1991.

    Examples
    --------
    >>> any_bounded(1.0).Fs
    1.0
    """
    return AnyFriction(
        kind="bounded",
        Fs=require_positive("Fs", Fs),
        bristle_time=require_nonnegative("bristle_time", bristle_time),
        position_unit=position_unit,
    )


def any_passive(*, position_unit: str = "m") -> AnyFriction:
    """Return the class of every friction that never returns more energy than it received: int f v dt >= -E0.

    Not all friction is passive: LuGre is passive only if sigma2 >= sigma1 (Fs - Fc)/Fc.

    Parameters
    ----------
    position_unit : str
        "m", or "rad" with Nm.

    Returns
    -------
    AnyFriction

    Raises
    ------
    ValueError
        Another unit.

    References
    ----------
    N. Barabanov, R. Ortega, IEEE Trans. Automatic Control 45, 2000 (when LuGre is passive).

    Examples
    --------
    >>> any_passive().kind
    'passive'
    """
    return AnyFriction(kind="passive", position_unit=position_unit)


def _require_ratio(stiction: float) -> float:
    stiction = require_real("stiction", stiction)
    if stiction < 1:
        raise ValueError(f"stiction must be at least 1, largest over smallest force of a slider, got {stiction:g}")
    return stiction
