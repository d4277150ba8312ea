"""Shared by the tests of robust: work that several tests ask for is done once in a process."""

import pytest


@pytest.fixture(scope="module")
def friction_read_once():
    """Let checks and commands take the friction of records, and the fits of machines, that were
    made before.
    """
    from tests.support.friction_fits import CALLS

    with pytest.MonkeyPatch.context() as patch:
        for call, once in CALLS.items():
            patch.setattr(call, once)
        yield
