"""Search for certificates: bounded real, intervals, stability.

bands         the largest gain in a band of frequencies, bounded from both sides
bounded_real  one linear matrix inequality for a whole norm
certificate   `Certificate`: what was proved, how, and if not, why not
intervals     magnitudes of single-loop systems on intervals, and responses that rounding has no part in
programs      convex programs, solved under a time cap
scaled_kyp    P and one scaling for all frequencies, by cvxpy
stability     stable or not: floating point far from the boundary, exact arithmetic beside it
"""
