"""Fits: a nominal plant, its poles, weights.

class_error      what a class of models misses: an error next to the scatter of the lines, and its size
fit_uncertainty  standard deviations of poles, zeros, gain and delay
nominal          the nominal model: a rational function through a measured FRF
rational         rational functions through complex data: vector fitting, starting poles, numerators
refinement       a rational function, or a weight, refined by its roots
search           where a fit starts: scanned delays, vector fitting, the fits of fewer poles
shared_poles     several inputs and outputs: poles shared by all entries, residues of low rank
spectral         weights that are matrices: a convex program for the spectrum, a Riccati equation for its factor
weights          weights that cover a radius: stable, minimum phase, as little above it as the order allows
"""
