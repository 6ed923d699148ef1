"""`handeyed stitch SCAN_DIR`: the gap between views of one surface or edge, as a number."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import ExitStatus, require_finite
from daemon.cli.output import ArmErrors, ArmTemperature, Json

if TYPE_CHECKING:
    from registration.scan_folder import StitchedPairDocument

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
    from daemon.cli.arm_file import read_in_use
    from daemon.cli.compare import read_calibration
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
