"""Controllers of fixed structure, from the FRF or with a proof.

cone_program    one convex step, in second-order cones
convex_concave  the iteration from a starting controller to one that no step improves
demands         what is asked of the loop, line by line, as a convex program takes it
design_frf      the entry point: one loop by itself, several one after the other
one_loop        what is asked of a loop, and what came out of it
plants          one plant or a family stacked line after line, each a disc as the controller sees it
population      the few parameters of a structure searched over the band, by differential evolution
sequential      the loops of a matrix closed in turn by a diagonal controller, and the whole checked
starts          a simple stabilising controller to begin from, or the one that was given
structures      K = X/Y, linear in its parameters
"""
