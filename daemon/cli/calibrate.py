"""`handeyed calibrate`: ask the daemon for a calibration, and follow it."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import Json

Url = Annotated[str, typer.Option("--url", envvar="HANDEYED_URL", help="Where the daemon listens.")]


def calibrate(
    url: Url = "http://127.0.0.1:8372",
    count: Annotated[int | None, typer.Option(help="How many poses; the settings' number by default.")] = None,
    uncertainty: Annotated[
        float | None,
        typer.Option(metavar="MM", help="Stop when a mapped point is known as well as this (one sigma, mm)."),
    ] = None,
    manual: Annotated[
        bool, typer.Option("--manual", help="You jog the arm and take each view with Enter; nothing else moves it.")
    ] = False,
    request: Annotated[
        Path | None, typer.Option("--request", help="A JSON file with the whole request: poses, count, target.")
    ] = None,
    apply: Annotated[bool, typer.Option("--apply", help="Put it in force when the verdict accepts it.")] = False,
    json: Json = False,
) -> None:
    """Let the daemon calibrate: THE ROBOT MOVES. Shows progress, then the verdict. Ctrl-C stops the arm.

    With --manual you move it: after each view you are told what to turn next, and what that will give.

    Exit status: 0 accepted, 3 solved or refused but not accepted, 1 the run failed.
    """
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.calibration_text import summary
    from daemon.cli.manual import by_hand
    from daemon.cli.rest_client import DaemonClient

    body = _body(request, count, uncertainty, manual)
    with DaemonClient(url) as daemon:
        run = by_hand(daemon, body) if body.get("manual") else daemon.run("/calibrate", body, _tell)
        if run["state"] != "finished":
            cause = run["cause"] or {"what": f"the run was {run['state']}", "fix": "start it again"}
            raise CommandError(f"{daemon.url}/runs/{run['id']}", cause["what"], cause["fix"])
        document = CalibrationDocument.model_validate(daemon.get(f"/calibrations/{run['result']['calibration_id']}"))
        applied = run["result"]["applied"]
        if apply and document.verdict.accepted and not applied:
            daemon.post(f"/calibrations/{document.id}/apply", {"applied_by": "handeyed calibrate"})
            applied = True
    typer.echo(document.model_dump_json() if json else summary(f"calibration {document.id}", document))
    if not json:
        typer.echo(f"  {'in force now' if applied else f'not in force: POST {url}/calibrations/{document.id}/apply'}")
    raise typer.Exit(ExitStatus.OK if document.verdict.accepted else ExitStatus.NOT_ACCEPTED)


def _body(request: Path | None, count: int | None, uncertainty: float | None, manual: bool) -> dict[str, Any]:
    from calibration.documents.validation import parse_document
    from daemon.model.requests import CalibrateRequest
    from daemon.sessions.session_reader import read_bytes

    body: dict[str, Any] = {}
    if request is not None:
        body = parse_document(CalibrateRequest, read_bytes(request), str(request)).model_dump(
            mode="json", exclude_none=True
        )
    given = {"count": count, "uncertainty_mm": uncertainty, "manual": manual or None}
    return body | {name: value for name, value in given.items() if value is not None}


def _tell(event: dict[str, Any]) -> None:
    """One line that is rewritten on a terminal; silence elsewhere, where nobody watches."""
    if not sys.stderr.isatty():
        return
    line = f"station {min(event['station'] + 1, event['stations'])} of {event['stations']}: {event['state']}"
    from daemon.cli.rest_client import OVER

    over = event["state"] in OVER
    typer.echo(f"\r\033[K{'' if over else line}", nl=False, err=True)
