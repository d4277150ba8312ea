"""The program `robust`: its commands in the order of their help, and how it is run."""

from __future__ import annotations

import nlfrf
import robust
from nlfrf._base.command import Commands, Version, run_command
from nlfrf._base.files import LOAD_OPTIONS
from robust.cli.check import check
from robust.cli.design import design
from robust.cli.export import export
from robust.cli.learn import learn_app
from robust.cli.model import model
from robust.cli.orders import orders
from robust.cli.prove import prove
from robust.cli.prove_schedule import prove_schedule
from robust.cli.reduce import reduce
from robust.cli.report import report
from robust.cli.shape import shape
from robust.cli.verify import verify
from robust.servo.cli import servo_app

app = Commands(
    help="Uncertainty models of measured machines, controllers for them, and checks with proofs.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # units stand in brackets
)

#: Parameters of the library whose options have other names.
_OPTIONS = LOAD_OPTIONS | {
    "n_poles": "poles",
    "n_zeros": "zeros",
    "dt": "sample-time",
    "M_S": "peak",
    "M_T": "peak-t",
    "filter_time": "filter-time",
    "omega_c": "bandwidth",
    "relative_std": "relative-std",
    "n_averages": "averages",
    "channel": "channel",
    "columns": "columns",
    "Fs": "force",
    "omega_Q": "cutoff",
    "u_max": "limit",
    "base_velocity": "velocity",
    "n_levels": "ramp",
    "n_periods": "periods",
    "n_realizations": "realizations",
    "max_candidates": "candidates",
    "f_min": "f-min",
    "f_max": "f-max",
}


@app.callback()
def _common(version: Version = False) -> None:
    """Uncertainty models of measured machines, controllers for them, and checks with proofs."""


for command in (
    *(model, design, check, verify, prove, prove_schedule),
    *(orders, export, reduce, report, shape),
):
    app.command()(command)
app.add_typer(servo_app, name="servo")
app.add_typer(learn_app, name="learn")


def main() -> None:
    """Run the command `robust`."""
    run_command("robust", app, nlfrf.DataWarning, robust.DesignWarning, options=_OPTIONS)
