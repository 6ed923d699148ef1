"""`handeyed robot ...`: install the robot program on a controller, copy its files, or remove it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import CommandGroup
from daemon.cli.robot_acceptance import acceptance
from daemon.cli.robot_files import module_files, program_files
from daemon.cli.robot_frame import write_frame
from daemon.cli.robot_jog import jog
from daemon.cli.robot_setup import remove, setup

if TYPE_CHECKING:
    from drivers.robots.abb.rws.address import RwsAddress
    from drivers.robots.abb.rws.parsing import ControllerState

MAX_CONNECT_S = 15.0

app = typer.Typer(cls=CommandGroup, no_args_is_help=True, help="The controller over Robot Web Services.")


@app.callback()
def robot() -> None:
    """The controller over Robot Web Services."""


app.command()(jog)
app.command()(setup)
app.command()(acceptance)
app.command()(remove)
app.command("write-frame")(write_frame)


@app.command()
def upload(
    address: Annotated[str, typer.Argument(help="rws://host, rws://user:password@host:port?version=2")],
    folder: Annotated[Path, typer.Argument(help="The RAPID modules, as deploy/rapid.")],
    to: Annotated[str, typer.Option(help="The folder within HOME: on the controller.")] = "handeyed",
    called: Annotated[bool, typer.Option("--called", help="A main of yours calls cell_motion: no CELL_main.")] = False,
    egm: Annotated[str | None, typer.Option(metavar="HOST", help="EGM is wanted, sent to this PC's address.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for consent.")] = False,
) -> None:
    """Copy the robot program to the controller, with the configuration fragments of its RobotWare (FOLDER/rw6, rw7).

    With --called without CELL_main; CELL_egm and its device only with --egm.

    Nothing is written before you consent; nothing is loaded or started.

    Exit status: 0 it is there, 1 it is not, 2 the folder has no modules.
    """
    import asyncio

    from drivers.errors import AddressNotUnderstood
    from drivers.robots.abb.rws.address import RwsAddress

    if not address.startswith("rws://"):
        raise AddressNotUnderstood(address, "modules are copied over Robot Web Services", "write rws://host")
    where = RwsAddress.parse(address)
    module_files(folder)  # refused before the controller is asked
    state, robotware = asyncio.run(_state(where))
    files = program_files(folder, robotware, called=called, egm=egm)
    typer.echo(f"{where.address}: {state}")
    for name, content in files.items():
        typer.echo(f"  HOME:/{to}/{name}  {len(content)} bytes")
    if not (yes or typer.confirm(f"Write these {len(files)} files?", default=False)):
        raise CommandError(where.address, "nothing was written", "consent to it, or give --yes")
    asyncio.run(_upload(where, files, to))
    typer.echo("written; docs/rapid.md says what comes next")


async def _state(where: "RwsAddress") -> "tuple[ControllerState, int]":
    from drivers.robots.abb.rws.robot import RwsRobot

    robot = RwsRobot(where)
    robot.start()
    try:
        await robot.wait_for_link(MAX_CONNECT_S)
        return await robot.read_state(), robot.robotware
    finally:
        await robot.close()


async def _upload(where: "RwsAddress", files: dict[str, bytes], to: str) -> None:
    from drivers.robots.abb.rws.robot import RwsRobot

    robot = RwsRobot(where)
    try:
        await robot.upload_modules(files, folder=to)
    finally:
        await robot.close()
