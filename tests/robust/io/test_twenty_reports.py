"""Twenty designs, twenty reports: every number on the page, in order, against the value that it was
made from.
"""

import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser

import control
import numpy as np
import pytest

import robust
from nlfrf import Record, identify, multisine, second_opinion
from robust import (
    UncertaintyModel,
    check,
    fit_nominal,
    frd,
    ncfsyn,
    performance_weight,
    sampled,
    step_response,
    uncertainty,
    validate,
    worst_case,
)
from robust.analysis import sample_loops
from robust.io import controller_sections, pid_gains
from robust.reports import write_report
from tests.support.bla import make_bla
from tests.support.responses import response

T = 0.02
F = np.arange(1, 80, 2) * 0.1
NUMBER = re.compile(r"(?<![\w.])-?(?:\d+(?:\.\d+)?(?:e[-+]?\d+)?|inf)(?![\w.]*\w)")


def plant(s):
    return 90 / (s * s + 6 * s + 100)


def bla_of(level=1.0, seed=0):
    size = np.abs(plant(2j * np.pi * F))
    return make_bla(
        lambda s: level * plant(s),
        F,
        f0=0.1,
        sigma_distortion=0.05 * size,
        rng=seed,
        hold="band-limited",
    )


BLA, LOUD = bla_of(), bla_of(1.1, 1)


@cache
def rig_fit():
    return fit_nominal(BLA, n_poles=2, n_zeros=0)


@cache
def fit_of_both():
    return fit_nominal([BLA, LOUD], n_poles=2, n_zeros=0)


LTI = UncertaintyModel(
    *(
        control.tf([1], [1, 1]),
        control.tf([0.2], [1]),
        "multiplicative",
        np.array([1.0, 20.0]),
        np.array([0.1, 0.2]),
    ),
    perturbation="LTI",
)
W_P = performance_weight(1.5, M_S=2.5, A=0.02)
PI, SLOW = robust.shaping.pid(0.2, 3.0, dt=T), robust.shaping.pid(0.3, 4.0)


def recorded():
    """A record with names and units, behind a cube."""
    ms = multisine(fs=64, n_samples=1024, f_min=0.5, f_max=12, rng=5)
    line = np.fft.rfftfreq(1024, 1 / 64)
    y = np.fft.irfft(np.fft.rfft(ms.u[0] + 0.02 * ms.u[0] ** 3) * plant(2j * np.pi * line), 1024)
    y = np.stack([y, y]) + 1e-3 * np.random.default_rng(4).standard_normal((2, 1024))
    named = {
        "u_name": "force",
        "y_name": "position",
        "u_unit": "N",
        "y_unit": "mm",
        "hold": "band-limited",
    }
    return Record(u=np.stack([ms.u[0]] * 2)[None], y=y[None], fs=64, lines=ms.lines, **named)


@cache
def rig_record():
    return recorded()


@cache
def measured():
    return identify(rig_record())


@cache
def fitted():
    return fit_nominal(measured(), n_poles=2, n_zeros=0)


@cache
def shaped(dt):
    G = sampled(rig_fit().G, dt) if dt else rig_fit().G
    return ncfsyn(G, robust.shaping.crossover_weight(G, 6.0)).K


@cache
def rig_model(form="multiplicative", simultaneous=False):
    return uncertainty(BLA, rig_fit(), form=form, order=3, simultaneous=simultaneous)


def family():
    return uncertainty([BLA, LOUD], fit_of_both(), order=3)


def rolled(model):
    """An additive set with a weight that falls off above the Nyquist frequency: a sampler would see
    it unfiltered.
    """
    if model.form != "additive":
        return model
    corner = np.pi / T
    roll_off = control.tf([np.hypot(1, model.omega[-1] / corner)], [1 / corner, 1])
    return replace(model, weight=model.weight * roll_off)


FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")


def of_form(form):
    """Return the designs of a form: sampled, and in continuous time with a demand."""
    return {
        f"{form}, sampled": lambda: (rolled(rig_model(form)), shaped(T), {}, {"bla": BLA}),
        f"{form}, continuous, w_P": lambda: (rig_model(form), shaped(0), {"w_P": W_P}, {}),
    }


#: name -> model, controller, how it is checked, and what is handed over with it.
DESIGNS = {
    **{name: design for form in FORMS for name, design in of_form(form).items()},
    "delay": lambda: (rig_model(), shaped(T), {"delay": 0.013}, {"nominal": rig_fit()}),
    "delay and w_P": lambda: (
        rig_model(),
        shaped(T),
        {"delay": 0.013, "w_P": W_P},
        {"bla": BLA, "nominal": rig_fit()},
    ),
    "continuous with delay": lambda: (rig_model(), shaped(0), {"delay": 0.02}, {}),
    "PI, sampled": lambda: (rig_model(), PI, {"w_P": W_P}, {"bla": BLA}),
    "PI, continuous": lambda: (rig_model(), SLOW, {}, {}),
    "family": lambda: (family(), PI, {"w_P": W_P}, {"bla": [BLA, LOUD], "nominal": fit_of_both()}),
    "all lines together": lambda: (rig_model(simultaneous=True), PI, {}, {"bla": BLA}),
    "with its record": lambda: (
        uncertainty(measured(), fitted()),
        PI,
        {"w_P": W_P},
        {"record": rig_record(), "nominal": fitted()},
    ),
    "a demand not met": lambda: (
        rig_model(),
        PI,
        {"w_P": performance_weight(30.0, M_S=1.2, A=1e-3)},
        {},
    ),
    "unstable": lambda: (rig_model(), 40 * PI, {"w_P": W_P}, {"bla": BLA}),
    "a gain on an LTI set": lambda: (
        LTI,
        2.0,
        {"w_P": performance_weight(0.5, M_S=3.0, A=0.5), "delay": 0.02},
        {},
    ),
    "not robust": lambda: (LTI, control.tf([300], [1, 1]), {}, {}),
}


class Told(dict):
    """Texts by (section, label), and which of them were held against anything."""

    def __init__(self):
        super().__init__()
        self.held = set()

    def __getitem__(self, key):
        self.held.add(key)
        return super().__getitem__(key)

    def left(self):
        """What has numbers and was held against nothing."""
        return {
            key: text for key, text in self.items() if key not in self.held and NUMBER.search(text)
        }


class Facts(HTMLParser):
    """(section, label) -> text of every fact, and the rows of every table."""

    def __init__(self, text):
        super().__init__()
        self.section, self.label, self.tag, self.said, self.rows = "", "", "", Told(), {}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag == "section":
            self.section = dict(attrs)["id"]
        if tag == "tr":
            self.label = ""
            self.rows.setdefault(self.section, []).append([])
        self.tag = "fact" if dict(attrs).get("scope") == "row" else tag

    def handle_endtag(self, tag):
        self.tag = ""

    def handle_data(self, text):
        if self.tag == "fact":
            self.label = text
        elif self.tag == "td" and self.label:
            key = (self.section, self.label)
            self.said[key] = f"{self.said.get(key)}: {text}" if key in self.said else text
        elif self.tag == "figcaption":
            self.said[f"{self.section}, a picture", text] = text
        elif self.tag == "td":
            self.rows[self.section][-1].append(text)


def is_written(token, value):
    """Whether a number on the page is this value, in one of the ways in which numbers are written
    there.
    """
    wanted = float(token)
    written = [f"{value:.{n}g}" for n in (3, 4, 6, 10, 12)] + [
        f"{value:.{n}f}" for n in (0, 1, 2, 3)
    ]
    return any(float(text) == wanted for text in written)


def holds(text, *values):
    """Every number in the text is the next of the values, and none is left over; one that is
    infinite is written as a word.
    """
    tokens = NUMBER.findall(text)
    assert text.count("infinite") >= np.isinf(values).sum()
    values = [value for value in values if not np.isinf(value)]
    assert len(tokens) == len(values), f"{tokens} in {text!r}, and {values}"
    for token, value in zip(tokens, values, strict=True):
        assert is_written(token, value), f"{token} in {text!r} is no {value!r}"


def in_hertz(roots, dt):
    """Frequency [Hz], and damping where it is a pair, of roots sorted by size."""
    if dt:
        roots = np.where((roots.real < 0) & (np.abs(roots.imag) < 1e-7), roots.real + 0j, roots)
    with np.errstate(divide="ignore"):
        s = np.log(roots.astype(complex)) / dt if dt else roots.astype(complex)
    out = []
    for root in sorted(s[s.imag >= -1e-9 * np.abs(s)], key=abs):
        size = abs(root)
        if not np.isfinite(size):
            out.append(0.0)  # "z = 0"
        elif size < 1e-6 or abs(root.imag) < 1e-9 * size:
            out.append(size / 2 / np.pi if size >= 1e-6 else 0.0)
        else:
            out += [size / 2 / np.pi, -root.real / size]
    return out


def factor(margin):
    return margin if margin > 1 else 100 * margin


HZ = 2 * np.pi


def classical(report):
    """The numbers of the loop gain by fact, read off the curves of the report by plain means."""
    seen, out = report.classical, {}
    if not np.isnan(seen.crossover):
        out["crossover"] = [seen.crossover / HZ]
        out["phase margin"] = [np.degrees(seen.phase_margin), seen.omega_phase / HZ, 30]
    for name, gain, omega in (
        ("gain margin", seen.gain_margin, seen.omega_gain),
        ("lower gain margin", seen.gain_reduction, seen.omega_reduction),
    ):
        if np.isfinite(gain) and gain > 0:
            out[name] = [20 * np.log10(gain), omega / HZ]
            L = np.interp(omega, report.curves.omega, np.abs(report.curves.G * report.curves.K))
            assert abs(gain * L - 1) < 0.02
    if np.isfinite(seen.bandwidth):
        assert np.interp(
            seen.bandwidth, report.curves.omega, np.abs(report.curves.S)
        ) == pytest.approx(np.sqrt(0.5), rel=0.02)
        out["bandwidth of S"] = [seen.bandwidth / HZ]
    return out


def of_step(step):
    last = [2, step.settling_time if np.isfinite(step.settling_time) else step.t[-1]]
    return [step.final, 10, 90, step.rise_time, 100 * step.overshoot, *last]


def told_by_the_check(facts, report):
    assert facts["verdict", "because"] == report.reason
    assert facts["verdict", "proved"] == report.proved
    assert facts["verdict", "not proved"] == report.not_proved
    assert facts.get(("verdict", "next"), "") == report.next_step
    assert facts["check", "loop"] == report.context
    if not report.nominally_stable:
        assert facts["check", "nominal loop"] == "not stable: no margin is given"
        return
    margins, curves = report.margins, report.curves
    assert 1 / margins.rs == pytest.approx(
        np.max(curves.rs), rel=1e-3
    )  # the margin is refined between
    holds(facts["verdict", "max rs"], 1 / margins.rs, margins.omega_rs / HZ, factor(margins.rs))
    if report.folding:
        assert facts["verdict", "aliases"] == report.folding
    alpha = 1 / np.max(np.abs(curves.S - 0.5))
    assert margins.disk == pytest.approx(alpha, rel=1e-3)
    both = 20 * np.log10(margins.disk_gain), np.degrees(margins.disk_phase)
    holds(facts["check", "disk margin"], margins.disk, margins.omega_disk / HZ, *both)
    worst = np.max(np.abs(curves.S) / (1 - curves.rs)) if np.max(curves.rs) < 1 else np.inf
    if np.isfinite(worst) and report.form == "multiplicative" and not report.folding:
        assert margins.S_worst == pytest.approx(worst, rel=1e-2)
    if np.isfinite(margins.omega_S_worst):
        size = [margins.S_worst] * int(np.isfinite(margins.S_worst))
        holds(facts["verdict", "max |S|"], *size, margins.omega_S_worst / HZ, 2)
    if ("check", "encoder") in facts:
        holds(facts["check", "encoder"], 1, report.encoder_noise)
    for name, numbers in classical(report).items():
        holds(facts["check", name], *numbers)
    if report.given.demand is not None:
        S_w = np.abs(response(report.given.demand, curves.omega)) * np.abs(curves.S)
        assert np.max(curves.np_) == pytest.approx(np.max(S_w), rel=1e-9)
        own, worst = np.argmax(curves.np_), np.argmax(curves.rp)
        holds(facts["verdict", "max |w_P S|"], S_w[own], curves.omega[own] / HZ)
        peak = curves.rp[worst], curves.omega[worst] / HZ
        holds(facts["verdict", "performance"], *peak, *[peak[0]] * int(1 < peak[0] < np.inf))
    assert (("verdict", "performance") in facts) == (report.given.demand is not None)


def told_of_the_controller(facts, rows, K, unit):
    dt = K.dt or 0.0
    holds(facts["loop", "controller"], K.nstates, *([1 / dt] if dt else []))
    holds(facts["loop", "poles"], *in_hertz(K.poles(), dt))
    holds(facts["loop", "zeros"], *in_hertz(K.zeros(), dt))
    if dt:
        np.testing.assert_allclose(
            [[float(c) for c in row] for row in rows["loop"] if row],
            controller_sections(K),
            rtol=1e-11,
        )
    said = (
        [f"PID {row}" for row in str(pid_gains(K, unit=unit)).splitlines()] if K.nstates < 2 else []
    )
    assert facts.get(("loop", "gains"), "").splitlines() == said


def told_of_the_advice(facts, model, report):
    """Where the margin is limited, what is assumed there, the shares of the radius, how far the
    weight lies above.
    """
    key = ("verdict", "next")
    if key not in facts:
        return
    text, omega = facts[key], report.margins.omega_rs
    if not report.nominally_stable:
        holds(text)
        return
    k = np.argmin(np.abs(np.log(model.omega / omega)))
    over = np.abs(response(model.weight, model.omega[[k]]))[0] / model.radius[k]
    wanted = [omega / HZ]
    if "The radius there is extrapolated" in text:
        wanted += [*map(float, NUMBER.findall(model.origin.extrapolation)), model.omega[k] / HZ]
    shares = np.array([part[k] for part in model.budget.values()])
    shares = np.sort(shares[shares > 0] / shares[np.isfinite(shares)].sum())[::-1][:4]
    wanted += [100 * share for share in shares if share >= 0.005]
    if "makes the radius" in text:
        wanted.append(np.abs(response(model.weight, np.array([omega])))[0] / model.radius[k] / over)
    if "above the radius there" in text:
        wanted.append(20 * np.log10(over))
    if "On the measured lines the radius passes" in text:
        wanted += [
            float(text.split("rs is at most ")[1].split(".  ")[0].split()[0].rstrip(".")),
            *[model.weight.nstates + 2] * 2,
        ]
    holds(text, *wanted)


def told_of_the_gains(facts, K, unit):
    """Every gain is that of the controller; the equation for a PLC is held where it is written, by
    running it.
    """
    key = ("loop", "gains")
    if key not in facts:
        with pytest.raises(ValueError, match="K must be a P"):
            pid_gains(K)
        return
    gains, text = pid_gains(K, unit=unit), facts[key]
    for name, number in (
        ("Kp", gains.kp),
        ("Ki", gains.ki),
        ("Kd", gains.kd),
        ("Tf", gains.filter_time),
    ):
        for token in re.findall(rf"\b{name} = ([-+.\de]+)", text):
            assert is_written(token, number)
    assert text.splitlines() == [f"PID {row}" for row in str(gains).splitlines()]


def told_of_the_worst(facts, model, K, report):
    if not report.nominally_stable:
        assert not [label for section, label in facts if section == "worst"]
        return
    delay = report.given.delay
    worst = worst_case(model, K, delay=delay)
    peak = [worst.achieved] if worst.stable else []
    holds(facts["worst", "worst plant"], *peak, worst.omega_worst / HZ, abs(worst.delta))
    holds(facts["worst", "its poles"], *in_hertz(worst.plant.poles(), worst.plant.dt or 0.0))
    holds(
        facts["worst", "step, nominal plant"],
        *of_step(step_response(model.nominal, K, delay=delay)),
    )
    if worst.stable:
        holds(
            facts["worst", "step, worst plant"],
            *of_step(step_response(worst.plant, K, delay=delay)),
        )
    lost = np.sum(~sample_loops(model, K, 25, delay=delay, rng=0).stable)
    holds(facts["worst", "random plants"], 25, lost)


def told_of_the_model(facts, model, given):
    holds(facts["nominal", "nominal plant"], model.nominal.nstates)
    holds(facts["nominal", "poles"], *in_hertz(model.nominal.poles(), (model.nominal.dt or 0.0)))
    holds(facts["nominal", "zeros"], *in_hertz(model.nominal.zeros(), (model.nominal.dt or 0.0)))
    assert facts["set", "set"] == str(model)
    assert facts["set", "source"] == model.origin.source
    if np.isnan(model.confidence):
        assert facts["set", "confidence"] == "none claimed"
    else:
        assert NUMBER.findall(facts["set", "confidence"])[0] == f"{100 * model.confidence:g}"
    assert facts["set", "outside the measured band"].endswith(model.origin.extrapolation)
    if "nominal" in given:
        assert facts["nominal", "fit"] == str(given["nominal"]).removeprefix("nominal model: ")
    blas = given.get("bla", measured() if "record" in given else [])
    blas = blas if isinstance(blas, list) else [blas]
    for i, bla in enumerate(blas):
        which = f", record {i + 1}" if len(blas) > 1 else ""
        seen = validate(model, bla)
        said = NUMBER.findall(facts["nominal", f"lines in the set{which}"])
        holds(" ".join(said[:2]), seen.n_outside_set, seen.n_lines)
        change = [seen.p_value]
        if seen.change is not None:
            change += [
                100 * seen.change.gain,
                100 * seen.change.frequency,
                1e3 * seen.change.delay,
                seen.change.level,
                seen.change.p_level,
            ]
        for token in said[2:]:
            assert any(
                is_written(token, number) for number in (*change, seen.n_outside, seen.n_expected)
            ), said
        rows = [row.strip() for row in str(bla).splitlines()]
        assert facts["bla", f"BLA{which.replace(', ', ' of ')}"].splitlines() == rows


def told_of_the_record(facts):
    u, grid = rig_record().u[0, -1], rig_record().lines
    counts = [
        grid.excited.size,
        grid.excited[0] / 16,
        grid.excited[-1] / 16,
        grid.odd.size,
        grid.even.size,
    ]
    rms = np.sqrt(np.mean(u**2))
    holds(facts["record", "excitation"], *counts, rms, np.abs(u).max() / rms)
    assert f"rms {rms:.4g} N," in facts["record", "excitation"]
    holds(facts["record", "record"], 1, 2, 1024, 64, 32, 1 / 16)


def told_of_the_opinion(facts):
    """The median difference of the two readings, and the limit between agreeing and not."""
    opinion = second_opinion(rig_record())
    assert not opinion.disagree.any()
    percent = float(opinion.law.split(" %")[0].rpartition(" ")[2])  # of a record of a cubic
    holds(facts["opinion", "opinion"], np.median(opinion.difference), 6, percent)


def told_of_settings(facts, model, K, report):
    holds(facts["settings", "weight"], model.weight.nstates)
    holds(
        facts["settings", "computation delay"], 1e3 * report.given.delay, 1e3 * model.origin.delay
    )
    holds(facts["settings", "sampling of the controller"], *([1 / K.dt] if K.dt else []))
    if report.given.demand is None:
        assert facts["settings", "performance weight"] == "none asked for"
    else:
        size = np.abs(response(report.given.demand, np.array([1e-3, 1e6])))
        omega = np.geomspace(1e-3, 1e6, 4000)
        last = omega[np.flatnonzero(np.abs(response(report.given.demand, omega)) >= 1)[-1]]
        holds(facts["settings", "performance weight"], 1 / size[0], 1 / size[1], last / HZ)


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("name", DESIGNS)
def test_every_number_is_that_of_the_value(name, tmp_path, undrawn):
    model, K, asked, given = DESIGNS[name]()
    K = control.ss(K) if not isinstance(K, float) else control.ss([], [], [], [[K]])
    report = check(model, K, **asked)
    write_report(tmp_path / "r.html", model, K, report=report, **given)
    page = Facts((tmp_path / "r.html").read_text(encoding="utf-8"))
    told_by_the_check(page.said, report)
    told_of_the_controller(page.said, page.rows, K, model.origin.unit)
    told_of_the_advice(page.said, model, report)
    told_of_the_gains(page.said, K, model.origin.unit)
    told_of_the_worst(page.said, model, K, report)
    told_of_the_model(page.said, model, given)
    told_of_settings(page.said, model, K, report)
    if "record" in given:
        told_of_the_record(page.said)
        told_of_the_opinion(page.said)
    for section, caption in [key for key in page.said if key[0].endswith("a picture")]:
        if " with its " in caption:
            holds(page.said[section, caption].split(" with its ")[1], 95)
        if caption.startswith("Input spectrum"):
            U = np.abs(np.fft.rfft(rig_record().u[0, -1]))
            stray = (
                np.delete(U, rig_record().lines.excited).max() / U[rig_record().lines.excited].min()
            )
            holds(page.said[section, caption], 100)
            assert 20 * np.log10(stray) < -100
        if " of record " in caption:
            which = NUMBER.findall(page.said[section, caption])[0]
            assert 1 <= int(which) <= len(given["bla"])
    told = page.said["check", "certificate"] if report.proofs.certificates else ""
    assert told.count(" at all frequencies: ") == len(report.proofs.certificates)
    for certificate in report.proofs.certificates:
        assert (
            f"{certificate.subject} at all frequencies: {'yes' if certificate.holds else 'no'}"
            in told
        )
        assert certificate.level == 1.0  # the bound that the page gives to every curve
    assert not page.said.left()


def test_there_are_twenty_designs_of_every_kind():
    assert len(DESIGNS) >= 20
    verdicts = {
        check(model, K, **asked, certify=False).verdict
        for model, K, asked, _ in (design() for design in DESIGNS.values())
    }
    assert {"not robust", "not certified"} <= verdicts


def test_a_plant_on_its_lines_only_is_told_by_its_lines(tmp_path, undrawn):
    model = uncertainty(BLA, frd(BLA), order=4)
    report = check(model, PI)
    write_report(tmp_path / "r.html", model, PI, report=report)
    page = Facts((tmp_path / "r.html").read_text(encoding="utf-8"))
    holds(page.said["nominal", "nominal plant"], F.size)
    told_by_the_check(page.said, report)
    told_of_the_controller(page.said, page.rows, PI, "")
