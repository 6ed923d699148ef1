"""`handeyed init`: write a cell's first settings from five answers, each checked at the devices. Nothing moves."""

from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import writing

if TYPE_CHECKING:
    from daemon.tools.first_setup.answers import Corner, TargetSize
    from daemon.tools.first_setup.devices import SeenCamera, SeenController

Given = TypeVar("Given")
USUAL_TOLERANCE_MM = 1.0


def init(
    file: Annotated[
        Path, typer.Argument(help="The settings file to write; one that is there is kept as FILE.1.")
    ] = Path("handeyed.toml"),
) -> None:
    """Write a cell's settings: asks for controller, camera, target, tolerance and box, and checks each. Nothing moves.

    Answers are read line by line, so they can come from a file: handeyed init < answers. An answer that is refused is
    asked again. deploy/handeyed.example.toml explains every other setting.
    """
    from calibration.kinematics.abb_arms import find_any_arm
    from daemon.cli.local_daemon import free_port
    from daemon.config.settings import parse_settings
    from daemon.tools.first_setup.answers import CellAnswers, keep_old, parse_setup, parse_tolerance
    from registration.io.regular_file import require_replaceable

    with writing(file, "name another file"):
        require_replaceable(file)
    controller = _controller()
    model = controller.model or _ask(
        "The arm, as `handeyed arms` lists it; Enter: another one",
        lambda text: find_any_arm(text).name if text.strip() else None,
        "",
    )
    camera = _camera()
    setup = _ask("Is the camera on the arm, or beside it? (arm, beside)", parse_setup, "arm")
    size = _target(camera)
    usual = f"{USUAL_TOLERANCE_MM:g}"
    tolerance_mm = _ask("How exactly must a point be known, mm (the largest U, k = 2)?", parse_tolerance, usual)
    box_mm = _box(controller)
    frame, port = controller.base_frame, free_port()
    cell = CellAnswers(controller.address, model, frame, camera.address, setup, size, tolerance_mm, box_mm, port)
    text = cell.settings_text()
    parse_settings(text.encode(), str(file))
    with writing(file, "name another file"):
        new = file.with_name(f"{file.name}.new")
        new.write_text(text, encoding="utf-8")
        kept = keep_old(file)
        new.rename(file)
    old = f"; the old one is {kept}" if kept is not None else ""
    typer.echo(f"\n{file} is written{old}. Next:\n  handeyed check {file}\n  handeyed serve {file}")


def _ask(question: str, answer: Callable[[str], Given], default: str | None = None) -> Given:
    """What `answer` makes of a line; asked again while it refuses it. Raises CommandError when the answers end."""
    from calibration.errors import CalibrationError
    from daemon.errors import DaemonError
    from drivers.errors import DeviceError

    while True:
        try:
            text = typer.prompt(f"\n{question}", default=default, show_default=bool(default))
        except typer.Abort:
            raise CommandError("the answers", "they end before the last question", "nothing was written") from None
        try:
            return answer(text)
        except (CalibrationError, DaemonError, DeviceError) as error:
            typer.echo(f"  ! {error}")


def _now(work: Awaitable[Given]) -> Given:
    import asyncio

    async def wait() -> Given:
        return await work

    return asyncio.run(wait())


def _controller() -> "SeenController":
    from daemon.tools.first_setup.devices import find_controller, look_at_controller

    question = "The controller's address: host, rws://USER:PASSWORD@HOST, or tcp://HOST:PORT of the robot program"
    seen = _ask(question, lambda text: _now(look_at_controller(text.strip())), _now(find_controller()))
    at = ", ".join(f"{value:.0f}" for value in seen.flange_mm)
    typer.echo("\n".join(f"  {line}" for line in (*seen.lines, f"flange at ({at}) mm; [robot] address {seen.address}")))
    if seen.model is not None:
        typer.echo(f"  arm {seen.model}")
    if seen.advice:
        typer.echo(f"  ! {seen.advice}; install it with: handeyed robot setup")
    return seen


def _camera() -> "SeenCamera":
    from daemon.tools.camera_discovery import discover
    from daemon.tools.first_setup.devices import take_picture

    found = [entry for entry in discover() if not entry.problem]
    typer.echo("\nCameras that answer:" if found else "\nNo camera answers discovery.")
    typer.echo("\n".join(f"  {number}  {entry.line()}" for number, entry in enumerate(found, 1)))
    numbers = {str(number): entry.address for number, entry in enumerate(found, 1)}

    def look(text: str) -> "SeenCamera":
        return _now(take_picture(numbers.get(text.strip(), text)))

    question = "The camera: its number, or an address, as http://HOST/frame.png (docs/cameras.md)"
    seen = _ask(question, look, "1" if found else None)
    height, width = seen.image.shape[:2]
    typer.echo("  " + ", ".join(filter(None, (seen.who, f"a picture of {width} x {height}"))))
    return seen


def _target(camera: "SeenCamera") -> "TargetSize":
    from calibration.detection.recognition import Recognised, recognise
    from calibration.errors import DetectionError
    from daemon.tools.first_setup.answers import EDGES, describe_target, parse_size
    from daemon.tools.first_setup.devices import take_picture

    def look(text: str) -> Recognised | None:
        return recognise(_now(take_picture(camera.address)).image)

    found = None
    with suppress(DetectionError):  # a black picture: the next one says why
        found = recognise(camera.image)
    while found is None:
        found = _ask("No target is recognised. Bring one whole into view; Enter takes another picture", look, "")
    _, second, what, second_what = EDGES[type(found.target)]
    typer.echo(f"\nThe picture shows: {describe_target(found.target)}")
    for doubt in found.doubts:
        typer.echo(f"  ! {doubt}: correct [target] in the file, or begin again with the whole target in view")
    also = "" if second is None else f" [{second_what}]"
    question = f"Measured, mm: {what}{also} [instrument], as 22 or 220/10{' 16.5' if second else ''} calliper"
    return _ask(question, lambda text: parse_size(text, found.target))


def _box(controller: "SeenController") -> "tuple[Corner, Corner]":
    from daemon.tools.first_setup.answers import box_of, parse_corners
    from daemon.tools.first_setup.devices import read_flange

    allowed = controller.program_box_mm

    def take(text: str) -> "tuple[list[Corner], Corner]":
        stands = _now(read_flange(controller))
        return parse_corners(text, stands, allowed), stands

    def both(text: str) -> "tuple[Corner, Corner]":
        corners, stands = take(text)
        if len(corners) == 1:
            opposite, stands = _ask("Jog it to the opposite corner, and answer here (or x y z)", take)
            corners += opposite
        return box_of(corners, stands)

    program = "" if allowed is None else f", or program for {allowed[0]} to {allowed[1]}"
    return _ask(f"The box for the flange, mm in the base: x y z x y z; here at one corner{program}", both)
