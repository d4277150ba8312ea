"""Synthesis of controllers.

cascade    an outer and an inner loop as one controller
fixed      controllers of fixed structure, from the FRF or with a proof
hinf       h-infinity synthesis
reduction  a controller of lower order that keeps what was proved
shaping    compensators: lead, lag, notch, PID, roll-off
tune       blocks of any structure in any loops, tuned together for several plants
two_dof    prefilter and feedforward
"""
