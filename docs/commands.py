"""The page of the commands, from their own help."""

from __future__ import annotations

from pathlib import Path

from docs.api import write_if_changed

INTRODUCTION = """# Commands

Files in, files out; bad input is one line on standard error and exit code 2. The pages below are what `--help` prints.
"""


def write_page(path: Path) -> None:
    """Every command of both programs with its help."""
    from typer.main import get_command

    import nlfrf.cli
    import robust.cli

    page = [INTRODUCTION]
    for program, app in (("nlfrf", nlfrf.cli.app), ("robust", robust.cli.app)):
        group = get_command(app)
        page.append(f"## {program}\n")
        for name, command in group.commands.items():
            context = command.make_context(f"{program} {name}", [], resilient_parsing=True, terminal_width=96)
            page.append(f"### {program} {name}\n\n```text\n{command.get_help(context).strip()}\n```\n")
    write_if_changed(path, "\n".join(page))
