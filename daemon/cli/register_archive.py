"""`handeyed register-archive DIR`: register every scan below a folder, on one machine or several."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput
from daemon.cli.output import ArmErrors, Json, Refine, print_error, progress_bar

if TYPE_CHECKING:
    from daemon.tools.batch_registration.archive_run import FinishedScans
    from daemon.tools.batch_registration.tasks import OutcomeDocument, RegistrationTask


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
    typer.echo("\n".join(one.model_dump_json() for one in outcomes) if json else _summary(out, outcomes))
    raise typer.Exit(_status(outcomes))


def _tasks(
    folder: str, calibration: Path, out: str, arm: Path | None, how: dict[str, Any]
) -> "tuple[list[RegistrationTask], FinishedScans]":
    from daemon.cli.arm_file import read_in_use
    from daemon.cli.compare import read_calibration
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


def _summary(out: str, outcomes: "list[OutcomeDocument]") -> str:
    points = sum(each.points for each in outcomes)
    counts = {state: sum(each.state == state for each in outcomes) for state in ("registered", "unchanged", "failed")}
    numbers = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    return f"{out}: {len(outcomes)} scans ({numbers}), {points:,} points in the base frame, mm"


def _status(outcomes: "list[OutcomeDocument]") -> ExitStatus:
    if any(each.state == "failed" for each in outcomes):
        return ExitStatus.UNREADABLE
    return ExitStatus.OK if all(each.accepted for each in outcomes) else ExitStatus.NOT_ACCEPTED
