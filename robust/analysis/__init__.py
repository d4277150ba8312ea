"""A controller checked: stability of the nominal loop, what the set does to it, what of that is proved.

check            the door: one model, one controller, one report
check_lines      the same where the plant is known on measured lines only
check_structure  the same with several uncertainties
loop             plant, controller, hold, delay on one time base: stable or not, its peaks, with another plant
aliases          a set of continuous plants as a sampler sees it: every alias of a frequency at once
curves           S, T, rs, rp over frequency for the whole set, at the poles of the parts too
claims           what a check claims, in the form in which it is verified
proofs           stability and performance of the whole set proved at every frequency
report           `RobustnessReport`: its fields, how it is filled and printed
verdict          what was found, in words: verdict, reason, advice, what is proved and what is not
worst_case       the one plant of the set that hurts most, to replay
family           loops around random plants of the set, to look at
disk_margin      gain and phase at once, in all channels at once
loop_level       predict at which level a loop moves the machine, and compare that with the measured levels
gap              the distance between plants (nu-gap), and the margin of a loop for it
"""
