"""The friction rig, simulated: experiments on it, and a sampled controller around it.

closed_loop  a sampled controller around the rig, or a stack of them
drive        a drive: gains, filters, sampling and units, for a simulated or a real axis
level_study  a multisine at several levels of excitation
machine      machines with several coupled masses
motion       a rig or a friction law without a controller, from rest
rig          the machine `Rig`, the rig of the paper, a stage with two axes
run          any machine through any signal
servo        a servo axis under its drive: motor, load, P-PI cascade; four presets
simulate     multisine experiments, run to steady state
trajectory   the motion of a machine, sample by sample
"""
