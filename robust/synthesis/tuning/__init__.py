"""Blocks of fixed structure in any loops, tuned together for several plants.

closing     the closed loop and its derivative by the blocks
design      the result
friction    a limit that keeps the proof with friction
limits      limits: gains of closed-loop channels, for the nominal or for the whole set
loops       the loop around one plant, and its limits: peaks of each over frequency
minimax     the minimax search: stability first, then the smallest largest limit, at exact peaks
parameters  all blocks as one matrix of the coordinates of the search, and its slopes
plants      plants with hold and delay, or as FRFs on their lines
problem     poles, peaks and slopes of all plants at given coordinates
tune        the entry point
worst       the worst gain over a set: a disc in closed form, several blocks by scalings
"""
