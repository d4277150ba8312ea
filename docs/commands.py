"""The page of the commands, from their own help."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docs.api import write_if_changed

INTRODUCTION = """# Commands

Files in, files out. Exit code 0: done, and proved or met where the command has a verdict (`robust check`, `design`,
`prove`, `verify`, `drive check`); 1: not proved, limits not met, or a warning on the page of `drive check` (what was
found is written all the same); 2: bad input, one line on standard error; 3: `drive check` passed the linear loop and
could not judge the friction. No command writes onto a file that it reads, or over one that no such command made: see
[files](../guide/files.md). Every file that was written is named, a line each. With `--json` standard output is the
result as JSON and nothing else. `--install-completion` teaches your shell the
commands and their options. The pages below are what `--help` prints.
"""


def commands_of(group: Any) -> Iterator[tuple[str, Any]]:
    """(name, command) of a group, those of a group inside it behind its name."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from ((f"{name} {inner}", one) for inner, one in commands_of(command))
        else:
            yield name, command


def write_page(path: Path) -> None:
    """Every command of both programs with its help."""
    from typer.main import get_command

    import nlfrf.cli
    import robust.cli

    page = [INTRODUCTION]
    for program, app in (("nlfrf", nlfrf.cli.app), ("robust", robust.cli.app)):
        group = get_command(app)
        page.append(f"## {program}\n")
        for name, command in commands_of(group):
            context = command.make_context(
                f"{program} {name}", [], resilient_parsing=True, terminal_width=96
            )
            page.append(
                f"### {program} {name}\n\n```text\n{command.get_help(context).strip()}\n```\n"
            )
    write_if_changed(path, "\n".join(page))
