"""Proofs that hold to the last bit, by someone who knows nothing of how they were found.

claim       what is claimed of a loop, with every number as given, and its digest
exact       transfer functions over the rationals; hold and delay in balls
axis        the parts of a claimed loop on one imaginary axis
conditions  what a claim asks at a frequency, in sums and products
stability   Routh's array; what a delay does to the roots
poles       loops and matrices decided stable or not
roots       zeros and poles in many digits, for responses that doubles cannot tell
half_line   polynomials positive from zero to infinity
jets        Taylor models on an interval
aliases     claims about continuous plants under a sampled controller
intervals   claims with a delay or a continuous weight, interval by interval
matrices    matrix inequalities over the rationals
norms       the norm of a system below a level
closed_loops  the norm of a plant closed through a controller, in many digits and in balls
loops       the door: a claim in, `Verification` out
file        certificates as JSON that someone else can check
"""
