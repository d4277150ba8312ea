"""Identification: from a periodic record of any number of channels to the best linear approximation
with its variances.

bla                `Bla`: the matrix, its covariances, its bounds
calibration        variance of a cubic on detection lines against that on excited lines; crest factor correction
channel_mismatch   a channel whose gain or delay in one experiment differs from that in the others
covariance         Hermitian matrices on every line: products, inverses, correlations, square roots
cross_check        second opinion: distortion from detection lines against distortion from roughness; power law
distortion         distortion covariance of one experiment and distribution of the error, from one statistical model
experiment_checks  experiments refused or warned of: silent, unequal, dependent, copies, low crest, disturbed
frf                the matrix over all sets, its covariance by noise and in total; outputs that follow no input
from_frf           a `Bla` from an FRF that was measured elsewhere, with its standard deviation or coherence
gains              singular values and relative gains of a measured matrix, with their bounds
identify           from a periodic record to its `Bla`
line_index         indices of the lines of a grid, and windows of neighbouring lines, computed once for each grid
local_models       local polynomial and rational models of an FRF (LPM, LRM), and their residual: the roughness
log_level          the log level of distortion on the windows of a grid: locally linear over frequency
noise_excitation   the BLA from noise excitation, by Welch segments or local polynomials
realizations       experiments with the same phases, merged; unequal amplitude spectra; low crest factors
residual           the nonlinear residual: outputs without their linear part, on all lines
scaled_f           scaled inverse chi-squares and the F distributions of their errors
spectra            DFT of the periods of every channel: mean and scatter on the lines; transients subtracted
zippered           the matrix where each line drives one input: columns interpolated between their own lines
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
