"""Verification of friction proofs in exact arithmetic.

claim   a claim with all its numbers as given: machine, controller, class of friction, weights, stored energy
loops   the sliding loop over the rationals, built again from the claim
verify  the entry point: a claim in, `Verification` out
"""
