"""Blocks of fixed structure in any loops, tuned together for several plants.

closing     the closed loop and its derivative by the blocks
design      the result
friction    a limit that keeps the proof with friction
limits      limits: gains of closed-loop channels, for the nominal or for the whole set
loops       the loop around a plant with a model, and its limits: peaks of each over frequency
measured_loop  the same around a plant known on its lines
minimax     the search: stability first, then the minimum of the largest limit ratio
parameters  all blocks as one matrix of the search variables, and its derivatives
plants      plants with hold and delay, or as FRFs on their lines
problem     poles, peaks and gradients of all plants for given search variables
result      the result: everything evaluated again, more densely
scenes      the loop around every plant, from the fixed parts, the blocks and the limits
tune        the entry point
worst       the worst gain over a set: a disc in closed form, several blocks by scalings
"""
