"""Sound files (.wav), by SciPy: a sampling frequency, one stream per channel, full scale 1."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents


def contents(path: Path) -> Contents:
    """Read channels ch1, ch2, ..., whole numbers divided by their full scale.

    This module is loaded by its path in its own process, so it imports nothing from this package.
    """
    from scipy.io import wavfile

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks without sound
        fs, samples = wavfile.read(path)
    kind = samples.dtype
    if kind.kind == "u":
        samples = (samples.astype(float) - 128) / 128
    elif kind.kind == "i":
        samples = samples / float(2 ** (8 * kind.itemsize - 1))
    rows = np.atleast_2d(samples.T)
    names = [f"ch{i + 1}" for i in range(len(rows))]
    return dict(zip(names, rows, strict=True)), {}, {"": float(fs)}, {}
