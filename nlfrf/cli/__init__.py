"""The command ``nlfrf``: files in, files out.

design    `nlfrf design`: a random-phase multisine
doctor    `nlfrf doctor`: the installed versions, and what is wrong with them
frf       `nlfrf frf`: a BLA of an FRF from another program
identify  `nlfrf identify`: the best linear approximation of a measured record
inspect   `nlfrf inspect`: the content of a measurement file
options   the option that several commands share
plot      `nlfrf plot`: a picture of a saved result
program   the program: its commands in the order of their help, and how it is run
simulate  `nlfrf simulate`: a multisine through the built-in rig
"""

from nlfrf.cli.program import app, main

__all__ = ["app", "main"]
