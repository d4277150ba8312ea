"""The program `nlfrf`: its commands in the order of their help, and how it is run."""

from __future__ import annotations

import nlfrf
from nlfrf._base.command import Commands, Version, run_command
from nlfrf._base.files import LOAD_OPTIONS
from nlfrf.cli.design import design
from nlfrf.cli.doctor import doctor
from nlfrf.cli.frf import frf
from nlfrf.cli.identify import identify
from nlfrf.cli.inspect import inspect
from nlfrf.cli.plot import plot
from nlfrf.cli.simulate import simulate

app = Commands(
    help="Best linear approximations with a distortion bound from one multisine experiment.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # units stand in brackets
)

#: Parameters of the library whose options have other names.
_OPTIONS = LOAD_OPTIONS | {
    "n_periods": "periods",
    "n_realizations": "realizations",
    "n_log": "log-lines",
    "n_detection": "detection",
    "level_from": "level-from",
    "f_min": "f-min",
    "f_max": "f-max",
    "columns": "columns",
}


@app.callback()
def _common(version: Version = False) -> None:
    """Best linear approximations with a distortion bound from one multisine experiment."""


for command in (design, simulate, inspect, identify, frf, plot, doctor):
    app.command()(command)


def main() -> None:
    """Run the command `nlfrf`."""
    run_command("nlfrf", app, nlfrf.DataWarning, options=_OPTIONS)
