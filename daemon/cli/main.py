"""The command `handeyed`, assembled from one module per command."""

import os
from collections.abc import Mapping
from typing import Annotated

import typer

from daemon.cli.arms import arms
from daemon.cli.assess import assess
from daemon.cli.audit import app as audit
from daemon.cli.backup import backup, restore
from daemon.cli.calibrate import calibrate
from daemon.cli.check import check
from daemon.cli.compare import compare
from daemon.cli.demo import demo
from daemon.cli.devices import devices
from daemon.cli.export import export
from daemon.cli.health import health
from daemon.cli.import_session import import_session
from daemon.cli.init import init
from daemon.cli.keys import app as keys
from daemon.cli.mock import mock
from daemon.cli.output import CommandGroup, Commands
from daemon.cli.plan import plan
from daemon.cli.register import register
from daemon.cli.register_archive import register_archive
from daemon.cli.report import report
from daemon.cli.robot import app as robot
from daemon.cli.schema import schema
from daemon.cli.serve import serve
from daemon.cli.solve import solve
from daemon.cli.stitch import stitch
from daemon.cli.support_bundle import support_bundle
from daemon.cli.target import app as target
from daemon.cli.tls import app as tls
from daemon.cli.verify_scanner import verify_scanner
from daemon.cli.version import version
from extensions.commands import COMMANDS

PASS_ARGUMENTS_ON = {"ignore_unknown_options": True, "help_option_names": ["--about"]}
"""`handeyed mock` passes its arguments on, including --help."""

ABOUT = "Makes an ABB robot cell see: eye-in-hand calibration with an uncertainty to trust, clouds in the base frame."

TRY, CELL, OFFLINE = "Try it", "In the cell", "From files"


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


def command_line(extensions: Mapping[str, Commands]) -> typer.Typer:
    """The core's commands, and those of `extensions`, by their names."""
    app = typer.Typer(
        cls=CommandGroup,
        no_args_is_help=True,
        rich_markup_mode="rich",
        pretty_exceptions_show_locals=False,
        help=ABOUT,
    )
    app.callback()(options)
    app.command(rich_help_panel=TRY)(demo)
    app.command(rich_help_panel=TRY, context_settings=PASS_ARGUMENTS_ON)(mock)
    app.command(rich_help_panel=CELL)(init)
    app.command(rich_help_panel=CELL)(check)
    app.command(rich_help_panel=CELL)(health)
    app.command(rich_help_panel=CELL)(devices)
    app.command(rich_help_panel=CELL)(serve)
    app.command(rich_help_panel=CELL)(calibrate)
    app.command(rich_help_panel=CELL)(backup)
    app.command(rich_help_panel=CELL)(restore)
    app.add_typer(robot, name="robot", rich_help_panel=CELL)
    app.add_typer(target, name="target", rich_help_panel=CELL)
    app.add_typer(keys, name="keys", rich_help_panel=CELL)
    app.add_typer(tls, name="tls", rich_help_panel=CELL)
    app.add_typer(audit, name="audit", rich_help_panel=CELL)
    app.command("support-bundle", rich_help_panel=CELL)(support_bundle)
    app.command("import", rich_help_panel=OFFLINE)(import_session)
    app.command(rich_help_panel=OFFLINE)(solve)
    app.command(rich_help_panel=OFFLINE)(compare)
    app.command(rich_help_panel=OFFLINE)(export)
    app.command(rich_help_panel=OFFLINE)(report)
    for command in (command for commands in extensions.values() for command in commands):
        if isinstance(command, typer.Typer):
            app.add_typer(command, rich_help_panel=OFFLINE)
        else:
            app.command(rich_help_panel=OFFLINE)(command)
    app.command("verify-scanner", rich_help_panel=OFFLINE)(verify_scanner)
    app.command(rich_help_panel=OFFLINE)(stitch)
    app.command(rich_help_panel=OFFLINE)(register)
    app.command(rich_help_panel=OFFLINE)(register_archive)
    app.command(rich_help_panel=OFFLINE)(plan)
    app.command(rich_help_panel=OFFLINE)(assess)
    app.command(rich_help_panel=OFFLINE)(arms)
    app.command(rich_help_panel=OFFLINE)(schema)
    app.command(rich_help_panel=OFFLINE)(version)
    return app


app = command_line(COMMANDS)


def main() -> None:
    """The console script."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "200000000")  # read by OpenCV when it is loaded
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # its messages would mix with ours; failures are raised
    app()
