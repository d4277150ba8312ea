"""Linear systems with nothing uncertain about them; a system is a `control.StateSpace`.

r --->(+)-- e -->[ K ]-- u -->[ G ]---+--> y        L = G K,  S = 1/(1 + L),  T = 1 - S
      -^                              |
       +------------------------------+

realisation  whatever a user calls a system, an FRF or a weight, checked, as one state space; roots into sections
lti          response at frequencies, poles, zeros, sampling time; states in units of their own
closed_loop  the loop above by its ports, and the worst case over a disc in closed form
connections  systems in series, in parallel, in a loop of their own
lft          systems of several inputs and outputs closed through one another: upper and lower F(P, K)
sampling     plants behind hold and delay as a sampled controller sees them; controllers made discrete
bilinear     the map between the unit circle and the axis
stability    is it stable: poles beyond rounding, and what a delay does to them
nyquist      how often 1 + L winds about zero on the lines of an FRF
norms        the H-infinity norm
riccati      stabilising solutions of Riccati equations
pickles      state spaces sent to workers in other processes
grids        frequency grids that see every mode, and the peaks of curves on them
"""
