"""`handeyed compare A B`: how far two calibrations are apart; and how commands read one, alone or with its arm."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput
from daemon.cli.output import Json

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.calibration_in_use import CalibrationInUse


DEFAULT_FALSE_ALARM = 0.01
"""As `calibration.monitoring.comparison.FALSE_ALARM_PROBABILITY`, which is not imported for a help text."""


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="calibration.json.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Another one of the same camera.")],
    false_alarm: Annotated[
        float,
        typer.Option(min=1e-12, max=0.5, help="Probability that two that agree are said to contradict each other."),
    ] = DEFAULT_FALSE_ALARM,
    json: Json = False,
) -> None:
    """Compare two calibrations: difference in mm and degrees, at the points that matter, and whether they agree.

    Exit status: 0 they agree, 3 they contradict each other or it is not known, 2 unreadable input.
    """
    from calibration.monitoring.comparison import compare as compare_documents
    from calibration.monitoring.comparison import comparison_text

    found = compare_documents(read_calibration(a), read_calibration(b), false_alarm)
    typer.echo(found.model_dump_json() if json else comparison_text(found))
    raise typer.Exit(ExitStatus.OK if found.agree else ExitStatus.NOT_ACCEPTED)


def read_calibration(file: Path) -> "CalibrationDocument":
    """Read calibration.json. Raises DocumentError."""
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.validation import parse_document
    from calibration.errors import DocumentError
    from daemon.runtime.bounded_read import read_document

    content = read_document(file)
    if b'"views"' in content and b'"verdict"' not in content:
        fix = f"solve it: handeyed solve {file.parent} --out calibration.json"
        raise DocumentError.one(str(file), "document", "this is a session, not its calibration", fix)
    return parse_document(CalibrationDocument, content, str(file))


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
