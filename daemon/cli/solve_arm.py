"""`handeyed solve --arm NAME`: the errors of the arm as built, from the joints of sessions."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import write_document

if TYPE_CHECKING:
    from calibration.problem import Problem
    from calibration.transforms import Array

ARM_FILE = "arm.json"


def solve_arm(
    name: str, problems: "Sequence[Problem]", folder: Path | None, box_mm: "Array | None", *, json: bool
) -> None:
    """Print the arm's errors, and write them as arm.json into `folder`. Raises CommandError.

    `box_mm` (2, 3) of the base: where the gain of more views is predicted.
    """
    from calibration.documents.arm import arm_summary
    from calibration.documents.identified_arm import identify_arm_document
    from calibration.errors import CalibrationError
    from calibration.kinematics.abb_arms import find_arm
    from daemon.runtime.clock import Clock
    from daemon.runtime.version import SOFTWARE

    try:
        arm, created_at = find_arm(name), Clock().timestamp()
        document = identify_arm_document(arm, problems, created_at=created_at, software=SOFTWARE, box_mm=box_mm)
    except CalibrationError as error:
        raise CommandError("--arm", str(error), "no arm.json is written", ExitStatus.UNREADABLE) from None
    typer.echo(document.model_dump_json() if json else arm_summary(document))
    if folder is not None:
        write_document(folder / ARM_FILE, document)
