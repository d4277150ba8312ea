"""A loop shaped by hand.

compensators  lead, lag, notch, roll-off, PID, to be multiplied
bounds        where |L| must not be, whatever its phase
"""
