"""What was measured: u and y as (M, P, N) arrays of realisations, whole periods, samples.

record         `Record`: checked when made
several        `MultiRecord`: the same with a channel axis in front
samples        a record cut out of streams of samples
detection      the period and the excited lines, found in a measured input
regular_grids  the grid that was played, where the actuator distorts
reference      the design that was played, laid under what was measured
faults         drifting clocks, lost samples, clipping, dead channels
output_faults  the same of the output against the input, drifting gains, wandering operating points
"""
