"""`handeyed register SCAN_DIR`: the clouds of a part, in the robot's base frame, as one."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import ExitStatus
from daemon.cli.output import Json

if TYPE_CHECKING:
    from daemon.scan_folder import RegistrationDocument


def register(
    folder: Annotated[Path, typer.Argument(metavar="SCAN_DIR", help="Folder with a scan.json and its clouds.")],
    calibration: Annotated[Path, typer.Option(help="calibration.json, eye-in-hand.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .ply, .pcd, .npy, .xyz, .csv or .bin.")],
    json: Json = False,
) -> None:
    """Put every cloud of a scan into the robot's base frame, in mm, and write them as one.

    Exit status: 0 done, 3 done with a calibration that was not accepted, 2 unreadable input.
    """
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.validation import parse_document
    from daemon.scan_folder import open_scan, register_plainly
    from daemon.session_folder import read_bytes

    document = parse_document(CalibrationDocument, read_bytes(calibration), str(calibration))
    report = register_plainly(open_scan(folder), document, out)
    typer.echo(report.model_dump_json() if json else _told(report, out))
    raise typer.Exit(ExitStatus.OK if report.verdict.accepted else ExitStatus.NOT_ACCEPTED)


def _told(report: "RegistrationDocument", out: Path) -> str:
    from daemon.cli.summary import finding_line

    lines = [f"{out}: {report.points:,} points of {len(report.views)} views, base frame, mm"]
    lines += [f"  {view.cloud:<24}{view.points:>12,} points" for view in report.views]
    return "\n".join([*lines, *(f"  {finding_line(finding)}" for finding in report.verdict.findings)])
