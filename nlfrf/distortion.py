"""Even and odd distortion levels at the output, from the lines that were not excited."""

from __future__ import annotations

import numpy as np

from nlfrf.values import value


@value
class DistortionLevels:
    """What the output holds on each kind of line.

    Fields
    ------
    f_excited, f_odd, f_even : (F,), (O,), (E,) ndarray
        Frequencies of the excited and of the odd and even detection lines [Hz].
    excited, odd, even : (M, F), (M, O), (M, E) complex ndarray
        Output amplitudes of each realisation, averaged over periods [unit of y]. On detection lines the linear
        answer to whatever input energy stood there was taken off, Y - G U. The level is the rms over M.
    noise_excited, noise_odd, noise_even : (F,), (O,), (E,) ndarray
        Standard deviation of those amplitudes by noise [unit of y]; nan where there was one period only.
    """

    f_excited: np.ndarray
    f_odd: np.ndarray
    f_even: np.ndarray
    excited: np.ndarray
    odd: np.ndarray
    even: np.ndarray
    noise_excited: np.ndarray
    noise_odd: np.ndarray
    noise_even: np.ndarray
