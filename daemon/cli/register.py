"""`handeyed register`, `stitch` and `register-archive`: the clouds of scans in the robot's base frame."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput, require_finite
from daemon.cli.output import ArmErrors, ArmTemperature, Json, Refine, print_error, progress_bar, writing

if TYPE_CHECKING:
    from daemon.tools.batch_registration.archive_run import FinishedScans
    from daemon.tools.batch_registration.tasks import RegistrationTask
    from registration.documents import RegistrationReportDocument
    from registration.fusion.merging import Outliers
    from registration.fusion.stitching import StitchedPairDocument


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
    from daemon.cli.compare import read_calibration, read_in_use
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


SHOWN = ("nothing", "a plane", "an edge", "all directions")


def stitch(
    folder: Annotated[Path, typer.Argument(metavar="SCAN_DIR", help="Folder with a scan.json and its clouds.")],
    calibration: Annotated[Path, typer.Option(help="calibration.json, eye-in-hand.")],
    tolerance_mm: Annotated[float | None, typer.Option(min=1e-6, help="Largest gap and shift accepted, mm.")] = None,
    reach_mm: Annotated[
        float | None, typer.Option(min=1e-3, max=1e4, help="Largest gap looked for; by default 4 mm or 4 spacings.")
    ] = None,
    arm: ArmErrors = None,
    arm_temperature: ArmTemperature = None,
    json: Json = False,
) -> None:
    """Measure how far the views of a scan lie apart where they overlap, placed by robot and calibration alone.

    Exit status: 0 measured and within --tolerance-mm, 3 beyond it, 2 unreadable input or no views overlap.
    """
    from daemon.cli.compare import read_calibration, read_in_use
    from registration.scan import scanner_mount_of
    from registration.scan_folder import place_views, read_scan, stitch_views

    require_finite(tolerance_mm=tolerance_mm, reach_mm=reach_mm, arm_temperature=arm_temperature)
    given = read_in_use(read_calibration(calibration), arm, arm_temperature)
    found = stitch_views(place_views(given, read_scan(folder)), scanner_mount_of(given.document), reach_mm)
    typer.echo(found.model_dump_json() if json else "\n".join(map(_line, found.pairs)))
    within = tolerance_mm is None or found.largest_mm <= tolerance_mm
    raise typer.Exit(ExitStatus.OK if within else ExitStatus.NOT_ACCEPTED)


def _line(pair: "StitchedPairDocument") -> str:
    a, b = pair.views
    x, y, z = pair.base_offset_mm
    return (
        f"views {a + 1} and {b + 1}: gap {pair.gap_mm:+.3f} mm (95 % within {pair.width_mm:.3f} mm),"
        f" shift ({x:+.3f}, {y:+.3f}, {z:+.3f}) mm shown by {SHOWN[len(pair.directions)]}, {pair.overlap:.0%} overlap"
    )


def register_archive(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder or URL; every folder below with a scan.json.")],
    calibration: Annotated[Path, typer.Option(help="calibration.json, eye-in-hand.")],
    out: Annotated[str, typer.Option("--out", "-o", help="Folder or URL for NAME/merged.ply, report, manifest.")],
    scheduler: Annotated[
        str, typer.Option(help="local, here (this process), or a Dask scheduler: tcp://...")
    ] = "local",
    workers: Annotated[int, typer.Option(min=1, max=256, help="Worker processes of --scheduler local.")] = 2,
    refine: Refine = False,
    voxel_mm: Annotated[float | None, typer.Option(help="Average the points of each cell of this size.")] = None,
    arm: ArmErrors = None,
    force: Annotated[bool, typer.Option("--force", help="Register clouds whose unit cannot be, too.")] = False,
    json: Json = False,
) -> None:
    """Register every scan of an archive; finished scans are skipped.

    Exit status: 0 all done, 3 done but some not accepted, 2 some could not be read (they are named).
    """
    from daemon.tools.batch_registration.archive_run import open_executor

    tasks, finished = _tasks(folder, calibration, out, arm, {"refine": refine, "voxel_mm": voxel_mm, "force": force})
    outcomes = []
    with open_executor(scheduler, workers) as run, progress_bar(folder) as progress:
        for outcome in finished.run(tasks, run):
            outcomes.append(outcome)
            progress(len(outcomes), len(tasks))
            if outcome.error is not None:
                print_error(f"{folder}: {outcome.scan or '.'}: {outcome.error}")
    outcomes.sort(key=lambda each: each.scan)
    counts = {state: sum(each.state == state for each in outcomes) for state in ("registered", "unchanged", "failed")}
    numbers = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    points = sum(each.points for each in outcomes)
    totals = f"{out}: {len(outcomes)} scans ({numbers}), {points:,} points in the base frame, mm"
    typer.echo("\n".join(one.model_dump_json() for one in outcomes) if json else totals)
    if counts["failed"]:
        raise typer.Exit(ExitStatus.UNREADABLE)
    raise typer.Exit(ExitStatus.OK if all(each.accepted for each in outcomes) else ExitStatus.NOT_ACCEPTED)


def _tasks(
    folder: str, calibration: Path, out: str, arm: Path | None, how: dict[str, Any]
) -> "tuple[list[RegistrationTask], FinishedScans]":
    from daemon.cli.compare import read_calibration, read_in_use
    from daemon.runtime.bounded_read import read_document
    from daemon.tools.batch_registration.archive_run import FinishedScans
    from daemon.tools.batch_registration.remote_folder import RemoteFolder
    from daemon.tools.batch_registration.tasks import SCAN, RegistrationTask
    from registration.scan import scanner_mount_of

    content = read_document(calibration)
    given = read_in_use(read_calibration(calibration), arm, None)
    scanner_mount_of(given.document)
    errors = None if arm is None else read_document(arm).decode()
    source, target = RemoteFolder.from_url(folder), RemoteFolder.from_url(out)
    listed = source.list_marks()
    scans = sorted(scan for scan, files in listed.items() if SCAN in files)
    if not scans:
        raise UnreadableInput(folder, f"no folder below holds a {SCAN}", "name another folder")
    tasks = [RegistrationTask(source.url, target.url, scan, content.decode(), arm=errors, **how) for scan in scans]
    return tasks, FinishedScans(target, listed)
