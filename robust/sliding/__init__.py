"""A machine while it slides: its linear part in a loop, without any friction, and what that alone decides.

machine      the linear part of a machine with friction
loop         the sliding loop: flows between samples, jumps at them
response     its response from the friction to the velocity
springs      refutation: a friction that never slips is a spring
bounded      friction that is only known to be bounded: sure run-away, hunting
"""
