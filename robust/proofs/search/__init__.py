"""Search for certificates: bounded real, intervals, stability.

bands         bounds from both sides of the largest gain in a band of frequencies
bounded_real  one linear matrix inequality for a whole norm
certificate   `Certificate`: what is proved and how, or why it is not
intervals     magnitudes of single-loop systems on intervals, and responses free of rounding
programs      convex programs, solved under a time cap
scaled_kyp    P and one scaling for all frequencies, by cvxpy
scheduled     P as a polynomial of a parameter, by cvxpy
stability     stable or not: floating point far from the boundary, exact arithmetic close to it
"""
