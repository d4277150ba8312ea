"""The findings about a loop and its set: curves, margins, proofs, and the verdict from them."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from nlfrf._base.values import ArrayField, value
from robust._base.states import Stability, Verdict
from robust._base.types import SystemField
from robust.analysis.classical import USUAL_PEAK, ClassicalMargins, classical_margins
from robust.lti.grids import NO_PEAK, Peak, peak_of
from robust.pages.section import Fact
from robust.proofs.search.certificate import Certificate

#: Relative change of the gain that is tried against thin margins, and the least relative decrease
#: of |S| that counts.
_GAIN_STEP, _LEAST_GAIN = 0.1, 0.02

#: Methods of proof for one channel.
ProofMethod: TypeAlias = Literal["exact", "lmi", "both"]
METHODS = ("exact", "lmi", "both")


@value
class Effort:
    """Options of a judge: which proofs it searches, with which solver."""

    certify: bool = True  # prove the result at all frequencies
    proof: ProofMethod = "exact"  # method for one channel
    solver: str | None = None  # of cvxpy, for proofs by P and a scaling; None: the default solvers
    gap: float | None = (
        # relative distance of proof and counter-example; None: 5 %, only if the verdict is open
        None
    )


@value
class ReportCurves:
    """Curves of a loop on a frequency grid; for several channels only bounds of mu.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    rs, np_, rp : (W,) ndarray
        Robust stability (below 1), nominal performance |w_P S|, robust performance |w_P| max |S_p|.
        nan if the nominal loop is unstable, if there is no set, or if there is no w_P. If the loop
        is judged by mu, rs and rp are upper bounds of mu, and np_ is nan.
    S, T : (W,) complex ndarray or None
        Sensitivity and complementary sensitivity of the nominal loop. These fields and all fields
        below are for one channel only.
    G, K : (W,) complex ndarray or None
        Responses of plant and controller, hold and delay included.
    radius : (W,) ndarray or None
        |weight|, in the unit of the form.
    w_P : (W,) ndarray or None
        |w_P|, if there is a demand.
    shaping : (W,) complex ndarray or None
        Scaling of the plant, for the coprime form, which depends on the units of the plant.

    References
    ----------
    SP 7.5, 7.6, 8.9 (RS), 8.10 (RP).

    Examples
    --------
    >>> rs, nothing = np.array([0.5, 0.8]), np.full(2, np.nan)
    >>> curves = ReportCurves(omega=np.array([1.0, 2.0]), rs=rs, np_=nothing, rp=nothing)
    >>> float(curves.rs.max()), curves.S is None
    (0.8, True)
    """

    omega: np.ndarray
    rs: np.ndarray
    np_: np.ndarray
    rp: np.ndarray
    S: ArrayField = None
    T: ArrayField = None
    G: ArrayField = None
    K: ArrayField = None
    radius: ArrayField = None
    w_P: ArrayField = None
    shaping: ArrayField = None

    @property
    def L(self) -> np.ndarray:
        """(W,) loop gain G K, for one channel."""
        return np.asarray(self.G * self.K)

    @property
    def measure(self) -> str:
        """Name of the measure of robust stability."""
        return "mu"

    @property
    def classical(self) -> ClassicalMargins:
        """Classical margins of a stable nominal loop; nan for several channels."""
        return ClassicalMargins()

    @property
    def classical_facts(self) -> tuple[Fact, ...]:
        """Lines of a report about the classical margins, if the loop has them."""
        return ()

    @property
    def better_gain(self) -> str:
        """As `RobustnessReport.better_gain`."""
        return ""

    @property
    def cure_of_peak(self) -> str:
        """What lowers |S|, as the end of a sentence; empty if unknown."""
        return ""

    @property
    def shows_missed_demand(self) -> bool:
        """Whether a plant of the set misses the demand; an upper bound shows none."""
        return False

    def describe_peak(self, n_lines: int) -> str:
        """Describe the largest |S| over the set; n_lines : as `Margins.S_worst_lines`."""
        where = f", on {n_lines} frequencies" * (n_lines > 0)
        return f"bound of its largest singular value over the set{where}"

    def performance_facts(self, margins: Margins, met: str) -> list[Fact]:
        """Return the lines of a report about a demand; met : whether the set meets it."""
        worst = margins.peak_rp or ""
        return [Fact("performance", worst, meaning=f"max mu, allowed is 1; {met}")]


@value
class LoopCurves(ReportCurves):
    """Curves of a loop with one channel and one uncertainty, by closed forms: all fields are
    given.
    """

    @property
    def measure(self) -> str:
        return "rs"

    @property
    def classical(self) -> ClassicalMargins:
        return classical_margins(self.omega, self.L)

    @property
    def classical_facts(self) -> tuple[Fact, ...]:
        return self.classical.facts

    @property
    def better_gain(self) -> str:
        L = self.L
        loose = self.rs * np.abs(1 + L)  # radius of the disc of L over the set

        def worst(factor: float) -> float:
            return float(np.max(1 / np.maximum(np.abs(1 + factor * L) - factor * loose, 1e-9)))

        tried = {worst(1 + _GAIN_STEP): "higher", worst(1 - _GAIN_STEP): "lower"}
        if min(tried) < (1 - _LEAST_GAIN) * worst(1.0):
            return tried[min(tried)]
        return ""

    @property
    def cure_of_peak(self) -> str:
        better = self.better_gain
        if better:
            return f"a {better} gain"
        return "more phase there; neither a higher nor a lower gain helps"

    @property
    def shows_missed_demand(self) -> bool:
        return bool(np.max(self.rp) > 1)

    def describe_peak(self, n_lines: int) -> str:
        del n_lines  # attained at its frequency
        return f"over the set; customary is at most {USUAL_PEAK:g}"

    def performance_facts(self, margins: Margins, met: str) -> list[Fact]:
        del margins  # the curves have the nominal value, too
        nominal, worst = (peak_of(self.omega, one) for one in (self.np_, self.rp))
        if 1 < worst.value < np.inf:
            missed = f", missed by a factor {worst.value:.3g}"
        else:
            missed = ""
        return [
            Fact("max |w_P S|", nominal, meaning="nominal"),
            Fact("performance", worst, meaning=f"{met}{missed}"),
        ]


@value
class Margins:
    """Margins of a loop: peaks over frequency, and the factors that follow from their sizes.

    A peak is a pair (value, omega [rad/s]). An unstable nominal loop has no peak, and a margin
    without a peak is nan: `rs` and `S_worst` without a set, `rp` without a demand.

    Fields
    ------
    peak_rs : Peak or None
        Largest rs. If the loop is judged by mu: largest upper bound of mu, or a smaller bound that
        was proved on the parts of the box of real parameters.
    peak_rp : Peak or None
        Largest inverse of the factor on the uncertainty up to which the demand rp <= 1 is met; inf
        if |w_P S| >= 1 for the nominal plant. If the loop is judged by mu: largest upper bound of
        mu with the performance; its inverse is a factor on perturbations and performance together.
    peak_disk : Peak or None
        Largest |S - 1/2|, for one channel.
    peak_S : Peak or None
        Largest |S| over the set; for several channels an upper bound of the largest singular value
        of S. inf if the loop with a plant of the set is unstable.
    S_worst_lines : int
        For several channels: 0 if `S_worst` is proved at all frequencies, else the number of
        frequencies checked.
    broken : float
        Factor on the uncertainty at which a perturbation was found that makes the loop singular;
        inf if none was found. Perturbations are searched if the loop is judged by mu.
    worst : dict or None
        The perturbation behind `broken`, divided by `broken`. For each block by name: a number in
        [-1, 1] for a real block, the gain for a complex block.

    References
    ----------
    SP 7.5, 7.6, 8.9, 8.10; Seiler, Packard & Gahinet 2020 (disk margin).

    Examples
    --------
    >>> margins = Margins(peak_disk=Peak(1.0, 2.0))
    >>> round(margins.disk_gain, 3), round(float(np.degrees(margins.disk_phase)), 1)
    (3.0, 53.1)
    >>> margins.rs
    nan
    """

    peak_rs: Peak | None = None
    peak_rp: Peak | None = None
    peak_disk: Peak | None = None
    peak_S: Peak | None = None
    S_worst_lines: int = 0
    broken: float = np.inf
    worst: dict[str, float] | None = None

    @property
    def rs(self) -> float:
        """Largest factor on the uncertainty for which the loop is robustly stable."""
        return _reciprocal(self.largest_rs)

    @property
    def largest_rs(self) -> float:
        """Largest rs, or largest bound of mu."""
        return (self.peak_rs or NO_PEAK).value

    @property
    def omega_rs(self) -> float:
        """Frequency at which rs is largest [rad/s]."""
        return (self.peak_rs or NO_PEAK).omega

    @property
    def rp(self) -> float:
        """Largest factor on the uncertainty for which the loop meets the demand."""
        return _reciprocal((self.peak_rp or NO_PEAK).value)

    @property
    def omega_rp(self) -> float:
        """Frequency at which `rp` is smallest [rad/s]."""
        return (self.peak_rp or NO_PEAK).omega

    @property
    def disk(self) -> float:
        """Symmetric disk margin alpha = 1/max |S - 1/2|, for one channel."""
        return _reciprocal((self.peak_disk or NO_PEAK).value)

    @property
    def omega_disk(self) -> float:
        """Frequency at which the disk margin is smallest [rad/s]."""
        return (self.peak_disk or NO_PEAK).omega

    @property
    def S_worst(self) -> float:
        """Largest |S| over the set, or a bound of its largest singular value."""
        return (self.peak_S or NO_PEAK).value

    @property
    def omega_S_worst(self) -> float:
        """Frequency at which `S_worst` is attained [rad/s]."""
        return (self.peak_S or NO_PEAK).omega

    @property
    def disk_gain(self) -> float:
        """Factor by which the loop gain may change, at any phase inside the disk margin."""
        if self.disk < 2:
            return (2 + self.disk) / (2 - self.disk)
        return np.inf

    @property
    def disk_phase(self) -> float:
        """Phase [rad] by which the loop may be shifted in either direction inside the disk margin."""
        return 2 * float(np.arctan(self.disk / 2))


def _reciprocal(x: float) -> float:
    """Return one over a nonnegative number; inf for zero, nan for nan."""
    if np.isnan(x):
        return x
    if x > 0:
        return 1 / x
    return np.inf


@value
class Proofs:
    """Proofs of a loop at all frequencies.

    Fields
    ------
    certificates : tuple of Certificate
        Proof of stability; then of performance, if there is a demand and stability holds. For a
        sampled set with several channels, the last certificate proves that this set contains the
        continuous set.
    robustly_stable, robust_performance : bool
        True only if proved for the whole set, whatever the class of the set.
    violated : bool
        True if the loop with a plant of the set is unstable.

    Examples
    --------
    >>> Proofs().robustly_stable
    False
    """

    certificates: tuple[Certificate, ...] = ()
    robustly_stable: bool = False
    robust_performance: bool = False
    violated: bool = False


@value
class Given:
    """Input of a check: the set, the demand, and the measurement behind them.

    Fields
    ------
    perturbation : str
        Class of the set: "LTI", "statistical" or "operator". Empty for an `UncertainSystem`: each
        block has its own.
    demand : control.StateSpace or None
        Performance weight.
    delay : float
        Computation delay [s] in addition to the delay of the model.
    dt : float
        Sampling time of the controller [s]; 0 in continuous time.
    band : (2,) ndarray or None
        First and last measured frequency [rad/s]; outside, the radius is an assumption.
    unit : str
        Unit of the plant, y over u; empty if unknown.

    Examples
    --------
    >>> Given(delay=1e-3).delay
    0.001
    """

    perturbation: str = ""
    demand: SystemField = None
    delay: float = 0.0
    dt: float = 0.0
    band: np.ndarray | None = None
    unit: str = ""


@value
class Findings:
    """Result of a judge: the first fields of `RobustnessReport`."""

    verdict: Verdict
    nominally_stable: bool
    curves: ReportCurves
    margins: Margins = Margins()
    proofs: Proofs = Proofs()
    form: str = ""
    reason: str
    advice: str = ""
    proved: str
    not_proved: str
    context: str = ""
    folding: str = ""

    @property
    def is_single(self) -> bool:
        """True for one channel with one uncertainty (closed forms); False for a result by mu."""
        return isinstance(self.curves, LoopCurves)


def decide_verdict(nominal: Stability, proofs: Proofs, *, statistical: bool) -> Verdict:
    """Return the verdict: by the nominal loop, then by a plant of the set that breaks it, then by
    the proofs.

    A set that contains the plant with some probability only makes "robust" into "statistically
    robust".

    >>> decide_verdict(Stability.STABLE, Proofs(robustly_stable=True), statistical=True)
    'statistically robust'
    >>> decide_verdict(Stability.UNDECIDED, Proofs(), statistical=False)
    'not certified'
    """
    if nominal is Stability.UNSTABLE or proofs.violated:
        return Verdict.NOT_ROBUST
    if nominal is Stability.UNDECIDED or not proofs.robustly_stable:
        return Verdict.NOT_CERTIFIED
    if statistical:
        return Verdict.STATISTICALLY_ROBUST
    return Verdict.ROBUST
