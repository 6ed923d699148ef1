"""`handeyed robot upload`: copy the robot program to the controller, after consent."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import CommandGroup

if TYPE_CHECKING:
    from drivers.robots.abb.rws.address import RwsAddress
    from drivers.robots.abb.rws.parsing import ControllerState

MAX_CONNECT_S = 15.0
SUFFIXES = (".mod", ".sys", ".cfg")

app = typer.Typer(cls=CommandGroup, no_args_is_help=True, help="The controller over Robot Web Services.")


@app.callback()
def robot() -> None:
    """The controller over Robot Web Services."""


@app.command()
def upload(
    address: Annotated[str, typer.Argument(help="rws://host, rws://user:password@host:port?version=2")],
    folder: Annotated[Path, typer.Argument(help="The RAPID modules, as deploy/rapid.")],
    to: Annotated[str, typer.Option(help="The folder within HOME: on the controller.")] = "handeyed",
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for consent.")] = False,
) -> None:
    """Copy the robot program to the controller, with the configuration fragments of its RobotWare (FOLDER/rw6, rw7).

    Nothing is written before you consent; nothing is loaded or started.

    Exit status: 0 it is there, 1 it is not, 2 the folder has no modules.
    """
    import asyncio

    from drivers.errors import AddressNotUnderstood
    from drivers.robots.abb.rws.address import RwsAddress

    if not address.startswith("rws://"):
        raise AddressNotUnderstood(address, "modules are copied over Robot Web Services", "write rws://host")
    where, files = RwsAddress.parse(address), _files(folder)
    state, robotware = asyncio.run(_state(where))
    files |= _files(folder / f"rw{robotware}", modules=False)
    typer.echo(f"{where.address}: {state}")
    for name, content in files.items():
        typer.echo(f"  HOME:/{to}/{name}  {len(content)} bytes")
    if not (yes or typer.confirm(f"Write these {len(files)} files?", default=False)):
        raise CommandError(where.address, "nothing was written", "consent to it, or give --yes")
    asyncio.run(_upload(where, files, to))
    typer.echo("written; docs/rapid.md says what comes next")


def _files(folder: Path, *, modules: bool = True) -> dict[str, bytes]:
    from daemon.runtime.bounded_read import read_bounded

    if not (modules or folder.is_dir()):
        return {}
    try:
        found = {path.name: read_bounded(path) for path in sorted(folder.iterdir()) if path.suffix in SUFFIXES}
    except OSError as error:
        raise CommandError(
            str(folder), error.strerror or str(error), "name the folder of the modules", ExitStatus.UNREADABLE
        ) from None
    if modules and not any(name.endswith((".mod", ".sys")) for name in found):
        raise CommandError(str(folder), "no RAPID module is in it", "name deploy/rapid", ExitStatus.UNREADABLE)
    return found


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
