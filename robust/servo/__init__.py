"""A servo axis: gains of its drive as a controller and back, and a check of them against traces.

    read_experiments -> records -> check(records, gains) -> DriveCheck -> write_page

checking  the check: traces, machine, friction, simulation, findings
cli       the commands `robust servo`
gains     the gains: as a controller and back, as blocks, in a file, for a PLC
page      the page of a check, with pictures
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
