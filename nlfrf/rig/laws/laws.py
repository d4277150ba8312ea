"""Friction laws, for the argument `friction` of `nlfrf.rig.Rig`.

All are point symmetric (`VaryingSliders` need not be): the reversed motion gives the reversed
force. s(v) is the Stribeck curve,

    s(v) = sgn(v) [Fc + (Fs - Fc) exp(-|v / vs|^delta)].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_positive,
    require_real,
    require_real_array,
)
from nlfrf._base.values import ArrayField, value
from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.kernels.data import initial_memory
from nlfrf.rig.laws.curves import NO_GRID, Curve, Linear, MaxwellSlip, Tanh
from nlfrf.rig.laws.hysteresis import pack_curve


@value
class OwnFriction:
    """Friction law by your own functions: dz/dt = derivative(x, v, z), F = force(x, v, z).

    Use this for a law that is not built in. Simulations of one axis accept the law; proofs do
    not.

    - The functions are compiled by numba if they use only numbers, arrays and loops of Python and
      NumPy. Otherwise they run about a hundred times slower.
    - The integration is fourth-order Runge-Kutta with fixed steps. A law with a jump, such as sgn v,
      needs short steps.

    Fields
    ------
    derivative : callable
        Function (x, v, z) -> (s,) array: time derivative of the state z, at position x [m] and
        velocity v [m/s].
    force : callable
        Function (x, v, z) -> float: friction force [N]. A force with the sign of v opposes the
        motion.
    rest : (s,) ndarray
        Initial state z, for a machine that has never moved; empty for a law without state.
    stiffness : float
        dF/dx while friction sticks [N/m]; the integration step is chosen by it.
    damping : float
        dF/dv while friction sticks [Ns/m].

    Raises
    ------
    ValueError
        For x = v = 0 and z = rest, the functions do not return a finite force and one finite
        derivative per state.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, *A new model for control of systems
    with friction*, IEEE Transactions on Automatic Control 40 (1995): the law of the example.

    Examples
    --------
    >>> from nlfrf.rig import Rig, run
    >>> def derivative(x, v, z):
    ...     return v - 1e5 * np.abs(v) * z / 0.7
    >>> def force(x, v, z):
    ...     return 1e5 * z[0]
    >>> dahl = OwnFriction(derivative=derivative, force=force, rest=[0.0], stiffness=1e5)
    >>> motion = run(Rig(1.0, 80e3, dahl), np.full(2000, 1.0), fs=4000.0)
    >>> bool(abs(motion.friction).max() < 0.7)
    True
    """

    derivative: Callable[[float, float, np.ndarray], ArrayLike]
    force: Callable[[float, float, np.ndarray], float]
    rest: np.ndarray
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        rest = require_real_array("rest", np.atleast_1d(np.asarray(self.rest, dtype=float)), ndim=1)
        object.__setattr__(self, "rest", rest)
        if rest.size > kernel_data.STACK_DEPTH or not np.isfinite(rest).all():
            raise ValueError(
                f"rest must hold at most {kernel_data.STACK_DEPTH} finite numbers, got {rest.size}"
            )
        require_nonnegative("stiffness", self.stiffness)
        require_nonnegative("damping", self.damping)
        for name, wanted in (("derivative", rest.shape), ("force", ())):
            function = getattr(self, name)
            if not callable(function):
                raise ValueError(
                    f"{name} must be a function of (x, v, z), got {type(function).__name__}"
                )
            try:
                found = np.asarray(function(0.0, 0.0, rest.copy()), dtype=float)
            except Exception as error:  # a function of the user may raise anything
                raise ValueError(
                    f"{name} must be a function of (x, v, z), got {type(error).__name__}: {error}"
                ) from error
            if found.shape != wanted or not np.isfinite(found).all():
                if wanted:
                    what = f"{rest.size} finite numbers"
                else:
                    what = "one finite number"
                raise ValueError(f"{name} must give {what} at rest, got {found.tolist()}")

    @property
    def compiled(self) -> bool:
        """True if numba has compiled the functions."""
        from nlfrf.rig.kernels.loops import compile_user_law

        return compile_user_law(self.derivative, self.force, self.rest.size)[1]


class UserLawData(kernel_data.Law):
    """Parameters of a law whose state equation and force are user functions."""

    functions: OwnFriction


def _pack_user_law(law: OwnFriction) -> tuple[UserLawData, kernel_data.Grid]:
    """Return the parameters of a law of user functions for the integration."""
    spring = kernel_data.Curve(kernel_data.SPRING, float(law.stiffness), np.inf)
    numbers = UserLawData(
        kernel_data.OWN, np.inf, np.inf, 1.0, 2.0, float(law.damping), 0.0, 1.0, spring
    )
    numbers.functions = law
    return numbers, NO_GRID


@value
class VaryingSliders:
    """Friction of parallel elements (Maxwell slip) whose strength varies between two limits.

    Each element is a spring in series with a slider. A slider with strength W holds up to the force
    below, and slips at that force:

        W [1/stiction + (1 - 1/stiction) m],   0 <= m <= 1,

    m is the product of these factors, each present only if its parameter is given:

    - in slip: exp(-(v/vs)^2)
    - after a time of rest: 1 - exp(-rest/dwell)
    - along the path: (1 + cos(2 pi x / wavelength)) / 2
    - while it moves in negative direction: 1 - asymmetry
    - with a seed: a random number, drawn each time the slider sticks

    The class `robust.friction.MaxwellSlip(sum of stiffness, stiction)` contains every such law.

    Parameters
    ----------
    stiffness : (E,) ndarray
        Stiffness of each element [N/m].
    strength : (E,) ndarray
        Largest force of each slider [N].
    stiction : float
        Ratio of the largest to the smallest force of a slider.
    vs : float
        Velocity scale of the decrease of the force in slip [m/s]; infinite for no decrease.
    dwell : float
        Time constant with which a slider at rest regains its strength [s]; zero: at once.
    wavelength : float
        Wavelength of the variation along the path [m]; infinite for no variation.
    asymmetry : float
        Fraction by which m is smaller in negative direction, 0 to 1.
    seed : int
        Seed of the random numbers; zero for none.

    Raises
    ------
    ValueError
        The numbers of the elements do not fit each other, stiction is below one, or a number is out
        of range.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements); B.
    Armstrong-Hélouvry, *Control of Machines with Friction*, 1991 (rising static friction, position
    dependence).

    Examples
    --------
    >>> law = VaryingSliders(stiffness=[4e4, 2.4e4], strength=[0.5, 0.5], stiction=1.4, vs=0.01)
    >>> float(law.strength.sum())
    1.0
    """

    stiffness: ArrayField
    strength: ArrayField
    stiction: float = 1.0
    vs: float = np.inf
    dwell: float = 0.0
    wavelength: float = np.inf
    asymmetry: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        elements = MaxwellSlip(stiffness=self.stiffness, strength=self.strength)
        object.__setattr__(self, "stiffness", elements.stiffness)
        object.__setattr__(self, "strength", elements.strength)
        if require_real("stiction", self.stiction) < 1:
            raise ValueError(f"stiction must be at least 1, got {self.stiction:g}")
        for name in ("vs", "wavelength"):
            if not np.isposinf(getattr(self, name)):
                require_positive(name, getattr(self, name))
        if require_real("dwell", self.dwell) < 0:
            raise ValueError(f"dwell must be zero or positive, got {self.dwell:g}")
        if not 0 <= require_real("asymmetry", self.asymmetry) <= 1:
            raise ValueError(f"asymmetry must lie between 0 and 1, got {self.asymmetry:g}")
        require_integer("seed", self.seed, least=0)


def _pack_sliders(law: VaryingSliders) -> tuple[kernel_data.Law, kernel_data.Grid]:
    """Return parameters and grid for compiled code: stiffness, strength, phase, four parameters
    common to elements.
    """
    total, strength = float(np.sum(law.stiffness)), float(np.sum(law.strength))
    n = law.stiffness.size
    grid = np.zeros((7, n))
    grid[0], grid[1] = law.stiffness, law.strength
    grid[2] = 2.399963 * np.arange(n)  # phases at the golden angle from each other
    grid[3] = 0.0 if np.isinf(law.wavelength) else 2 * np.pi / law.wavelength
    grid[4], grid[5], grid[6] = law.dwell, law.asymmetry, law.seed
    if np.isinf(law.vs):
        vs = 1e300
    else:
        vs = float(law.vs)
    curve = kernel_data.Curve(kernel_data.VARYING, total, strength)
    return (
        kernel_data.Law(
            kernel_data.SLIDERS,
            strength,
            strength / law.stiction,
            vs,
            2.0,
            0.0,
            0.0,
            float(law.stiction),
            curve,
        ),
        grid,
    )


def element_forces(sliders: VaryingSliders, x: ArrayLike, v: ArrayLike, *, fs: float) -> np.ndarray:
    """Return the force of each element of a friction law along a prescribed motion, from rest.

    For a periodic motion give two periods: from the second period on the forces are periodic.

    Parameters
    ----------
    sliders : VaryingSliders
        Friction law with E elements.
    x, v : (n,) ndarray
        Displacement [m] and velocity [m/s]; between two samples the motion is monotonic.
    fs : float
        Sampling frequency [Hz].

    Returns
    -------
    (E, n) ndarray
        Forces [N].

    Raises
    ------
    ValueError
        Displacements and velocities are not two finite arrays of equal length.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements).

    Examples
    --------
    Two elements that slip at 1 m and at 3 m.

    >>> sliders = VaryingSliders(stiffness=[1.0, 1.0], strength=[1.0, 3.0])
    >>> element_forces(sliders, [0.0, 2.0, 4.0, 3.5], np.ones(4), fs=1.0).tolist()
    [[0.0, 1.0, 1.0, 0.5], [0.0, 2.0, 3.0, 2.5]]
    """
    from nlfrf.rig.kernels.slip import follow_sliders

    path, speed = (
        np.ascontiguousarray(require_real_array(name, one, ndim=1))
        for name, one in (("x", x), ("v", v))
    )
    if path.size != speed.size or not path.size:
        raise ValueError(
            f"x and v must have the same number of samples, at least one, got {path.size},"
            f" {speed.size}"
        )
    law, grid = _pack_sliders(sliders)
    memory = initial_memory(law.curve, grid)
    forces = np.empty((grid.shape[1], path.size))
    follow_sliders(law, grid, memory.stack, path, speed, 1 / require_positive("fs", fs), forces)
    return forces


def load_forces(
    sliders: VaryingSliders,
    x: ArrayLike,
    v: ArrayLike,
    *,
    mass: float,
    stiffness: float,
    damping: float,
    viscous: float,
    fs: float,
    slopes: bool = False,
) -> np.ndarray:
    """Return the force of a load with friction on the body that moves it through a spring and a
    damper.

    The motion of that body is given and periodic. The load starts from rest, and the second period
    is returned. While friction sticks, few samples are enough: with 14 samples per cycle the error
    was 0.03 % of the force. In slip the error falls with the square of the step.

    Parameters
    ----------
    sliders : VaryingSliders
        Friction of the load, with E elements. Their strength must not depend on position or
        direction.
    x, v : (n,) ndarray
        One period of the motion at the other end of the spring: displacement [m] and velocity
        [m/s].
    mass, stiffness, damping, viscous : float
        Mass of the load [kg], stiffness [N/m] and damping [Ns/m] between motion and load, and
        viscous friction of the load [Ns/m].
    fs : float
        Sampling frequency [Hz].
    slopes : bool
        True: also return the derivatives of the force with respect to, in this order: the
        logarithms of mass, stiffness and damping; `viscous`; the logarithms of stiction - 1 and vs;
        the logarithms of the stiffness of each element; the logarithms of the break-away
        displacement of each element.

    Returns
    -------
    (1, n) or (7 + 2 E, n) ndarray
        Force [N], and with `slopes` its derivatives.

    Raises
    ------
    ValueError
        Displacements and velocities are not two finite arrays of equal length; a number is not
        positive; or the sliders depend on time at rest, position, direction or random numbers.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements); G. F.
    Franklin, J. D. Powell, M. L. Workman, *Digital Control of Dynamic Systems*, 3rd ed., 1998, 6.3
    (triangle hold).

    Examples
    --------
    Below break-away the element is a spring to ground. It is in series with the spring of the load:
    1 N/m and 1 N/m give 0.5 N/m.

    >>> sliders = VaryingSliders(stiffness=[1.0], strength=[10.0])
    >>> t = np.arange(1000) * 2 * np.pi / 1000
    >>> number = dict(mass=1e-6, stiffness=1.0, damping=1e-3, viscous=0.0, fs=1000 / (2 * np.pi))
    >>> bool(np.allclose(load_forces(sliders, np.sin(t), np.cos(t), **number)[0], np.sin(t) / 2, atol=1e-3))
    True
    """
    from nlfrf.rig.kernels.slip import follow_load

    x, v = (require_real_array(name, one, ndim=1) for name, one in (("x", x), ("v", v)))
    if x.size != v.size or not x.size:
        raise ValueError(
            f"x and v must have the same number of samples, at least one, got {x.size}, {v.size}"
        )
    if sliders.dwell or sliders.asymmetry or sliders.seed or np.isfinite(sliders.wavelength):
        raise ValueError(
            "sliders must vary with velocity only, got a dwell, wavelength, asymmetry or seed"
        )
    m, k, c = (
        require_positive(*one)
        for one in (("mass", mass), ("stiffness", stiffness), ("damping", damping))
    )
    elements = np.stack([sliders.stiffness, sliders.strength / sliders.stiffness])
    n, E, h = x.size, elements.shape[1], 1 / require_positive("fs", fs)
    numbers = np.array(
        [m, k, c, require_nonnegative("viscous", viscous), sliders.stiction, min(sliders.vs, 1e300)]
    )
    rates = np.zeros((4, 4))  # position, velocity, force and its rise over a step
    rates[0, 1], rates[1, :3], rates[2, 3] = (
        1.0,
        [-(k + elements[0].sum()) / m, -(c + viscous) / m, 1 / m],
        1 / h,
    )
    ahead = expm(rates * h)[:2]
    step = np.column_stack([ahead[:, :2], ahead[:, 2] - ahead[:, 3], ahead[:, 3]])
    # linear interpolation between samples reduces the force at every frequency
    drive = np.fft.irfft(np.fft.rfft(k * x + c * v) / np.sinc(np.fft.rfftfreq(n)) ** 2, n)
    if slopes:
        P = 6 + 2 * E
    else:
        P = 0
    out = np.empty((1 + P, n))
    follow_load(
        numbers,
        elements,
        step,
        np.stack([x, v, drive]),
        h,
        np.zeros((7, E)),
        np.zeros((P, 3 + E)),
        out,
    )
    return out


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
            return _pack_sliders(law)
        case OwnFriction():
            return _pack_user_law(law)
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
