"""Classes of friction laws, described by bounds instead of parameters: one module each, with its
proof.

bounded       any friction up to a largest force: a distance from rest
bristle       bristles that bend and creep
maxwell_slip  springs in series with sliders
passive       friction that returns no energy
"""
