"""Proofs that a loop with friction comes to rest, for every friction of a class.

certify             a judged certificate and its claim
dissipation         the dissipation inequality of the multipliers, in states that come to rest
multipliers         weights of filters on the friction, by a linear program
ports               friction at several places: weights of the filters at each, and a bound
prove               the entry point: a proof for every friction of a class
protocol            the interface of a class of friction, and `FrictionProof`
saturation          a machine with friction whose actuator saturates
settling            bounds on the final distance from rest, for friction with stiction
storage             quadratic storage functions, and polynomials that keep their sign
"""
