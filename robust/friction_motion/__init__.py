"""How a loop with friction moves: predicted by amplitude, never proved.

quasi_linear  the door: amplitude, kick and outcome of a loop around friction of a given amplitude
equivalent    a friction law at an amplitude as a spring and a damper
"""
