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
