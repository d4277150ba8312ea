"""Commands and files of every kind, mixed by chance: an answer or one line, and nothing that was there is touched."""

from benchmarks.fuzz_commands import attack


def test_any_file_in_the_place_of_any_other_is_answered_or_refused_in_one_line():
    faults = {job: fault for job, fault in attack(n_jobs=90, seed=1) if fault}
    assert not faults
