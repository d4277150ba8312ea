"""Identification: from a periodic record of any number of channels to the best linear approximation with its variances.

bla               `Bla`: the matrix, its covariances, its bounds
calibration       what a detection line tells about an excited line, grid by grid
channel_mismatch  a channel that differs in one experiment from the others
conditions        experiments refused or warned of: silent, unequal, dependent, copies, low peaks, disturbed
covariance        Hermitian matrices on every line: products, inverses, correlations, roots
distortion        the covariance of one experiment's distortion and the distribution of the error: one statistical model
frf               the matrix over all sets, its covariance by noise and in total; outputs that follow no input
from_frf          a `Bla` of an FRF that was measured elsewhere, by its standard deviation or coherence
gains             singular values and relative gains of a measured matrix, with their bounds
identify          from a periodic record to its `Bla`
local_models      rational fits of FRFs in windows of lines, and the scatter they leave
neighbours        where the lines stand, and windows of them, worked out once a grid
noise_excitation  the BLA when noise was played instead of a multisine
realizations      experiments that repeat one another, joined; amplitude spectra and peaks that differ
residual          the outputs with their linear part taken off, on all lines
second_opinion    detection lines held against roughness
spectra           DFT of the periods of every channel: their means and their scatter on the lines
zippered          the matrix where each line drives one input: columns fitted between their own lines
"""
