"""Controllers of fixed structure, from the FRF or with a proof.

cone_program    one convex step, in second-order cones
convex_concave  the iteration from a starting controller to one that no step improves
demands         demands on the loop, line by line, in the form of a convex program
design_frf      the entry point: one loop by itself, several one after the other
one_loop        the design for one loop: its demands and its result
plants          one plant or a family stacked line after line, each a disc in front of the controller
population      the few parameters of a structure searched over the band, by differential evolution
sequential      the loops of a matrix closed in turn by a diagonal controller, and the whole checked
starts          a simple stabilising controller to begin from, or a given one
structures      K = X/Y, linear in its parameters
"""
