"""The report page of a loop that was designed on an FRF of another program."""

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust.reports import write_report
from tests.robust.io.test_report_page import Reader

F = np.geomspace(10, 2000, 60)


@pytest.fixture(scope="module")
def bla():
    s = 2j * np.pi * F
    G = 9e4 / (s**2 + 80 * s + 1.3e4) * np.exp(-2e-4 * s)
    return nlfrf.bla_from_frf(F, G, std=0.01 * np.abs(G))


def test_thin_margins_stand_on_the_page_and_no_picture_is_empty(bla, tmp_path):
    nominal = robust.fit_nominal(bla, n_poles=2, n_zeros=0, delay=2e-4)
    model = robust.uncertainty(bla, nominal)
    lead = control.tf([2e-3, 1.0], [1e-4, 1.0])
    report, K = next(
        (report, gain * lead)
        for gain in np.geomspace(1, 300, 25)
        if (report := robust.check(model, gain * lead)).thin_margins
    )
    write_report(tmp_path / "r.html", model, K, bla=bla, nominal=nominal, report=report)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert report.thin_margins.partition(":")[2].strip()[:40] in page.replace("&gt;", ">")
    assert "To lower |S|" in page
    assert "by kind of line" not in page  # a swept sine has no detection lines


def test_a_delay_is_no_pole_of_the_plant(tmp_path, undrawn):
    omega = np.array([1.0, 20.0])

    def told(G):
        model = robust.UncertaintyModel(
            G, control.tf([0.1], [1]), "multiplicative", omega, np.full(2, 0.05)
        )
        report = robust.check(model, 0.1, certify=False)
        write_report(tmp_path / "r.html", model, 0.1, report=report)
        page = Reader((tmp_path / "r.html").read_text(encoding="utf-8"))
        return page.text.rpartition("Nominal fit")[2].partition("Uncertainty and weight")[0]

    late = control.ss(control.tf(*control.pade(1e-3, 4)))
    rows = told(late * control.ss(control.tf([1.0, 5.0], [1.0, 2.0, 100.0])))
    roots, _, delay = rows.partition(" poles ")[2].partition(" delay ")
    assert delay.startswith("1 ms, by an all-pass of order 4")
    poles, _, zeros = roots.partition(" zeros ")
    assert poles.count("Hz") == zeros.count("Hz") == 1
    assert " delay " not in told(control.ss(control.tf([1.0, -5.0], [1.0, 2.0, 100.0])))
