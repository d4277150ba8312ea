"""Friction laws and hysteresis.

curves       virgin curves: the force on the way out from rest
hysteresis   the force along a path, with all its memory (Masing, Madelung)
integration  from a law to the compiled code that steps it
laws         Coulomb, Dahl, LuGre, Leuven, generalised Maxwell slip
"""
