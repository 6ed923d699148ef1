"""`handeyed profiles ...`: calibrate a line profiler from a folder of sweeps, and put sweeps into the base frame."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput
from daemon.cli.output import CommandGroup, Json, new_calibration, print_error, write_document

app = typer.Typer(
    name="profiles",
    cls=CommandGroup,
    no_args_is_help=True,
    help="Line profilers on the flange: calibrate one from sweeps, put sweeps into the base frame.",
)

WRITTEN = "File to write: .ply, .pcd, .las, .laz, .e57 (metres), .npy, .xyz, .csv or .bin."
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder with a profiles.json, its profiles and paths.")]


@app.command()
def calibrate(
    folder: Folder,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Also write calibration.json here.")] = None,
    rough: Annotated[
        Path | None, typer.Option(help="calibration.json with a rough flange_T_camera; else it is searched.")
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(metavar="MM", help="Accept up to this U (k = 2) at the worst point.")
    ] = None,
    artefact: Annotated[
        str | None,
        typer.Option(help="Of profiles taken standing, a file each beside poses.csv: sphere:RADIUS_MM, plane or edge."),
    ] = None,
    convention: Annotated[str | None, typer.Option(help="Of poses.csv, where its names leave it open.")] = None,
    json: Json = False,
) -> None:
    """Find the profiler on the flange and the offset of its clock, from sweeps over a sphere or over planes.

    With --artefact from one profile at each of 12 poses or more. An edge has the same face on the left in all of them.

    flange_T_camera is the profiler's frame: x along the laser line, z along the light, y = 0 the laser plane.

    Exit status: 0 accepted, 3 not accepted (see the findings), 2 unreadable input.
    """
    from calibration.documents.calibration_text import summary
    from daemon.cli.compare import read_calibration
    from daemon.cli.solve import requirement_of
    from extensions.sweeps.mathematics.folder import read_profile_folder
    from extensions.sweeps.mathematics.profiler import ArtefactSweep, solve_profiler
    from extensions.sweeps.mathematics.standing import read_standing_profiles
    from registration.calibrate.outcome import judge_scan

    limits, _ = requirement_of(tolerance, None)
    first = None if rough is None else read_calibration(rough).flange_T_camera
    if artefact is not None:
        sweeps = read_standing_profiles(folder, artefact, convention)
    else:
        sweeps = [
            ArtefactSweep(*sweep.read(), sweep.artefact, sweep.radius_mm)
            for sweep in read_profile_folder(folder)
            if sweep.artefact is not None
        ]
    solution = solve_profiler(sweeps, None if first is None else first.transform())
    document = new_calibration(solution, judge_scan(solution, limits))
    if out is not None:
        write_document(out, document)
    if json:
        typer.echo(document.model_dump_json())
    else:
        typer.echo(summary(str(folder), document))
        if document.clock_offset is not None:
            typer.echo(
                f"  clock: robot minus sensor {document.clock_offset.offset_s * 1e3:+.2f} ms"
                f" +- {document.clock_offset.sigma_s * 1e3:.2f} ms"
            )
    raise typer.Exit(ExitStatus.OK if document.verdict.accepted else ExitStatus.NOT_ACCEPTED)


@app.command()
def register(
    folder: Folder,
    calibration: Annotated[Path, typer.Option(help="calibration.json of `handeyed profiles calibrate`.")],
    out: Annotated[Path, typer.Option("--out", "-o", help=WRITTEN)],
    json: Json = False,
) -> None:
    """Put all sweeps of a folder into the robot's base frame, in mm, and write them as one cloud.

    Exit status: 0 done, 3 done with a calibration that was not accepted, 2 unreadable input.
    """
    from daemon.cli.compare import read_calibration
    from extensions.sweeps.mathematics.assembler import assemble_sweep
    from extensions.sweeps.mathematics.folder import read_profile_folder
    from registration.io.writing import new_cloud
    from registration.points.layout import XYZ_FLOAT32

    document, sweeps = read_calibration(calibration), read_profile_folder(folder)
    if document.flange_T_camera is None or document.clock_offset is None:
        what = "it has no flange_T_camera with a clock_offset"
        fix = "use a calibration.json of handeyed profiles calibrate"
        raise UnreadableInput(str(calibration), what, fix)
    x, offset_s, profiles = document.flange_T_camera.transform(), document.clock_offset.offset_s, 0
    with new_cloud(out, XYZ_FLOAT32, calibration_id=document.id) as cloud:
        for sweep in sweeps:
            block, path = sweep.read()
            profiles += len(block)
            for points in assemble_sweep(block, path, x, offset_s):
                cloud.write(points.view(XYZ_FLOAT32.dtype)[:, 0])
    if json:
        from json import dumps

        typer.echo(dumps({"sweeps": len(sweeps), "profiles": profiles, "points": cloud.points, "out": str(out)}))
    else:
        typer.echo(f"{out}: {cloud.points:,} points of {profiles:,} profiles, {len(sweeps)} sweeps, base frame, mm")
    if not document.verdict.accepted:
        print_error(f"{calibration}: verdict: this calibration was not accepted: calibrate again, and register anew")
    raise typer.Exit(ExitStatus.OK if document.verdict.accepted else ExitStatus.NOT_ACCEPTED)
