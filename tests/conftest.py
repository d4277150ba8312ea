"""Shared by all tests: where measured records lie, axes to draw on."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("patient", deadline=None)  # how long a case takes says something of the machine only
settings.load_profile("patient")


@pytest.fixture(scope="session")
def measured():
    """The folder of measured records: NLFRF_DATA, else ../shared/data beside the checkout."""
    folder = Path(os.environ.get("NLFRF_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "motor_bench").is_dir():
        pytest.skip(f"no measured records in {folder}; set NLFRF_DATA to the folder that holds motor_bench")
    return folder


@pytest.fixture
def ax():
    """Axes of a figure of their own, closed afterwards."""
    from matplotlib import pyplot as plt

    figure, ax = plt.subplots()
    yield ax
    plt.close(figure)
