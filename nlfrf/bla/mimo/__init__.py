"""Identification with several inputs and outputs: the frequency response matrix.

channels      spectra of every channel, and their scatter over periods
conditions    dead and dependent inputs, phases that are copies of one another
counts        what two inputs together send to detection and to excited lines, exactly
gains         singular values and relative gains of a measured matrix, with their bounds
identify      from a record of any number of channels to its `Bla`
local_matrix  the matrix fitted over its neighbouring lines, with one denominator for all entries
matrix_frf    the matrix, what its estimation makes of a residual, the residuals themselves
matrix_level  the covariance of one experiment's distortion, from detection lines or from roughness
repeats       experiments that were played again: periods of one
unequal       a channel that differs in one experiment from the others
zippered      the same where each line drives one input: columns fitted between their own lines
"""
