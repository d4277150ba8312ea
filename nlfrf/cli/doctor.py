"""The command `nlfrf doctor`: the installed versions, and what is wrong with them."""

from __future__ import annotations

import typer

from nlfrf.doctor import examine
from nlfrf.io.measurement_files import extra_of_file


def doctor() -> None:
    """Show the installed versions, and what is wrong with them (exit code 1)."""
    rows, faults = examine(extra_of_file)
    for name, version, requirement in rows:
        print(f"{name:14} {version or 'not installed':16} {requirement}")
    for fault in faults:
        print(fault)
    if faults:
        raise typer.Exit(1)
    print("all is well")
