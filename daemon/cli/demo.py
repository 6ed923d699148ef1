"""`handeyed demo`: calibrate and register against a mock cell, and compare with the truth."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import Json

if TYPE_CHECKING:
    from daemon.cli.demo_run.processes import ChildProcess


def demo(
    folder: Annotated[Path, typer.Option(help="Where the demo keeps its files; emptied at the start.")] = Path(".demo"),
    keep: Annotated[bool, typer.Option("--keep", help="Leave cell and daemon running until Ctrl-C.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the simulated cell.")] = 7,
    time_scale: Annotated[float, typer.Option(help="How many times faster than real the arm moves.")] = 10.0,
    controller: Annotated[
        str | None, typer.Option(help="Whose robot program answers: rapid (the shipped one, interpreted) or python.")
    ] = None,
    open_page: Annotated[bool, typer.Option("--open", help="With --keep: open the page in the browser.")] = False,
    as_json: Json = False,
) -> None:
    """Calibrate and register against a mock ABB cell over real sockets; print the truth beside the answer."""
    import os
    import webbrowser

    from daemon.cli.demo_run.processes import exit_on_signals, start_child
    from daemon.cli.demo_run.scenario import (
        VIEW_FILE,
        ProgressPrinter,
        next_steps,
        report,
        report_json,
        run_scenario,
        settings_text,
    )
    from daemon.cli.rest_client import free_port

    _clear_folder(folder)
    printer = ProgressPrinter(aside=as_json)
    printer.line("\nhandeyed demo: a mock ABB cell, calibrated and used over real sockets\n")
    mock = ["mock_robot", "run", "--with-parent", "--seed", str(seed), "--time-scale", str(time_scale)]
    mock += ["--controller", controller] if controller else []
    with (
        exit_on_signals(),
        printer.progress_line("mock cell", "robot, camera and scanner") as starting,
        start_child("mock-cell", mock, folder) as cell,
    ):
        starting.finish(f"on real sockets, the arm {time_scale:g} x as fast as real")
        settings = folder / "handeyed.toml"
        settings.write_text(settings_text(cell.announcement, free_port() if keep else 0))
        serve = ["daemon.cli", "serve", str(settings)]
        with printer.progress_line("daemon", str(settings)) as step, start_child("daemon", serve, folder) as daemon:
            url = daemon.announcement["url"]
            step.finish(url)
            found = run_scenario(url, folder, seed, printer)
            printer.line(report(found))
            if as_json:
                typer.echo(report_json(found))
            printer.line(next_steps(url if keep else None, folder / VIEW_FILE))
            if keep:
                if open_page and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
                    webbrowser.open(f"{url}/page/")  # elsewhere it would be one of the terminal's
                _wait_for_interrupt([cell, daemon])


def _wait_for_interrupt(children: "list[ChildProcess]") -> None:
    """Wait for Ctrl-C. Raises CommandError when a child process ends by itself."""
    try:
        while True:
            for process in children:
                if not process.is_running():
                    raise CommandError(process.name, "it ended by itself", f"see {process.log}")
            time.sleep(0.5)
    except KeyboardInterrupt:
        typer.echo("\nEnding the cell ...")


def _clear_folder(folder: Path) -> None:
    """Empty the folder, if an earlier demo made it, else require that it is empty. Raises CommandError."""
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
