"""Measured records: samples cut into periods, excited lines, the period, the reference.

direction      which of two signals was played, by what stands between their lines
excited_lines  the lines that a signal excites, and the grid they make
period         its period
record         `Record`, checked when made: realisations, periods, channels
reference      the design that was played, laid under what was measured
samples        a record cut out of streams of samples
screened       what screening finds, sample by sample, for a picture
screening      screening of a record
"""
