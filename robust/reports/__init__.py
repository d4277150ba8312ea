"""Reports: a whole run in one file.

command       pictures, models and demands for the commands: what they read, draw and write
data          sections on what was measured and modelled
page          the file: its sections in order
parts         values, systems and demands in words
prove         machine and class of friction from the files of a command, and the commands that go on
sections      sections on the controller: loop, check, worst case, settings
shaping_page  the page on which a loop is shaped live
verdicts      both verdicts side by side: of a check, of a proof for a class of friction
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
