"""One seed of the study of loops at other levels than that of the experiment, and how it judges."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.level_of_loop import Outcome, behaves_table, bound_table, judge, state_table, study
from robust.analysis import LevelState


@pytest.mark.attack
def test_a_seed_of_the_study():
    """Loops found at 0.1 N behave there; 10 N of force breaks some, and each of these was called
    above.
    """
    runs = study(0, experiments=((0.1,),), noise=(0.1, 10.0), steps=())
    noise = [run for run in runs if run.kind == "noise"]
    here = [run for run in noise if run.size == 0.1]
    assert len(here) > 5
    assert all(
        run.behaves and run.as_predicted and run.y_state is not LevelState.ABOVE for run in here
    )
    broken = [run for run in noise if not run.behaves]
    assert broken
    assert all(
        run.u_state is LevelState.ABOVE and run.y_state is LevelState.ABOVE for run in broken
    )
    assert behaves_table(runs, "noise")[2].startswith(f"| 0.1 N | {len(here)} of {len(here)} |")
    assert any(row.startswith("| one level | above |") for row in state_table(runs, "noise"))
    assert bound_table(runs)[2].split("|")[1].strip() == "inside"
    t = np.arange(7500) / 1000
    for v, outcome in (
        (np.sin(300 * t) * 1e-3, Outcome.CYCLES),
        (np.sin(300 * t) * np.exp(-t), Outcome.DIES_OUT),
        (0 * t, Outcome.RESTS),
    ):
        assert judge(SimpleNamespace(v=v, diverged=False)) is outcome
    assert judge(SimpleNamespace(v=v, diverged=True)) is Outcome.RUNS_AWAY
