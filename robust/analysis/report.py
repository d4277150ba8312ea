"""``RobustnessReport``: the verdict on a controller, in fields for programs and on one screen for people."""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value
from robust._base.states import Demand, Verdict
from robust.analysis.disk import LoopMargins
from robust.analysis.findings import Findings, Given
from robust.analysis.loop_level import LoopLevel, describe_encoder_noise
from robust.analysis.performance import ClassicalMargins, classical_margins
from robust.analysis.text import (
    CLAIM_HINT,
    PLANT_ALONE,
    USUAL_PEAK,
    describe_broken,
    describe_certificate,
    describe_meaning,
    describe_thin_margins,
    disk_margin_fact,
    format_margin_factor,
    performance_facts,
    worst_sensitivity_fact,
)
from robust.lti.grids import Peak
from robust.models.sets.forms import FORMS, loop_discs
from robust.pages.section import Fact
from robust.pages.text import format_facts

#: Change of the gain that is tried against thin margins, and the least share by which |S| has to fall.
_GAIN_STEP, _LEAST_GAIN = 0.1, 0.02
#: A design that keeps |S| below a limit on its own grid passes it by less between its frequencies.
_ROUNDING = 0.01


@value
class RobustnessReport(Findings):
    """What was found about one controller on one model, and what was proved; for any number of channels.

    One loop with one uncertainty is judged by closed forms and exact arithmetic; several channels, and several
    uncertainties of an `UncertainSystem`, by the structured singular value. Fields that only one of the two has
    say so.

    Fields
    ------
    verdict : Verdict
        "robust", "statistically robust", "not robust" or "not certified".
    nominally_stable : bool
        Whether the loop with the nominal plant is; True only when established.
    curves : ReportCurves
        Over frequency: `omega`, `rs`, `np_`, `rp`, and of one loop `S`, `T`, `G`, `K`, `L`, `radius`.
    margins : Margins
        `rs`, `rp`, `disk`, `S_worst`, each with its frequency, `omega_rs` and so on.
    proofs : Proofs
        `robustly_stable`, `robust_performance`, and the `certificates` behind them.
    form : str
        Form of the uncertainty, of several channels the one that says most; empty of an `UncertainSystem`.
    reason, advice : str
        Why, and what limits the margin and what to measure or change next.
    proved, not_proved : str
        In one sentence each.
    context : str
        The loop in one line.
    folding : str
        Of a set of continuous plants under a sampled controller: what rs is made of where it is largest.
    given : Given
        What was checked: class and form of the set, the demand, delay, measured band and unit.
    channels : LoopMargins or None
        Of a set of several channels the disk margins of its nominal loop, one loop at a time and all at once.
    level : LoopLevel or None
        At which level the loop moves the machine, where the signals in it were named and the nominal loop is stable.
    encoder_noise : float
        Rms of u over the step of an encoder that rounds y [unit of u over y], of the nominal loop, while y moves over
        many steps: the step over sqrt(12) through K S. nan where the loop is continuous or of several channels.
    peak : float
        Largest |S| over the set that is not warned of: that of the demand, 2 without one.
    confidence : tuple of str
        With which probability the set holds a line, and all lines, of another realisation; empty where none is claimed.
    warnings : tuple of str
        What was warned of the records, the model and the loop; the verdict and its probability are subject to them.

    References
    ----------
    SP 7.5, 7.6, 8.9 (RS), 8.10 (RP); Seiler, Packard & Gahinet 2020 (disk margin).

    Examples
    --------
    >>> import control
    >>> from robust.models import Block, interconnection
    >>> from robust import UncertaintyModel, check
    >>> from robust.analysis import check_structure
    >>> plant, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(plant, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> report = check(model, 2.0)
    >>> report.verdict, bool(report.margins.rs * max(report.curves.rs) > 0.999)
    ('statistically robust', True)

    By the structured singular value:

    >>> lag = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y")
    >>> K = control.ss([], [], [], [[-4.0]], inputs="y", outputs="u")
    >>> report = check_structure(interconnection([lag, K], {"pole": Block("y", "pole", 7.5, kind="real")}))
    >>> report.verdict, round(report.margins.rs, 3)                                  # 5 of 7.5
    ('not robust', 0.667)
    """

    given: Given = Given()
    channels: LoopMargins | None = None
    level: LoopLevel | None = None
    encoder_noise: float = float("nan")
    peak: float = USUAL_PEAK
    confidence: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def discs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (W,) centre and (W,) radius of the disc that L fills over the set."""
        curves, shaping = self.curves, 1.0 if self.curves.shaping is None else self.curves.shaping
        centre, radius = loop_discs(self.form, curves.radius, G=curves.G, K=curves.K, W=shaping)
        if self.folding and not FORMS[self.form].inverse:  # with every alias, L + K sum_k h_k F_k Delta_k
            radius = curves.rs * np.abs(1 + centre)
        return centre, radius

    @property
    def classical(self) -> ClassicalMargins:
        """Return the crossover, phase and gain margin and bandwidth of the nominal loop, one at a time."""
        seen = self.nominally_stable and self.is_single
        return classical_margins(self.curves.omega, self.curves.L) if seen else ClassicalMargins()

    @property
    def better_gain(self) -> str:
        """Return "higher" or "lower": the gain of one loop by which max |S| over the set falls; empty where neither."""
        if self.curves.G is None or self.curves.K is None:
            return ""
        L = self.curves.G * self.curves.K
        loose = self.curves.rs * np.abs(1 + L)  # how far the set moves L

        def worst(factor: float) -> float:
            return float(np.max(1 / np.maximum(np.abs(1 + factor * L) - factor * loose, 1e-9)))

        tried = {worst(1 + _GAIN_STEP): "higher", worst(1 - _GAIN_STEP): "lower"}
        return tried[min(tried)] if min(tried) < (1 - _LEAST_GAIN) * worst(1.0) else ""

    @property
    def thin_margins(self) -> str:
        """Return why a loop that is stable with the whole set is close to instability; empty where |S| stays small."""
        if not (self.proofs.robustly_stable and self.margins.S_worst > self.peak * (1 + _ROUNDING)):
            return ""
        phase = self.classical.phase_margin if self.is_single else None
        return describe_thin_margins(self.margins, self.peak, phase=phase)

    @property
    def warning_of_margins(self) -> str:
        """Return why a loop is close to instability, and what makes |S| smaller; empty where it stays small."""
        thin, better = self.thin_margins, self.better_gain
        if not (thin and self.is_single):
            return thin
        cure = f"a {better} gain" if better else "neither a higher nor a lower gain; more phase there"
        return f"{thin}. What makes it smaller: {cure}"

    @property
    def performance(self) -> Demand | None:
        """Return whether the whole set meets the demand; None without one, and of an unstable nominal loop."""
        if not (self.nominally_stable and np.isfinite(self.margins.rp)):
            return None
        if self.proofs.robust_performance:
            return Demand.MET
        missed = self.is_single and np.max(self.curves.rp) > 1  # mu is an upper bound
        return Demand.NOT_MET if missed else Demand.NOT_PROVED

    @property
    def missed_performance(self) -> str:
        """Return what the verdict has to add of a loop that is robustly stable and misses the demand; else empty."""
        missed = self.verdict.is_robust and self.performance not in (None, Demand.MET)
        return f", performance {self.performance}" if missed else ""

    @property
    def headline(self) -> str:
        """Return the verdict, with what stands against it: a demand that was missed, thin margins."""
        return f"{self.verdict}{self.missed_performance}{', thin margins' * bool(self.thin_margins)}"

    @property
    def meaning(self) -> str:
        """Return what the verdict means for the machine."""
        alone = self.verdict.is_robust and np.isnan(self.margins.rs)
        return PLANT_ALONE if alone else describe_meaning(self.verdict, self.confidence)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Return what the verdict is subject to, a line each: mostly the confidence of the set."""
        if self.verdict is Verdict.STATISTICALLY_ROBUST and not self.confidence:
            return (CLAIM_HINT,)
        return self.confidence if self.nominally_stable else ()

    @property
    def next_step(self) -> str:
        """Return the advice where there is something to mend: not where the loop is robust and meets its demand."""
        return "" if self.verdict.is_robust and not self.missed_performance else self.advice

    @property
    def claims(self) -> list[Fact]:
        """Return the verdict with its meaning, and the conditions and warnings that it is subject to."""
        verdict = Fact("verdict", f"{self.headline.upper()}: {self.meaning}")
        conditions = [Fact("condition", text) for text in self.conditions]
        return [verdict, *conditions, *(Fact("warning", text) for text in (*self.warnings, self.warning_of_margins))]

    @property
    def findings(self) -> list[Fact]:
        """Return the reason, how far the loop is from trouble over the set, what was proved and what not, what next."""
        margins, facts = self.margins, [Fact("because", self.reason)]
        if self.nominally_stable:
            largest = Peak(margins.largest_rs, margins.omega_rs)
            facts += [
                Fact("stability", "no uncertainty to hold it against" if np.isnan(margins.rs) else ""),
                Fact("max rs" if self.is_single else "max mu", largest, meaning=format_margin_factor(margins.rs)),
                worst_sensitivity_fact(margins, single=self.is_single),
                Fact("aliases", self.folding),
                Fact("worst found", describe_broken(margins)),
                *performance_facts(self.curves, margins, self.performance),
            ]
        return [
            *facts,
            Fact("proved", self.proved),
            Fact("not proved", self.not_proved),
            Fact("level", str(self.level or "")),
            Fact("next", self.next_step),
        ]

    @property
    def details(self) -> list[Fact]:
        """Return the certificates, the margins of the nominal loop, and the loop in one line."""
        return [
            *(Fact("certificate", describe_certificate(one)) for one in self.proofs.certificates),
            disk_margin_fact(self.margins),
            Fact("margins", self.channels.least() if self.channels is not None and not self.channels.reason else ""),
            *(self.classical.facts if self.nominally_stable and self.is_single else ()),
            Fact("encoder", describe_encoder_noise(self.encoder_noise, self.given.unit)),
            Fact("loop", self.context),
        ]

    @property
    def summary(self) -> str:
        """Return verdict, margins, what was proved and what was not, in a few lines."""
        return format_facts([*self.claims, *self.findings])

    def __str__(self) -> str:
        return format_facts([*self.claims, *self.findings, *self.details])
