"""Functions that stand for data or for demands, with the order you ask for.

nominal          the nominal model: a rational function through a measured FRF
fit_uncertainty  standard deviations of poles, zeros, gain and delay
orders           how many poles the FRF asks for
matrix_nominal   the nominal model of a measured matrix
shared_poles     several inputs and outputs: poles shared by all entries, residues of low rank
rational         rational functions through complex data: vector fitting, starting poles, numerators
refinement       the same, refined by its roots
weights          weights that cover a radius: stable, minimum phase, as little above it as the order allows
overbound        the search behind them: from where to start, and what to keep
excess           |W| as a function of its roots, and how far it lies above a target
descent          Newton steps on those roots
weight_formulas  weights by formula: what is asked of S and K S, what a delay may do
design_warning   `DesignWarning`, and what is warned of: usable but suspicious fits, weights
"""
