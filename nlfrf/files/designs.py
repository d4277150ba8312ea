"""Multisines to and from files, and to play."""

from __future__ import annotations

import os

import numpy as np

from nlfrf.excitation.multisine import Multisine
from nlfrf.files.stored_values import load_value, save_value
from nlfrf.shared.arguments import integer
from nlfrf.shared.whole_files import path_of, save_mat, write_whole

__all__ = ["MULTISINE_SCHEMA", "load_multisine", "save_multisine"]


MULTISINE_SCHEMA = "nlfrf-multisine"


def save_multisine(ms: Multisine, path: str | os.PathLike[str]) -> None:
    """Write a design with its samples.

    ``.npz`` and ``.h5`` hold the design exactly, and the samples u (M, N) beside it. ``.csv``, ``.mat`` and ``.wav``
    hold what a signal generator plays, one column, row or channel a realisation, with the design in an ``.npz`` of the
    same name beside them; a WAV file is scaled to a peak of 1, and that peak stored with the design.

    Parameters
    ----------
    ms : Multisine
        The design.
    path : path
        File to write; its suffix says the format. Written whole or not at all.

    Raises
    ------
    ValueError
        Another suffix; a sampling frequency that is not a whole number for a WAV file, which can hold no other.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> from nlfrf.excitation.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> save_multisine(ms, f"{folder.name}/ms.csv")              # and the design beside it
    >>> bool(np.array_equal(load_multisine(f"{folder.name}/ms.npz").phase, ms.phase))
    True
    >>> folder.cleanup()
    """
    path = path_of(path)
    suffix, u = path.suffix.lower(), ms.u
    if suffix == ".csv":
        t = np.arange(ms.n_samples) / ms.fs
        table = np.column_stack([t, *u])
        header = ",".join(["t [s]", *(f"u{m}" for m in range(ms.n_realizations))])
        write_whole(path, lambda to: np.savetxt(to, table, delimiter=",", header=header, comments="", fmt="%.17g"))
    elif suffix == ".mat":
        save_mat(path, {"u": u, "fs": np.array(ms.fs), "f": ms.f, "amplitude": ms.amplitude, "phase": ms.phase})
    elif suffix == ".wav":
        from scipy.io import wavfile

        rate = integer("fs of a .wav file", ms.fs, least=1)
        samples = (u.T / np.abs(u).max()).astype(np.float32)
        write_whole(path, lambda target: wavfile.write(target, rate, samples))
    else:
        save_value(ms, MULTISINE_SCHEMA, path, u=u)
        return
    save_value(ms, MULTISINE_SCHEMA, path.with_suffix(".npz"), u=u, peak=np.array(np.abs(u).max()))


def load_multisine(path: str | os.PathLike[str]) -> Multisine:
    """Read the design that `save_multisine` wrote.

    Parameters
    ----------
    path : path
        The ``.npz`` or ``.h5`` file of the design.

    Returns
    -------
    Multisine

    Raises
    ------
    ValueError
        A file that is not a whole design of a version this package reads.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_multisine("README.md")
    Traceback (most recent call last):
        ...
    ValueError: path must end in .mat, .npz, .csv, ... got 'README.md'; arrays of any origin go to ...
    """
    ms: Multisine = load_value(Multisine, MULTISINE_SCHEMA, path)
    return ms
