"""What was measured: u and y as (M, P, N) arrays of realisations, whole periods, samples.

record     `Record`, and how one is cut out of a stream of samples
detection  the period and the excited lines, found in a measured input
faults     drifting clocks, lost samples, clipping, dead channels
"""
