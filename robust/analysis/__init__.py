"""Analysis of a controller: check, report, margins, worst case, performance.

aliases          a sampled loop with a set of continuous plants: all aliases of a frequency together
bounds           the region that |L| must avoid at any phase
classical        crossover, phase and gain margin, bandwidth
curves           S, T and the measures of robust stability (rs) and performance (rp) over frequency, for the whole set
disk             disk margins: allowed change of gain, of phase or of both, in all channels at once
family           loops around random plants of the set
findings         the result of a judge: curves, margins, proofs, verdict
gap              the distance between plants (nu-gap), and the margin of a loop for it
judge_exact      one channel: closed forms, every alias, exact arithmetic
judge_lines      a plant that is known as an FRF, on its lines
judge_mu         several channels or several uncertainties: bounds of mu
lmi_proofs       proofs for one channel by a matrix inequality that cvxpy solves
loop             plant, controller, hold and delay on one time base: stability, peaks, the loop around another plant
loop_proofs      proofs of stability and performance for the whole set at all frequencies
loop_of_channels  a set and a controller for several channels on one time base
loop_gains       singular values of L, S, T and K S over frequency
loop_level       the level at which a loop moves the machine, compared with the measured levels
report           `RobustnessReport`: its fields and its text
robust_gain      `robgain`: the factor on the uncertainty at which a gain reaches a level
robustness       `check`: assembles the loop of a model and a controller, calls a judge, returns the report
sampled_set      a sampled set that contains a continuous set for several channels, every alias included
signals          reference, disturbance and noise that act on a loop
step             a step of the reference: overshoot, rise and settling time, output of the actuator
text             every sentence of a report
worst_plant      `worst_case`: the plant of the set with the largest gain, as a system
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
