"""Friction laws and hysteresis.

curves       virgin curves: the force on the way out from rest
hysteresis   the force along a path, with all its memory (Masing, Madelung)
integration  integration of a law by its compiled code
laws         Coulomb, Dahl, LuGre, Leuven, generalised Maxwell slip
own          a law of user functions
sliders      sliders of varying strength, and the forces of elements on a given motion
"""
