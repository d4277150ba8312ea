"""Several inputs and outputs: from a `MultiRecord` to the frequency response matrix `Frm` with its bound.

    MultiRecord -> spectra -> G, Gamma and the residuals V = Y - G U -> covariance C_V of one experiment -> `Frm`

    Cov(vec G) = conj(Gamma) kron C_V,   Gamma = W^H W,   W = Z^H (U Z^H)^-1

identify         the door: a record of one input and one output or of several, to its `Bla` or `Frm`
frm              `Frm`: the matrix, its covariances, its bounds
gains            singular values and relative gains of a measured matrix, with their bounds
channels         spectra of every channel, and their scatter over periods
matrix_frf       the matrix, what its estimation makes of a residual, the residuals themselves
zippered         the same where each line drives one input: columns fitted between their own lines
matrix_level     the covariance of one experiment's distortion, from detection lines or from roughness
counts           what two inputs together send to detection and to excited lines, exactly
local_matrix     the matrix fitted over its neighbouring lines, with one denominator for all entries
repeats          experiments that were played again: periods of one
unequal          a channel that differs in one experiment from the others
conditions       dead and dependent inputs, phases that are copies of one another
"""
