"""Identification: from a periodic record of any number of channels to the best linear approximation
with its variances.

bla                `Bla`: the matrix, its covariances, its bounds
calibration        ratio of the distortion variance on excited lines to that on detection lines; crest factor correction
channel_mismatch   find a channel whose gain or delay in one experiment differs from the other experiments
covariance         Hermitian matrices on every line: products, inverses, correlations, square roots
cross_check        compare two estimates of the distortion: from detection lines, and from roughness
distortion         covariance of the distortion in one experiment, and the distribution of the error of G
experiment_checks  errors and warnings for bad experiments: no input, unequal spectra, copied phases, low crest factor
frf                the matrix G from all experiments and its covariances; outputs that do not follow the input
from_frf           a `Bla` from an FRF of another program, with its standard deviation or coherence
gains              singular values and relative gains of a measured matrix, with their bounds
identify           from a periodic record to its `Bla`
line_index         indices of the lines of a grid, and windows of neighbouring lines, computed once for each grid
local_models       local polynomial and rational models of an FRF (LPM, LRM); their residual is called roughness
log_level          the log level of distortion on the windows of a grid: locally linear over frequency
noise_excitation   the BLA from noise excitation, by Welch segments or local polynomials
realizations       merge experiments with the same phases; check amplitude spectra and crest factors
residual           the nonlinear residual: outputs without their linear part, on all lines
scaled_f           scaled inverse chi-squares and the F distributions of their errors
spectra            DFT of the periods of every channel: mean and scatter on the lines; transients subtracted
zippered           the matrix G if each line excites one input: each column interpolated between the lines of its input
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
