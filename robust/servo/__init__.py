"""A servo axis: experiments under its running drive, the gains of the drive, and a check of the
gains against traces.

    design_experiment -> set points -> trace -> read_experiments -> records -> check(records, gains)
    -> write_page

checking    the check: traces, machine, friction, simulation, findings
cli         the commands `robust servo`
experiment  experiments on the axis: designs, the simulated axis, levels of a pre-test
gains       the gains: as a controller and back, as blocks, in a file, for a PLC
page        the HTML page of a check, with pictures
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
