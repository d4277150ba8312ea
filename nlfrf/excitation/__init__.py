"""What is played: u(t) = sum_k A_k cos(2 pi k f0 t + phi_k) on chosen lines k, with random phases phi_k.

lines      harmonic grids: which DFT lines are excited, which are left out to detect distortion
multisine  the design of a random-phase multisine
orthogonal several inputs: orthogonal sets of experiments, zippered lines
crest      lower crest factors at an unchanged amplitude spectrum
"""
