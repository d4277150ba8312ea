"""Shared by all tests: where measured records lie, axes to draw on."""

import collections
import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("patient", deadline=None)  # how long a case takes says something of the machine only
settings.load_profile("patient")


def pytest_addoption(parser):
    parser.addoption("--attack", action="store_true", help="run only the cases that `make test` leaves out")


def is_left_to_attack(item, number):
    """Whether the case of this number of its test runs in `make attack` only: all but the first of every so many."""
    mark = item.get_closest_marker("attack")
    return mark is not None and (number % mark.kwargs["every"] != 0 if "every" in mark.kwargs else True)


def pytest_collection_modifyitems(config, items):
    """Keep the cases of this run; build the documentation last.

    The documentation takes what the tests of the examples have run, each in its own process.
    """
    seen = collections.Counter()
    chosen, others = [], []
    for item in items:
        test = item.nodeid.partition("[")[0]
        runs = is_left_to_attack(item, seen[test]) == config.getoption("--attack")
        (chosen if runs else others).append(item)
        seen[test] += 1
    if others:
        config.hook.pytest_deselected(items=others)
    items[:] = sorted(chosen, key=lambda item: item.path.name == "test_docs.py")


@pytest.fixture(scope="session")
def measured():
    """The folder of measured records: NLFRF_DATA, else ../shared/data beside the checkout."""
    folder = Path(os.environ.get("NLFRF_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "motor_bench").is_dir():
        pytest.skip(f"no measured records in {folder}; set NLFRF_DATA to the folder that holds motor_bench")
    return folder


@pytest.fixture(autouse=True)
def no_figure_stays():
    """What a test drew is closed behind it: in which order tests run must not matter."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def ax():
    """Axes of a figure of their own."""
    from matplotlib import pyplot as plt

    return plt.subplots()[1]
