"""Compiled steps of friction laws and of sampled loops; numba is imported only here, and installed
by an extra.

compiled the compiler, an extra
coupled  steps and runs for several coupled masses
data     the numbers that compiled code reads and writes
leuven   compiled steps of the Leuven, LuGre and Dahl laws
loops    compiled sampled loops around all these laws
servo    compiled drive, a P-PI cascade around one or two masses
slip     compiled steps of Coulomb friction and of Maxwell slip
"""
