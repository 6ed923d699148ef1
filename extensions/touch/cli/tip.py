"""`handeyed tip FILE`: the tip of a tool from poses in which it touches one fixed point."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import Json, write_document

if TYPE_CHECKING:
    from calibration.documents.imports.pose_table import PoseTable
    from extensions.touch.mathematics.pivot_calibration import TipCalibration

FEWER = 3.0
"""A reading of the numbers is decided by the poses when all others scatter this many times as much."""

SAME_MM = 1e-3
"""Tips nearer to each other are one place."""


def tip(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Poses of the flange: CSV, JSON, RAPID, ...")],
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE", help="tip.json to write.")] = None,
    convention: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of orientations, as of import; else the one that fits.")
    ] = None,
    unit: Annotated[Literal["m", "mm"] | None, typer.Option(help="Of the poses; else by their size.")] = None,
    json: Json = False,
) -> None:
    """Calibrate the tip of a tool: turn the flange about it, the tip always at one fixed point, from four poses on.

    FILE has the poses of the flange (tool0), as every file of `handeyed import`.

    Exit status: 0 done, 1 the poses are too few or turn too little, 2 unreadable input.
    """
    from calibration.documents.imports.pose_files import read_poses
    from daemon.runtime.bounded_read import read_document
    from extensions.touch.mathematics.pivot_calibration import tip_document, tip_text

    table = read_poses(str(file), read_document(file))
    document = tip_document(_calibrate(table, convention, unit), table.labels)
    typer.echo(document.model_dump_json() if json else tip_text(document))
    if out is not None:
        write_document(out, document)


def _calibrate(table: "PoseTable", convention: str | None, unit: Literal["m", "mm"] | None) -> "TipCalibration":
    """By the reading of the numbers that makes them poses about one point. Raises CommandError, UndeterminedError."""
    from calibration.documents.imports.pose_table import find_conventions
    from calibration.errors import CalibrationError, GeometryError
    from extensions.touch.mathematics.pivot_calibration import calibrate_tip

    try:
        named, unit_of_brand = (table.conventions(), None) if convention is None else find_conventions(convention)
    except GeometryError as error:
        fix = "give a brand or a name of docs/formats.md#conventions"
        raise UnreadableInput("--convention", str(error), fix) from None
    stated = unit or unit_of_brand
    read: list[tuple[TipCalibration, str]] = []
    refused: CalibrationError | None = None
    for one in named:
        for length in (stated,) if stated else table.units():
            try:
                read.append((calibrate_tip(table.poses(one, length, "base_T_flange")), f"{one.name} in {length}"))
            except CalibrationError as error:
                refused = refused or error
    if not read:
        raise refused or UnreadableInput(table.origin, "no convention fits it", "give --convention")
    read.sort(key=lambda one: one[0].sigma_mm)
    best = read[0][0]
    rivals = [
        words for found, words in read[1:]
        if found.sigma_mm < FEWER * best.sigma_mm and abs(found.flange_tip_mm - best.flange_tip_mm).max() >= SAME_MM
    ]  # fmt: skip
    if rivals:
        what = f"the poses fit as {read[0][1]} and as {', '.join(rivals)}"
        raise UnreadableInput(table.origin, what, "give --convention and --unit")
    return best
