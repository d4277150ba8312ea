"""Proof and verification in exact arithmetic: claims over the rationals, positivity, Taylor models.

alias_discs    stability of a set of an inverse form under a sampled controller: one disc for each alias
aliases        claims on continuous plants under a sampled controller
bands          inequalities between transfer matrices in a band of frequencies
channel_files  files of claims on loops with several channels
claim          a claim on a loop, with every number as given
claim_files    files of claims: plain numbers and words, with a digest
closed_loops   the norm of the closed loop of a plant and a controller, over the rationals
conditions     the inequalities of a claim at one frequency, written with sums and products only
folded_sets    claims that a sampled set with several channels contains a continuous one
interval_kyp   an upper bound of mu, proved with P, Q and a scaling for each frequency interval
learning       the factor per trial of a learning filter
loops          the entry point for one loop: a claim in, `Verification` out
matrices       matrix inequalities over the rationals: decisions on norms and definiteness
polynomial_matrices  matrices that are polynomials of a parameter, positive definite on an interval
polynomials    exact numbers, roots of polynomials, Routh's array, signs on a half line
sampled_motion one sample of a plant whose parameter changes in it, with a bound on the error
scaled_kyp     an upper bound of mu at every frequency, proved with P and one scaling
scheduled_kyp  a scheduled loop: V = x'P(theta)x decreases on every trajectory of theta
scheduled_loop the loop of a plant that depends on a parameter, as polynomials
stability      stability of a loop, and the effect of a delay on its roots
synthesis_levels  values of gamma that no controller reaches in H-infinity synthesis, in many digits
taylor_models  enclosures of functions on intervals
trajectories   trajectories of a parameter on which the state of a loop grows
verification   `Verification`: proved claims, failed claims, and reasons
"""
