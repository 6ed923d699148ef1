"""The command `handeyed`, assembled from one module a command."""

import os

import typer

from daemon.cli.assess import assess
from daemon.cli.calibrate import calibrate
from daemon.cli.mock import mock
from daemon.cli.output import Commands
from daemon.cli.plan import plan
from daemon.cli.solve import solve
from daemon.cli.target import app as target
from daemon.cli.version import version

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_show_locals=False,
    help="Makes an ABB robot cell see: eye-in-hand calibration with an uncertainty to trust, clouds in the base frame.",
)
app.command(rich_help_panel="Offline")(solve)
app.command(rich_help_panel="Offline")(assess)
app.command(rich_help_panel="Offline")(plan)
app.add_typer(target, name="target", rich_help_panel="Offline")
app.command(rich_help_panel="In the cell")(calibrate)
app.command(
    rich_help_panel="Try it", context_settings={"ignore_unknown_options": True, "help_option_names": ["--about"]}
)(mock)
app.command()(version)


def main() -> None:
    """The console script."""
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # its lines would mix with ours; failures come as errors
    app()
