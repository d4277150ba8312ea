"""``RobustnessReport``: the verdict on a controller, as fields for programs and as one screen of
text.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.types import Json
from nlfrf._base.values import to_plain, value
from robust._base.states import Demand, Verdict
from robust.analysis.classical import USUAL_PEAK, ClassicalMargins
from robust.analysis.disk import LoopMargins
from robust.analysis.findings import Findings, Given
from robust.analysis.loop_level import LoopLevel, describe_encoder_noise
from robust.analysis.text import (
    CLAIM_HINT,
    PLANT_ALONE,
    describe_broken,
    describe_certificate,
    describe_meaning,
    describe_thin_margins,
    disk_margin_fact,
    format_margin_factor,
)
from robust.models.sets.forms import FORMS, loop_discs
from robust.pages.section import Fact
from robust.pages.text import format_facts

#: A design that limits |S| on its own grid exceeds the limit by less than this between the grid
#: frequencies.
_ROUNDING = 0.01


@value
class RobustnessReport(Findings):
    """Verdict on one controller and one model, with margins and proofs, for any number of channels.

    `check` and `check_structure` return this report; `print(report)` shows it on one screen. A
    plant with one channel and one uncertainty is judged by closed formulas and exact arithmetic. A
    plant with several channels, or an `UncertainSystem` with several uncertainties, is judged by
    the structured singular value (mu).

    Fields
    ------
    verdict : Verdict
        "robust", "statistically robust", "not robust" or "not certified".
    nominally_stable : bool
        True only if the nominal loop is shown to be stable.
    curves : ReportCurves
        Over frequency: `omega` [rad/s], and the measures of robust stability (`rs`), nominal
        performance (`np_`) and robust performance (`rp`). For one channel also `S`, `T`, `G`, `K`,
        `L`, `radius`.
    margins : Margins
        Factors `rs` and `rp`, disk margin `disk`, and largest |S| over the set `S_worst`, each with
        its frequency (`omega_rs` and so on).
    proofs : Proofs
        `robustly_stable`, `robust_performance`, and their `certificates`.
    form : str
        Form of the uncertainty. For several channels, the form for which more was proved. Empty for
        an `UncertainSystem`.
    reason, advice : str
        Reason of the verdict; cause of the smallest margin, and what to measure or change next.
    proved, not_proved : str
        One sentence on what was proved, and one on what was not.
    context : str
        The loop in one line.
    folding : str
        For a continuous plant with a sampled controller: contributions to the largest rs, from its
        own frequency and from the aliases of this frequency.
    given : Given
        Input of the check: class of perturbations of the set, demand, delay, sampling time,
        measured band and unit.
    channels : LoopMargins or None
        For several channels: disk margins of the nominal loop, one channel at a time and all at
        once.
    level : LoopLevel or None
        Predicted rms of plant input and output in the loop, if `signals` were given and the nominal
        loop is stable.
    encoder_noise : float
        Rms of u caused by an encoder that rounds y, divided by the step of the encoder [unit of u
        over y]. The rounding error is taken as white noise of rms step / sqrt(12) through K S of
        the nominal loop, which holds for a y that moves over many steps. nan for a continuous loop
        and for several channels.
    peak : float
        Limit of |S| over the set; above this limit the report warns of thin margins. It is the peak
        that the demand allows, and 2 without a demand.
    confidence : tuple of str
        Probability that the set contains the FRF of another realisation (random draw of the phases
        of the excitation), on one line and on all lines together; empty if no probability is
        claimed.
    warnings : tuple of str
        Warnings about the records, the model and the loop, which limit the verdict and the
        probability.

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

    A report by mu:

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
        """(W,) centre and (W,) radius of the disc of all L = G_p K at each frequency, G_p in the
        set.
        """
        curves, shaping = self.curves, 1.0 if self.curves.shaping is None else self.curves.shaping
        centre, radius = loop_discs(self.form, curves.radius, G=curves.G, K=curves.K, W=shaping)
        if (
            self.folding and not FORMS[self.form].inverse
        ):  # with every alias, L + K sum_k h_k F_k Delta_k
            radius = curves.rs * np.abs(1 + centre)
        return centre, radius

    @property
    def classical(self) -> ClassicalMargins:
        """Crossover, phase margin, gain margin and bandwidth of the nominal loop; nan for an
        unstable loop.
        """
        if self.nominally_stable:
            return self.curves.classical
        return ClassicalMargins()

    @property
    def better_gain(self) -> str:
        """The loop gain that lowers max |S| over the set: "higher", "lower", or empty if neither
        does.
        """
        return self.curves.better_gain

    @property
    def thin_margins(self) -> str:
        """Where and why a robustly stable loop has thin margins; empty if |S| over the set stays
        below `peak`.
        """
        if not (self.proofs.robustly_stable and self.margins.S_worst > self.peak * (1 + _ROUNDING)):
            return ""
        return describe_thin_margins(self.margins, self.peak, phase=self.classical.phase_margin)

    @property
    def warning_of_margins(self) -> str:
        """The text of `thin_margins`, followed by a remedy."""
        thin = self.thin_margins
        cure = thin and self.curves.cure_of_peak
        if cure:
            return f"{thin}. To lower |S|: {cure}"
        return thin

    @property
    def performance(self) -> Demand | None:
        """Whether every plant of the set meets the demand; None without a demand or with an
        unstable nominal loop.
        """
        if not (self.nominally_stable and np.isfinite(self.margins.rp)):
            return None
        if self.proofs.robust_performance:
            return Demand.MET
        if self.curves.shows_missed_demand:
            return Demand.NOT_MET
        return Demand.NOT_PROVED

    @property
    def missed_performance(self) -> str:
        """Text after the verdict for a robustly stable loop that misses the demand; else empty."""
        missed = self.verdict.is_robust and self.performance not in (None, Demand.MET)
        if missed:
            return f", performance {self.performance}"
        return ""

    @property
    def headline(self) -> str:
        """The verdict, followed by a missed demand and by thin margins, if any."""
        return (
            f"{self.verdict}{self.missed_performance}{', thin margins' * bool(self.thin_margins)}"
        )

    @property
    def meaning(self) -> str:
        """Meaning of the verdict for the machine."""
        alone = self.verdict.is_robust and self.margins.peak_rs is None
        if alone:
            return PLANT_ALONE
        return describe_meaning(self.verdict, self.confidence)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the verdict, one a line: the confidence of the set, or the hint that the
        set has none.
        """
        if self.verdict is Verdict.STATISTICALLY_ROBUST and not self.confidence:
            return (CLAIM_HINT,)
        if self.nominally_stable:
            return self.confidence
        return ()

    @property
    def next_step(self) -> str:
        """The advice; empty if the loop is robust and meets its demand."""
        if self.verdict.is_robust and not self.missed_performance:
            return ""
        return self.advice

    @property
    def claims(self) -> list[Fact]:
        """The verdict with its meaning, its conditions and its warnings."""
        verdict = Fact("verdict", f"{self.headline.upper()}: {self.meaning}")
        conditions = [Fact("condition", text) for text in self.conditions]
        return [
            verdict,
            *conditions,
            *(Fact("warning", text) for text in (*self.warnings, self.warning_of_margins)),
        ]

    @property
    def findings(self) -> list[Fact]:
        """What the verdict rests on: reason, margins over the set, what was proved and not proved,
        and the next step. They are in `summary` and in the whole text.
        """
        margins, facts = self.margins, [Fact("because", self.reason)]
        if self.nominally_stable:
            facts += [
                Fact(
                    "stability", "the model has no uncertainty" if margins.peak_rs is None else ""
                ),
                Fact(
                    f"max {self.curves.measure}",
                    margins.peak_rs or "",
                    meaning=format_margin_factor(margins.rs),
                ),
                Fact(
                    "max |S|",
                    margins.peak_S or "",
                    meaning=self.curves.describe_peak(margins.S_worst_lines),
                ),
                Fact("aliases", self.folding),
                Fact("worst found", describe_broken(margins)),
                *self._performance_facts,
            ]
        return [
            *facts,
            Fact("proved", self.proved),
            Fact("not proved", self.not_proved),
            Fact("level", str(self.level or "")),
            Fact("next", self.next_step),
        ]

    @property
    def _performance_facts(self) -> list[Fact]:
        """The nominal and the worst value of the demand, and whether the whole set meets it; empty
        without one.
        """
        if self.performance is None:
            return []
        of = "" if self.margins.peak_rs is None else " for the whole set"
        return self.curves.performance_facts(self.margins, f"demand {self.performance}{of}")

    @property
    def details(self) -> list[Fact]:
        """Further numbers: certificates, margins of the nominal loop, the loop in one
        line. They are in the whole text, and not in `summary`.
        """
        return [
            *(Fact("certificate", describe_certificate(one)) for one in self.proofs.certificates),
            disk_margin_fact(self.margins),
            Fact(
                "margins",
                (
                    self.channels.least()
                    if self.channels is not None and not self.channels.reason
                    else ""
                ),
            ),
            *(self.curves.classical_facts if self.nominally_stable else ()),
            Fact("encoder", describe_encoder_noise(self.encoder_noise, self.given.unit)),
            Fact("loop", self.context),
        ]

    @property
    def summary(self) -> str:
        """Verdict, margins and proofs in a few lines."""
        return format_facts([*self.claims, *self.findings])

    def __str__(self) -> str:
        return format_facts([*self.claims, *self.findings, *self.details])


@to_plain.register
def _report_to_plain(thing: RobustnessReport, most: float = np.inf) -> Json:
    """Return a report in terms of JSON: fields, and every fact of its text."""
    plain = to_plain.dispatch(object)(thing, most)
    assert isinstance(plain, dict)
    facts = [fact for fact in (*thing.findings, *thing.details) if fact.amount]
    return plain | {"facts": to_plain(facts, most)}
