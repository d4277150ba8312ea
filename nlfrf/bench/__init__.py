"""The friction bench: masses on springs with friction, played by multisines or driven by a controller.

rig            the machine `Rig`, the paper's own `paper_rig`, a stage of two axes
steps          how long an integration step may be
motion         the machine's motion through any force, from rest on
simulate       multisine experiments, run to steady state
controllers    what is put around a rig, checked
closed_loop    a sampled controller around the rig, or a stack of them
axes_loop      a controller matrix around several axes
loop_runs      the same stack of loops as the compiled code takes it
loop_results   what is wanted of each of them, found where they are computed
loop_response  what a loop did, and what became of it
runs           many runs in parallel, resumed after a break
"""
