"""How long something takes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any


def best(function: Callable[[], Any], n: int = 5) -> float:
    """Shortest of n runs [s]: what the code takes when nothing else runs."""
    times = []
    for _ in range(n):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def in_turn(functions: dict[str, Callable[[], Any]], n: int = 5) -> dict[str, float]:
    """Median of the processor's time of n runs of each [s], taken in turn: what else runs counts for all of them alike.

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
