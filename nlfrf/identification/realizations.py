"""The realisations of an experiment: whether they are excited, and whether they belong together."""

from __future__ import annotations

import numpy as np

from nlfrf.identification.spectra import Spectra
from nlfrf.shared.leastsquares import squared

__all__ = ["check_realizations"]


N_PARTS = 8  # of the band, over which the input power of realisations is compared
STRANGE = 2.0  # how far it may be apart [dB] in realisations that belong together


def check_realizations(excited: Spectra) -> None:
    """Refuse lines without input, and realisations that are not of one excitation."""
    refuse_unexcited(excited)
    if excited.U.shape[0] > 1:
        refuse_strangers(excited)


def refuse_unexcited(excited: Spectra) -> None:
    """Refuse lines that carry no input, where G would be 0 / 0, or no reference, whose phase would be chance."""
    for name, spectrum in (("input", excited.U), ("reference", excited.R)):
        if spectrum is None:
            continue
        power = squared(spectrum)
        silent = (power <= 1e-18 * power.max()).any(axis=0)
        if silent.any():
            k = int(excited.lines[np.argmax(silent)])
            raise ValueError(f"lines must be excited by the {name}, got line {k} with no {name} on it")


def refuse_strangers(excited: Spectra) -> None:
    """Refuse realisations of another amplitude spectrum: their BLA is another one."""
    known = excited.U if excited.R is None else excited.R
    n_lines = known.shape[1]
    power = np.add.reduceat(squared(known), np.arange(0, n_lines, max(1, n_lines // N_PARTS)), axis=1)
    middle = np.sort(power, axis=0)[power.shape[0] // 2]
    apart = np.abs(10 * np.log10(power / middle)).max(axis=1)
    worst = int(np.argmax(apart))
    if apart[worst] > STRANGE:
        raise ValueError(
            f"u must have the same amplitude spectrum in every realisation, got realisation {worst} up to "
            f"{apart[worst]:.1f} dB apart from the others"
        )
