"""Every judge of a loop on every loop whose truth is known: none calls an unstable loop stable, none
claims more than the truth, and each comes as close to it as it promises.
"""

import numpy as np
import pytest

from robust import check
from tests.support.forms import DEVIATION
from tests.support.judges import JUDGES, model_of
from tests.support.loops import LATER, LOOPS, Loop, boundary
from tests.support.responses import response

ULP, DENORMAL = "a sampled pole one ulp inside the boundary", "a mode of the least damping"
#: Rows that are not true today, and why: (judge, loop) -> reason.
NOT_YET = {
    ("check by an inequality", "a sampled pole one ulp inside, its stability"): (
        "a product of an infinite and a zero number warns"
    ),
    **{
        (judge, ULP): "exp(j w T) rounds to one: rs is the one of the next frequency"
        for judge in ("check", "check without certificates", "check by an inequality", "worst_case")
    },
    **{
        (judge, DENORMAL): "the response at the mode is no number"
        for judge in (
            "worst_case",
            "disk_margin",
            "check_structure without certificates",
            "mu",
            "mu.worst_gain",
            "check of two side by side",
        )
    },
}


def rows():
    """Judge and loop of each row. A slow judge has a few loops here and the rest in `make attack`;
    loops on the boundary are left to it by slow judges only.
    """
    for name, judge in JUDGES.items():
        heard = 0
        for loop in filter(lambda loop: judge.hears(LOOPS[loop]), LOOPS):
            slow = judge.every > 3
            left = heard % judge.every > 0 if slow or loop not in boundary else False
            later = loop in LATER or left or (slow and (name, loop) in NOT_YET)
            heard += loop not in LATER
            marks = [pytest.mark.attack] * later
            if (name, loop) in NOT_YET:
                marks.append(pytest.mark.xfail(strict=True, reason=NOT_YET[name, loop]))
            yield pytest.param(name, loop, marks=marks, id=f"{name}: {loop}")


@pytest.mark.parametrize(("judge", "loop"), list(rows()))
def test_a_judge_says_what_is_true(judge, loop):
    judge, loop = JUDGES[judge], LOOPS[loop]
    said, truth = judge.says(loop), loop.truth
    if judge.decides:
        rounded = judge.rounds and loop.rounds and not said.stable
        assert said.stable == truth.stable or rounded
    if not (truth.stable and said.stable is not False):
        assert not any((said.stable, said.robust, said.met))
        assert not said.why or truth.words in said.why
        assert said.rs is said.S is said.rp is said.disk is None
        return
    below, above = judge.loss + truth.tolerance, judge.miss + truth.tolerance
    if truth.rs is not None:
        assert not (said.robust and truth.rs <= 1)
        assert not (said.refuted and truth.rs > 1 + truth.tolerance)
        if truth.rs > 1 + judge.proves:
            assert said.robust
        if truth.rs < 1 - judge.proves:
            assert said.refuted
        lies_between(said.rs, truth.rs * (1 - below), truth.rs * (1 + above))
        if np.isfinite(said.broken or np.inf):
            lies_between(said.broken, truth.rs * (1 - 2e-3), truth.rs * 1.01)
    if truth.at is not None:
        assert said.at in (None, pytest.approx(truth.at, rel=1e-6))
    if truth.worst is not None:
        assert said.worst in (None, pytest.approx(truth.worst, rel=1e-6))
    if truth.S is not None:
        # S grows as the margin ends, and with it what doubles make of the distance to it
        near = 1 + 1 / max(abs(1 - 1 / truth.rs), 1e-9)
        proves = judge.proves < np.inf
        proved = (below, truth.tolerance if proves else above)
        less, more = (min(0.5, near * one + 1e-17 * truth.S) for one in proved)
        lies_between(said.S, truth.S * (1 - more), truth.S * (1 + less))
        assert not (proves and said.lines)
        lies_between(said.shown, truth.S * (1 - less), truth.S * (1 + more))
    if truth.rp is not None:
        lies_between(said.rp, truth.rp * (1 - 1e-3), truth.rp * (1 + 1e-3))
        assert not (said.met and truth.rp >= 1)
        assert said.met or truth.rp > 1 - judge.proves
    if truth.disk is not None:
        lies_between(said.disk, truth.disk * (1 - below), truth.disk * (1 + above))
    if said.curves is not None and not loop.known:
        has_true_curves(loop, said.curves)
    if said.plant is not None and not loop.known:
        shows_it(loop, said)


def lies_between(number, low, high):
    """Where a judge says a number; a number that is infinite is said to be so."""
    if number is not None:
        assert low <= number <= high


def has_true_curves(loop, curves):
    """On the frequencies of the judge; in a fast clock, far below it."""
    omega, of = curves.omega, loop.unclocked or loop
    used = omega < 1e-3 if loop.unclocked else omega > 0
    rel = 2e-3 if loop.dt else 1e-6
    for name in "ST" if curves.S is not None else "":
        seen, true = getattr(curves, name)[used], of.curve(name, omega[used])
        np.testing.assert_allclose(seen, true, rtol=rel, atol=max(1e-9, rel**2))
    assert np.isfinite(curves.rs).all()
    assert omega.max() <= (np.pi / loop.dt if loop.dt else np.inf)
    if loop.kind != "sampled":
        rel = 1e-6 if curves.S is not None else 2e-2
        np.testing.assert_allclose(curves.rs, of.curve("rs", omega), rtol=rel, atol=1e-9)


def shows_it(loop, said):
    """The plant that a judge shows is in the set, and the loop with it as bad as it says."""
    if loop.kind != "sampled":
        S = loop.with_plant(said.plant).curve("S", np.array([said.omega]))[0]
        assert abs(S) == pytest.approx(said.shown, rel=1e-4) if said.shown else abs(S) > 1e3
    omega = loop.omega[:: 1 + loop.omega.size // 2000]
    size = np.abs(response(loop.G, omega))
    omega = omega[(size > 1e-3) & (size < 1e2)]  # where doubles tell G and H apart
    G, H, w = (response(system, omega) for system in (loop.G, said.plant, loop.weight))
    assert (DEVIATION[loop.form](H, G) / np.abs(w)).max() <= 1 + 1e-6


@pytest.mark.parametrize(
    "loop",
    [
        pytest.param(name, marks=[pytest.mark.attack] * (loop.peak is None))
        for name, loop in LOOPS.items()
        if isinstance(loop, Loop) and loop.stable and not (loop.known or loop.unclocked)
    ],
)
def test_a_set_is_robust_up_to_its_limit_and_not_beyond(loop):
    loop = LOOPS[loop]
    for share in (0.99, 1.01):
        at_limit = loop.grown(share * loop.truth.rs)
        verdict = check(model_of(at_limit), at_limit.K, delay=loop.delay).verdict
        assert verdict.is_robust == (share < 1)
        if loop.kind != "sampled":  # where aliases count, a set that is too large may stay open
            assert (verdict == "not robust") == (share > 1)
