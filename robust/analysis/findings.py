"""What a judge finds of a loop and its set: curves, margins, proofs, and the verdict that follows from them."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from nlfrf._base.values import ArrayField, value
from robust._base.states import Stability, Verdict
from robust._base.types import SystemField
from robust.proofs.search.certificate import Certificate

#: How one loop is proved.
ProofMethod: TypeAlias = Literal["exact", "lmi", "both"]
METHODS = ("exact", "lmi", "both")


@value
class Effort:
    """How much a judge does.

    Fields
    ------
    certify : bool
        Whether the result is to be proved at all frequencies.
    proof : str
        How one loop is proved: "exact", "lmi" or "both".
    solver : str or None
        Of cvxpy, for proofs by P and a scaling; None for the usual ones.
    gap : float or None
        Relative distance between proof and counter-example for which a box of real parameters is cut up; None to do so
        only where the verdict is still open.
    """

    certify: bool = True
    proof: ProofMethod = "exact"
    solver: str | None = None
    gap: float | None = None


@value
class ReportCurves:
    """Curves of a loop on a grid, as a report shows them; of several channels bounds of mu only.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    rs, np_, rp : (W,) ndarray
        Robust stability (below 1), nominal performance |w_P S|, robust performance |w_P| max |S_p|; nan where
        the nominal loop is unstable, there is no set or no w_P was given. By the structured singular value rs and rp
        are upper bounds of mu, and np_ is nan.
    S, T : (W,) complex ndarray or None
        Sensitivity and complementary sensitivity of the nominal loop; of one loop, as all that follow.
    G, K : (W,) complex ndarray or None
        Responses of plant and controller, hold and delay included.
    radius : (W,) ndarray or None
        |weight|, in the unit of the form.
    w_P : (W,) ndarray or None
        |w_P|, where performance was asked for.
    shaping : (W,) complex ndarray or None
        What the plant is scaled by where the form depends on its units.

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
        """Return (W,) the loop gain G K, of one loop."""
        return np.asarray(self.G * self.K)


@value
class Margins:
    """How far a loop is from trouble, each margin with the frequency [rad/s] that limits it; nan where there is none.

    Fields
    ------
    rs, rp : float
        Largest factor on the uncertainty alone with robust stability, with rp <= 1 (0 where |w_P S| >= 1 already);
        nan for an unstable loop. By mu the factor up to which the upper bound stays at one (rp: on the
        perturbations and the performance together), or that was proved part by part of the box of real parameters.
    broken : float
        By mu: the factor at which a perturbation that was found makes the loop singular; inf where none was found.
    worst : dict or None
        By mu: that perturbation, block by block at broken = 1: a number in [-1, 1] for a real block, the size of a
        complex one.
    disk : float
        Symmetric disk margin alpha = 1/max |S - 1/2|; of one loop.
    S_worst : float
        Largest |S| over the set; of several channels a bound of its largest singular value. inf where a plant of the
        set is unstable, nan where there is no set.
    S_worst_lines : int
        Of several channels 0 where that bound is proved at all frequencies, else on how many it was looked at.
    omega_rs, omega_rp, omega_disk, omega_S_worst : float
        Where they are limited [rad/s].

    References
    ----------
    SP 7.5, 7.6, 8.9, 8.10; Seiler, Packard & Gahinet 2020 (disk margin).

    Examples
    --------
    >>> margins = Margins(disk=1.0)
    >>> round(margins.disk_gain, 3), round(float(np.degrees(margins.disk_phase)), 1)
    (3.0, 53.1)
    """

    rs: float = np.nan
    omega_rs: float = np.nan
    rp: float = np.nan
    omega_rp: float = np.nan
    broken: float = np.nan
    worst: dict[str, float] | None = None
    disk: float = np.nan
    omega_disk: float = np.nan
    S_worst: float = np.nan
    S_worst_lines: int = 0
    omega_S_worst: float = np.nan

    @property
    def largest_rs(self) -> float:
        """Return the largest rs, or the largest bound of mu."""
        return reciprocal(self.rs)

    @property
    def disk_gain(self) -> float:
        """Return the factor that the loop gain may change by, with any phase inside the disk margin."""
        return (2 + self.disk) / (2 - self.disk) if self.disk < 2 else np.inf

    @property
    def disk_phase(self) -> float:
        """Return the phase [rad] the loop may gain or lose, by the disk margin."""
        return 2 * float(np.arctan(self.disk / 2))


def reciprocal(x: float) -> float:
    """Return one over a number that is not negative; inf of zero, nan of nan."""
    return 1 / x if x > 0 else x if np.isnan(x) else np.inf


@value
class Proofs:
    """What was proved of a loop at all frequencies.

    Fields
    ------
    certificates : tuple of Certificate
        Stability first, then performance where it was asked for and stability holds; of a sampled set of several
        channels the last one says that it contains the continuous set.
    robustly_stable, robust_performance : bool
        True only when established for the whole set, whatever the verdict makes of the set.
    violated : bool
        A plant of the set is unstable in the loop.

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
    """What a check was given: the set, the demand, and what is known of the measurement behind them.

    Fields
    ------
    perturbation : str
        Class of the set: "LTI", "statistical" or "operator"; empty of an `UncertainSystem`, whose blocks have theirs.
    demand : control.StateSpace or None
        The performance weight.
    delay : float
        Computation delay [s] on top of what the model contains.
    band : (2,) ndarray or None
        First and last measured frequency [rad/s]: outside, the radius is assumed.
    unit : str
        Unit of the plant, y over u, where it is known.

    Examples
    --------
    >>> Given(delay=1e-3).delay
    0.001
    """

    perturbation: str = ""
    demand: SystemField = None
    delay: float = 0.0
    band: np.ndarray | None = None
    unit: str = ""


@value
class Findings:
    """What a judge found of a loop, and its reasons in words: the fields that `RobustnessReport` begins with."""

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
        """Return whether it is of one loop with one uncertainty, by closed forms; else it is by mu."""
        return self.curves.S is not None


def decide_verdict(nominal: Stability, proofs: Proofs, *, statistical: bool) -> Verdict:
    """Return the verdict: on the nominal loop, then by a plant of the set that breaks it, then by what was proved.

    Of a set that holds the plant with a probability only, what is proved is robust at that probability.

    >>> decide_verdict(Stability.STABLE, Proofs(robustly_stable=True), statistical=True)
    'statistically robust'
    >>> decide_verdict(Stability.UNDECIDED, Proofs(), statistical=False)
    'not certified'
    """
    if nominal is Stability.UNSTABLE or proofs.violated:
        return Verdict.NOT_ROBUST
    if nominal is Stability.UNDECIDED or not proofs.robustly_stable:
        return Verdict.NOT_CERTIFIED
    return Verdict.STATISTICALLY_ROBUST if statistical else Verdict.ROBUST
