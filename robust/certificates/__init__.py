"""Bounds proved at every frequency: a certificate is numbers judged here, never the word of a solver.

certificate   `Certificate`: what was proved, how, and if not, why not
bounded_real  one linear matrix inequality for a whole norm
intervals     weights frozen on an interval, a Hamiltonian test on each
closed_loop   the norm that a controller reaches with a plant, from both as they are given
single_loop   a proof for one loop from its responses, interval by interval, a delay taken as it is
stability     stable or not: floating point far from the boundary, exact arithmetic beside it
responses     responses in doubles, from exact roots where the matrices are too poor for them
solver        cvxpy behind a time cap, by solvers that may fail in any way
"""
