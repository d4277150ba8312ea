"""Reports: a whole run in one file.

command       files, models, demands and pictures for the commands
data          sections on measurement and model
page          the file: its sections in order
parts         values, systems and demands as text
prove         machine and class of friction from the files of a command, and the next commands to run
sections      sections on the controller: loop, check, worst case, settings
shaping_page  the page on which a loop is shaped live
verdicts      both verdicts side by side: that of a check, and that of a proof for a class of friction
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
