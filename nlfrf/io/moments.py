"""Check that channels were sampled at the same times, if the file has a time axis or a start time
for each.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nlfrf._base.arguments import data_warning

# samples of delay between two starts: limit of a warning, of a refusal
_WARN_SHIFT = 0.05
_MAX_SHIFT = 0.5
_N_COMPARED = 1000  # samples of long axes that are compared
_OTHER_ORIGIN = 1e8  # [s] between two starts, three years, above which they have different origins


def require_same_moments(file: str, axes: Mapping[str, np.ndarray | float], fs: float) -> None:
    """Refuse channels that begin at different moments, and warn of a difference by part of a
    sample.

    Parameters
    ----------
    file : str
        Name of the file.
    axes : dict of str to ndarray or float
        The moments of each channel, or its first one [s].
    fs : float
        Sampling frequency of the channels [Hz].
    """
    (first, there), *others = axes.items()
    for name, here in others:
        late = _start_difference(there, here, fs)
        if abs(late) < _WARN_SHIFT:
            continue
        if np.ndim(here) and abs(late) >= max(np.size(here), _N_COMPARED):
            data_warning(
                f"the times of {first!r} and {name!r} in {file!r} do not overlap. It is assumed"
                " that their clocks have different origins, and that the first samples of both"
                " were taken together"
            )
            continue
        message = f"by the times in {file!r} {name!r} begins {late:+.4g} samples after {first!r}"
        if abs(late) > _MAX_SHIFT:
            raise ValueError(
                f"u and y must be sampled together, but {message}. Resample them to common"
                " times, and give them to record_from_samples"
            )
        data_warning(
            f"{message}: G includes this delay, which comes from the recorder and not from the"
            " machine"
        )


def _start_difference(there: float | np.ndarray, here: float | np.ndarray, fs: float) -> float:
    """Return the delay of one axis against the other in samples; 0 if it is unknown, or if origins
    differ.
    """
    if here is there or np.shape(here) != np.shape(there):
        return 0.0
    step = max(1, np.size(here) // _N_COMPARED)
    behind = np.ravel(here)[::step] - np.ravel(there)[::step]
    behind = behind[np.isfinite(behind)]
    if behind.size:
        late = float(np.median(behind))
    else:
        late = 0.0
    if abs(late) < _OTHER_ORIGIN:
        return late * fs
    return 0.0
