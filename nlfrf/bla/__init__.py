"""Identification: from a periodic record to the best linear approximation with its variances.

bla               `Bla`: the FRF, its variances, its bound
calibration       what a detection line tells about an excited line, grid by grid
distortion        the variance of one realisation's FRF and the distribution of its error: one statistical model
from_frf          a `Bla` of an FRF that was measured elsewhere, by its standard deviation or coherence
frf               the FRF over realisations, its variance by noise and in total
identify          the door: from a periodic record to its `Bla`
localfit          rational fits of the FRF in windows of lines, and the scatter they leave
mimo              identification with several inputs and outputs
neighbours        where the lines stand, and windows of them, worked out once a grid
noise_excitation  the BLA when noise was played instead of a multisine
realizations      realisations: refused where an input is missing or another spectrum, joined where they repeat
residual          the output with its linear part taken off, on all lines
second_opinion    detection lines held against roughness
spectra           DFT of the periods: their means and their noise on the lines, input and output
"""
