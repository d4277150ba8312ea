"""Shared by the tests of robust: work that several tests ask for is done once in a process."""

import pytest


@pytest.fixture(scope="module")
def friction_read_once():
    """Let checks and commands take the friction of records that were read before."""
    from tests.support.friction_fits import CALLERS, identify_once

    with pytest.MonkeyPatch.context() as patch:
        for caller in CALLERS:
            patch.setattr(f"{caller}.identify_friction", identify_once)
        yield
