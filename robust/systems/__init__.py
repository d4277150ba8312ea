"""Linear systems with nothing uncertain about them; a system is a `control.StateSpace`.

r --->(+)-- e -->[ K ]-- u -->[ G ]---+--> y        L = G K,  S = 1/(1 + L),  T = 1 - S
      -^                              |
       +------------------------------+

realisation  whatever a user calls a system, as one state space
lti          response, poles, zeros
closed_loop  the loop above as one state space, with the ports of an uncertainty
connections  systems in series, in parallel, in a loop of their own
lft          systems closed through one another (linear fractional transformations)
sampling     plants as a sampled controller sees them; controllers made discrete
bilinear     the map between the circle and the axis
stability    poles beyond rounding, and what a delay does to them
nyquist      how often 1 + L winds about zero on the lines of an FRF
norms        the H-infinity norm
riccati      stabilising solutions of Riccati equations
pickles      state spaces sent to workers in other processes
grids        frequency grids that see every mode, and the peaks of curves on them
"""
