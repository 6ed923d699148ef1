"""`handeyed calibrate`: start a calibration through the daemon, and follow it."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from daemon.cli.errors import ExitStatus
from daemon.cli.output import Json

Url = Annotated[str, typer.Option("--url", envvar="HANDEYED_URL", help="Where the daemon listens.")]


def calibrate(
    url: Url = "http://127.0.0.1:8372",
    count: Annotated[int | None, typer.Option(help="How many poses; the settings' number by default.")] = None,
    uncertainty: Annotated[
        float | None,
        typer.Option(metavar="MM", help="Stop when a measured point is known as well as this (one sigma, mm)."),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(metavar="MM", help="Stop at, and accept up to, this U (k = 2) at the worst point.")
    ] = None,
    manual: Annotated[
        bool, typer.Option("--manual", help="You jog the arm and take each picture with Enter; nothing else moves it.")
    ] = False,
    arm: Annotated[
        bool | None,
        typer.Option("--arm/--no-arm", help="Identify the errors of the arm as built, too; else as the settings say."),
    ] = None,
    request: Annotated[
        Path | None, typer.Option("--request", help="A JSON file with the whole request: poses, count, target.")
    ] = None,
    apply: Annotated[bool, typer.Option("--apply", help="Activate it when the verdict accepts it.")] = False,
    json: Json = False,
) -> None:
    """Calibrate through the daemon: THE ROBOT MOVES. Shows progress, then the verdict. Ctrl-C stops the arm.

    With --manual you move it: after each picture the command advises the next pose, and what it will bring.

    Exit status: 0 accepted, 3 solved or refused but not accepted, 1 the run failed.
    """
    from calibration.documents.calibration_text import summary
    from daemon.cli.manual import calibrate_manually
    from daemon.cli.rest_client import connect
    from daemon.model.requests import CalibrateRequest
    from daemon.runtime.bounded_read import read_as

    given = {"count": count, "uncertainty_mm": uncertainty, "tolerance_mm": tolerance}
    given |= {"manual": manual or None, "arm": arm}
    body: dict[str, Any] = {}
    if request is not None:
        body = read_as(CalibrateRequest, request).model_dump(mode="json", exclude_none=True)
    body |= {name: value for name, value in given.items() if value is not None}
    with connect(url) as daemon:
        run = (
            calibrate_manually(daemon, body)
            if body.get("manual")
            else daemon.follow("/calibrate", body, _show_progress)
        )
        result, document = daemon.require_finished(run), daemon.result(run)
        applied, why_not = result["applied"], result["not_applied"]
        if apply and document.verdict.accepted and not applied and not why_not:
            daemon.activate(document.id, by="handeyed calibrate")
            applied = True
    typer.echo(document.model_dump_json() if json else summary(f"calibration {document.id}", document))
    if not json:
        if why_not:
            typer.echo(f"  {why_not['message']}")
        typer.echo(f"  {'active now' if applied else f'not active: POST {url}/calibrations/{document.id}/apply'}")
    raise typer.Exit(ExitStatus.OK if document.verdict.accepted else ExitStatus.NOT_ACCEPTED)


def _show_progress(event: dict[str, Any]) -> None:
    """Rewrite one progress line on a terminal; print nothing elsewhere."""
    if not sys.stderr.isatty():
        return
    line = f"station {min(event['station'] + 1, event['stations'])} of {event['stations']}: {event['state']}"
    from daemon.model.run_states import FINAL_STATES

    over = event["state"] in FINAL_STATES
    typer.echo(f"\r\033[K{'' if over else line}", nl=False, err=True)
