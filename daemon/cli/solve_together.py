"""`handeyed solve --together`: cameras and scanners on one mount, solved together."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import write_document

if TYPE_CHECKING:
    from calibration.problem import Problem
    from calibration.solution import Solution

FILE = "rig.json"


def solve_together(
    solved: "list[tuple[Path, Problem, Solution]]", tolerance_mm: float, out: Path | None, *, json: bool
) -> bool:
    """Print the joint solution of the folders, write rig.json into `out`; returns whether it is accepted.

    Raises CommandError, CalibrationError.
    """
    from calibration.documents.rig import rig_document, rig_text
    from calibration.errors import GeometryError, UndeterminedError
    from calibration.solve import solve_rig

    names = [folder.resolve().name for folder, _, _ in solved]
    if len(set(names)) < len(names):
        repeated = "two folders have the same name"
        raise CommandError("--together", repeated, "name each after its sensor", ExitStatus.UNREADABLE)
    sessions = dict(zip(names, solved, strict=True))
    try:
        rig = solve_rig({name: problem for name, (_, problem, _) in sessions.items()})
    except UndeterminedError as error:
        raise CommandError("--together", error.what, error.fix, ExitStatus.NOT_ACCEPTED) from None
    except GeometryError as error:
        raise CommandError("--together", str(error), "check the sessions", ExitStatus.UNREADABLE) from None
    document = rig_document(rig, {name: solution for name, (_, _, solution) in sessions.items()}, tolerance_mm)
    typer.echo(document.model_dump_json() if json else rig_text(document))
    if out is not None:
        write_document(out / FILE, document)
    return document.verdict.accepted
