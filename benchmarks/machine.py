"""What the figures were measured on: printed once, before them."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = (
    "nlfrf",
    "numpy",
    "scipy",
    "numba",
    "control",
    "slycot",
    "cvxpy",
    "clarabel",
    "best-linear-approximation",
)


def processor() -> str:
    """Its name, as the system knows it."""
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        names = [
            line.partition(":")[2].strip()
            for line in listed.read_text().splitlines()
            if "model name" in line
        ]
        if names:
            return names[0]
    return platform.processor() or platform.machine()


def installed(package: str) -> str:
    """Its version, or that it is not there."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} not installed"


def main() -> None:
    """Print it."""
    print(f"{processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}")
    print(f"Python {platform.python_version()}; {', '.join(map(installed, PACKAGES))}")


if __name__ == "__main__":
    main()
