"""Fits: a nominal plant, its poles, weights.

class_error      the model error of a class of models: its size, and its weight on each line
fit_uncertainty  standard deviations of poles, zeros, gain and delay
nominal          the nominal model: a rational function through a measured FRF
rational         rational functions through complex data: vector fitting, starting poles, numerators
refinement       a rational function, or a weight, refined by its roots
search           starts of a fit: scanned delays, vector fitting, fits with fewer poles
shared_poles     several inputs and outputs: poles shared by all entries, residues of low rank
spectral         weights that are matrices: a convex program for the spectrum, a Riccati equation for its factor
weights          weights that cover a radius: stable, minimum phase, as little above it as the order allows
"""
