"""Controllers of given structure (PID, lead, order n) straight from the FRF, by convex programs.

design_frf      the door: what is asked, and what came out of it
structures      K = X/Y, linear in its parameters
plants          one plant or a family stacked line after line, each a disc as the controller sees it
demands         what is asked of the loop, line by line, as a convex program takes it
starts          a simple stabilising controller to begin from, or the one that was given
convex_concave  the iteration, from there to one that no step improves
cone_program    one convex step, in second-order cones
proved           the stiffest PID with which a machine is still proved to come to rest
"""
