"""`handeyed verify-scanner SCAN`: probing and sphere-spacing errors from scans of a sphere or a ball bar."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import CommandError, ExitStatus, require_finite
from daemon.cli.output import Json

if TYPE_CHECKING:
    from daemon.model.requests import ArtefactRequest
    from daemon.scans.scanner_acceptance import AcceptanceDocument

MAX_EVALUATION_S = 600.0


def verify_scanner(
    scan: Annotated[str, typer.Argument(metavar="SCAN", help="Folder with a scan.json; with --url a scan's id.")],
    radius_mm: Annotated[float, typer.Option(min=1e-3, max=10_000, help="Calibrated radius of the sphere or spheres.")],
    spacing_mm: Annotated[
        float | None, typer.Option(min=1e-3, max=100_000, help="Calibrated distance of a ball bar's two centres.")
    ] = None,
    limit_mm: Annotated[
        float | None, typer.Option(min=1e-6, help="Largest error accepted of form, size and spacing, mm.")
    ] = None,
    url: Annotated[
        str | None, typer.Option(help="Let the daemon at this address evaluate its scan, and store the figures.")
    ] = None,
    json: Json = False,
) -> None:
    """Verify a scanner with a sphere or a ball bar; each view of the scan is one position of it.

    Based on VDI/VDE 2634-3 and ISO 10360-13. The daemon's figures are listed by GET /acceptances.

    Exit status: 0 evaluated and within --limit-mm, 3 beyond it, 2 unreadable input or not the sphere.
    """
    from daemon.model.requests import ArtefactRequest
    from daemon.scans.scanner_acceptance import assess_clouds
    from registration.scan_folder import read_scan

    require_finite(radius_mm=radius_mm, spacing_mm=spacing_mm, limit_mm=limit_mm)
    artefact = ArtefactRequest(radius_mm=radius_mm, spacing_mm=spacing_mm)
    if url is None:
        clouds = [(view.path, view.unit) for view in read_scan(Path(scan))]
        found = assess_clouds(Path(scan).resolve().name, clouds, artefact)
    else:
        found = _of_daemon(url, scan, artefact)
    typer.echo(found.model_dump_json() if json else _text(found))
    errors = (found.probing_form_mm, found.probing_size_mm, found.sphere_spacing_mm or 0.0)
    within = limit_mm is None or max(abs(error) for error in errors) <= limit_mm
    raise typer.Exit(ExitStatus.OK if within else ExitStatus.NOT_ACCEPTED)


def _of_daemon(url: str, scan_id: str, artefact: "ArtefactRequest") -> "AcceptanceDocument":
    from daemon.cli.rest_client import connect
    from daemon.scans.scanner_acceptance import AcceptanceDocument

    with connect(url, MAX_EVALUATION_S) as daemon:
        answer = daemon.post("/verify", {"scan_id": scan_id, "artefact": artefact.model_dump(exclude_none=True)})
    try:
        return AcceptanceDocument.model_validate(answer)
    except ValueError:
        raise CommandError(url, "its answer is no verification of a scanner", "is the daemon up to date?") from None


def _text(found: "AcceptanceDocument") -> str:
    spacing = "" if found.sphere_spacing_mm is None else f", sphere spacing {found.sphere_spacing_mm:+.4f} mm"
    lines = [
        f"probing error: form {found.probing_form_mm:.4f} mm, size {found.probing_size_mm:+.4f} mm{spacing}",
        f"  the largest of {len(found.positions)} positions, {found.based_on}",
    ]
    for position in found.positions:
        balls = "; ".join(f"form {ball.form_mm:.4f}, size {ball.size_mm:+.4f} mm" for ball in position.balls)
        apart = "" if position.spacing_error_mm is None else f"; spacing {position.spacing_error_mm:+.4f} mm"
        lines.append(f"  position {position.view + 1}: {balls}{apart}")
    return "\n".join(lines)
