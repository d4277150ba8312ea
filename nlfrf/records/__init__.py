"""What was measured: u and y as (M, P, N) arrays of realisations, whole periods, samples.

record         `Record`, checked when made: realisations, periods, channels
several        `MultiRecord`: the same with a channel axis in front
samples        a record cut out of streams of samples
detection      the excited lines of a signal, found in what was measured
period         its period
coarse         long signals looked at coarsely, where they are smooth
regular_grids  the grid that was played, where the actuator distorts
reference      the design that was played, laid under what was measured
faults         faults of one signal: drifting clocks, lost samples, standstills, clipping, dead channels
gaps           samples lost or repeated inside a period
ringing        a transient between periods: it is smooth over frequency
output_faults  faults of the output against the input: lost samples, clocks apart, another sign
changes        what changes over the periods: the gain, evenly or at once, and the operating point
"""
