"""Controllers of given structure (PID, lead, order n) straight from the FRF, by convex programs.

design_frf      the door: one loop by itself, several one after the other
one_loop        what is asked of a loop, and what came out of it
sequential      the loops of a matrix closed in turn by a diagonal controller, and the whole checked
structures      K = X/Y, linear in its parameters
plants          one plant or a family stacked line after line, each a disc as the controller sees it
demands         what is asked of the loop, line by line, as a convex program takes it
starts          a simple stabilising controller to begin from, or the one that was given
convex_concave  the iteration, from there to one that no step improves
cone_program    one convex step, in second-order cones
proved           the stiffest PID with which a machine is still proved to come to rest
"""
