"""What was measured: u and y as (M, P, N) arrays of realisations, whole periods, samples.

record     `Record`, and how one is cut out of a stream of samples
several    `MultiRecord`: the same with a channel axis in front
detection  the period and the excited lines, found in a measured input
faults     drifting clocks, lost samples, clipping, dead channels
"""
