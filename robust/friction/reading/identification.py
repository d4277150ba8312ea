"""Machine and friction identified from records at several levels, from sticking to sliding, and the
open questions.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

import nlfrf
from nlfrf._base.arguments import short_form
from nlfrf._base.numbers import smallest_step
from nlfrf._base.values import value
from robust.friction.reading.balance import (
    COARSE,
    FINE,
    KNOWN_IN_MOTION,
    LOAD,
    MEDIUM,
    SHRINKAGE,
    STEP,
    STEPS_PER_CYCLE,
    Candidate,
    Motion,
    as_real,
    element_spectra,
    force_of_motion,
    motion_of_record,
    pack,
    reaction_of_load,
    residual_of,
)
from robust.friction.reading.intervals import FORCE_ERROR, derived_numbers, deviations, mode_error
from robust.friction.reading.levels import FEWEST_LINES, require_levels
from robust.friction.reading.load import linear_load, start_with_load
from robust.friction.reading.numbers import (
    HALF_WIDTH,
    REPORTED,
    NumbersRead,
    number_facts,
    unit_of,
    units_of,
)
from robust.friction.reading.search import (
    EXPLAINED_BY_TWO,
    REFUTED,
    WORTH,
    escape,
    gain_of,
    largest_share,
    refine,
    reweight,
    search,
    settle,
    share_left,
    start_candidates,
    tangent_of,
    with_branches,
)
from robust.friction.units import format_length
from robust.pages.text import format_facts

#: (share of the time steps, shrinkage by noise) of fits that should give the same numbers. Their
#: differences enter every interval: 0.01 % of Fs and 0.04 % of the Coulomb friction on the linear
#: motor preset (medians of 25 runs).
_ALTERNATIVES = ((1 / 2, 8.0), (3 / 4, 1.0))
#: `FORCE_ERROR` for two masses, whose load is simulated. Six runs of the belt were off by up to 0.2
#: % of Fs and of the friction at the load and by 0.1 % of K0 and the delay; two of 72 numbers,
#: dampings of one run, were outside their intervals.
_LOAD_ERROR = 2e-3
#: Share of the force or of Fs that may stay unexplained at a level beyond noise. The preset of one
#: mass leaves 0.5 %, those of two masses 4 to 15 % around break-away, where Fs was up to 16 % off.
_MOST_UNEXPLAINED = 0.02
#: Share of Fs that may break away in the outer part of the largest swing, and share of K0 that may
#: slip at the lowest level.
_MOST_LATE, _MOST_EARLY = 0.1, 0.2
#: Start of the outer part of the swing. An element that sticks throughout the swing is a spring: a
#: free axis has none, and with a spring to ground it looks like a part of it. With a highest level
#: of 0.6 times the break-away force k was 23, 25 and 48 % of K0 too high on three random machines
#: (benchmarks/read_machine.py): one element was not seen, the others broke away up to 0.32, 0.41
#: and 0.24 of the swing. Of 26 sets with a highest level of 4 or 5.5 times, 25 stay below 0.2.
_OUTER_OF_FREE, _OUTER_WITH_SPRING = 0.75, 0.2
#: Standard deviations by which a lag must exceed the delay that contains it to count as a mode.
_DISTINCT = 3.0
#: Share of Fs that may lie at either motor or load, by the half-width of its interval, before they
#: are inseparable.
_MOST_SPLIT = 0.1
#: Levels whose forces differ by less than this factor are one level.
_SAME_LEVEL = 1.3


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
class _OpenQuestion:
    """A question that the levels leave open: the number that shows it, and what to measure.

    Fields
    ------
    kind : Gap
        Kind of the question.
    description : str
        The number that shows it, and what to measure.

    Examples
    --------
    >>> question = _OpenQuestion(kind=Gap.EQUAL_LEVELS, description="levels of 1, 1, 1 N rms count as 1")
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
    questions: tuple[_OpenQuestion, ...]
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


#: Highest line, relative to the antiresonance of the load, at which two masses move like one.
_RIGID = 1 / 3
#: Number of lines that suffices for a spring and a damper.
_FEWEST_RIGID = 4


def _balance_of(level: Motion, std: np.ndarray, candidate: Candidate) -> LevelBalance:
    """Return a level as a spring and a damper, measured and fitted; for two masses on lines where
    they move as one.
    """
    chosen = level.excited
    left = residual_of(level, candidate)
    spectra = element_spectra(
        level, candidate.breakaway, stiction=candidate.stiction, vs=candidate.vs
    )
    fitted = np.tensordot(candidate.stiffness, spectra, axes=1) + reaction_of_load(level, candidate)
    rigid = chosen
    # Well below the mode of the coupling both masses move as one: there the force less that of the
    # inertia is friction, as for one mass.
    if candidate.terms.load:
        load, coupling = (float(np.exp(candidate.numbers[name])) for name in LOAD[:2])
        fitted = fitted + load * level.omega**2 * level.Y
        below = chosen & (level.omega < _RIGID * np.sqrt(coupling / load))
        rigid = below if below.sum() >= _FEWEST_RIGID else chosen
    columns = np.stack([level.Y, 1j * level.omega * level.Y], axis=-1)[:, rigid]
    table = as_real([columns / std[:, rigid, np.newaxis]])
    k, c = (
        np.linalg.lstsq(table, as_real([force[:, rigid] / std[:, rigid]]), rcond=None)[0]
        for force in (fitted + left, fitted)
    )
    unexplained, noise = share_left(level, candidate)
    return LevelBalance(
        force=level.force,
        motion=float(np.sqrt((np.abs(level.Y) ** 2).sum(axis=1).mean() / 2)),
        stiffness=float(k[0]),
        damping=float(k[1]),
        stiffness_fit=float(c[0]),
        damping_fit=float(c[1]),
        unexplained=unexplained,
        noise=noise,
    )


#: Advice for levels that one mass (False) or two masses (True) do not explain.
_ANOTHER_MACHINE = {
    False: (
        "Measure to beyond the resonance and take masses=2, or give machine_with_friction the "
        "BLAs and a nominal with the mode"
    ),
    True: (
        "The search may have ended in a wrong minimum: add a level between those that bend. Or look"
        " for play, or measure in motion (identify_sliding)"
    ),
}
#: Advice for levels of which one mass explains the sticking one and no slipping one.
_ANOTHER_FRICTION = (
    "It explains the lowest level, so the friction is not Maxwell slip: it creeps before it slips"
    " (LuGre, Dahl), or slips at other forces"
)


def _questions_of(
    levels: list[Motion],
    candidate: Candidate,
    *,
    balances: list[LevelBalance],
    units: tuple[str, str],
    stuck: float,
    mode: str | None,
    split: float,
    damping: tuple[float, float],
) -> Iterator[_OpenQuestion]:
    """Yield the questions that the levels leave open.

    levels : the highest first.
    stuck : stiffness that never slips [N/m].
    mode : evidence that the machine is not rigid in the band; None if there is none.
    split : half-width of the interval of the break-away force of the load [N]; zero for one mass.
    damping : viscous friction and three of its standard deviations [Ns/m].
    """
    N, speed_unit = units[0], unit_of("L/s", units)
    k, D = candidate.all_elements
    Fs, K0 = float(k @ D), float(k.sum())
    two = candidate.terms.load
    limits = [
        EXPLAINED_BY_TWO if two and one.force > Fs / 2 else _MOST_UNEXPLAINED for one in balances
    ]
    worst, limit = max(
        zip(balances, limits, strict=True), key=lambda one: one[0].unexplained / one[1]
    )
    model = "motor and load" if two else "one mass"
    if worst.unexplained > limit:
        slips = not two and balances[-1].unexplained < limit
        yield _OpenQuestion(
            kind=Gap.OTHER_MACHINE,
            description=(
                f"{model} with Maxwell slip leaves {100 * worst.unexplained:.2g} % of the force (or"
                f" of Fs) at {worst.force:.3g} {N} rms unexplained, more than {100 * limit:g} %"
                f" beyond noise. {_ANOTHER_FRICTION if slips else _ANOTHER_MACHINE[two]}"
            ),
        )
    c, half = damping
    if c + half < 0:
        yield _OpenQuestion(
            kind=Gap.OTHER_MACHINE,
            description=(
                f"viscous friction of {c:.3g} +- {half:.1g} {unit_of('F s/L', units)} would drive"
                " the machine: the search ended in a wrong minimum, or another delay is mistaken"
                f" for it. {_ANOTHER_MACHINE[two]}"
            ),
        )
    delay, period = candidate.numbers["delay"], float(2 * np.pi / levels[0].omega.min())
    if abs(delay) > period:
        yield _OpenQuestion(
            kind=Gap.OTHER_MACHINE,
            description=(
                f"{model} with Maxwell slip needs a delay of {delay:.3g} s, longer than the"
                f" {period:.3g} s of the lowest line: the search ended in a wrong minimum."
                f" {_ANOTHER_MACHINE[two]}"
            ),
        )
    if mode is not None:
        yield _OpenQuestion(
            kind=Gap.FLEXIBLE,
            description=(
                f"the machine is no rigid mass with Maxwell slip in the band: {mode}. No single"
                " mass fits, so mass and friction are wrong by several per cent."
                f" {_ANOTHER_MACHINE[two]}"
            ),
        )
    outer = levels[0].half_swing
    begins = _OUTER_WITH_SPRING if candidate.terms.spring else _OUTER_OF_FREE
    late = float((k * D)[begins * outer < D].sum()) / Fs
    if late > _MOST_LATE or stuck:
        if stuck:
            seen = f"{stuck:.3g} {unit_of('F/L', units)} never slip"
        else:
            seen = f"{100 * late:.2g} % of Fs breaks away beyond {begins:.2g} of that"
        yield _OpenQuestion(
            kind=Gap.HIGHEST_LEVEL_STICKS,
            description=(
                f"the highest level still sticks: it swings +-{format_length(outer, units[1])}, and"
                f" {seen}. Fs is not known, nor which part is spring and which friction. Measure at"
                " three times the force"
            ),
        )
    inner = float(np.std(levels[-1].x))
    early = float(k[inner > D].sum()) / K0
    if early > _MOST_EARLY:
        yield _OpenQuestion(
            kind=Gap.LOWEST_LEVEL_SLIPS,
            description=(
                f"the lowest level does not stick: it moves {format_length(inner, units[1])} rms,"
                f" where {100 * early:.2g} % of K0 slips, and elements that slip earlier are not"
                " seen. Measure at a third of the force"
            ),
        )
    distinct = _count_distinct(levels)
    if distinct < min(3, len(levels)):
        listed = ", ".join(f"{level.force:.3g}" for level in levels)
        yield _OpenQuestion(
            kind=Gap.EQUAL_LEVELS,
            description=(
                f"levels of {listed} {N} rms count as {distinct}, as neighbours differ by less than"
                f" {_SAME_LEVEL:g} times in force and motion. Measure at three that differ:"
                " sticking, bending, sliding"
            ),
        )
    if split > _MOST_SPLIT * Fs:
        yield _OpenQuestion(
            kind=Gap.SPLIT,
            description=(
                f"friction of the motor and of the load look alike: {split:.2g} {N} of Fs ="
                f" {Fs:.4g} {N} may belong to either. Their sum holds. Measure beyond the resonance"
            ),
        )
    if not candidate.terms.stiction:
        yield _OpenQuestion(
            kind=Gap.STICTION,
            description=(
                "no stiction above Coulomb friction is seen at speeds up to"
                f" {np.abs(levels[0].v).max():.2g} {speed_unit}; stiction that falls only at higher"
                " speeds counts as part of Fs"
            ),
        )


def _count_distinct(levels: list[Motion]) -> int:
    """Return the number of levels that differ: when friction slides, the motion grows and the force
    hardly does.
    """
    rises = [
        max(high.force / low.force, high.half_swing / low.half_swing)
        for high, low in pairwise(levels)
    ]
    return 1 + sum(rise > _SAME_LEVEL for rise in rises)


#: Shares of mass and friction that are tried for a load; only their ratio matters.
_LOADS = ((1.0, 0.0), (1.0, 0.5), (1.0, 1.0), (0.5, 1.0))
#: Bins beyond this multiple of the highest line are noise and are left out for an oscillating load.
_HARMONICS = 3


def _compliance_column(
    level: Motion, candidate: Candidate, mass_share: float, friction_share: float
) -> np.ndarray:
    """Return (M, W) derivative of the force of one mass by the compliance 1/k between it and a
    share of it as a load.

    The load reacts with N = -m2 w^2 Y2 + F2(y2), and y2 = y - N/k. To first order in 1/k this is
    N0, the reaction of one mass, plus 1/k (m2 w^2 N0 + d/de F2(y - e n0)).
    """
    n = level.x.shape[1]
    omega = 2 * np.pi * level.fs / n * np.arange(n // 2 + 1)
    mass = mass_share * candidate.numbers["mass"]
    law = nlfrf.friction.VaryingSliders(
        stiffness=candidate.stiffness,
        strength=candidate.stiffness * candidate.breakaway,
        stiction=candidate.stiction,
        vs=candidate.vs,
    )

    def friction(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        forces = nlfrf.friction.element_forces(law, np.tile(x, 2), np.tile(v, 2), fs=level.fs)
        return np.asarray(friction_share * forces[:, n:].sum(axis=0))

    found = np.empty(level.U.shape, dtype=complex)
    for i, (x, v) in enumerate(zip(level.x, level.v, strict=True)):
        held = friction(x, v)
        reaction = np.fft.rfft(held) - mass * omega**2 * np.fft.rfft(x)
        reaction[_HARMONICS * level.lines[-1] :] = 0.0
        behind, behind_speed = np.fft.irfft(reaction, n), np.fft.irfft(1j * omega * reaction, n)
        step = STEP * x.std() / behind.std()
        slope = (friction(x - step * behind, v - step * behind_speed) - held) / step
        found[i] = 2 / n * (mass * omega**2 * reaction + np.fft.rfft(slope))[level.lines]
    return found


def _sign_of_mode(
    levels: list[Motion],
    weights: list[np.ndarray],
    *,
    candidate: Candidate,
    stds: dict[str, float],
    unit: str,
) -> str | None:
    """Return the evidence that the machine is not one rigid mass; None if there is none.

    To first order a load on a spring is a term -w^4, and while friction slides it looks like a lag
    of the force. A lag that is longer than the delay that contains it is a mode. If the load has
    friction, a positive compliance of its connection improves the fit: for one mass it came out
    negative or without improvement (benchmarks/read_machine.py, preset and random machines).
    """
    if candidate.terms.softening:
        return f"a term w^4 of {candidate.numbers['softening']:.2g} {unit} improves the fit"
    delay = candidate.numbers["delay"]
    lag = float(np.sqrt(max(0.0, candidate.numbers.get("lag_squared", 0.0))))
    if lag > delay + _DISTINCT * np.hypot(stds["lag"], stds["delay"]):
        return (
            f"the force lags by {1e3 * lag:.3g} +- {1e3 * stds['lag']:.1g} ms, more than its whole"
            f" delay of {1e3 * delay:.3g} ms, as it does below a mode above the band"
        )
    Q, left = tangent_of(levels, weights, candidate)
    tried = []
    for shares in _LOADS:
        columns = [_compliance_column(one, candidate, *shares) for one in levels]
        tried.append(
            gain_of(as_real([c / std for c, std in zip(columns, weights, strict=True)]), Q, left)
        )
    worth = max((worth for worth, amount in tried if amount > 0), default=0.0)
    if worth > WORTH:
        load = "a flexible load behind the motor, or friction that breaks away more slowly,"
        return f"{load} improves the fit (F ratio {worth:.3g}, chance {WORTH:g})"
    return None


def _stuck_stiffness(levels: list[Motion], stds: list[np.ndarray], candidate: Candidate) -> float:
    """Return the stiffness [N/m] of a free axis that no element explains; zero by chance."""
    Q, left = tangent_of(levels, stds, candidate)
    worth, amount = gain_of(
        as_real([one.Y / std for one, std in zip(levels, stds, strict=True)]), Q, left
    )
    if worth > WORTH and amount > 0:
        return amount
    return 0.0


def identify_friction(
    records: Sequence[nlfrf.Record],
    *,
    free: bool = False,
    masses: int = 1,
    sliding: NumbersRead | None = None,
) -> FrictionFit:
    """Identify an axis with friction from records at several levels, from sticking to sliding.

    The axis is one mass, or a motor and a load. One fit over all levels gives mass, viscous
    damping, spring, delay and friction with 95 % intervals. The records may be from open or closed
    loop. The friction model is Maxwell slip with any number of elements, stiction and a Stribeck
    curve.

    Use this for an axis that you can excite at three levels or more. The lowest level must be so
    low that the friction sticks. `machine_with_friction` makes a class of friction from the fit,
    for `prove_friction`.

    With two masses the force acts on the motor, and the encoder measures the position of the motor.
    A spring and a damper couple the load to the motor, and each mass has friction. Measure beyond
    the resonance: below it motor and load are hard to distinguish.

    Parameters
    ----------
    records : sequence of Record
        Periodic records in steady state with force [N] as input and position [m] as output: one
        record for each of at least three levels. Several periods are needed to estimate the noise.
    free : bool
        True for an axis without a spring from motor to ground.
    masses : int
        1, or 2 for a motor and a load.
    sliding : SlidingFit, optional
        Motor and load from `identify_sliding`, as start of the search. If given, lines on which
        much of the force is due to the quantisation by the encoder, as around the antiresonance,
        are left out. Otherwise all lines have equal weight.

    Returns
    -------
    FrictionFit
        Its field `questions` lists what the levels do not determine.

    Raises
    ------
    ValueError
        Masses other than one or two; fewer than three records; several channels; too few lines;
        units with a prefix; a reversed sign.

    References
    ----------
    J. G. MacKinnon, H. White, *Some heteroskedasticity-consistent covariance matrix estimators*, J.
    Econometrics 29, 1985 (jackknife); J. D. Angrist, J.-S. Pischke, *Mostly Harmless Econometrics*,
    2009, section 8.1 (use of the larger of two standard errors); F. Al-Bender, V. Lampaert, J.
    Swevers, IEEE Trans. Automatic Control 50, 2005 (elements).

    Examples
    --------
    >>> identify_friction([])
    Traceback (most recent call last):
        ...
    ValueError: records must hold at least three levels, from sticking to sliding, got 0
    """
    if masses not in (1, 2):
        raise ValueError(f"masses must be 1, or 2 for a motor and a load, got {masses}")
    records = _list_levels(records)
    two = masses == 2
    if sliding is None or not two:
        machine = None
    else:
        machine = linear_load(sliding)
    # for two masses the errors of the time steps are in `_LOAD_ERROR`
    if two:
        first, finest = 1, COARSE
    else:
        first, finest = COARSE, FINE

    def motions(steps: float, shrinkage: float = SHRINKAGE) -> list[Motion]:
        finer = FINE if two else steps  # an oscillation of the load may have few samples
        found = [
            motion_of_record(record, finer, shrinkage, STEPS_PER_CYCLE * steps)
            for record in records
        ]
        if sliding is None or machine is None:
            return found
        return [
            without_noisy_lines(one, record, sliding)
            for one, record in zip(found, records, strict=True)
        ]

    coarse = motions(first)
    span = (
        min(float(np.std(one.x)) for one in coarse) / 2,
        0.9 * max(one.half_swing for one in coarse),
    )
    if two:
        starts = start_with_load(coarse, spring=not free, machine=machine)
    else:
        starts = start_candidates(coarse, span, spring=not free)
    if not starts[0].numbers["mass"] > 0:
        raise ValueError(
            f"records must be from force to position, got a mass of {starts[0].numbers['mass']:.3g}"
            " kg: the output falls when the input rises. Reverse the sign of the sensor"
        )
    known = machine is not None
    # the other starts are guesses of the machine
    candidate = search(
        coarse, starts[:1] if known else starts, span, KNOWN_IN_MOTION if known else ()
    )
    fine = motions(finest)
    # for two masses only a fit that explains the levels is worth finer steps
    refuted = largest_share(coarse, candidate) > (_MOST_UNEXPLAINED if two else REFUTED)
    if not (two or refuted):  # for two masses each start takes seconds
        candidate = escape(motions(MEDIUM), candidate, span)
    if not refuted:
        candidate = settle(fine, candidate, span)[1]
    fine = with_branches(fine, candidate)
    stds = reweight(fine, candidate)
    if refuted:  # none of its numbers holds
        numbers = derived_numbers(pack(candidate), candidate)
        spread = dict.fromkeys(numbers, np.inf)
    else:
        others = [motions(share * finest, shrinkage) for share, shrinkage in _ALTERNATIVES]
        numbers, spread = _numbers_with_spread(
            fine, others, stds=stds, candidate=candidate, span=span
        )
    balances = [_balance_of(level, std, candidate) for level, std in zip(fine, stds, strict=True)]
    units = units_of(records[0])
    if free and not refuted:
        stuck = _stuck_stiffness(fine, stds, candidate)
    else:
        stuck = 0.0
    mode = None
    if (
        not two and max(one.unexplained for one in balances) < _MOST_UNEXPLAINED
    ):  # any term improves a worse fit
        mode = _sign_of_mode(
            fine, stds, candidate=candidate, stds=spread, unit=unit_of("F s^4/L", units)
        )
    split = HALF_WIDTH * spread.get("load_Fs", 0.0)
    damping = numbers["damping"], 3 * spread["damping"]
    questions = list(
        _questions_of(
            fine,
            candidate,
            balances=balances,
            units=units,
            stuck=stuck,
            mode=mode,
            split=split,
            damping=damping,
        )
    )
    return FrictionFit(
        **numbers,
        vs=candidate.vs,
        stds=_leave_open(spread, questions, stuck),
        element_stiffness=candidate.stiffness,
        element_strength=candidate.stiffness * candidate.breakaway,
        seen_from=span[0],
        seen_to=max(level.half_swing for level in fine),
        levels=tuple(balances),
        questions=tuple(questions),
        units=units,
        load_sliders=candidate.load_sliders,
    )


def _list_levels(records: Sequence[nlfrf.Record]) -> list[nlfrf.Record]:
    """Return the records of at least three levels of one axis, the highest force first; refuse
    anything else.
    """
    if isinstance(records, Iterable):
        levels = list(records)
    else:
        levels = records
    if not isinstance(levels, list) or not all(
        isinstance(one, nlfrf.Record) and one.is_single for one in levels
    ):
        raise ValueError(
            f"records must be a list of Records with one input and output, got {short_form(levels)}"
        )
    units = [(record.y_unit, record.u_unit) for record in levels]
    require_levels("records", units, [record.lines.excited.size for record in levels])
    return sorted(levels, key=lambda record: -motion_of_record(record, 1).force)


#: Numbers that a question leaves open: all of them if the machine is not one mass.
_LEFT_OPEN = {
    Gap.OTHER_MACHINE: tuple(REPORTED),
    Gap.FLEXIBLE: tuple(REPORTED),
    Gap.HIGHEST_LEVEL_STICKS: ("Fs", "coulomb", "stiction"),
    Gap.LOWEST_LEVEL_SLIPS: ("K0",),
    Gap.STICTION: ("stiction",),
    Gap.SPLIT: ("load_K0", "load_Fs", "load_coulomb"),
}


def _leave_open(
    spread: dict[str, float], questions: list[_OpenQuestion], stuck: float
) -> dict[str, float]:
    """Return the standard deviations, infinite for numbers that the questions leave open.

    On a free axis a stiffness that never slips is friction, so K0 of the elements is too small. An
    assumed number, such as no spring, has no deviation and is not left open.
    """
    names = {name for question in questions for name in _LEFT_OPEN.get(question.kind, ())} | (
        {"K0"} if stuck else set()
    )
    return spread | {name: np.inf for name in names if spread.get(name)}


#: Share of the force of a level that one step of the encoder may make on a line: around the
#: antiresonance of a load the motion is small. This error repeats with the motion, so the scatter
#: over the periods does not show it. With all lines the true machine left 2 to 29 % of the force at
#: the levels of two axes; without them one fit left 0.0 to 0.6 %.
_MOST_OF_LINE = 0.02


def without_noisy_lines(level: Motion, record: nlfrf.Record, sliding: NumbersRead) -> Motion:
    """Return a level without the lines on which the step of the encoder makes much of the force; a
    few are kept.
    """
    step = smallest_step(record.y) / np.sqrt(
        3 * record.u.shape[-1]
    )  # standard deviation of a peak amplitude
    noise = np.abs(force_of_motion(sliding, level.omega, 0.0)) * step
    least = np.sort(noise)[min(FEWEST_LINES, noise.size) - 1]
    kept = noise <= max(least, _MOST_OF_LINE * float(np.sqrt((np.abs(level.U) ** 2).mean())))
    names = ("omega", "U", "Y", "noise", "excited", "lines")
    return replace(level, **{name: getattr(level, name)[..., kept] for name in names})


def _numbers_with_spread(
    fine: list[Motion],
    alternatives: list[list[Motion]],
    *,
    stds: list[np.ndarray],
    candidate: Candidate,
    span: tuple[float, float],
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the numbers and their standard deviations.

    A variance is the sum of that of `deviations`, of the mean square difference of the alternatives
    (fits of the levels with other time steps and another suppression of noise), and of a floor for
    model errors.
    """
    terms, numbers = candidate.terms, derived_numbers(pack(candidate), candidate)
    spread = deviations(fine, stds, candidate)
    others = []
    for alternative in alternatives:
        levels = [
            replace(one, centred=level.centred)
            for one, level in zip(alternative, fine, strict=True)
        ]
        other = refine(levels, stds, candidate=candidate, span=span)
        others.append(derived_numbers(pack(other), other))
    error = _LOAD_ERROR if terms.load else FORCE_ERROR
    top, speed = float(fine[0].omega[-1]), max(float(np.std(level.v)) for level in fine)
    floors = {
        "mass": numbers["mass"] * float(np.hypot(error, mode_error(fine[0], numbers))),
        "damping": error * numbers["coulomb"] / speed,
        "stiffness": error * (abs(numbers["stiffness"]) + numbers["K0"]) if terms.spring else 0.0,
        "delay": error / top,
    }
    for name, std in spread.items():
        between = np.mean([(other[name] - numbers[name]) ** 2 for other in others])
        spread[name] = float(
            np.sqrt(std**2 + between + floors.get(name, error * numbers[name]) ** 2)
        )
    return numbers, spread
