"""The command `handeyed`, assembled from the modules of its commands."""

import os
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from daemon.cli.arms import arms
from daemon.cli.audit import app as audit
from daemon.cli.backup import backup, restore
from daemon.cli.calibrate import calibrate
from daemon.cli.check import check, devices, health, support_bundle
from daemon.cli.compare import compare
from daemon.cli.demo import demo
from daemon.cli.export import export
from daemon.cli.import_session import import_session
from daemon.cli.init import init
from daemon.cli.keys import app as keys
from daemon.cli.mock import mock
from daemon.cli.output import CommandExtension, CommandGroup, Commands
from daemon.cli.plan import assess, plan
from daemon.cli.register import register, register_archive, stitch
from daemon.cli.report import report
from daemon.cli.robot import app as robot
from daemon.cli.schema import schema
from daemon.cli.serve import serve
from daemon.cli.solve import solve
from daemon.cli.target import app as target
from daemon.cli.tls import app as tls
from daemon.cli.verify_scanner import verify_scanner
from daemon.cli.version import version
from extensions.commands import COMMANDS
from gateways.commands import COMMANDS as GATEWAYS

ABOUT = "Makes an ABB robot cell see: eye-in-hand calibration with an uncertainty to trust, clouds in the base frame."

OFFLINE = "From files"
PANELS: dict[str, Commands] = {
    "Try it": (demo, mock),
    "In the cell": (
        init, check, health, devices, serve, calibrate, backup, restore, robot, target, keys, tls, audit,
        *GATEWAYS, support_bundle,
    ),
}  # fmt: skip
EARLY: Commands = (import_session, solve, compare, export, report)
LATE: Commands = (verify_scanner, stitch, register, register_archive, plan, assess, arms, schema, version)
"""Commands by the heading of the help, in order; those of extensions stand between EARLY and LATE, OFFLINE."""

NAMES: dict[Any, str] = {import_session: "import"}
SETTINGS: dict[Any, dict[str, Any]] = {mock: {"ignore_unknown_options": True, "help_option_names": ["--about"]}}
"""`handeyed mock` passes its arguments on, including --help."""


def print_version(wanted: bool) -> None:
    """Print the version and end, when `wanted`."""
    if wanted:
        from daemon.runtime.version import SOFTWARE

        typer.echo(SOFTWARE)
        raise typer.Exit


def options(
    version: Annotated[
        bool, typer.Option("--version", callback=print_version, is_eager=True, help="Print the version, and end.")
    ] = False,
) -> None:
    """Options of the command itself."""


def command_line(extensions: Mapping[str, CommandExtension]) -> typer.Typer:
    """The core's commands, and those of `extensions`, by their names."""
    after_solve = {option: how for extension in extensions.values() for option, how in extension.after_solve.items()}
    app = typer.Typer(
        cls=CommandGroup, no_args_is_help=True, rich_markup_mode="rich", pretty_exceptions_show_locals=False,
        help=ABOUT, context_settings={"obj": after_solve},
    )  # fmt: skip
    app.callback()(options)
    added = (command for extension in extensions.values() for command in extension.commands)
    for panel, commands in {**PANELS, OFFLINE: (*EARLY, *added, *LATE)}.items():
        for command in commands:
            if isinstance(command, typer.Typer):
                app.add_typer(command, rich_help_panel=panel)
            else:
                app.command(NAMES.get(command), rich_help_panel=panel, context_settings=SETTINGS.get(command))(command)
    return app


app = command_line(COMMANDS)


def main() -> None:
    """The console script."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "200000000")  # read by OpenCV when it is loaded
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # its messages would mix with ours; failures are raised
    app()
