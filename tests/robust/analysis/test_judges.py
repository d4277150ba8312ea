"""One loop of one channel before both judges: closed forms with exact arithmetic, and bounds
of mu.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check
from robust.analysis.findings import Effort
from robust.analysis.judge_exact import judge_exact
from robust.analysis.judge_mu import judge_system
from robust.analysis.loop import assemble_loop
from robust.analysis.loop_of_channels import set_gain
from robust.lti.lti import response
from robust.lti.sampling import sampled
from robust.models import Block, UncertainSystem

T, OMEGA = 1e-2, np.geomspace(0.1, 100, 20)
LAG = control.ss(control.tf([2.0], [0.3, 1]))
RISING = control.ss(control.tf([0.3, 0.2], [0.1, 1]))
W_P = control.ss(control.tf([0.4, 0.1], [1, 1e-3]))
FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")


def loop_of(form, gain, *, size=1.0, dt=0.0, perturbation="LTI", w_P=None):
    """Return a lag with a rising weight under an integrating controller, continuous or sampled
    throughout.
    """
    G, w = (sampled(LAG, dt), control.StateSpace(*small(RISING), dt)) if dt else (LAG, RISING)
    w = control.StateSpace(w.A, w.B, size * w.C, size * w.D, dt)
    K = control.ss(control.tf([gain, gain], [1, 0]))
    K = control.c2d(K, dt, "tustin") if dt else K
    model = UncertaintyModel(
        G, w, form, OMEGA, np.abs(response(w, OMEGA)), perturbation=perturbation
    )
    return assemble_loop(model, K, w_P=w_P, delay=0.0)


def small(w):
    """Return the matrices of a sampled weight like a continuous one: its bilinear image."""
    found = control.c2d(w, T, "tustin")
    return found.A, found.B, found.C, found.D


def system_of(loop):
    """Return the loop with its perturbation pulled out."""
    inputs, outputs = ((), ()) if loop.w_P is None else (("r",), ("weighted e",))
    block = Block("z", "d", perturbation=loop.model.perturbation)
    return UncertainSystem(
        N=loop.perturbation_loop, blocks={loop.form: block}, inputs=inputs, outputs=outputs
    )


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dt", [0.0, T])
def test_both_judges_find_the_same(form, dt):
    """Mu of one full block is the size of what it sees: verdicts, margins, worst cases and curves
    must agree.
    """
    verdicts = set()
    for gain, size in ((0.05, 1.0), (0.5, 0.2), (3.0, 1.0), (60.0, 0.2), (400.0, 0.2)):
        loop = loop_of(form, gain, size=size, dt=dt)
        exact, by_mu = judge_exact(loop, Effort()), judge_system(system_of(loop), Effort())
        assert (exact.verdict, exact.nominally_stable) == (by_mu.verdict, by_mu.nominally_stable), (
            gain
        )
        assert exact.proofs.robustly_stable == by_mu.proofs.robustly_stable
        if exact.nominally_stable:
            assert by_mu.margins.rs == pytest.approx(exact.margins.rs, rel=1e-3)
            assert by_mu.margins.broken == pytest.approx(exact.margins.rs, rel=1e-2)
            seen = np.interp(by_mu.curves.omega[1:], exact.curves.omega, exact.curves.rs)
            inside = (by_mu.curves.omega[1:] > exact.curves.omega[0]) & (
                by_mu.curves.omega[1:] < exact.curves.omega[-1]
            )
            np.testing.assert_allclose(by_mu.curves.rs[1:][inside], seen[inside], rtol=2e-2)
        if exact.proofs.robustly_stable:
            one = control.ss([], [], [], [[1.0]], loop.dt)
            system = system_of(replace(loop, w_P=one))
            S = set_gain(system.N, system.structure, curve=False)
            assert S.n_lines == 0
            assert (
                exact.margins.S_worst * (1 - 1e-6) <= S.peak.value <= exact.margins.S_worst * 1.002
            )
        verdicts.add(exact.verdict)
    assert {"robust", "not robust"} <= verdicts


@pytest.mark.parametrize("perturbation", ["LTI", "statistical", "operator"])
def test_both_judges_agree_on_performance(perturbation):
    """The demand is met in both readings: mu of two blocks below one, and |w_P| max |S_p| below
    one.
    """
    for gain, met in ((0.2, True), (0.6, False), (0.02, False)):
        loop = loop_of("multiplicative", gain, perturbation=perturbation, w_P=W_P)
        exact, by_mu = judge_exact(loop, Effort()), judge_system(system_of(loop), Effort())
        assert exact.verdict == by_mu.verdict
        assert exact.proofs.robust_performance == by_mu.proofs.robust_performance == met
        assert (np.nanmax(exact.curves.rp) < 1) == (by_mu.margins.rp > 1) == met


def test_a_loop_that_is_no_state_space_has_no_bounds_of_mu():
    model = UncertaintyModel(
        LAG, RISING, "multiplicative", OMEGA, np.abs(response(RISING, OMEGA)), perturbation="LTI"
    )
    late = assemble_loop(model, control.ss([], [], [], [[0.5]]), w_P=None, delay=0.01)
    folded = assemble_loop(model, control.ss([], [], [], [[0.5]], T), w_P=None, delay=0.0)
    for loop, reason in (
        (late, "the delay of a continuous loop"),
        (folded, "no inequality covers the aliases"),
    ):
        assert loop.reason_against_system.startswith(reason)


def test_check_reports_what_the_judge_of_the_loop_finds():
    loop = loop_of("additive", 0.5)
    report, found = check(loop.model, loop.controller), judge_exact(loop, Effort())
    assert (report.verdict, report.reason, report.form) == (found.verdict, found.reason, "additive")
    assert report.margins.rs == found.margins.rs
