"""`handeyed demo`: the main job against a mock cell, with the truth beside the answer."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import Json

if TYPE_CHECKING:
    from daemon.cli.demo_run.processes import Child


def demo(
    folder: Annotated[Path, typer.Option(help="Where the demo keeps its files; emptied at the start.")] = Path(".demo"),
    keep: Annotated[bool, typer.Option("--keep", help="Leave cell and daemon running until Ctrl-C.")] = False,
    seed: Annotated[int, typer.Option(help="Another number is another cell.")] = 7,
    time_scale: Annotated[float, typer.Option(help="How many times faster than real the arm moves.")] = 10.0,
    controller: Annotated[
        str | None, typer.Option(help="Whose robot program answers: rapid (the shipped one, interpreted) or python.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Calibrate and register against a mock ABB cell over real sockets; print the truth beside the answer."""
    from daemon.cli.demo_run.processes import child, signals_as_exits
    from daemon.cli.demo_run.progress import Teller
    from daemon.cli.demo_run.report import farewell, report, report_json
    from daemon.cli.demo_run.scenario import VIEW_FILE, play
    from daemon.cli.demo_run.settings_file import settings_text

    _empty(folder)
    teller = Teller(aside=as_json)
    teller.line("\nhandeyed demo: a mock ABB cell, calibrated and used over real sockets\n")
    mock = ["mock_robot", "run", "--with-parent", "--seed", str(seed), "--time-scale", str(time_scale)]
    mock += ["--controller", controller] if controller else []
    with (
        signals_as_exits(),
        teller.step("mock cell", "robot, camera and scanner") as starting,
        child("mock-cell", mock, folder) as cell,
    ):
        starting.done(f"on real sockets, the arm {time_scale:g} x as fast as real")
        settings = folder / "handeyed.toml"
        settings.write_text(settings_text(cell.announcement, _port() if keep else 0))
        serve = ["daemon.cli", "serve", str(settings)]
        with teller.step("daemon", str(settings)) as step, child("daemon", serve, folder) as daemon:
            url = daemon.announcement["url"]
            step.done(url)
            found = play(url, folder, seed, teller)
            teller.line(report(found))
            if as_json:
                typer.echo(report_json(found))
            teller.line(farewell(url if keep else None, folder / VIEW_FILE))
            if keep:
                _until_told([cell, daemon])


def _until_told(children: "list[Child]") -> None:
    """Until Ctrl-C; a child that ends by itself is an error."""
    try:
        while True:
            for process in children:
                if process.ended():
                    raise CommandError(process.name, "it ended by itself", f"see {process.log}")
            time.sleep(0.5)
    except KeyboardInterrupt:
        typer.echo("\nEnding the cell ...")


def _empty(folder: Path) -> None:
    """Only what an earlier demo made is removed."""
    import shutil

    mark = folder / "made-by-handeyed-demo"
    try:
        if folder.exists() and any(folder.iterdir()):
            if not mark.exists():
                raise CommandError(str(folder), "this folder is not the demo's", "give an empty one with --folder")
            shutil.rmtree(folder)
        folder.mkdir(parents=True, exist_ok=True)
        mark.touch()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise CommandError(str(folder), f"cannot be used ({reason})", "give another one with --folder") from None


def _port() -> int:
    """The usual port when it is free, so that the curl lines are always the same; else one the system chooses."""
    import socket

    from daemon.config.server_settings import ServerSettings

    usual = ServerSettings()
    try:
        with socket.create_server((usual.host, usual.port)):
            return usual.port
    except OSError:
        return 0
