"""`--arm FILE`: a calibration with the errors of its arm."""

from pathlib import Path
from typing import TYPE_CHECKING

from daemon.cli.errors import UnreadableInput

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.calibration_in_use import CalibrationInUse


def read_in_use(
    calibration: "CalibrationDocument", file: Path | None, temperature_c: float | None
) -> "CalibrationInUse":
    """The calibration, with arm.json in `file`, if any; the arm's links at `temperature_c`, where that is known.

    Raises DocumentError; CommandError for one of another set-up, and one whose parameters are damaged.
    """
    from calibration.documents.arm import ArmErrorsDocument
    from calibration.documents.calibration_in_use import CalibrationInUse
    from calibration.errors import CalibrationError
    from calibration.kinematics.arm_conditions import ArmConditions
    from daemon.runtime.bounded_read import read_as

    if file is None:
        return CalibrationInUse(calibration)
    errors = read_as(ArmErrorsDocument, file)
    if errors.setup != calibration.setup:
        what = f"it is of an {errors.setup} cell, the calibration of an {calibration.setup} one"
        raise UnreadableInput(str(file), what, "name the arm.json of the same session")
    try:
        return CalibrationInUse.of(calibration, errors, ArmConditions(temperature_c=temperature_c))
    except CalibrationError as error:
        raise UnreadableInput(str(file), str(error), "identify the arm again") from None
