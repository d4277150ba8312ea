"""Whether channels were sampled at the same moments, where the file has a time axis or a start for each of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nlfrf._base.arguments import data_warning

_WARN_SHIFT, _MAX_SHIFT = 0.05, 0.5  # samples by which one channel may begin behind another
_N_COMPARED = 1000  # samples of long axes
_OTHER_ORIGIN = 1e8  # seconds between two starts, three years, from which they count from different moments


def require_same_moments(file: str, axes: Mapping[str, np.ndarray | float], fs: float) -> None:
    """Refuse channels that begin at different moments, and warn of those that do by part of a sample.

    Parameters
    ----------
    file : str
        What the file is called.
    axes : dict of str to ndarray or float
        The moments of a channel, or its first one [s].
    fs : float
        Their sampling frequency [Hz].
    """
    (first, there), *others = axes.items()
    for name, here in others:
        late = _start_difference(there, here, fs)
        if abs(late) < _WARN_SHIFT:
            continue
        if np.ndim(here) and abs(late) >= max(np.size(here), _N_COMPARED):
            data_warning(
                f"the times of {first!r} and {name!r} in {file!r} have no moment in common: their clocks are taken to "
                "have started at different moments, and the first samples of both to be of one"
            )
            continue
        message = f"by the times in {file!r} {name!r} begins {late:+.4g} samples behind {first!r}"
        if abs(late) > _MAX_SHIFT:
            raise ValueError(
                f"u and y must be sampled together, but {message}; bring them to one clock and give them to "
                "record_from_samples"
            )
        data_warning(f"{message}: G has that delay in it, which is none of the machine")


def _start_difference(there: float | np.ndarray, here: float | np.ndarray, fs: float) -> float:
    """By how many samples one axis is behind the other; 0 where they cannot be told, or count from other origins."""
    if here is there or np.shape(here) != np.shape(there):
        return 0.0
    step = max(1, np.size(here) // _N_COMPARED)
    behind = np.ravel(here)[::step] - np.ravel(there)[::step]
    behind = behind[np.isfinite(behind)]
    late = float(np.median(behind)) if behind.size else 0.0
    return late * fs if abs(late) < _OTHER_ORIGIN else 0.0
