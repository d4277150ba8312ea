"""Sliders whose strength varies along the path, and the forces of their elements on a given
motion.
"""

from __future__ import annotations

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
from nlfrf.rig.laws.curves import MaxwellSlip


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


def pack_sliders(law: VaryingSliders) -> tuple[kernel_data.Law, kernel_data.Grid]:
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
    law, grid = pack_sliders(sliders)
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
