"""``RobustnessReport``: the verdict on a controller, in fields for programs and on one screen for people."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.cards import Sketch
from nlfrf.shared.values import value
from nlfrf.shared.wording import hertz, paragraph
from robust.analysis.curves import Curves, Peaks
from robust.analysis.loop_level import LoopLevel
from robust.analysis.verdict import judged, stability_words
from robust.certificates.certificate import Certificate
from robust.performance.classical import ClassicalMargins, classical_margins
from robust.shared.states import Verdict
from robust.uncertain.forms import FORMS, loop_discs

__all__ = ["RobustnessReport", "fill_report"]


@value
class RobustnessReport:
    """What was found about one controller on one model, and what was proved.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies of the curves [rad/s].
    S, T : (W,) complex ndarray
        Sensitivity and complementary sensitivity of the nominal loop.
    rs, np_, rp : (W,) ndarray
        Robust stability (below 1), nominal performance |w_P S|, robust performance |w_P| max |S_p|; nan where
        the nominal loop is unstable or no w_P was given.
    nominally_stable, robustly_stable, robust_performance : bool
        True only when established; robust ones hold for the whole set, whatever the verdict makes of the set.
    margin_rs, margin_rp : float
        Largest factor on the uncertainty alone with robust stability, with rp <= 1 (0 where |w_P S| >= 1 already);
        nan for an unstable loop.
    omega_rs, omega_rp : float
        Where they are limited [rad/s].
    disk_margin, omega_disk : float
        Symmetric disk margin alpha = 1/max |S - 1/2| and where; nan for an unstable loop.
    certificates : tuple of Certificate
        What was proved over all frequencies.
    perturbation : str
        Class of the set: "LTI", "statistical" or "operator".
    verdict : Verdict
        "robust", "statistically robust", "not robust" or "not certified".
    reason, advice : str
        Why, and what limits the margin and what to measure or change next.
    proved, not_proved : str
        In one sentence each.
    context : str
        The loop in one line.
    G, K : (W,) complex ndarray
        Responses of plant and controller, hold and delay included.
    radius : (W,) ndarray
        |weight|, in the unit of the form.
    form : str
        Form of the uncertainty.
    w_P : (W,) ndarray or None
        |w_P| on the grid, where performance was asked for.
    shaping : (W,) complex ndarray or None
        What the plant is scaled by where the form depends on its units.
    demand : control.StateSpace or None
        The performance weight itself.
    delay : float
        Computation delay [s] on top of what the model contains.
    band : (2,) ndarray or None
        First and last measured frequency [rad/s]: outside, the radius is assumed.
    unit : str
        Unit of the plant, y over u, where it is known.
    probability : str
        With which probability the set holds a line, and all lines, of another realisation; empty where none is claimed.
    folding : str
        Of a set of continuous plants under a sampled controller: what rs is made of where it is largest.
    level : LoopLevel or None
        At which level the loop moves the machine, where the signals in it were named and the nominal loop is stable.

    References
    ----------
    SP 7.5, 7.6; Seiler, Packard & Gahinet 2020 (disk margin).

    Examples
    --------
    >>> import control
    >>> from robust import UncertaintyModel, check
    >>> plant, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(plant, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> report = check(model, 2.0)
    >>> report.verdict, bool(report.margin_rs * max(report.rs) > 0.999)
    ('statistically robust', True)
    """

    omega: np.ndarray
    S: np.ndarray
    T: np.ndarray
    rs: np.ndarray
    np_: np.ndarray
    rp: np.ndarray
    nominally_stable: bool
    robustly_stable: bool = False
    robust_performance: bool = False
    margin_rs: float = np.nan
    margin_rp: float = np.nan
    omega_rs: float = np.nan
    omega_rp: float = np.nan
    disk_margin: float = np.nan
    omega_disk: float = np.nan
    certificates: tuple[Certificate, ...] = ()
    perturbation: str
    verdict: Verdict
    reason: str
    advice: str
    proved: str
    not_proved: str
    context: str
    G: np.ndarray
    K: np.ndarray
    radius: np.ndarray
    form: str
    w_P: Any = None
    shaping: Any = None
    demand: Any = None
    delay: float = 0.0
    band: Any = None
    unit: str = ""
    probability: str = ""
    folding: str = ""
    level: LoopLevel | None = None

    @property
    def discs(self) -> tuple[np.ndarray, np.ndarray]:
        """(W,) centre and (W,) radius of the disc that L fills over the set."""
        shaping = 1.0 if self.shaping is None else self.shaping
        centre, radius = loop_discs(self.form, self.radius, self.G, self.K, shaping)
        if self.folding and not FORMS[self.form].inverse:  # with every alias, L + K sum_k h_k F_k Delta_k
            radius = self.rs * np.abs(1 + centre)
        return centre, radius

    @property
    def gain_margin(self) -> float:
        """Factor the loop gain may be multiplied or divided by, whatever the phase does inside the disk margin."""
        return (2 + self.disk_margin) / (2 - self.disk_margin) if self.disk_margin < 2 else np.inf

    @property
    def phase_margin(self) -> float:
        """Phase [rad] the loop may gain or lose, by the disk margin."""
        return 2 * float(np.arctan(self.disk_margin / 2))

    @property
    def classical(self) -> ClassicalMargins:
        """Crossover, phase and gain margin and bandwidth of the nominal loop, one at a time."""
        return classical_margins(self.omega, self.G * self.K) if self.nominally_stable else ClassicalMargins()

    @property
    def summary(self) -> str:
        """Verdict, margins and what was proved, in a few lines."""
        return "\n".join(self.findings())

    def findings(self) -> list[str]:
        """The rows of the summary."""
        lines = [
            *paragraph("verdict", judged(self.verdict, self.probability if self.nominally_stable else "")),
            *paragraph("because", self.reason),
        ]
        if self.nominally_stable and np.isfinite(self.margin_rs):
            lines += paragraph("stability", stability_words("rs", self.margin_rs, self.omega_rs))
            if self.folding:
                lines += paragraph("aliases", self.folding)
            if np.isfinite(self.margin_rp):
                worst = float(np.max(self.rp))
                text = (
                    f"nominal max |w_P S| {np.max(self.np_):.3f}, worst case {worst:.3f} at {hertz(self.omega_rp)}; "
                    + f"demand {'met' if self.robust_performance else 'not met' if worst > 1 else 'not proved'} "
                    "for the whole set"
                )
                lines += paragraph("performance", text)
        elif self.nominally_stable:
            lines += paragraph("stability", "no uncertainty to hold it against")
        return lines + paragraph("proved", self.proved)

    def _sketch_(self) -> Sketch:
        """What the set does to the loop and to the demand, for a notebook; one is the limit."""
        f = self.omega / (2 * np.pi)
        curves = [("rs", f, self.rs), ("rp", f, self.rp), ("limit", f[[0, -1]], np.ones(2)), ("|S|", f, np.abs(self.S))]
        return Sketch("Hz", "", [(label, x, np.minimum(y, 3.0)) for label, x, y in curves], log=True)

    def __str__(self) -> str:
        lines = self.findings()
        lines += paragraph("not proved", self.not_proved)
        for certificate in self.certificates:
            how = f"yes, {certificate.method}" if certificate.holds else f"no: {certificate.reason}"
            if certificate.holds and len(certificate.intervals) > 1:
                how += f" ({len(certificate.intervals)} of them)"
            if certificate.holds:
                how += f", {certificate.judged}"
            lines += paragraph("certificate", f"{certificate.subject} at all frequencies: {how}")
        if self.nominally_stable and np.isfinite(self.disk_margin):
            lines += paragraph(
                "disk margin",
                f"{self.disk_margin:.3f} at {hertz(self.omega_disk)}: gain {20 * np.log10(self.gain_margin):.2f} dB, "
                f"phase {np.degrees(self.phase_margin):.1f} deg, at once",
            )
        if self.nominally_stable:
            lines += paragraph("loop gain", str(self.classical))
        if self.level is not None:
            lines += paragraph("level", str(self.level))
        lines += paragraph("next", self.advice)
        lines += paragraph("loop", self.context)
        return "\n".join(lines)


def fill_report(
    curves: Curves, peaks: Peaks, words: dict[str, Any], *, perturbation: str, stable: bool, **known: Any
) -> RobustnessReport:
    """The report from what is known: curves that mean nothing for a loop that is not stable, or has no set, are nan."""
    nothing = np.full(curves.omega.size, np.nan)
    seen = stable and bool(np.isfinite(curves.w).all())
    return RobustnessReport(
        omega=curves.omega,
        S=curves.S,
        T=1 - curves.S,
        rs=curves.rs if seen else nothing,
        np_=curves.np_ if stable else nothing,
        rp=curves.rp if seen else nothing,
        nominally_stable=stable,
        perturbation=perturbation,
        G=curves.G,
        K=curves.K,
        radius=np.abs(curves.w),
        form=curves.form,
        w_P=None if curves.w_P is None else np.abs(curves.w_P),
        shaping=None if np.all(curves.W == 1) else curves.W,
        **peaks.margins,
        **words,
        **known,
    )
