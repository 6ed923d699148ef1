"""`handeyed solve --together`: several sensors on one mount from one estimate."""

import typer

from daemon.cli.errors import CommandError, ExitStatus, UnreadableInput
from daemon.cli.output import SolvedFolders, write_document


def solve_together(found: SolvedFolders) -> bool:
    """`--together`: print the joint solution, and write rig.json. Raises CommandError, CalibrationError."""
    from calibration.errors import GeometryError, UndeterminedError
    from extensions.rigs.mathematics.report import rig_document, rig_lines
    from extensions.rigs.mathematics.rig import solve_rig

    if len(found.solved) < max(len(found.folders), 2):
        raise UnreadableInput("--together", "it needs two folders with session.json", "name one for each sensor")
    names = [session.path.resolve().name for session, _, _ in found.solved]
    if len(set(names)) < len(names):
        repeated = "two folders have the same name"
        raise UnreadableInput("--together", repeated, "name each after its sensor")
    sessions = dict(zip(names, found.solved, strict=True))
    try:
        rig = solve_rig({name: problem for name, (_, problem, _) in sessions.items()})
    except UndeterminedError as error:
        raise CommandError("--together", error.what, error.fix, ExitStatus.NOT_ACCEPTED) from None
    except GeometryError as error:
        raise UnreadableInput("--together", str(error), "check the sessions") from None
    alone = {name: solution for name, (_, _, solution) in sessions.items()}
    document = rig_document(rig, alone, found.limits.tolerance_mm)
    typer.echo(document.model_dump_json() if found.json else "\n".join(rig_lines(document)))
    if found.out is not None:
        write_document(found.out / "rig.json", document)
    return document.verdict.accepted
