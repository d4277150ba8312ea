"""The friction bench: a mass on a spring with friction, played by multisines or driven by a controller.

rig            the machine `Rig`, the paper's own `paper_rig`, and its motion through any force, from rest on
simulate       multisine experiments, run to steady state
closed_loop    a sampled controller around the rig, or a stack of them
loop_runs      the same stack of loops as the compiled code takes it
loop_response  what a loop did, and what became of it
runs           many runs in parallel, resumed after a break
"""
