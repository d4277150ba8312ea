"""Fits: a nominal plant, its poles, weights.

class_error      the model error of a class of models: its size, and its weight on each line
doubts           warnings about a fit or a weight that is usable but suspicious
fit_uncertainty  standard deviations of poles, zeros, gain and delay
given_weights    weights by formula: for S and K S, and for a neglected delay and gain error
matrix_fit       the nominal model of a measured matrix: shared poles behind the delays of the inputs
measurement      the measurement behind a fit: one or several BLAs or an FRF, checked, and its lines as data
nominal          the nominal model: a rational function through a measured FRF
nominal_fit      `NominalFit`, a nominal model with the quality of its fit; any nominal as a plant
rational         rational functions through complex data: vector fitting, starting poles, numerators
refinement       a rational function, or a weight, refined by its roots
search           starts of a fit: scanned delays, vector fitting, fits with fewer poles
shared_poles     several inputs and outputs: poles shared by all entries, residues of low rank
spectral         weights that are matrices: a convex program for the spectrum, a Riccati equation for its factor
weight_search    the numerical problem behind a weight: sections placed one after the other, least squares
weights          weights that cover a radius: stable, minimum phase, as little above it as the order allows
"""
