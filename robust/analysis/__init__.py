"""Analysis of a controller: check, report, margins, worst case, performance.

aliases          a set of continuous plants as a sampler sees it: every alias of a frequency at once
bounds           the region that |L| must avoid, whatever its phase
curves           S, T and the measures of robust stability (rs) and performance (rp) over frequency, for the whole set
disk             disk margins: gain, phase or less of both, in all channels at once
family           loops around random plants of the set
findings         what is found of a loop: curves, margins, proofs, and what they are about
gap              the distance between plants (nu-gap), and the margin of a loop for it
judge_exact      one channel: closed forms, every alias, exact arithmetic
judge_lines      a plant that is known as an FRF, on its lines
judge_mu         several channels, several uncertainties: bounds of mu
lmi_proofs       the same proofs of one loop by a matrix inequality that cvxpy solves
loop             plant, controller, hold, delay on one time base: stable or not, its peaks, with another plant
loop_proofs      stability and performance of the whole set proved at every frequency
loop_of_channels  a set and a controller of several channels on one time base
loop_level       predict at which level a loop moves the machine, and compare that with the measured levels
performance      classical margins, gains of the loop, step responses
report           `RobustnessReport`: its fields, and how they are printed
robust_gain      `robgain`: how far the uncertainty may grow until a gain reaches a level
robustness       `check`: one model, one controller; makes the loop, lets a judge find, and reports
sampled_set      the sampled set that contains a continuous set of several channels, every alias included
text             every sentence of a report
worst_plant      `worst_case`: the plant of the set with the largest gain, as a system
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
