"""The report page of a loop that was designed on an FRF of another program."""

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust.reports import write_report
from robust.reports.data import roots_of_plant

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


def test_a_delay_is_no_pole_of_the_plant():
    num, den = control.pade(1e-3, 4)
    G = control.ss(control.tf(num, den)) * control.ss(control.tf([1.0, 5.0], [1.0, 2.0, 100.0]))
    rows = {fact.name: fact.value for fact in roots_of_plant(G)}
    assert rows["delay"].startswith("1 ms, by an all-pass of order 4")
    assert rows["poles"].count("Hz") == rows["zeros"].count("Hz") == 1
    alone = roots_of_plant(control.ss(control.tf([1.0, -5.0], [1.0, 2.0, 100.0])))
    assert "delay" not in [fact.name for fact in alone]
