"""`handeyed robot ...`: install the robot program on a controller, copy its files, remove it, or write X there."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError, ExitStatus, UnreadableInput
from daemon.cli.output import CommandGroup
from daemon.cli.robot_acceptance import acceptance
from daemon.cli.robot_jog import jog
from daemon.cli.robot_setup import module_files, program_files, remove, rws_address, setup

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument
    from calibration.transforms import Array
    from drivers.robots.abb.rws.address import RwsAddress

app = typer.Typer(cls=CommandGroup, name="robot", no_args_is_help=True, help="The controller over Robot Web Services.")


app.command()(jog)
app.command()(setup)
app.command()(acceptance)
app.command()(remove)


@app.command("write-frame")
def write_frame(
    address: Annotated[str, typer.Argument(help="rws://host, rws://user:password@host:port?version=2")],
    file: Annotated[Path, typer.Argument(help="calibration.json")],
    tooldata: Annotated[str | None, typer.Option(help="A tooldata whose tframe becomes X.")] = None,
    wobjdata: Annotated[str | None, typer.Option(help="A wobjdata whose uframe becomes the target's pose.")] = None,
    task: Annotated[str, typer.Option(help="The task that has it.")] = "T_ROB1",
    despite_verdict: Annotated[bool, typer.Option("--despite-verdict", help="Also when it is not accepted.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for consent.")] = False,
) -> None:
    """Write X into the tframe of a tooldata; or the target's pose, or that of a camera that stands still, into the
    uframe of a wobjdata. Everything else of the record stays as it is.

    Nothing is written before you consent, and nothing while the program runs. What was written is read back.

    Exit status: 0 written, 1 not written, 2 unreadable input, 3 the calibration is not accepted.
    """
    import asyncio

    from calibration.documents.exports.rapid import pose_text
    from daemon.cli.compare import read_calibration

    where = rws_address(address)
    kind, name = _place(tooldata, wobjdata, task)
    document = read_calibration(file)
    if not (document.verdict.accepted or despite_verdict):
        fix = "calibrate again as its findings advise, or give --despite-verdict"
        raise CommandError(str(file), "the calibration is not accepted", fix, ExitStatus.NOT_ACCEPTED)
    frame = pose_text(_frame(document, kind, file))
    asyncio.run(_write(where, kind, f"{task}/{name}", frame.replace(" ", ""), yes))
    typer.echo(f"{name}: written and read back")


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


NAME = r"[A-Za-z]\w{0,31}"


def _place(tooldata: str | None, wobjdata: str | None, task: str) -> tuple[str, str]:
    """Type and name of the data. Raises CommandError."""
    import re

    given = {kind: name for kind, name in (("tooldata", tooldata), ("wobjdata", wobjdata)) if name is not None}
    if len(given) != 1:
        raise UnreadableInput("write-frame", "it writes one frame", "give --tooldata or --wobjdata")
    ((kind, name),) = given.items()
    for word in (name, task):
        if not re.fullmatch(NAME, word):
            raise UnreadableInput(word[:40], "no name of RAPID", "write it as on the pendant")
    if name.lower() in ("tool0", "wobj0"):
        raise UnreadableInput(name, "it is the controller's own", f"name a {kind} of yours")
    return kind, name


def _frame(document: "CalibrationDocument", kind: str, file: Path) -> "Array":
    """What the calibration knows for that type of data. Raises CommandError."""
    if kind == "tooldata":
        pose, what = document.flange_T_camera, "no camera on the flange"
    else:
        pose, what = document.base_T_target or document.base_T_camera, "neither a target nor a camera in the base"
    if pose is None:
        raise CommandError(str(file), f"the calibration has {what}", "name another type of data")
    return pose.transform()


async def _write(where: "RwsAddress", kind: str, symbol: str, frame: str, yes: bool) -> None:
    from drivers.robots.abb.rws.administration import RwsAdministration
    from drivers.robots.abb.rws.rapid_data import FRAME_AT, read_record, write_frame

    async with RwsAdministration(where) as controller:
        panel = await controller.read_panel()
        if panel.get("ctrlexecstate") == "running":
            raise CommandError(where.address, "the program runs", "stop it: a frame is not changed below a moving arm")
        parts = await read_record(controller, symbol, kind)
        typer.echo(f"{where.address}: " + ", ".join(map(str, panel.values())))
        typer.echo(f"  {symbol} has   {parts[FRAME_AT[kind]]}\n  it will have {frame}")
        if not (yes or typer.confirm("Write it?", default=False)):
            raise CommandError(where.address, "nothing was written", "consent to it, or give --yes")
        await write_frame(controller, symbol, kind, parts, frame)
