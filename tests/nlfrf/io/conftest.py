"""Shared by the tests of files: where those of foreign libraries are read."""

import pytest

from benchmarks.doors import readers_in_this_process


@pytest.fixture(autouse=True)
def read_here(request):
    """Read such files in this process, by the same readers, but where a test is of their own process."""
    if request.node.get_closest_marker("own_process") is not None:
        yield
        return
    with readers_in_this_process():
        yield
