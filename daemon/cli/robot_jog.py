"""`handeyed robot jog`: one small move of the arm, for the first pose and for views by hand."""

from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError, UnreadableInput

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from daemon.cell.cell import Cell
    from daemon.config.settings import Settings
    from daemon.model.requests import JogRequest
    from drivers.interfaces import JointGoal, MoveGoal

MAX_CONNECT_S = 10.0


def jog(
    file: Annotated[Path, typer.Argument(help="handeyed.toml")],
    axis: Annotated[int, typer.Option(min=1, max=7, help="The axis to turn.")] = 1,
    by: Annotated[float, typer.Option(metavar="DEG", min=-30, max=30, help="By how much.")] = 0.0,
    to: Annotated[str | None, typer.Option(metavar="DEGREES", help="All axes to move to, as 0,20,10,0,60,0.")] = None,
    shift: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Shift of the flange in mm, at most 100.")] = None,
    turn: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Rotation vector in deg, at most 30.")] = None,
    frame: Annotated[str, typer.Option(help="Of --shift and --turn: base or flange.")] = "base",
    speed: Annotated[float | None, typer.Option(metavar="MM_S", min=1, max=250, help="Of the fastest point.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for consent.")] = False,
) -> None:
    """Turn one axis, move all axes to their angles (MoveAbsJ), or shift and turn the flange. The arm moves.

    The daemon must not be running: the controller serves one client; with it, send POST /robot/jog. Nobody may be
    near the arm; this is no safety function. Ctrl-C stops the arm.

    Exit status: 0 it stands there, 1 it was refused or stopped, 2 settings or options cannot be read.
    """
    import asyncio

    from calibration.documents.validation import validate_document
    from daemon.config.settings import load_settings
    from daemon.model.requests import JogRequest

    settings = load_settings(file)
    wanted: dict[str, object] = {"frame": frame, "speed_mm_s": speed}
    if to is not None:
        wanted["joints_deg"] = _numbers("--to", to, "six angles (or seven)", "0,20,10,0,60,0")
    if shift is not None:
        wanted["shift_mm"] = _numbers("--shift", shift, "three lengths", "0,0,50")
    if turn is not None:
        wanted["turn_deg"] = _numbers("--turn", turn, "three angles", "0,0,10")
    if to is shift is turn is None:
        wanted |= {"axis": axis, "by_deg": by}
    asyncio.run(_jog(settings, validate_document(JogRequest, wanted, "options"), yes=yes))


async def _jog(settings: "Settings", request: "JogRequest", *, yes: bool) -> None:
    from daemon.cell.motion_rules import MotionRules
    from daemon.runs.jog import Jog, result_of

    async with _open_cell(settings) as cell:
        act = Jog(cell, MotionRules(settings.robot), request)
        shown = _text_of(await act.goal())
        if not (yes or typer.confirm(f"Move {shown}?", default=False, err=True)):
            raise CommandError(settings.robot.address, "nothing moved", "consent to it, or give --yes")
        stands = result_of(await act.carry_out("handeyed robot jog"))
        typer.echo(f"the axes stand at {', '.join(f'{angle:.2f}' for angle in stands['joints_deg'])} deg")


@asynccontextmanager
async def _open_cell(settings: "Settings") -> "AsyncIterator[Cell]":
    """The cell of the settings, its robot connected; closed afterwards. Raises DeviceError."""
    from daemon.cell.cell import Cell
    from daemon.cell.devices import open_devices
    from daemon.runtime.clock import Clock
    from drivers.errors import DeviceUnreachable

    clock = Clock()
    interlocks = settings.interlocks.open() if settings.interlocks else None
    cell = Cell(open_devices(settings, clock), settings.robot.settling, clock, interlocks)
    try:
        ends_s = clock.monotonic_s() + MAX_CONNECT_S
        while not cell.robot.link.connected:
            if clock.monotonic_s() > ends_s:
                fix = "see that no daemon runs, and that the controller is on"
                raise DeviceUnreachable("robot", cell.robot.link.detail, fix)
            await clock.sleep(0.05)
        yield cell
    finally:
        await cell.close()


def _text_of(goal: "JointGoal | MoveGoal") -> str:
    import numpy as np

    from drivers.interfaces import JointGoal

    if isinstance(goal, JointGoal):
        where = f"the axes to {', '.join(f'{angle:.2f}' for angle in np.degrees(goal.joints_rad))} deg"
    else:
        where = f"the flange to {', '.join(f'{x:.1f}' for x in goal.base_T_flange[:3, 3])} mm"
    return f"{where} at {goal.speed_mm_s:g} mm/s"


def _numbers(option: str, text: str, what: str, example: str) -> list[float]:
    """Numbers between commas. Raises CommandError."""
    try:
        found = [float(each) for each in text.split(",")]
    except ValueError:
        found = []
    axes = len(example.split(","))
    if len(found) not in ((6, 7) if axes == 6 else (axes,)):
        raise UnreadableInput(option, f"{text!r} is not {what}", f"write {option} {example}")
    return found
