"""Friction laws, for the argument `friction` of `nlfrf.rig.Rig`.

All are point symmetric: the reversed motion gives the reversed
force. s(v) is the Stribeck curve,

    s(v) = sgn(v) [Fc + (Fs - Fc) exp(-|v / vs|^delta)].
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import (
    require_nonnegative,
    require_positive,
)
from nlfrf._base.values import ArrayField, value
from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.laws.curves import NO_GRID, Curve, Linear, MaxwellSlip, Tanh
from nlfrf.rig.laws.hysteresis import pack_curve
from nlfrf.rig.laws.own import OwnFriction, pack_user_law
from nlfrf.rig.laws.sliders import VaryingSliders, pack_sliders


@value
class Coulomb:
    """Coulomb friction: the mass sticks up to the force Fs, and then slides on the Stribeck curve
    s(v).

    In sliding F = s(v) + sigma2 v, s(v) = sgn(v) [Fc + (Fs - Fc) exp(-|v / vs|^delta)]. There is no
    motion before break-away.

    Parameters
    ----------
    Fc : float
        Coulomb friction [N].
    Fs : float
        Static friction [N].
    vs : float
        Stribeck velocity [m/s].
    delta : float
        Exponent of the Stribeck curve.
    sigma2 : float
        Viscous friction [Ns/m].

    Raises
    ------
    ValueError
        A number is not positive, or Fs is below Fc.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, Kluwer, 1991.

    Examples
    --------
    >>> Coulomb(Fc=0.7, Fs=1.0, vs=0.01).delta
    2.0

    The same friction at every velocity, also at rest:

    >>> Coulomb.constant(0.7).Fs
    0.7
    """

    Fc: float
    Fs: float
    vs: float
    delta: float = 2.0
    sigma2: float = 0.0

    def __post_init__(self) -> None:
        _check_stribeck(self)

    @classmethod
    def constant(cls, Fc: float, *, sigma2: float = 0.0) -> Coulomb:
        """Return the law with a flat Stribeck curve: the static friction is the Coulomb friction.

        Parameters
        ----------
        Fc : float
            Coulomb friction, which is also the static friction [N].
        sigma2 : float
            Viscous friction [Ns/m].

        Returns
        -------
        Coulomb
        """
        # a flat curve has no velocity scale: with any vs it is the same curve
        return cls(Fc=Fc, Fs=Fc, vs=1.0, sigma2=sigma2)


@value
class Dahl:
    """Dahl's friction model: the force depends on the displacement and on the direction of motion,
    not on the speed.

    dF/dx = sigma0 |1 - F/Fc sgn v|^n sgn(1 - F/Fc sgn v).

    Parameters
    ----------
    sigma0 : float
        Stiffness at the origin [N/m].
    Fc : float
        Coulomb friction [N].
    n : float
        Exponent; 1 in most of the literature.

    Raises
    ------
    ValueError
        sigma0, Fc or n is not positive.

    References
    ----------
    P. Dahl, *A solid friction model*, Aerospace Corporation, 1968.

    Examples
    --------
    >>> Dahl(sigma0=64e3, Fc=0.7).Fc
    0.7
    """

    sigma0: float
    Fc: float
    n: float = 1.0

    def __post_init__(self) -> None:
        for name in ("sigma0", "Fc", "n"):
            require_positive(name, getattr(self, name))


@value
class LuGre:
    """The LuGre friction model: bristles of deflection z, which slip at the force s(v) of the
    Stribeck curve.

    F = sigma0 z + sigma1 dz/dt + sigma2 v,  dz/dt = v - sigma0 |v| / |s(v)| z.

    The Stribeck curve is s(v) = sgn(v) [Fc + (Fs - Fc) exp(-|v / vs|^delta)].

    Parameters
    ----------
    sigma0 : float
        Stiffness of the bristles [N/m].
    sigma1, sigma2 : float
        Damping of the bristles, and viscous friction [Ns/m].
    Fc, Fs : float
        Coulomb and static friction [N].
    vs : float
        Stribeck velocity [m/s].
    delta : float
        Exponent of the Stribeck curve.

    Raises
    ------
    ValueError
        A stiffness, force or velocity is not positive, or Fs is below Fc.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, *A new model for control of systems
    with friction*, IEEE Trans. Automatic Control 40, 1995.

    Examples
    --------
    >>> LuGre(sigma0=64e3, sigma1=13, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01).delta
    2.0
    """

    sigma0: float
    sigma1: float
    sigma2: float
    Fc: float
    Fs: float
    vs: float
    delta: float = 2.0

    def __post_init__(self) -> None:
        require_positive("sigma0", self.sigma0)
        _check_stribeck(self)


@value
class Leuven:
    """The Leuven friction model: hysteresis with non-local memory before sliding, the Stribeck
    curve s(v) in sliding.

    F = Fh(z) + sigma1 dz/dt + sigma2 v,  dz/dt = v (1 - sgn(Fh/s(v)) |Fh/s(v)|^n),

    z is the presliding displacement, Fh its hysteresis force by `curve`, and s(v) = sgn(v) [Fc +
    (Fs - Fc) exp(-|v / vs|^delta)]. The defaults are those of `nlfrf.paper_rig`. The paper of that
    rig does not state n and the curve; they were chosen so that the resonances agree with those of
    the paper.

    Parameters
    ----------
    Fs, Fc : float
        Static and Coulomb friction [N].
    vs : float
        Stribeck velocity [m/s].
    delta : float
        Exponent of the Stribeck curve.
    sigma1, sigma2 : float
        Damping before sliding, and viscous friction [Ns/m].
    n : float
        Exponent: a larger one gives a more sudden transition from presliding to sliding.
    curve : Tanh, Linear, Exponential, Parabola, ElasticPlastic, Table or MaxwellSlip
        Force over displacement on the way out from rest (virgin curve). It must reach Fs.

    Raises
    ------
    ValueError
        Fs is below Fc, the curve does not reach Fs, or a number is not positive.

    References
    ----------
    J. Swevers, F. Al-Bender, C. Ganseman, T. Prajogo, *An integrated friction model structure with
    improved presliding behavior for accurate friction compensation*, IEEE Trans. Automatic Control
    45, 2000; V. Lampaert, J. Swevers, F. Al-Bender, *Modification of the Leuven integrated friction
    model structure*, IEEE Trans. Automatic Control 47, 2002.

    Examples
    --------
    With n = 1 and a linear curve it is the LuGre model.

    >>> Leuven().Fs, Leuven().Fc, Leuven().vs
    (1.0, 0.7, 0.01)
    """

    Fs: float = 1.0
    Fc: float = 0.7
    vs: float = 0.01
    delta: float = 2.0
    sigma1: float = 13.0
    sigma2: float = 0.4
    n: float = 1.0
    curve: Curve = Tanh(K0=64e3, Fy=1.0)

    def __post_init__(self) -> None:
        _check_stribeck(self)
        require_positive("n", self.n)
        packed, _ = pack_curve(self.curve)
        if packed.Fy < self.Fs * (1 - 1e-2):
            raise ValueError(
                f"curve must reach the static friction Fs = {self.Fs:g} N, got one that ends at"
                f" {packed.Fy:g} N"
            )


@value
class GeneralizedMaxwellSlip:
    """The generalised Maxwell-slip friction model: parallel elements, each of which sticks or
    slips.

    While an element sticks, dF_i/dt = k_i v. When its force reaches alpha_i s(v) it slips, and
    dF_i/dt = sgn(v) C (alpha_i - F_i / s(v)) until the velocity changes its sign. The friction
    force is F = sum F_i + sigma2 v, with s(v) = sgn(v) [Fc + (Fs - Fc) exp(-|v / vs|^delta)].

    Parameters
    ----------
    stiffness : (E,) ndarray
        Stiffness k_i of each element [N/m].
    alpha : (E,) ndarray
        Fraction of s(v) that each element carries; the sum must be one.
    C : float
        Rate at which the force of a slipping element approaches alpha_i s(v) [N/s].
    Fs, Fc : float
        Static and Coulomb friction [N].
    vs : float
        Stribeck velocity [m/s].
    delta : float
        Exponent of the Stribeck curve.
    sigma2 : float
        Viscous friction [Ns/m].

    Raises
    ------
    ValueError
        The numbers of the elements do not fit each other.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, *The generalized Maxwell-slip model: a novel model for
    friction simulation and compensation*, IEEE Trans. Automatic Control 50, 2005.

    Examples
    --------
    >>> law = GeneralizedMaxwellSlip(stiffness=[4e4, 2.4e4], alpha=[0.5, 0.5], C=10, Fc=0.7, Fs=1.0, vs=0.01)
    >>> float(law.alpha.sum())
    1.0
    """

    stiffness: ArrayField
    alpha: ArrayField
    C: float
    Fs: float
    Fc: float
    vs: float
    delta: float = 2.0
    sigma2: float = 0.0

    def __post_init__(self) -> None:
        shares = MaxwellSlip(stiffness=self.stiffness, strength=self.alpha)
        if not abs(shares.Fy - 1) < 1e-6:
            raise ValueError(f"alpha must add up to 1, got {shares.Fy:g}")
        object.__setattr__(self, "stiffness", shares.stiffness)
        object.__setattr__(self, "alpha", shares.strength)
        require_positive("C", self.C)
        _check_stribeck(self)


StribeckLaw = Coulomb | LuGre | Leuven | GeneralizedMaxwellSlip
Friction = StribeckLaw | Dahl | VaryingSliders | OwnFriction


def _check_stribeck(law: StribeckLaw) -> None:
    """Refuse parameters that give no Stribeck curve."""
    for name in ("Fc", "vs", "delta"):
        require_positive(name, getattr(law, name))
    require_nonnegative("sigma1", getattr(law, "sigma1", 0.0))
    require_nonnegative("sigma2", law.sigma2)
    if not require_positive("Fs", law.Fs) >= law.Fc:
        raise ValueError(f"Fs must be at least Fc = {law.Fc:g} N, got {law.Fs:g} N")


def pack_law(law: Friction) -> tuple[kernel_data.Law, kernel_data.Grid]:
    """Return the parameters of a law, and the grid of its curve or elements, for compiled code."""
    match law:
        case Dahl():
            force = float(law.Fc)
            spring, grid = pack_curve(Linear(K0=law.sigma0))
            return (
                kernel_data.Law(
                    kernel_data.DAHL, force, force, 1.0, 2.0, 0.0, 0.0, float(law.n), spring
                ),
                grid,
            )
        case LuGre():
            spring, grid = pack_curve(Linear(K0=law.sigma0))
            return _pack_stribeck_law(law, kernel_data.LEUVEN, n=1.0, curve=spring), grid
        case Leuven():
            curve, grid = pack_curve(law.curve)
            return _pack_stribeck_law(law, kernel_data.LEUVEN, n=law.n, curve=curve), grid
        case Coulomb():
            none = kernel_data.Curve(kernel_data.SPRING, 0.0, np.inf)
            return _pack_stribeck_law(law, kernel_data.COULOMB, n=1.0, curve=none), NO_GRID
        case GeneralizedMaxwellSlip():
            curve, grid = pack_curve(MaxwellSlip(stiffness=law.stiffness, strength=law.alpha))
            return _pack_stribeck_law(law, kernel_data.GMS, n=law.C, curve=curve), grid
        case VaryingSliders():
            return pack_sliders(law)
        case OwnFriction():
            return pack_user_law(law)
    raise ValueError(f"friction must be one of the laws of nlfrf.friction, got {law!r}")


def _pack_stribeck_law(
    law: StribeckLaw, form: int, *, n: float, curve: kernel_data.Curve
) -> kernel_data.Law:
    """Return the parameters of a law with a Stribeck curve for the kernel `form`; n: exponent, or C
    of a GMS model.
    """
    return kernel_data.Law(
        form=form,
        Fs=float(law.Fs),
        Fc=float(law.Fc),
        vs=float(law.vs),
        delta=float(law.delta),
        sigma1=float(getattr(law, "sigma1", 0.0)),
        sigma2=float(law.sigma2),
        n=float(n),
        curve=curve,
    )
