"""`handeyed calibrate --manual`: Enter takes a view, f finishes, q aborts; after each view the next pose is advised."""

import sys
from typing import Any

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import print_error
from daemon.cli.rest_client import DaemonClient, defer_interrupts

KEYS = "Enter: take a view   f Enter: finish and solve   q Enter: give up"
BEGIN = "jog the arm to where the camera sees the whole target and let it stand; nothing here moves it"
POLL_S = 20


def calibrate_manually(daemon: DaemonClient, body: dict[str, Any]) -> Any:
    """Run a manual calibration to its end; returns the run. Raises CommandError."""
    with defer_interrupts():
        run = daemon.post("/calibrate", body)
    links, ended = run["links"], False
    _print_aside(f"run {run['id']}: {BEGIN}\n{KEYS}")
    try:
        while not ended:
            run, ended = _handle_key(daemon, links, _read_key())
    except (KeyboardInterrupt, SystemExit, CommandError):
        if not daemon.get(links["self"])["over"]:
            daemon.post(links["abort"])
        raise
    return run


def _handle_key(daemon: DaemonClient, links: dict[str, str], key: str) -> tuple[Any, bool]:
    """Carry out one key; returns the run and whether it is over. A refusal of the daemon is printed."""
    try:
        if key in ("q", "quit"):
            return daemon.post(links["abort"]), True
        if key in ("f", "finish"):
            return _wait_until_over(daemon, daemon.post(links["finish"])), True
        if key:
            _print_aside(KEYS)
            return None, False
        run = daemon.post(links["stations"])
    except CommandError as refused:
        if daemon.get(links["self"])["over"]:
            raise
        print_error(f"not taken: {refused.what}: {refused.fix}")
        return None, False
    planning = run["planning"]
    _print_aside(
        f"view {run['station']} taken. {planning['predicted'] or 'not yet determined'}\n  next: {planning['advice']}"
    )
    return run, False


def _wait_until_over(daemon: DaemonClient, run: Any) -> Any:
    """Wait for the end of the run; returns it."""
    while not run["over"]:
        run = daemon.get(f"/runs/{run['id']}?wait={POLL_S}")
    return run


def _read_key() -> str:
    """Read a line from standard input; "q" at its end."""
    line = sys.stdin.readline()
    return line.strip().lower() if line else "q"


def _print_aside(text: str) -> None:
    """Print to standard error: only the result goes to standard output."""
    typer.echo(text, err=True)
