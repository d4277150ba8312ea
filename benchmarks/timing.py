"""How long something takes, by the processor's clock: what else runs on the machine does not
count.
"""

from __future__ import annotations

import resource
import statistics
import time
from collections.abc import Callable
from typing import Any


def of_children() -> float:
    """Processor's time of all processes that were started here and have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def best(
    function: Callable[[], Any], n: int = 5, clock: Callable[[], float] = time.process_time
) -> float:
    """Shortest of n runs [s]: what the code takes when the caches are warm."""
    times = []
    for _ in range(n):
        begin = clock()
        function()
        times.append(clock() - begin)
    return min(times)


def in_turn(functions: dict[str, Callable[[], Any]], n: int = 5) -> dict[str, float]:
    """Median of the processor's time of n runs of each [s], taken in turn: what else runs counts
    for all of them alike.

    Runs in turn find the caches as another one left them, as a user's do.
    """
    times: dict[str, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        function()
    for _ in range(n):
        for name, function in functions.items():
            begin = time.process_time()
            function()
            times[name].append(time.process_time() - begin)
    return {name: statistics.median(each) for name, each in times.items()}
