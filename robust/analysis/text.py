"""Every sentence of a report: reason, limit, remedy, proofs and conditions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import format_hertz
from robust._base.states import Stability, Verdict
from robust.analysis.aliases import RsBreakdown
from robust.analysis.classical import USUAL_PEAK, USUAL_PHASE_MARGIN
from robust.analysis.curves import MuCurves
from robust.analysis.findings import Margins, Proofs
from robust.analysis.loop import Loop
from robust.lti.grids import Peak
from robust.models.fit.weights import MAX_CHOSEN_ORDER
from robust.models.sets.forms import FORMS
from robust.models.sets.interconnection import UncertainSystem
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.records import format_probability
from robust.pages.section import Fact
from robust.proofs.search.certificate import Certificate

if TYPE_CHECKING:
    import control

    from robust.mu.parameters import ParameterMargin

# ---- Meaning of a result and advice on the next step.

_REMEDIES = {
    "noise": "noise: average more periods or sweeps",
    "odd": (
        "odd distortion: lower the bandwidth, or identify at the level of the loop; more periods"
        " will not help"
    ),
    "even": "even distortion: look for an offset or an asymmetry; more periods will not help",
    "misfit": (
        "misfit of the nominal model: fit it for the crossover of the loop (omega_c, robust model"
        " --bandwidth), or compare orders for it (robust orders --bandwidth)"
    ),
    "level": (
        "the change of the plant with the level: narrow the range of levels, or schedule the"
        " controller"
    ),
    "systematic": "the allowance for the systematic part: measure at a second level",
    "weight": "the weight lies far above the radius: fit a weight of a higher order",
    "assumed": "the assumption outside the measured band: measure there",
}
#: Distance of |T| from one below which a lower bandwidth does not help, and the advice for that
#: case.
_NEAR_ONE = 0.1
_ODD_WHERE_T_IS_ONE = (
    "Odd distortion at a frequency where |T| is near one, so a lower bandwidth does not reduce it."
    " Identify at the level of the loop or at another level, take more realisations, or improve the"
    " fit. More periods do not help."
)
#: Not covered by a verdict on a set around a sampled nominal.
_NONLINEAR_PLANT = (
    "stability of the nonlinear plant itself: distortion is not a linear perturbation, no theorem"
    " applies"
)
SAMPLES_ONLY = "; the set contains sampled plants, so nothing is proved between the samples"
_USUAL_JOINT = (
    0.94,
    0.99,
)  # probability of a whole FRF around a fitted nominal, in the 23 cases of benchmarks.joint
_NEGLIGIBLE_SHARE = 0.005  # of rs: a smaller part is not mentioned
#: Weight over radius, 2 dB and 6 dB: mentioned above the first, the first remedy above the second.
_MENTIONED_EXCESS, _DECISIVE_EXCESS = 1.26, 2.0


def advise_on_margin(
    model: UncertaintyModel,
    omega_rs: float,
    *,
    weight: Callable[[np.ndarray], np.ndarray],
    folding: RsBreakdown | None,
    T: float,
) -> str:
    """Advise what to measure or change, by the parts of the radius where the stability margin is
    limited.

    `weight` is the response of the weight; `folding` contains the parts of rs, if known; `T` is |T|
    at `omega_rs`.
    """
    seen_at = format_hertz(omega_rs)
    if folding is not None and folding.omega_source != folding.omega:
        seen_at += f" through its alias at {format_hertz(folding.omega_source)}"
        omega_rs = folding.omega_source
    low, high = float(model.omega[0]), float(model.omega[-1])
    outside = not low * 0.999 <= omega_rs <= high * 1.001
    k = int(np.argmin(np.abs(np.log(model.omega / omega_rs))))
    shares = model.radius_shares(k)
    listed = ", ".join(
        f"{name} {100 * share:.0f} %" for share, name in shares[:4] if share >= 0.005
    )
    if shares:
        where = f"where the radius consists of {listed}"
    else:
        where = "where the parts of the radius are unknown"
    on_line, there = np.abs(weight(np.array([model.omega[k], omega_rs]))).tolist()
    over, rise = on_line / float(model.radius[k]), 1.0
    if outside:
        if omega_rs < low:
            side, edge = "below", "first"
        else:
            side, edge = "above", "last"
        rise = there / on_line
        where = (
            f"{side} the measured band. The radius there is extrapolated "
            f"({model.origin.extrapolation}) from the {edge} line, {format_hertz(model.omega[k])}, "
            + where
        )
    sentences = [f"The margin is limited at {seen_at}, {where}."]
    if rise > _MENTIONED_EXCESS:
        sentences.append(f"The extrapolation makes the radius {rise:.3g} times as large there.")
    if over > _MENTIONED_EXCESS:
        sentences.append(f"The weight is {20 * np.log10(over):.1f} dB above the radius there.")
    if rise > _DECISIVE_EXCESS or (outside and not shares):
        cause = "assumed"
    elif over > _DECISIVE_EXCESS:
        cause = "weight"
    else:
        if shares:
            cause = shares[0][1]
        else:
            cause = ""
    if cause == "weight" and model.weight.nstates >= MAX_CHOSEN_ORDER:
        sentences.append(
            f"The radius has a peak there that a weight of order {model.weight.nstates} does not"
            " follow. Lower the peak by more periods or realisations."
        )
    elif cause == "odd" and abs(T - 1) < _NEAR_ONE:
        sentences.append(_ODD_WHERE_T_IS_ONE)
    elif cause:
        sentences.append(f"{_REMEDIES[cause][0].upper()}{_REMEDIES[cause][1:]}.")
        sentences += ["Or measure at that frequency."] * (outside and cause != "assumed")
    return " ".join(sentences)


def advise_on_weight(loop: Loop, margins: Margins) -> str:
    """Advise a better weight if the radius passes on every measured line and the weight does not;
    else empty.
    """
    model = loop.model
    omega = model.omega[model.omega < loop.omega_max]
    if margins.largest_rs < 1 or FORMS[model.form].depends_on_units or not omega.size:
        return ""
    curves = loop.curves(omega)
    nearest = int(np.argmin(np.abs(np.log(omega / margins.omega_rs))))
    there = np.abs(loop.responders["w"](np.array([margins.omega_rs])))[0]
    on_line = np.abs(curves.w[nearest])
    if (
        on_line < _MENTIONED_EXCESS * model.radius[nearest] or there > _MENTIONED_EXCESS * on_line
    ):  # the limit is the assumption outside the band
        return ""
    on_lines = float(np.max(np.abs(curves.b) * model.radius[: omega.size] / np.abs(curves.w)))
    if not on_lines < 1:
        return ""
    order = model.weight.nstates + 2
    text = (
        f" On the measured lines the radius passes: rs is at most {on_lines:.3g}. The weight does"
        " not pass: "
    )
    if model.weight.nstates >= MAX_CHOSEN_ORDER:
        return (
            f"{text}a weight of order {model.weight.nstates} does not follow the peak of the radius"
            " there."
        )
    return (
        f"{text}it lies above the radius. Fit a weight of a higher order: robust model ... --order"
        f" {order}, or uncertainty(..., order={order})."
    )


def _describe_set(model: UncertaintyModel) -> str:
    if model.perturbation == "LTI":
        return f"every stable LTI perturbation inside the {model.form} weight"
    if model.perturbation == "operator":
        return (
            f"every causal perturbation, nonlinear ones included, with the gain of the {model.form}"
            " weight"
        )
    return f"every linear plant inside the {model.form} weight"


def describe_confidence(
    model: UncertaintyModel | Bla | control.FrequencyResponseData,
) -> tuple[str, ...]:
    """Describe the confidence of a set, then its joint probability; empty if none is claimed."""
    if not isinstance(model, UncertaintyModel) or np.isnan(model.confidence):
        return ()
    confidence, joint = model.confidence, _probability_of_whole_frf(model)
    if model.alternative_form is not None:  # both sets have to contain the truth
        confidence = 2 * confidence - 1
    percent = f"{100 * confidence:.4g} %"
    if joint is None:
        estimated = ""
    else:
        estimated = format_probability(joint)
    whole: tuple[str, ...] = ()
    if model.simultaneous:
        text = (
            f"the FRF of another realisation lies in the set with {percent} probability, all lines"
            " together"
        )
        text += f" ({estimated} by estimate)" if estimated else ""
    else:
        text = f"each line of another realisation lies within the radius with {percent} probability"
        if joint is not None:
            whole = (f"a whole FRF lies under the weight with {estimated}{_compare_joint(joint)}",)
    return (f"subject to the warnings, {text}" if model.warnings else text), *whole


def _probability_of_whole_frf(model: UncertaintyModel) -> float | None:
    """Return the estimated probability that a whole FRF lies in the set, in both of its forms if it
    has two; None if it is unknown.
    """
    joint, other = model.joint, model.alternative_form
    if joint is None:
        return None
    if other is None:
        return joint.frf
    if other.joint is None:
        return None
    return max(joint.frf + other.joint.frf - 1, 0.0)  # the error probabilities add up


def _compare_joint(joint: float) -> str:
    """Compare the probability of a whole FRF with the usual one, and advise if it is low."""
    low, high = _USUAL_JOINT
    if joint < low:
        return (
            f"; {100 * low:g} to {100 * high:g} % are usual: a set for all lines together"
            " (simultaneous) reaches more"
        )
    return f" (usual: {100 * low:g} to {100 * high:g} %)"


def proof_sentences(loop: Loop, proofs: Proofs) -> tuple[str, str]:
    """Return one sentence on what was proved for one channel, and one on what was not."""
    model, missing = loop.model, []
    if model.perturbation == "statistical":
        missing += [_NONLINEAR_PLANT] + [
            "that the set contains the plant, beyond its confidence"
        ] * bool(describe_confidence(model))
    assumed = "the behaviour outside the measured band, where the radius is assumed ({})"
    return _join_proof_sentences(
        _describe_set(model),
        proofs,
        missing=[*missing, assumed.format(model.origin.extrapolation)],
        demand=loop.w_P is not None,
        dt=loop.dt,
        folded=loop.aliases is not None,
    )


def structure_proof_sentences(
    system: UncertainSystem, proofs: Proofs, *, folded: bool
) -> tuple[str, str]:
    """Return what was proved for several uncertainties and what was not; `folded` if the set
    contains every alias.
    """
    words = {
        "real": "every constant value of {}",
        "LTI": "every stable linear {}",
        "statistical": "every linear {}",
        "operator": "every causal {}, nonlinear ones included",
    }
    kinds = {
        name: "real" if one.kind == "real" else one.perturbation
        for name, one in system.blocks.items()
    }
    known = {"real": "parameters that change while the loop runs", "statistical": _NONLINEAR_PLANT}
    return _join_proof_sentences(
        f"{' and '.join(words[kind].format(name) for name, kind in kinds.items())}, all at once",
        proofs,
        missing=[text for kind, text in known.items() if kind in kinds.values()],
        demand=bool(system.inputs),
        dt=system.N.dt,
        folded=folded,
    )


def _join_proof_sentences(
    perturbations: str, proofs: Proofs, *, missing: list[str], demand: bool, dt: float, folded: bool
) -> tuple[str, str]:
    """Return what was proved with these perturbations, and what was not; `missing` begins the
    second sentence.
    """
    if not proofs.robustly_stable:
        return "Stability of the nominal loop only.", "Anything about the set around it."
    where = "at all frequencies"
    if dt:
        seen = "all aliases from above included" if folded else "for the samples only"
        where += f" up to Nyquist ({0.5 / dt:.4g} Hz), {seen}"
    if demand and not proofs.robust_performance:
        missing = [*missing, "the performance demand for the whole set"]
    if dt and not folded:
        missing = [
            *missing,
            (
                "perturbations of a continuous plant between the samples: the set contains sampled"
                " plants"
            ),
        ]
    what = "Stability and the performance demand" if proofs.robust_performance else "Stability"
    text = "; ".join(missing or ["anything outside the set"])
    return f"{what} with {perturbations}, {where}.", f"{text[0].upper()}{text[1:]}."


def describe_aliases(found: RsBreakdown, model: UncertaintyModel) -> str:
    """Describe the parts of the largest rs: its frequency and its aliases."""
    if not found.is_bounded:
        return (
            "the sum over the aliases is unbounded, because nothing filters the perturbation before"
            " the sampler"
        )
    if model.perturbation == "operator":
        other = "power that the perturbation moves to other frequencies"
    else:
        other = "the sum of the aliases"
    rs = f"rs {found.total:.3f} at {format_hertz(found.omega)}"
    if found.total - found.without_aliases < _NEGLIGIBLE_SHARE * found.total:
        text = f"{other} adds less than {100 * _NEGLIGIBLE_SHARE:g} % to {rs}"
    else:
        text = (
            f"{found.without_aliases:.3f} of {rs} acts at that frequency, the rest comes from"
            f" {other}"
        )
        if found.omega_source != found.omega:
            text += f", most of it from {format_hertz(found.omega_source)}"
    if found.total - found.in_band < _NEGLIGIBLE_SHARE * found.total:
        return f"{text}; nearly all of rs comes from measured lines"
    return f"{text}; the measured band alone gives {found.in_band:.3f}, the rest is assumed"


def _advise_on_aliases(found: RsBreakdown, model: UncertaintyModel) -> str:
    """Explain why the aliases prevent a certificate, and advise a remedy."""
    if not found.is_bounded:
        return (
            "the perturbation reaches the sampler unfiltered: it does not fall off above the"
            " Nyquist frequency, and the sum of its aliases is unbounded. Use a multiplicative set,"
            " which falls off with the plant. Or roll the weight off above Nyquist (guide on"
            " aliases), or put the anti-alias filter into the nominal"
        )
    if FORMS[model.form].inverse and model.perturbation != "operator" and found.F_max >= 1:
        return (
            f"the inverse uncertainty reaches {found.F_max:.3g} above the Nyquist frequency. From"
            " one on, the set contains plants of any gain there, and these alias. Keep the weight"
            " below one there, or use a multiplicative form"
        )
    if model.perturbation == "operator":
        other = "power that the perturbation moves to other frequencies"
    else:
        other = "aliases of the perturbation above the Nyquist frequency"
    text = f"with the {other}, rs reaches {found.total:.4g} at {format_hertz(found.omega)} "
    text += f"({found.without_aliases:.4g} without)"
    if found.omega_source != found.omega:
        text += f", most of it from {format_hertz(found.omega_source)}"
    helps = "Sample faster, or filter before the sampler"
    if found.in_band < 1:
        helps += (
            f"; the radius is assumed above the last line, {format_hertz(model.omega[-1])}: measure"
            " there"
        )
    return f"{text}. {helps}"


def describe_loop(loop: Loop) -> str:
    model = loop.model
    if loop.dt:
        kind = f"sampled at {1 / loop.dt:.6g} Hz"
    else:
        kind = "continuous"
    parts = ["zero-order hold"] * bool(loop.dt and not model.nominal.dt)
    parts += [f"a delay of {loop.delay:g} s"] * (loop.delay > 0)
    if parts:
        held = f", {' and '.join(parts)} in the plant"
    else:
        held = ""
    band = f"{format_hertz(model.omega[0])} to {format_hertz(model.omega[-1])}"
    return (
        f"{kind}{held}; plant {loop.G.nstates} states, controller {loop.K.nstates}; {model.form}"
        f" weight of order {model.weight.nstates}, perturbations {model.perturbation}, measured"
        f" {band}"
    )


#: Texts of a report on a loop without a stable nominal loop.
UNSTABLE_ADVICE = (
    "Lower the gain or the bandwidth until the nominal loop is stable; the set is judged only then."
)
NOTHING_PROVED = "Nothing."
NO_MARGINS = "Everything: margins mean nothing for a loop that is not stable."
ALIASES_NOT_PROVED = (
    "That the weights of the sampled set cover every alias between the frequencies of a grid"
)
NO_MU = "Everything: mu means nothing for a loop that is not stable."
#: Texts of a report on a plant that is known on its lines only.
LINES_ADVICE = (
    "Fit a nominal model (fit_nominal, uncertainty); the check can then be proved at all"
    " frequencies."
)
LINES_PROVED = "Nothing; computed on the measured lines only."
LINES_NOT_PROVED = "Anything between and outside the measured lines."


def explain_lines(
    nominal: Stability, encirclements: int, *, wanted: int, peak: float, has_set: bool
) -> str:
    """Explain a verdict that is based on the lines of an FRF; `peak` is the largest rs."""
    lines_only = "holds on the measured lines only"
    if nominal is Stability.UNSTABLE:
        return (
            f"unstable: on the measured lines 1 + L winds {encirclements} times about zero,"
            f" stability needs {wanted}"
        )
    if has_set and peak >= 1:
        return f"a plant of the set is unstable in this loop: rs = {peak:.4g}"
    if has_set:
        return f"rs stays below {peak:.4g}, but this {lines_only}: fit a nominal model"
    return f"the FRF has no uncertainty, and the result {lines_only}"


def explain_exact(
    loop: Loop, margins: Margins, proofs: Proofs, *, folding: RsBreakdown | None, certify: bool
) -> str:
    """Explain the verdict on one channel with a stable nominal loop."""
    if folding is not None and folding.total >= 1:
        if folding.single_frequency < 1:
            return _advise_on_aliases(folding, loop.model)
        size, where = folding.single_frequency, format_hertz(folding.omega)
        return f"a plant of the set is unstable in this loop: rs = {size:.4g} at {where}"
    if proofs.violated:
        found = f"rs = {margins.largest_rs:.4g} at {format_hertz(margins.omega_rs)}"
        how = proofs.certificates[0].reason if proofs.certificates else found
        return f"a plant of the set is unstable in this loop: {how}"
    if proofs.robustly_stable:
        reason = {
            "LTI": "every linear time-invariant perturbation of the set leaves the loop stable",
            "operator": (
                "every perturbation of the set, nonlinear ones included, leaves the loop stable"
            ),
            "statistical": "the loop is stable with every linear plant of the set",
        }
        return reason[loop.model.perturbation] + (
            SAMPLES_ONLY if loop.dt and loop.aliases is None else ""
        )
    return _explain_open(f"rs stays below {margins.largest_rs:.4g} on the grid", proofs, certify)


def _explain_open(below: str, proofs: Proofs, certify: bool) -> str:
    """Explain an open verdict with a curve below one: no proof was requested, or none was found."""
    if not certify:
        return f"{below}, and no proof was requested (certify=False)"
    return f"{below}, but no proof was found: {proofs.certificates[0].reason}"


#: Meaning of each verdict for the machine, in at most 20 words.
_VERDICT_MEANINGS = {
    Verdict.ROBUST: "this controller keeps every plant of the set stable, which is proved",
    Verdict.STATISTICALLY_ROBUST: (
        "this controller keeps every linear plant of the set stable; for the nonlinear machine"
        " itself there is no proof"
    ),
    Verdict.NOT_ROBUST: (
        "with this controller a plant of the set, or the nominal one, is unstable: do not use it"
    ),
    Verdict.NOT_CERTIFIED: (
        "stability of the machine with this controller is neither proved nor disproved"
    ),
}
#: Meaning for a set from a radius or from plants of the user, if no class of perturbation was
#: named.
_WITHOUT_CONFIDENCE = (
    "this controller keeps every linear plant of the set stable; the probability that the set"
    " contains the machine is unknown"
)
#: Meaning if no set was given.
PLANT_ALONE = (
    "this controller keeps the given plant stable, which is proved; no set of plants was given"
)
CLAIM_HINT = 'no class of perturbation is claimed; claim one by perturbation="LTI" or "operator"'


def format_margin_factor(margin: float) -> str:
    if margin > 1:
        return f"the uncertainty may grow by a factor {margin:.3g}"
    return f"the uncertainty would have to shrink to {100 * margin:.3g} %"


def explain_mu(
    system: UncertainSystem,
    curves: MuCurves,
    *,
    broken: float,
    proofs: Proofs,
    cut: ParameterMargin | None,
    certify: bool,
) -> str:
    """Explain the verdict by mu; `cut` is the result of the subdivision of the parameter box."""
    if broken <= 1:
        return (
            f"a perturbation of the set, {broken:.3f} times as large as allowed, makes the loop"
            " singular"
        )
    if proofs.robustly_stable:
        samples = SAMPLES_ONLY if system.N.dt else ""
        linear = any(block.perturbation == "statistical" for block in system.blocks.values())
        with_linear = "the loop is stable with every linear plant of the set"
        return (
            with_linear if linear else "every perturbation of the set leaves the loop stable"
        ) + samples
    if curves.peak >= 1:
        reached = (
            f"the upper bound of mu reaches {curves.peak:.4g} at {format_hertz(curves.omega_peak)}"
        )
        if cut is None:
            parts = ""
        else:
            parts = (
                f"; on parts of the box {cut.proved:.3g} times the set is proved, then {cut.reason}"
            )
        return f"{reached}, but no perturbation was found that breaks the loop{parts}"
    return _explain_open(f"mu stays below {curves.peak:.4g} on the grid", proofs, certify)


# ---- Sentences with the numbers of a report.


def describe_meaning(verdict: Verdict, confidence: tuple[str, ...]) -> str:
    without = verdict is Verdict.STATISTICALLY_ROBUST and not confidence
    if without:
        return _WITHOUT_CONFIDENCE
    return _VERDICT_MEANINGS[verdict]


def describe_thin_margins(margins: Margins, limit: float, *, phase: float) -> str:
    """Explain why a stable loop is close to instability; `phase` is the nominal phase margin [rad],
    nan if the loop has none.
    """
    if np.isnan(phase):
        margin = ""
    else:
        margin = f", and the nominal phase margin is {np.degrees(phase):.1f} deg"
    return (
        f"thin margins: |S| reaches {margins.S_worst:.3g} over the set, at"
        f" {format_hertz(margins.omega_S_worst)}, above {limit:g}{margin}. Usual limits are |S| of"
        f" at most {USUAL_PEAK:g} and a phase margin of at least {USUAL_PHASE_MARGIN:g} deg"
        " (Skogestad & Postlethwaite 2005, 2.4.3). The loop amplifies disturbances at that"
        " frequency"
    )


def disk_margin_fact(margins: Margins) -> Fact:
    meaning = (
        f"gain {20 * np.log10(margins.disk_gain):.2f} dB, or phase"
        f" {np.degrees(margins.disk_phase):.1f} deg, or less of both"
    )
    return Fact("disk margin", Peak(margins.disk, margins.omega_disk), meaning=meaning)


def describe_broken(margins: Margins) -> str:
    """Describe the perturbation that makes the loop singular, by block; empty if none."""
    if not margins.worst:
        return ""
    parts = ", ".join(f"{name} {number:+.3g}" for name, number in margins.worst.items())
    return f"{margins.broken:.3f} times ({parts}) makes the loop singular"


def describe_certificate(certificate: Certificate) -> str:
    """Describe the subject of a certificate, and its method or the reason why it fails."""
    if certificate.holds:
        how = f"yes, {certificate.method}"
    else:
        how = f"no: {certificate.reason}"
    if certificate.holds and len(certificate.intervals) > 1:
        how += f" ({len(certificate.intervals)} of them)"
    if certificate.holds:
        how += f", {certificate.judged}"
    return f"{certificate.subject} at all frequencies: {how}"
