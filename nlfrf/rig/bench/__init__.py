"""Simulated machines with friction: experiments on them, and a sampled controller around them.

closed_loop  a sampled controller around a machine, for one run or for many
drive        a drive: gains, filters, sampling and units, for a simulated or a real axis
level_study  a multisine at several rms values
machine      machines with several coupled masses
motion       a rig or a friction law without a controller, from rest
presets      typical servo axes, each with a drive that is tuned for it
rig          the machine `Rig`, the example `paper_rig`, a stage with two axes
run          simulate any machine under any signal
servo        a servo axis with its drive: motor, load, P-PI cascade
simulate     multisine experiments, run to steady state
trajectory   the motion of a machine, sample by sample
"""
