"""`FrictionFit`: the machine and friction of several levels, and what the levels leave open."""

from __future__ import annotations

import enum

import numpy as np

import nlfrf
from nlfrf._base.values import value
from robust.friction.reading.numbers import NumbersRead, number_facts
from robust.friction.units import format_length
from robust.pages.text import format_facts


class Gap(enum.Enum):
    """Kind of question that records at several levels can leave open: what they do not determine.

    References
    ----------
    docs/guide/axis.md: the tests behind each kind.

    Examples
    --------
    >>> Gap.LOWEST_LEVEL_SLIPS.value
    'K0'
    """

    HIGHEST_LEVEL_STICKS = "Fs"
    LOWEST_LEVEL_SLIPS = "K0"
    EQUAL_LEVELS = "levels"
    OTHER_MACHINE = "machine"
    FLEXIBLE = "mode"
    STICTION = "stiction"
    SPLIT = "split"


@value
class OpenQuestion:
    """A question that the levels leave open: the number that shows it, and what to measure.

    Fields
    ------
    kind : Gap
        Kind of the question.
    description : str
        The number that shows it, and what to measure.

    Examples
    --------
    >>> question = OpenQuestion(kind=Gap.EQUAL_LEVELS, description="levels of 1, 1, 1 N rms count as 1")
    >>> print(question)
    levels of 1, 1, 1 N rms count as 1
    """

    kind: Gap
    description: str

    def __str__(self) -> str:
        return self.description


@value
class LevelBalance:
    """Friction at one level as an equivalent spring and damper, measured and fitted.

    Fields
    ------
    force, motion : float
        Rms of the force [N] and of the position [m] on the lines.
    stiffness, damping : float
        Spring [N/m] and damper [Ns/m] that fit the friction force best, which is the measured force
        minus the force of the machine without friction.
    stiffness_fit, damping_fit : float
        Spring [N/m] and damper [Ns/m] that fit the force of the identified friction elements best.
    unexplained : float
        Rms of the force that neither the fit nor noise explains, divided by the larger of `force`
        and Fs.
    noise : float
        Rms of the force that noise explains, divided by the larger of `force` and Fs.

    References
    ----------
    A. Gelb, W. E. Vander Velde, *Multiple-Input Describing Functions*, 1968 (statistical
    linearisation).

    Examples
    --------
    >>> numbers = dict(force=1.0, motion=1e-6, stiffness=2e6, damping=0.0, stiffness_fit=2e6, damping_fit=0.0)
    >>> LevelBalance(**numbers, unexplained=0.001, noise=0.06).noise
    0.06
    """

    force: float
    motion: float
    stiffness: float
    damping: float
    stiffness_fit: float
    damping_fit: float
    unexplained: float
    noise: float


@value
class FrictionFit(NumbersRead):
    """Machine and Maxwell-slip friction, identified from records at several levels together.

    Fields
    ------
    mass, damping, stiffness : float
        Mass m [kg], viscous friction c [Ns/m] and stiffness to ground k [N/m] (zero for a free
        axis), of motor and load together.
    K0, Fs, coulomb, stiction : float
        Presliding stiffness [N/m] and break-away force [N] of all friction elements together,
        friction force at speed [N], and the ratio Fs/coulomb.
    vs : float
        Stribeck velocity at the motor [m/s]; infinite if the records show no stiction.
    delay, lag : float
        Whole delay from the command to the force [s], and the part of it that is a first-order lag.
    softening : float
        Coefficient of -w^4 [N s^4/m] in the dynamic stiffness, the effect of a mode above the band;
        zero if the records show none.
    stds : dict of str to float
        Standard deviation of each of these numbers; infinite if the levels do not determine it.
    element_stiffness, element_strength : (E,) ndarray
        Stiffness [N/m] and largest force [N] of each friction element at the motor, in the order in
        which the elements break away.
    seen_from : float
        Smallest detectable break-away displacement [m]. K0 does not contain elements that break
        away below it.
    seen_to : float
        Largest displacement [m] from the middle of the motion. An element that still sticks at this
        displacement counts as a spring to ground.
    levels : tuple of LevelBalance
        Force balance of each level, the highest level first.
    questions : tuple of OpenQuestion
        Open questions of the levels.
    units : tuple of str
        Units of force and position; all other units follow from them.
    load_mass, coupling, coupling_damping : float
        For two masses: load [kg], spring [N/m] and damper [Ns/m] between motor and load; zero for
        one mass.
    load_K0, load_Fs, load_coulomb : float
        Parts of K0, Fs and coulomb that act at the load.
    load_sliders : VaryingSliders, optional
        Friction law at the load.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements).

    Examples
    --------
    >>> import nlfrf
    >>> from robust.friction import identify_friction
    >>> law = nlfrf.friction.VaryingSliders(stiffness=[4e4, 2.4e4], strength=[0.5, 0.5])
    >>> rig = nlfrf.rig.Rig(1.0, 80e3, law, 10.0)
    >>> grid = dict(fs=1024, n_samples=2048, f_min=2, f_max=200)
    >>> played = [nlfrf.multisine("special-odd", rms=rms, rng=i, **grid) for i, rms in enumerate((0.1, 0.5, 2, 6))]
    >>> fit = identify_friction([nlfrf.simulate(rig, ms, n_periods=2, n_discard=3, oversampling=8) for ms in played])
    >>> round(fit.mass, 2), round(fit.Fs, 2), round(fit.stiffness / 1e3, 1)
    (1.0, 1.0, 80.0)
    >>> low, high = fit.interval("K0")
    >>> bool(low < 64e3 < high)
    True
    """

    mass: float
    damping: float
    stiffness: float
    K0: float
    Fs: float
    coulomb: float
    stiction: float
    vs: float
    delay: float
    lag: float
    softening: float
    stds: dict[str, float]
    element_stiffness: np.ndarray
    element_strength: np.ndarray
    seen_from: float
    levels: tuple[LevelBalance, ...]
    questions: tuple[OpenQuestion, ...]
    units: tuple[str, str] = ("N", "m")
    seen_to: float = np.inf
    load_mass: float = 0.0
    coupling: float = 0.0
    coupling_damping: float = 0.0
    load_K0: float = 0.0
    load_Fs: float = 0.0
    load_coulomb: float = 0.0
    load_sliders: nlfrf.friction.VaryingSliders | None = None

    @property
    def reason(self) -> str:
        """First reason why the levels determine no class of friction; empty if they do."""
        for question in self.questions:
            known = (
                question.kind is Gap.HIGHEST_LEVEL_STICKS
                and not self.stiffness
                and np.isfinite(self.stds["K0"])
            )
            if question.kind is not Gap.STICTION and not known:
                return question.description
        return ""

    def __str__(self) -> str:
        elements = f"{self.element_stiffness.size} elements"
        if self.load_sliders is not None:
            elements += f" at the motor and {self.load_sliders.stiffness.size} at the load,"
        last = (
            f"95 % intervals, given Maxwell slip of {elements} none of which slips below"
            f" {format_length(self.seen_from, self.units[1])}; at most"
            f" {100 * max(level.unexplained for level in self.levels):.2g} % of the force"
            " unexplained"
        )
        return "\n".join(
            [
                format_facts(number_facts(self)),
                last,
                *(f"Open: {question}" for question in self.questions),
            ]
        )
