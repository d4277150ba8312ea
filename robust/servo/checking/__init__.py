"""A check of the gains of a drive against traces of its axis.

cures       what a change of the drive does to a friction verdict
doubts      why a check may not be trusted, or why gains are not safe though the verdict is good
findings    what a check finds, and the page as text
friction    friction in the loop of a drive, read from traces at rest, and the proof with it
judge       the entry point: gains checked against traces
machine     the machine behind delay and lag of the drive, and its fit
read        traces as records in the units of the velocity loop
simulation  an axis as it was read, run under its drive: whether it rests, and what to change where it hunts
"""
