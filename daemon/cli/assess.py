"""`handeyed assess FILE`: the uncertainty that a calibration from given poses will have."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.errors import ExitStatus
from daemon.cli.output import Json
from daemon.cli.plan import prediction_text, read_plan


def assess(
    file: Annotated[Path, typer.Argument(help='plan.json with "views": \\[pose, ...], the poses to assess.')],
    json: Json = False,
) -> None:
    """Predict how well given robot poses will determine the calibration, before anything moves.

    Exit status 3 when they do not determine it at all.
    """
    import numpy as np

    from calibration.documents.plan import AssessedDocument
    from calibration.errors import DocumentError

    question = read_plan(file)
    if not question.views:
        raise DocumentError.one(str(file), "views", "missing", "add the poses to assess")
    predicted = question.assess(np.stack([view.transform() for view in question.views]))
    typer.echo(AssessedDocument(predicted=predicted).model_dump_json() if json else prediction_text(predicted))
    if predicted.point_mm is None:
        raise typer.Exit(ExitStatus.NOT_ACCEPTED)
