"""A machine with friction: masses on springs, forces in, positions out.

    m x'' + c x' + k x + friction(x') = force                                          one axis
    M q'' + C q' + K q + cubic springs + friction(q') = actuators @ force, y = sensors @ q        several

`Rig` describes the machine. `nlfrf.rig.run` simulates it under any force, and `nlfrf.simulate`
under multisines.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from nlfrf._base.arguments import DataWarning, require_choice, require_nonnegative, require_positive
from nlfrf._base.values import ArrayField, value
from nlfrf.rig.bench.machine import (
    FIELDS,
    check_axes,
    check_single_axis,
    integrate_axes,
    poles,
    stack_matrices,
    stack_memories,
)
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.integration import integrate
from nlfrf.rig.laws.laws import Leuven, LuGre, pack_law

#: |h lambda| on the negative real axis up to which the fourth-order Runge-Kutta step is stable.
_RUNGE_KUTTA_REAL_LIMIT = 2.785
#: Relative error at the resonance of the stuck rig above which a step is reported as coarse.
_MAX_RESONANCE_ERROR = 0.01


def _longest_step(pole: complex) -> float:
    """Return the longest step [s] with which the fourth-order Runge-Kutta method keeps a mode from
    growing.

    inf for a pole at zero, and for an unstable pole, which grows with every step.
    """
    if abs(pole) == 0 or pole.real > 0:
        return np.inf
    direction = pole / abs(pole)

    def growth(length: float) -> float:
        q = length * direction
        return abs(1 + q + q**2 / 2 + q**3 / 6 + q**4 / 24)

    low, high = 0.0, 4.0  # along every ray in the left half plane growth passes 1 once below 4
    for _ in range(25):
        middle = (low + high) / 2
        if growth(middle) <= 1 + 1e-12:
            low, high = middle, high
        else:
            low, high = low, middle
    return low / abs(pole)


def require_stable_step(longest: float, fs: float, oversampling: int) -> None:
    """Refuse a step that is unstable even before the rig slides."""
    if 1 / (fs * oversampling) > longest:
        raise ValueError(
            f"oversampling must be at least {int(np.ceil(1 / (fs * longest)))} for a stable"
            f" integration step of at most {longest:.3g} s at fs = {fs:g} Hz, got {oversampling}"
        )


def unstable_step_error(fs: float, oversampling: int, stable: Callable[[int], bool]) -> ValueError:
    """Return the error for a step that is unstable in sliding, with an oversampling tested to be
    stable.
    """
    enough, finer = "more than", oversampling
    for finer in (oversampling * 2**i for i in range(1, 10)):
        if stable(finer):
            enough = "about"
            break
    return ValueError(
        f"oversampling must be {enough} {finer} for a stable integration step in sliding "
        f"({1 / (fs * finer):.3g} s at fs = {fs:g} Hz), got {oversampling}"
    )


def warn_of_coarse_step(poles: np.ndarray, fs: float, oversampling: int) -> None:
    """Warn of a step that moves a pole of the stuck rig by more than 1 % of its damping: the
    resonance is wrong.
    """
    swinging = poles[(poles.imag > 0) & (poles.real != 0)]
    if not swinging.size:
        return
    # the error of a fourth-order Runge-Kutta step is (h p)^5 / 120
    shift = np.max(
        np.abs(swinging / swinging.real) * (np.abs(swinging) / (fs * oversampling)) ** 4 / 120
    )
    if shift > _MAX_RESONANCE_ERROR:
        enough = int(np.ceil(oversampling * (shift / _MAX_RESONANCE_ERROR) ** 0.25))
        warnings.warn(
            "the integration step is coarse: the resonance of the stuck rig is wrong by"
            f" {100 * shift:.2g} %. Use an oversampling of {enough}",
            DataWarning,
            stacklevel=3,
        )


@value(kw_only=False)
class Rig:
    """A mass on a spring, with viscous damping and friction to ground; or several coupled masses.

    For one axis give numbers. For n axes give matrices, and one friction law or None per axis.

    Parameters
    ----------
    mass : float or (n, n) ndarray
        Mass [kg]; a matrix must be symmetric and positive definite.
    stiffness : float or (n, n) ndarray
        Stiffness of the springs to ground and between axes [N/m]; zero for a free mass.
    friction : law, or a list of n laws or None
        Friction law of `nlfrf.friction`: Coulomb, Dahl, LuGre, Leuven, GeneralizedMaxwellSlip or
        VaryingSliders; for one axis also OwnFriction.
    damping : float or (n, n) ndarray
        Viscous damping [Ns/m], in addition to that in the friction law.
    cubic : (n, n) ndarray, optional
        Symmetric matrix of cubic springs, each with force c d^3 [N/m^3] for a deflection d. Springs
        to ground are on the diagonal, springs between two axes off the diagonal.
    actuators : (n, n_u) ndarray, optional
        Force on each axis per unit of each input; by default each axis has its own input.
    sensors : (n_y, n) ndarray, optional
        Measured positions per unit of each axis position; by default the position of each axis is
        measured.
    inputs, outputs : tuple of str
        Names of the n_u forces and of the n_y positions; records of the rig have the same names.

    Raises
    ------
    ValueError
        The mass is not positive (definite), stiffness or damping is negative (not semidefinite),
        `friction` is not a friction law, or matrices, laws and names do not fit each other.

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements", section 2: the
    experiment.

    Examples
    --------
    >>> from nlfrf.rig.laws.laws import LuGre
    >>> lugre = LuGre(sigma0=64e3, sigma1=13, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)
    >>> rig = Rig(1.0, 80e3, lugre)
    >>> bool(rig.stable_step > 1 / 4096), rig.n_axes
    (True, 1)

    A motor with friction drives a load through a shaft. The position of the load is measured:

    >>> drive = Rig(np.diag([1.0, 2.0]), [[5e4, -5e4], [-5e4, 5e4]], [lugre, None], [[2.0, -2.0], [-2.0, 2.0]],
    ...             actuators=[[1.0], [0.0]], sensors=[[0.0, 1.0]])
    >>> drive.n_axes, drive.n_inputs, drive.n_outputs
    (2, 1, 1)
    """

    mass: ArrayField
    stiffness: ArrayField
    friction: Any  # a law, or a tuple with one or None for each axis
    damping: ArrayField = 0.0
    cubic: ArrayField = None
    actuators: ArrayField = None
    sensors: ArrayField = None
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.several:
            checked: Mapping[str, object] = check_axes(
                {name: getattr(self, name) for name in FIELDS}
            )
        else:
            checked = check_single_axis({name: getattr(self, name) for name in FIELDS})
            require_positive("mass", self.mass)
            require_nonnegative("stiffness", self.stiffness)
            require_nonnegative("damping", self.damping)
            pack_law(self.friction)
        for name, content in checked.items():
            object.__setattr__(self, name, content)

    @property
    def several(self) -> bool:
        """True if the rig is given by matrices; signals then have an axis of channels."""
        return np.ndim(self.mass) > 0

    @property
    def n_axes(self) -> int:
        """Number of axes n."""
        if self.several:
            return len(self.mass)
        return 1

    @property
    def n_inputs(self) -> int:
        """Number of forces n_u."""
        return len(self.inputs)

    @property
    def n_outputs(self) -> int:
        """Number of measured positions n_y."""
        return len(self.outputs)

    def poles(self, gain: float) -> np.ndarray:
        """Return the (2 n,) poles [rad/s] of the rig, with friction as a spring of `gain` times its
        stiffness while it sticks.

        `gain` is 1 for a machine that sticks and 0 for one that slides.
        """
        mass, stiffness, damping = map(np.atleast_2d, (self.mass, self.stiffness, self.damping))
        return poles(
            mass, stiffness, damping, self.friction if self.several else [self.friction], gain
        )

    @cached_property
    def stable_step(self) -> float:
        """Longest integration step [s] that is stable while friction sticks; sliding may need a
        shorter one.
        """
        # stuck, just after a reversal (dz/dt = 2 v), and sliding
        limits = [
            _longest_step(complex(pole)) for gain in (1.0, 2.0, 0.0) for pole in self.poles(gain)
        ]
        for friction in self.friction if self.several else (self.friction,):
            if friction is None:
                continue
            law, _ = pack_law(friction)
            if (
                law.form == packing.GMS
            ):  # a slipping element relaxes to the Stribeck curve at the rate C / Fc
                limits.append(_RUNGE_KUTTA_REAL_LIMIT * law.Fc / law.n)
        return min(limits)


def paper_rig() -> Rig:
    """Return the example machine of these packages: a mass of 1 kg on a spring of 80 kN/m, with
    Leuven friction.

    It is the experiment of the paper in References. Its resonance is near 59 Hz in small motions,
    in which friction acts as a spring, and near 45 Hz in large ones.

    Returns
    -------
    Rig

    References
    ----------
    "The impact of nonlinear friction on frequency response function measurements": its table of
    parameters.

    Examples
    --------
    >>> round(float(np.sqrt(paper_rig().stiffness / paper_rig().mass) / (2 * np.pi)), 2)
    45.02
    """
    return Rig(mass=1.0, stiffness=80e3, friction=Leuven())


def two_axis_stage(nonlinearity: str = "friction") -> Rig:
    """Return a stage with two coupled axes, two forces and two measured positions.

    Masses of 1 and 1.5 kg are on springs, with a spring and a damper between them. The resonances
    are near 29 and 50 Hz. Each measured position is a combination of both axis positions.

    Parameters
    ----------
    nonlinearity : str
        "friction": LuGre friction on both axes. "springs": cubic springs to ground and between the
        axes. "none": a linear stage.

    Returns
    -------
    Rig
        Rig with inputs Fx, Fy [N] and outputs x, y [m].

    Raises
    ------
    ValueError
        `nonlinearity` is another text.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 3.7:
    several inputs.

    Examples
    --------
    >>> poles = two_axis_stage("none").poles(1.0)
    >>> (np.sort(np.abs(poles))[::2] / (2 * np.pi)).round(1).tolist()
    [28.9, 49.8]
    """
    require_choice("nonlinearity", nonlinearity, ("friction", "springs", "none"))
    k1, k2, coupling = 0.8 * (2 * np.pi * 28) ** 2, 1.5 * (2 * np.pi * 48) ** 2, 9e3
    lugre = LuGre(sigma0=3e4, sigma1=13.0, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)
    return Rig(
        mass=np.diag([1.0, 1.5]),
        stiffness=np.array([[k1 + coupling, -coupling], [-coupling, k2 + coupling]]),
        friction=[lugre, lugre] if nonlinearity == "friction" else [None, None],
        damping=np.array([[8.0, -2.0], [-2.0, 14.0]]),
        cubic=np.array([[3.3e10, 4.5e10], [4.5e10, 1.2e11]]) if nonlinearity == "springs" else None,
        sensors=np.array([[1.0, 0.15], [-0.1, 1.0]]),
        inputs=("Fx", "Fy"),
        outputs=("x", "y"),
    )


def require_one_axis(rig: Rig, where: str) -> Rig:
    """Return the rig; refuse one given by matrices, with `where` in the message."""
    if rig.several:
        raise ValueError(f"rig must have one axis {where}, got a rig of matrices with {rig.n_axes}")
    return rig


def initial_memory(rig: Rig) -> packing.Memory:
    if rig.several:
        return stack_memories(rig.friction)
    law, grid = pack_law(rig.friction)
    return packing.initial_memory(law.curve, grid)


def integrate_rig(
    rig: Rig, memory: packing.Memory, *, drive: np.ndarray, h: float, substeps: int
) -> np.ndarray | None:
    """Integrate the rig over the force at start, middle and end of each step; update `memory`.

    `drive` is (n, 3), or (n, 3, n_u) for several axes. Returns (n / substeps, 4), or (n / substeps,
    4, axes): position, velocity, z and friction force; None if the step was unstable.
    """
    if rig.several:
        machine = stack_matrices(rig.mass, rig.stiffness, damping=rig.damping, cubic=rig.cubic)
        forces = drive.reshape(len(drive), 3, rig.n_inputs) @ rig.actuators.T
        return integrate_axes(
            machine, rig.friction, memory=memory, drive=forces, h=h, substeps=substeps
        )
    law, grid = pack_law(rig.friction)
    body = packing.Body(False, float(rig.mass), float(rig.stiffness), float(rig.damping))
    return integrate(body, law, grid=grid, memory=memory, drive=drive, h=h, substeps=substeps)
