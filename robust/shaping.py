"""Loop shaping by hand: compensators, bounds on |L|, a page and a widget to shape on."""

from robust.analysis.bounds import loop_bounds
from robust.reports.shaping_page.page import write_shaping_page
from robust.reports.shaping_page.widget import shape
from robust.synthesis.hinf.ncfsyn import crossover_weight
from robust.synthesis.shaping import lag, lead, low_pass, notch, pid

__all__ = [
    "crossover_weight",
    "lag",
    "lead",
    "loop_bounds",
    "low_pass",
    "notch",
    "pid",
    "shape",
    "write_shaping_page",
]
