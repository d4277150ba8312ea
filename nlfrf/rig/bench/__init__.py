"""The friction rig, simulated: experiments on it, and a sampled controller around it.

closed_loop  a sampled controller around the rig, or a stack of them
drive        a drive: gains, filters, sampling and units, of a simulated axis as of a real one
level_study  a multisine at several levels of excitation
machine      machines of several coupled masses
motion       a rig or a friction law without a controller, from rest on
rig          the machine `Rig`, the paper's own `paper_rig`, a stage of two axes
run          any machine through any signal
servo        a servo axis under its drive: motor, load, P-PI cascade; four presets
simulate     multisine experiments, run to steady state
trajectory   what a machine did, sample by sample
"""
