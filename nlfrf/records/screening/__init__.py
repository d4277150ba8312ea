"""Screening of a record: timing of input and output, lost samples, drift, channels.

decimation  long signals decimated where they are smooth
drifts      drifts over the periods: the gain from input to output, the offset of the output
gaps        samples lost or repeated inside a period
input       faults of one signal: drifting clocks, lost samples, standstills, clipping, dead channels
stream      faults of one signal before it is cut: silence, positions that wrap, outliers, hits of a hammer
output      faults of the output against the input: lost samples, another clock, a changed sign, unrelated periods
transients  transients between periods, separated from noise and faults
"""
