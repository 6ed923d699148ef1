"""`handeyed compare A B`: how far two calibrations are apart, beside what both know."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import ExitStatus
from daemon.cli.output import Json

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument

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
