"""The report of several inputs and outputs: every number on the page stands in a value that was
handed to it.
"""

import re
from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

import nlfrf
import robust
from tests.robust.io.test_report_page import Reader

T = 1 / 256
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")


def plant(s):
    return 900 / (s * s + 6 * s + 900)


def measured():
    ms = nlfrf.multisine("random-odd", fs=256, n_samples=512, f_min=1, f_max=60, n_inputs=2, rng=1)
    line, u = np.fft.rfftfreq(512, T), np.repeat(ms.u[:, :, None], 2, axis=2)
    G = np.array([[1.0, 0.2], [-0.1, 0.5]])[:, :, None] * plant(2j * np.pi * line)
    y = np.fft.irfft(np.einsum("jik,impk->jmpk", G, np.fft.rfft(u)), 512)
    y += 2e-3 * y.std() * np.random.default_rng(0).standard_normal(y.shape)
    return nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines, inputs=("Fx", "Fy"), outputs=("x", "y"))


@cache
def rig_record():
    return measured()


@cache
def rig_frm():
    return nlfrf.identify(rig_record(), transient="none")


@cache
def rig_fit():
    return robust.fit_nominal(rig_frm(), n_poles=2, rank=2, dt=T)  # both axes have one mode


@cache
def rig_model():
    return robust.uncertainty(rig_frm(), rig_fit(), form="additive", order=2)


@cache
def small_report():
    return robust.check(rig_model(), SMALL)


SMALL = control.append(*[control.ss(control.tf([0.3 * T, 0], [1, -1], T))] * 2)
W_P = robust.lti.discretize(robust.performance_weight(0.1, M_S=4.0, A=0.1), T)

#: Words of the page where the weakest direction of a matrix may be noise alone.
LOST = "lines the set may contain a matrix of lower rank: the weakest direction is not measured"


@pytest.mark.attack(every=3)
@pytest.mark.parametrize(
    ("K", "w_P"), [(SMALL, None), (SMALL, W_P), (control.ss([], [], [], 500 * np.eye(2), T), None)]
)
def test_every_number_on_the_page_is_held(K, w_P, tmp_path, undrawn):
    report = robust.reports.write_report(
        tmp_path / "r.html", rig_model(), K, bla=rig_frm(), nominal=rig_fit(), w_P=w_P
    )
    again = robust.check(rig_model(), K, w_P=w_P)
    page = Reader((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert page.ids == ["verdict", "bla", "nominal", "set", "loop", "check", "worst", "settings"]
    text = page.text.rpartition("Worst case")[
        0
    ]  # behind it what worst_case found, and the machine that wrote it
    rows = [
        rig_frm(),
        rig_fit(),
        rig_model(),
        again,
        *([again.channels] if again.channels else []),
    ]
    said = [
        row.strip()
        for value in rows
        for row in str(value).removeprefix("nominal model: ").splitlines()
    ]
    sigma, low, _ = nlfrf.bla.singular_values(rig_frm())
    assert np.all(low[-1] > 0)
    k = np.argmax(sigma[0] / sigma[-1])
    said.append(
        f"2 singular values on {rig_frm().f.size} lines; largest {sigma[0].max():.4g}, smallest"
        f" {sigma[1].min():.4g}, condition at most {sigma[0, k] / sigma[1, k]:.4g} at"
        f" {rig_frm().f[k]:g} Hz"
    )
    assert LOST not in page.text
    said += [
        again.reason,
        again.proved,
        again.not_proved,
        "; ".join(again.confidence),
        *again.conditions,
        rig_model().origin.source,
        rig_model().origin.extrapolation,
    ]
    seen = robust.validate(rig_model(), rig_frm())
    said.append(f"{seen.n_outside_set} of {seen.n_lines} lines of the BLA lie outside")
    said += [
        f"the uncertainty may grow by a factor {again.margins.rs:.3g}"
        if again.margins.rs > 1
        else f"the uncertainty would have to shrink to {100 * again.margins.rs:.3g} %",
        *([again.channels.least()] if again.nominally_stable else []),
    ]
    said += [
        text for fact in (*again.findings, *again.details) for text in (fact.amount, fact.meaning)
    ]
    for system in (rig_model().nominal, K):
        said.append(f"{system.nstates} states, sampled at 256 Hz")
        s = np.log(system.poles().astype(complex)) / T
        said += [
            f"{abs(p) / 2 / np.pi:.4g} Hz, damping {round(-p.real / abs(p), 6) + 0.0:.3g}"
            for p in s
            if abs(p) > 1e-6
        ]
        said += [f"{abs(p) / 2 / np.pi:.4g} Hz" for p in s if abs(p) > 1e-6]
    for known in sorted(
        {" ".join(one.split()) for one in said if one.strip()}, key=len, reverse=True
    ):
        text = text.replace(known, " # ")
    text = re.sub(r"Written \S+ \S+ \S+|0 to reset|0 Hz \(integrator\)|95 %", " ", text)
    text = re.sub(
        r"\b[1-8]\. (?=Verdict|Best|Nominal|Uncertainty|Controller|Check|Worst|Versions|$)",
        " ",
        text,
    )
    assert [text[max(0, m.start() - 40) : m.end() + 20] for m in NUMBER.finditer(text)] == []
    assert (
        report.verdict == again.verdict == ("statistically robust" if K is SMALL else "not robust")
    )
    assert report.verdict in text.lower()
    for row in str(rig_frm()).splitlines():
        assert " ".join(row.split()) in page.text


def test_a_weak_direction_that_was_not_measured_has_a_word(tmp_path, undrawn):
    """Gains of rank one, behind noise that hides the second singular value on most lines."""
    record = rig_record()
    y = np.repeat(record.u.sum(axis=0, keepdims=True), 2, axis=0)
    y = y + 0.05 * np.random.default_rng(2).standard_normal(y.shape)
    frm = nlfrf.identify(replace(record, y=y), transient="none")
    lost = np.count_nonzero(nlfrf.bla.singular_values(frm)[1][1] == 0)
    assert lost > 0.9 * frm.f.size
    report = robust.check(rig_model(), SMALL, certify=False)
    robust.reports.write_report(tmp_path / "r.html", rig_model(), SMALL, bla=frm, report=report)
    page = Reader((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert f"; on {lost} {LOST}" in page.text


def test_pictures_are_in_the_file_and_refusals_leave_none(tmp_path):
    report = small_report()
    robust.reports.write_report(
        tmp_path / "r.html", rig_model(), SMALL, record=rig_record(), report=report
    )
    page = Reader((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert len(page.images) == 9
    assert all(
        address.startswith(("data:image/svg+xml;base64,", "#")) for address in page.addresses
    )
    with pytest.raises(ValueError, match="w_P must be that of the report"):
        robust.reports.write_report(tmp_path / "n.html", rig_model(), SMALL, report=report, w_P=W_P)
    with pytest.raises(ValueError, match="delay must be in the nominal for several channels"):
        robust.reports.write_report(tmp_path / "n.html", rig_model(), SMALL, delay=0.1)
    single = robust.UncertaintyModel(
        control.tf([1], [1, 1]),
        control.tf([0.1], [1]),
        "multiplicative",
        rig_frm().omega[:2],
        np.array([0.05, 0.05]),
    )
    alone = robust.check(single, 2.0)
    for model, K, parts, message in (
        (
            rig_model(),
            SMALL,
            {"report": alone},
            "report must be the result of check for this model and this K",
        ),
        (
            rig_model(),
            SMALL,
            {"bla": rig_frm().entry(0, 0)},
            "of several inputs or outputs, got one of one input",
        ),
        (
            rig_model(),
            SMALL,
            {"report": report, "nominal": 3},
            "nominal must be of type NominalFit",
        ),
        (
            single,
            2.0,
            {"report": report},
            "report must be the result of check for this model and this K",
        ),
        (single, 2.0, {"bla": rig_frm()}, "of one input and output, got one of 2 x 2"),
    ):
        with pytest.raises(ValueError, match=message):
            robust.reports.write_report(tmp_path / "n.html", model, K, **parts)
    assert not (tmp_path / "n.html").exists()


def test_a_report_of_another_loop_is_refused(tmp_path):
    """Another controller, and another set around the same nominal, by as little as a tenth."""
    report = small_report()
    wider = robust.uncertainty(rig_frm(), rig_fit(), form="additive", order=2, confidence=0.999)
    for model, K in ((rig_model(), 1.01 * SMALL), (wider, SMALL)):
        with pytest.raises(
            ValueError, match="report must be the result of check for this model and this K"
        ):
            robust.reports.write_report(tmp_path / "r.html", model, K, report=report)
    assert not list(tmp_path.iterdir())
