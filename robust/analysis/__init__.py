"""A controller checked: stability of the nominal loop, what the set does to it, what of that is proved.

check            the door: one model, one controller, one report
check_lines      the same where the plant is known on measured lines only
check_structure  the same with several uncertainties
loop             plant, controller, hold and delay on one time base: curves and margins
curves           what the loop does over frequency, for its whole set
claims           what a check claims, in the form in which it is verified
proofs           robust stability and performance proved at every frequency
report           `RobustnessReport`: what was found
verdict          what it means, in words
worst_case       the worst plant of the set, to replay
family           loops around random plants of the set
disk_margin      gain and phase at once, in all channels at once
gap              the distance between plants (nu-gap), and the margin of a loop for it
"""
