"""`handeyed calibrate --manual`: Enter takes a picture, f finishes, q aborts; after each the next pose is advised."""

import sys
from typing import Any

import typer

from daemon.cli.output import print_error
from handeyed.client import Client, Run, defer_interrupts
from handeyed.errors import ClientError

KEYS = "Enter: take a picture   f Enter: finish and solve   q Enter: give up"
BEGIN = "jog the arm to where the camera sees the whole target and let it stand; nothing here moves it"


def calibrate_manually(daemon: Client, body: dict[str, Any]) -> Run:
    """Run a manual calibration to its end; returns the run. Raises ClientError."""
    with defer_interrupts():
        run = daemon.start("/calibrate", body)
    links, ended = run["links"], False
    typer.echo(f"run {run['id']}: {BEGIN}\n{KEYS}", err=True)  # only the result goes to standard output
    try:
        while not ended:
            line = sys.stdin.readline()  # "" at the end of the input
            run, ended = _handle_key(daemon, links, line.strip().lower() if line else "q")
    except (KeyboardInterrupt, SystemExit, ClientError):
        if not daemon.run(run["id"])["over"]:
            daemon.abort(run)
        raise
    return run


def _handle_key(daemon: Client, links: dict[str, str], key: str) -> tuple[Any, bool]:
    """Carry out one key; returns the run and whether it is over. A refusal of the daemon is printed."""
    try:
        if key in ("q", "quit"):
            return daemon.post(links["abort"]), True
        if key in ("f", "finish"):
            return daemon.wait(daemon.post(links["finish"])), True
        if key:
            typer.echo(KEYS, err=True)
            return None, False
        run = daemon.post(links["stations"])
    except ClientError as refused:
        if daemon.get(links["self"])["over"]:
            raise
        print_error(f"not taken: {refused.what}: {refused.fix}")
        return None, False
    planned, number = run["planning"], sum(name.startswith("frame ") for name in run["links"])
    known = planned["predicted"] or "not yet determined"
    typer.echo(f"picture {number} taken. {known}\n  next: {planned['advice']}", err=True)
    return run, False
