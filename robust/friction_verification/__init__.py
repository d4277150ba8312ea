"""A proof for a machine with friction, made again to the last bit by someone who does not know how it was found.

claim     what is claimed: machine, controller, class of friction, weights and stored energy, with every number as given
loop      the sliding loop over the rationals, built anew from the claim
actuator  an actuator that saturates, over the rationals
supply    the dissipation inequality of the class, over the rationals
verify    the door: a claim in, `Verification` out
file      the claim as JSON, with a digest
"""
