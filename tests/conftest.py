"""Shared by all tests: where measured records lie, axes to draw on."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("patient", deadline=None)  # how long a case takes says something of the machine only
settings.load_profile("patient")


def pytest_collection_modifyitems(items):
    """Build the documentation last: it takes what the tests of the examples have run, each in its own process."""
    items.sort(key=lambda item: item.path.name == "test_docs.py")


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
