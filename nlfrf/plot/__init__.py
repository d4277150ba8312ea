"""Pictures of signals and of identified systems. They convert units and compute nothing else.

    signals  one period, the harmonic grid, played and measured signals, faults found by screening
    bla      the BLA with its bound, the output spectrum, two estimates of the distortion
    matrix   a matrix for several inputs and outputs: entries, singular values, relative gains
    look     colours and markers of all pictures

Import them from this package: `from nlfrf.plot import plot_bla`.
"""

from nlfrf.plot.bla import plot_bla, plot_blas, plot_bode, plot_levels, plot_opinion, plot_phase
from nlfrf.plot.matrix import plot_frm, plot_frm_bounds, plot_rga, plot_singular_values
from nlfrf.plot.signals import plot_excitation, plot_input, plot_samples, plot_spectrum

__all__ = [
    "plot_bla",
    "plot_blas",
    "plot_bode",
    "plot_excitation",
    "plot_frm",
    "plot_frm_bounds",
    "plot_input",
    "plot_levels",
    "plot_opinion",
    "plot_phase",
    "plot_rga",
    "plot_samples",
    "plot_singular_values",
    "plot_spectrum",
]
