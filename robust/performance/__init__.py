"""What a loop does, in the numbers that a commissioning engineer asks for; nothing about sets.

classical  crossover, phase and gain margin, bandwidth, off the curve of L
loop_gains singular values of L, S, T and K S of a loop of several inputs and outputs
loop_signals reference, disturbance and noise of a loop as a user names them, and their spectra
steps      a step of the reference: overshoot, rise and settling time, what the actuator has to give
"""
