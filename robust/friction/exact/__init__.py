"""Verification of friction proofs in exact arithmetic.

claim     a claim with all its numbers as given: machine, controller, class of friction, weights, stored energy
classes   the classes of friction in a claim, and what they guarantee
loops     the sliding loop over the rationals, built again from the claim
settling  a bound on the final distance from rest for Maxwell slip with stiction
supply    a sliding loop, its rest, and the supply of a class of friction in it
verify    the entry point: a claim in, `Verification` out
"""
