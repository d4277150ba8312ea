"""Verification of friction proofs in exact arithmetic.

claim   what is claimed: machine, controller, class of friction, weights and stored energy, with every number as given
loops   the sliding loop over the rationals, built anew from the claim
verify  the entry point: a claim in, `Verification` out
"""
