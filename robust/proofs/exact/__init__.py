"""Proof and verification in exact arithmetic: claims over the rationals, positivity, Taylor models.

alias_discs    the distance of a set of an inverse form from instability, as a sum of discs
aliases        claims on continuous plants under a sampled controller
bands          inequalities between transfer matrices in a band of frequencies
channel_files  claims on loops with several channels, in files
claim          a claim on a loop, with every number as given
claim_files    claims as plain numbers and words, in files with a digest
closed_loops   the norm of a plant closed through a controller, over the rationals
conditions     the inequalities of a claim at a frequency, in sums and products
folded_sets    claims that a sampled set with several channels contains a continuous one
interval_kyp   a level of mu interval by interval, from P, Q and a scaling for each
learning       the factor per trial of a learning filter
loops          the entry point for one loop: a claim in, `Verification` out
matrices       matrix inequalities over the rationals: decisions on norms and definiteness
polynomial_matrices  matrices that are polynomials of a parameter, positive definite on an interval
polynomials    exact numbers, roots of polynomials, Routh's array, signs on a half line
sampled_motion one sample of a plant whose parameter moves, bounded
scaled_kyp     a level of mu at every frequency, from P and one scaling
scheduled_kyp  a schedule: V = x'P(theta)x falls on every trajectory
scheduled_loop the loop of a plant that goes with a parameter, as polynomials
stability      stability of a loop, and the effect of a delay on its roots
synthesis_levels  levels of H-infinity synthesis that no controller reaches, in many digits
taylor_models  enclosures of functions on intervals
trajectories   trajectories of a parameter on which a loop grows
verification   `Verification`: proved claims, failed claims, and reasons
"""
