"""The command ``robust``: files in, files out.

check           `robust check`: controllers against a model
design          `robust design`: a controller by H-infinity synthesis or with a fixed structure
export          `robust export`: a model or controller for other programs and targets
learn           `robust learn`: the input of a repeated trial
model           `robust model`: a nominal model and a weight for a measured BLA or FRF
options         arguments and options that several commands share
orders          `robust orders`: nominal models of growing order
program         the program: its commands in the order of their help, and how it is run
prove           `robust prove`: a loop with every friction of a class
prove_schedule  `robust prove-schedule`: a scheduled loop while its operating point moves
reduce          `robust reduce`: a controller of lower order with the same proofs
report          `robust report`: a whole run on one page
shape           `robust shape`: a page to shape a loop by hand
verify          `robust verify`: the proof of a certificate, repeated
"""

from robust.cli.program import app, main

__all__ = ["app", "main"]
