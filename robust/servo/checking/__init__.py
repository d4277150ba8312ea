"""A check of the gains of a drive against traces of its axis.

cures       changes of the drive that improve a friction verdict
doubts      reasons to distrust a check, or gains with a good verdict
drive_friction  `DriveFriction`: the friction as identified, with its proof, its bound and its simulation
findings    the result of a check, and its page as text
friction    the friction of traces at rest identified, and the loop proved with it
judge       the entry point: gains checked against traces
linear      the linear loop: the set of a BLA, the controller of the gains, reasons to distrust it
machine     the machine without delay and lag of the drive, and its fit
read        traces as records in the units of the velocity loop
rest        the motion of the axis: a bound of the error, a simulation
simulation  simulation of the identified axis under its drive: rest or hunting, and the gain to change
traces      the traces: each with its name, its conditions, its BLA and its warnings
"""
