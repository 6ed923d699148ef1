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
from daemon.cli.robot_setup import remove, rws_address, setup

if TYPE_CHECKING:
    from drivers.robots.abb.rws.address import RwsAddress

app = typer.Typer(cls=CommandGroup, name="robot", no_args_is_help=True, help="The controller over Robot Web Services.")


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

    where = rws_address(address)
    module_files(folder)  # refused before the controller is asked
    asyncio.run(_upload(where, folder, to, called, egm, yes))
    typer.echo("written; docs/rapid.md says what comes next")


async def _upload(where: "RwsAddress", folder: Path, to: str, called: bool, egm: str | None, yes: bool) -> None:
    from drivers.robots.abb.rws.administration import RwsAdministration

    async with RwsAdministration(where) as controller:
        panel = await controller.read_panel()
        files = program_files(folder, {1: 6, 2: 7}[controller.version], called=called, egm=egm)
        typer.echo(f"{where.address}: " + ", ".join(map(str, panel.values())))
        for name, content in files.items():
            typer.echo(f"  HOME:/{to}/{name}  {len(content)} bytes")
        if not (yes or typer.confirm(f"Write these {len(files)} files?", default=False)):
            raise CommandError(where.address, "nothing was written", "consent to it, or give --yes")
        await controller.make_folder(to)
        for name, content in files.items():
            await controller.write_file(f"{to}/{name}", content)
