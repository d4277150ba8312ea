"""What is played: u(t) = sum_k A_k cos(2 pi k f0 t + phi_k) on chosen lines k, with random phases phi_k.

lines       harmonic grids: excited lines, detection lines, which grid a set of lines is
multisine   the design of a random-phase multisine
orthogonal  several inputs: orthogonal sets of experiments, zippered lines
phases      what random phases have in common by chance
crest       peaks: crest factors lowered or drawn low, and what random phases are expected to have
"""
