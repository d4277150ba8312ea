"""Models: a nominal with weights, the set of plants around it, and its validation by records.

fit         fits
sets        uncertainty sets
validation  does a record contradict a model, does another record confirm it
"""
