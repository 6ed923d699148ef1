"""`handeyed register SCAN_DIR`: merge the clouds of a part in the robot's base frame."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput
from daemon.cli.output import ArmErrors, ArmTemperature, Json, Refine, print_error, writing

if TYPE_CHECKING:
    from registration.documents import RegistrationReportDocument
    from registration.fusion.merging import Outliers


def register(
    folder: Annotated[Path, typer.Argument(metavar="SCAN_DIR", help="Folder with a scan.json and its clouds.")],
    calibration: Annotated[Path, typer.Option(help="calibration.json, eye-in-hand.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="File to write: .ply, .pcd, .las, .laz, .e57 (metres), .npy, .xyz, .csv or .bin."
        ),
    ],
    refine: Refine = False,
    voxel_mm: Annotated[float | None, typer.Option(help="Average the points of each cell of this size.")] = None,
    normals: Annotated[bool, typer.Option("--normals", help="Estimate normals where the clouds have none.")] = False,
    outliers: Annotated[
        str, typer.Option(help="Isolated points: keep, or remove by 'statistical' or 'radius'.")
    ] = "keep",
    views: Annotated[Path | None, typer.Option(help="Also write each view to this folder.")] = None,
    arm: ArmErrors = None,
    arm_temperature: ArmTemperature = None,
    force: Annotated[bool, typer.Option("--force", help="Register clouds whose unit cannot be, too.")] = False,
    json: Json = False,
) -> None:
    """Put every cloud of a scan into the robot's base frame, in mm, and write them as one.

    Exit status: 0 done, 3 done but not accepted (see the findings), 2 unreadable input.
    """
    from calibration.errors import CalibrationError
    from daemon.cli.arm_file import read_in_use
    from daemon.cli.compare import read_calibration
    from registration.fusion.merging import Merge
    from registration.scan import scanner_mount_of
    from registration.scan_folder import place_views, read_scan, register_scan

    document = read_calibration(calibration)
    merge = Merge(voxel_mm, normals, cast("Outliers", outliers))
    if views is not None:
        with writing(views, "check path and rights"):
            views.mkdir(parents=True, exist_ok=True)
    given = read_in_use(document, arm, arm_temperature)
    scanned = read_scan(folder)
    try:
        views_in_use = place_views(given, scanned)
    except CalibrationError as error:
        if arm is None:
            raise
        raise UnreadableInput(str(arm), str(error), "correct the joints, or register without --arm") from None
    report = register_scan(
        views_in_use,
        scanner_mount_of(given.document),
        out,
        time.perf_counter,
        refine=refine,
        merge=merge,
        views_out=views,
        further=given.findings([view.stance for view in scanned]),
        force=force,
    )
    typer.echo(report.model_dump_json() if json else _summary(report, out))
    if not document.verdict.accepted:
        print_error(f"{calibration}: verdict: this calibration was not accepted: calibrate again, and register anew")
    accepted = report.verdict.accepted and document.verdict.accepted
    raise typer.Exit(ExitStatus.OK if accepted else ExitStatus.NOT_ACCEPTED)


def _summary(report: "RegistrationReportDocument", out: Path) -> str:
    from calibration.documents.calibration_text import finding_line

    lines = [f"{out}: {report.points:,} points of {len(report.views)} views, base frame, mm"]
    before, after = report.rms_mm.before, report.rms_mm.after
    if before is not None:
        fitted = "" if after is None else f", {after:.3f} mm after refinement"
        lines.append(f"  between overlapping views {before:.3f} mm RMS by the robot's poses{fitted}")
    for view in report.views:
        deviation = "" if view.rms_mm is None else f"{view.rms_mm:8.3f} mm RMS"
        lines.append(f"  {view.cloud:<24}{view.points:>12,} points{view.overlap:6.0%} overlap{deviation}")
    return "\n".join([*lines, *(f"  {finding_line(finding)}" for finding in report.verdict.findings)])
