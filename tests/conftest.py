"""Shared by all tests: where measured records lie, axes to draw on."""

import collections
import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from benchmarks.readers_here import readers_in_this_process

# How long a case takes says something of the machine only. The same cases in every run of the
# tests: what fails was changed since the last one. `make attack` draws others each time.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("searching", deadline=None)
settings.load_profile("repeatable")


#: What `make test` leaves out, by the option that runs it: long statistics; examples of one path
#: more, and the pages.
LATER = ("attack", "docs")


def pytest_addoption(parser):
    for name in LATER:
        parser.addoption(
            f"--{name}",
            action="store_true",
            help=f"run only what `make test` leaves to `make {name}`",
        )


def left_to(item, number):
    """Return what runs the case of this number of its test: "attack", "docs", or "" where `make
    test` does.

    Of a test with every=3 it is the first case of every three.
    """
    for name in LATER:
        mark = item.get_closest_marker(name)
        if mark is not None and (
            number % mark.kwargs["every"] != 0 if "every" in mark.kwargs else True
        ):
            return name
    return ""


def pytest_collection_modifyitems(config, items):
    """Keep the cases of this run; build the documentation last.

    The documentation takes what the tests of the examples have run, each in its own process.
    """
    wanted = next((name for name in LATER if config.getoption(f"--{name}")), "")
    seen, left = collections.Counter(), collections.Counter()
    chosen, others = [], []
    for item in items:
        test = item.nodeid.partition("[")[0]
        later = left_to(item, seen[test])
        (chosen if later == wanted else others).append(item)
        left[later] += 1
        seen[test] += 1
    if others:
        config.hook.pytest_deselected(items=others)
    if not wanted:
        note = ", ".join(f"{left[name]} cases to make {name}" for name in LATER if left[name])
        getattr(config, "workeroutput", {})["left"] = config.left_out = note
    items[:] = sorted(chosen, key=lambda item: item.path.name == "test_docs.py")


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Take what a worker of xdist says it left out."""
    node.config.left_out = getattr(node, "workeroutput", {}).get("left", "")


def pytest_terminal_summary(terminalreporter, config):
    """Say what this run left out, and which command runs it."""
    if left := getattr(config, "left_out", ""):
        terminalreporter.write_line(f"left {left}")


@pytest.fixture(scope="session")
def measured():
    """The folder of measured records: NLFRF_DATA, else ../shared/data beside the checkout."""
    folder = Path(os.environ.get("NLFRF_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "motor_bench").is_dir():
        pytest.skip(
            f"no measured records in {folder}; set NLFRF_DATA to the folder that holds motor_bench"
        )
    return folder


@pytest.fixture(autouse=True)
def read_here(request):
    """Files of foreign libraries are read in this process, but where a test is of the process that
    they have.
    """
    if request.node.get_closest_marker("own_process") is not None:
        yield
        return
    with readers_in_this_process():
        yield


@pytest.fixture(autouse=True)
def no_figure_stays():
    """What a test drew is closed behind it: in which order tests run must not matter."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def undrawn(monkeypatch):
    """Reports whose words are looked at and not their pictures, which take most of the time."""
    from robust.pages import html
    from robust.pages.section import Picture

    monkeypatch.setattr(html, "draw_picture", lambda caption, *_, **__: Picture("#", caption))


@pytest.fixture
def ax():
    """Axes of a figure of their own."""
    from matplotlib import pyplot as plt

    return plt.subplots()[1]
