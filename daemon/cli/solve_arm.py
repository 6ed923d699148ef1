"""`handeyed solve --arm NAME`: the errors of the arm as built, from the joints of sessions."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import write_document

if TYPE_CHECKING:
    from calibration.problem import Problem
    from calibration.solver.arm_session import KnownDistance
    from calibration.transforms import Array
    from daemon.sessions.session_reader import SessionFolder

ARM_FILE = "arm.json"


def known_distances(sessions: "Sequence[SessionFolder]") -> "list[KnownDistance]":
    """What the sessions state of the target's places, counted as they are. Raises CommandError for another session."""
    from calibration.solver.arm_session import KnownDistance

    names, found = [session.path.resolve().name for session in sessions], []
    for place, session in enumerate(sessions):
        for row, known in enumerate(session.document.distances):
            if names.count(known.to) != 1 or known.to == names[place]:
                what = f"distances[{row}].to: {known.to!r} is not the name of one other folder of the command"
                raise CommandError(str(session.file), what, "name that folder, too", ExitStatus.UNREADABLE)
            found.append(KnownDistance(place, names.index(known.to), known.distance_mm, known.sigma_mm))
    return found


def solve_arm(
    name: str,
    problems: "Sequence[Problem]",
    folder: Path | None,
    box_mm: "Array | None",
    distances: "Sequence[KnownDistance]",
    *,
    json: bool,
) -> None:
    """Print the arm's errors, and write them as arm.json into `folder`. Raises CommandError.

    `box_mm` (2, 3) of the base: where the gain of more views is predicted. `distances`: between the places.
    """
    from calibration.documents.arm import arm_summary
    from calibration.documents.identified_arm import identify_arm_document
    from calibration.errors import CalibrationError
    from calibration.kinematics.abb_arms import find_arm
    from daemon.runtime.clock import Clock
    from daemon.runtime.version import SOFTWARE

    try:
        arm, created_at = find_arm(name), Clock().timestamp()
        document = identify_arm_document(
            arm, problems, created_at=created_at, software=SOFTWARE, box_mm=box_mm, distances=distances
        )
    except CalibrationError as error:
        raise CommandError("--arm", str(error), "no arm.json is written", ExitStatus.UNREADABLE) from None
    typer.echo(document.model_dump_json() if json else arm_summary(document))
    if folder is not None:
        write_document(folder / ARM_FILE, document)
