"""Commands and files of every kind, mixed by chance: an answer or one line, and nothing that was
there is touched.
"""

import pytest

from benchmarks.fuzz_commands import attack


@pytest.mark.parametrize("n", [12, pytest.param(90, marks=pytest.mark.attack)])
def test_any_file_in_the_place_of_any_other_is_answered_or_refused_in_one_line(n):
    faults = {job: fault for job, fault in attack(n_jobs=n, seed=1) if fault}
    assert not faults
