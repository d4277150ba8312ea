"""Files of foreign libraries read in this process: to start a process for each takes a hundred
times as long.
"""

from __future__ import annotations

import importlib.util
import io
import traceback
import warnings
from contextlib import contextmanager
from functools import cache
from unittest import mock

from nlfrf._base.own_process import receive, send
from nlfrf.io import measurement_files
from nlfrf.io.readers import matlab


@cache
def reader_of(file):
    """Return the module of a reader, by its path alone as its own process loads it."""
    spec = importlib.util.spec_from_file_location("reader", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def read(file, path):
    """Read a file as `read_in_own_process` does, refused by the last line of what the library
    raises.
    """
    stream, said = io.BytesIO(), ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            send(reader_of(file).contents(path), stream)
    except ModuleNotFoundError:
        raise
    except Exception as error:
        said = traceback.format_exception_only(error)[-1].strip().splitlines()[-1]
    if said:  # raised here, so that nothing keeps the file open
        raise ValueError(said.removeprefix("ValueError: "))
    stream.seek(0)
    return receive(stream, path.stat().st_size)


@contextmanager
def readers_in_this_process():
    """Let all that loads files read them here."""
    with (
        mock.patch.object(measurement_files, "read_in_own_process", read),
        mock.patch.object(matlab, "read_in_own_process", read),
    ):
        yield
