"""`handeyed solve --arm NAME`: the errors of the arm as built, from the joints of sessions."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import write_document

if TYPE_CHECKING:
    from calibration.problem import Problem

ARM_FILE = "arm.json"


def solve_arm(name: str, problems: "Sequence[Problem]", folder: Path | None, *, json: bool) -> None:
    """Print the arm's errors, and write them as arm.json into `folder`. Raises CommandError."""
    from calibration.documents.arm import arm_document, arm_summary
    from calibration.errors import CalibrationError
    from calibration.kinematics.abb_arms import find_arm
    from calibration.solve import identify_arm_session
    from daemon.runtime.clock import Clock
    from daemon.runtime.version import SOFTWARE

    if any(problem.in_space for problem in problems):
        raise CommandError("--arm", "it is for images only", "leave it out", ExitStatus.UNREADABLE)
    try:
        fit = identify_arm_session(find_arm(name), problems)
    except CalibrationError as error:
        raise CommandError("--arm", str(error), "no arm.json is written", ExitStatus.UNREADABLE) from None
    document = arm_document(fit, problems, created_at=Clock().timestamp(), software=SOFTWARE)
    typer.echo(document.model_dump_json() if json else arm_summary(document))
    if folder is not None:
        write_document(folder / ARM_FILE, document)
