"""Controllers of fixed structure, from the FRF or with a proof.

cone_program    one convex step, in second-order cones
convex_concave  the iteration of convex steps, from a start to a local optimum
demands         demands on the loop, line by line, in the form of a convex program
design_frf      the entry point: one loop by itself, several one after the other
one_loop        the design for one loop: its demands and its result
plants          the plant or family of plants on the lines, each with its disc
population      global search over the parameters of a structure by differential evolution
sequential      the loops of a matrix closed in turn by a diagonal controller, and the whole checked
starts          a simple stabilising controller to begin from, or a given one
structures      K = X/Y, linear in its parameters
"""
