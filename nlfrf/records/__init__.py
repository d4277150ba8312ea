"""Measured records: samples cut into periods, excited lines, the period, the reference.

direction      which of two signals was played, found from their detection lines
excited_lines  the excited lines of a signal, and their grid
given_streams  the streams of a record as given: shapes, rates, a hint if input and output look swapped
period         the period of a signal
periods        streams cut into periods
record         `Record`, checked when made: realisations, periods, channels
reference      the design that was played, aligned with the measured input
samples        a record from streams of samples in memory
screened       the faults that screening finds, sample by sample, for a picture
screening      screening of a record
"""
