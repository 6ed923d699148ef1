"""`handeyed calibrate --manual`: Enter takes a view, f finishes, q gives up; after each view the next is advised."""

import sys
from typing import Any

import typer

from daemon.cli.errors import CommandError
from daemon.cli.output import error_line
from daemon.cli.rest_client import DaemonClient, interrupts_deferred

KEYS = "Enter: take a view   f Enter: finish and solve   q Enter: give up"
BEGIN = "jog the arm to where the camera sees the whole target and let it stand; nothing here moves it"
LOOK_S = 20


def by_hand(daemon: DaemonClient, body: dict[str, Any]) -> Any:
    """The finished run. Raises CommandError when it cannot begin, or has ended meanwhile."""
    with interrupts_deferred():
        run = daemon.post("/calibrate", body)
    links, ended = run["links"], False
    _say(f"run {run['id']}: {BEGIN}\n{KEYS}")
    try:
        while not ended:
            run, ended = _obeyed(daemon, links, _key())
    except (KeyboardInterrupt, SystemExit, CommandError):
        if not daemon.get(links["self"])["over"]:
            daemon.post(links["abort"])
        raise
    return run


def _obeyed(daemon: DaemonClient, links: dict[str, str], key: str) -> tuple[Any, bool]:
    """The run, and whether it is over. What the daemon refuses is told, and asked for again."""
    try:
        if key in ("q", "quit"):
            return daemon.post(links["abort"]), True
        if key in ("f", "finish"):
            return _over(daemon, daemon.post(links["finish"])), True
        if key:
            _say(KEYS)
            return None, False
        run = daemon.post(links["stations"])
    except CommandError as refused:
        if daemon.get(links["self"])["over"]:
            raise
        error_line(f"not taken: {refused.what}: {refused.fix}")
        return None, False
    planning = run["planning"]
    _say(f"view {run['station']} taken. {planning['predicted'] or 'not yet determined'}\n  next: {planning['advice']}")
    return run, False


def _over(daemon: DaemonClient, run: Any) -> Any:
    """The run when it has ended."""
    while not run["over"]:
        run = daemon.get(f"/runs/{run['id']}?wait={LOOK_S}")
    return run


def _key() -> str:
    """What was typed before Enter; giving up when nobody can type any more."""
    line = sys.stdin.readline()
    return line.strip().lower() if line else "q"


def _say(text: str) -> None:
    """To the person who jogs: standard error, so that the answer alone is on standard output."""
    typer.echo(text, err=True)
