"""How long something takes."""

from __future__ import annotations

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


def side_by_side(functions: dict[str, Callable[[], Any]], n: int = 5) -> dict[str, float]:
    """Shortest of n runs of each [s], taken in turn: a machine that slows down for a while does so for all of them."""
    times = dict.fromkeys(functions, float("inf"))
    for _ in range(n):
        for name, function in functions.items():
            times[name] = min(times[name], best(function, 1))
    return times
