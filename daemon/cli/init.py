"""`handeyed init`: write a cell's first settings from five answers, each checked at the devices. Nothing moves."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import writing

if TYPE_CHECKING:
    from daemon.tools.first_setup.interview import AnswerFound, Interview


def init(
    file: Annotated[
        Path, typer.Argument(help="The settings file to write; one that is there is kept as FILE.1.")
    ] = Path("handeyed.toml"),
    from_file: Annotated[
        Path | None, typer.Option("--from", help="Settings whose values are proposed; else those of FILE, if any.")
    ] = None,
) -> None:
    """Write a cell's settings: asks for controller, camera, target, tolerance and box, and checks each. Nothing moves.

    Answers are read line by line, so they can come from a file: handeyed init < answers. An answer that is refused is
    asked again. Of settings that are there, what is not asked stays. `handeyed serve --setup` asks the same in the
    page. deploy/handeyed.example.toml explains every other setting.
    """
    import asyncio

    from daemon.cli.rest_client import free_port
    from daemon.runtime.bounded_read import read_document
    from daemon.tools.camera_discovery import discover
    from daemon.tools.first_setup.devices import find_controllers
    from daemon.tools.first_setup.interview import QUESTIONS, USUAL, Interview
    from daemon.tools.first_setup.settings_before import SettingsBefore, write_settings
    from registration.io.regular_file import require_replaceable

    with writing(file, "name another file"):
        require_replaceable(file)
    before = SettingsBefore.of_file(file, free_port())
    if from_file is not None:
        before = before.with_answers_of(read_document(from_file), str(from_file))
    interview, usual = Interview(before=before), {**dict.fromkeys(QUESTIONS), **USUAL, **before.answers()}
    usual["controller"] = usual["controller"] or next(iter(asyncio.run(find_controllers())), None)
    typer.echo("".join(f"{line}\n" for line in before.lines()), nl=False)
    for name, question in QUESTIONS.items():
        if name == "model" and interview.model is not None:
            continue
        numbers: dict[str, str] = {}
        if name == "camera":
            cameras = [entry for entry in discover() if not entry.problem]
            typer.echo("\nCameras that answer:" if cameras else "\nNo camera answers discovery.")
            typer.echo("\n".join(f"  {number}  {entry.line()}" for number, entry in enumerate(cameras, 1)))
            numbers = {str(number): entry.address for number, entry in enumerate(cameras, 1)}
            usual[name] = usual[name] or ("1" if cameras else None)
        while not (found := _ask(interview, name, question, usual[name], numbers)).complete:
            usual[name] = found.answer if name != "box" else None
        usual["target"] = usual["target"] or found.target or ""
    with writing(file, "name another file"):
        kept = write_settings(file, interview.settings_text())
    old, url = f"; the old one is {kept}" if kept is not None else "", before.settings.server.local_url
    typer.echo(f"\n{file} is written{old}. Next:\n  handeyed check {file}\n  handeyed serve {file}")
    typer.echo(f"  handeyed calibrate --url {url}  # in a second terminal: THE ARM MOVES")


def _ask(interview: "Interview", name: str, question: str, usual: str | None, numbers: dict[str, str]) -> "AnswerFound":
    """What came of a line; asked again while it is refused. Raises CommandError when the answers end."""
    import asyncio

    from calibration.errors import CalibrationError
    from daemon.errors import DaemonError
    from drivers.errors import DeviceError

    while True:
        try:
            text = typer.prompt(f"\n{question}", default=usual, show_default=bool(usual))
        except (typer.Abort, RuntimeError):  # RuntimeError: there is no input at all
            raise CommandError("the answers", "they end before the last question", "nothing was written") from None
        try:
            found = asyncio.run(interview.take(name, numbers.get(text.strip(), text)))
        except (CalibrationError, DaemonError, DeviceError) as error:
            typer.echo(f"  ! {error}")
            continue
        typer.echo(
            "".join(f"  {line}\n" for line in found.found) + "".join(f"  ! {line}\n" for line in found.doubts), nl=False
        )
        return found
