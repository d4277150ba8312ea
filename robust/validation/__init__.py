"""A second record, of another day, level or loop, held against a set of plants and the record behind it.

difference  shape and level of the difference of two records, whitened
matrices    several inputs and outputs: entries, whole matrices, a change that all share
records     the door: one input and one output, or several
"""
