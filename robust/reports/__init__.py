"""Reports: a design with its measurement, model, check and proofs in one file.

command       files, models, demands and pictures for the commands
data          sections on measurement and model
page          the file: its sections in order
parts         values, systems and demands as text
prove         machine and class of friction from the files of a command
sections      sections on the controller: loop, check, worst case, settings
shaping_page  the interactive page for loop shaping
verdicts      the verdict of a check and the verdict of a friction proof, side by side
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
