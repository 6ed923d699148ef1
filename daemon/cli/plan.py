"""`handeyed plan FILE`: the robot poses that determine X best; `handeyed assess FILE`: how well given ones do."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import ExitStatus
from daemon.cli.output import Json

if TYPE_CHECKING:
    from calibration.documents.plan import PlanDocument, PlannedDocument, PredictedDocument
    from calibration.kinematics.arm import Arm


def plan(
    file: Annotated[Path, typer.Argument(help="plan.json: target, camera, guesses, noise, limits, number of poses.")],
    json: Json = False,
) -> None:
    """Choose the robot poses that determine the calibration best, within limits and reach."""
    from calibration.planning.reachability import reachable_by

    question = read_plan(file)
    reachable = None if question.robot is None else reachable_by(_arm(question.robot, file), sight=question.sight())
    answer = question.choose_poses(reachable)
    typer.echo(answer.model_dump_json() if json else _text(answer))


def read_plan(file: Path) -> "PlanDocument":
    """Read plan.json, for `plan` and `assess`. Raises DocumentError."""
    from calibration.documents.plan import PlanDocument
    from daemon.runtime.bounded_read import read_as

    return read_as(PlanDocument, file)


def _arm(name: str, file: Path) -> "Arm":
    from calibration.errors import DocumentError, GeometryError
    from calibration.kinematics.abb_arms import find_arm

    try:
        return find_arm(name)
    except GeometryError as error:
        raise DocumentError.one(str(file), "robot", str(error), "correct it, or leave it out") from None


def prediction_text(predicted: "PredictedDocument") -> str:
    """The predicted standard deviations in one line of text."""
    if predicted.point_mm is None or predicted.translation_mm is None or predicted.rotation_deg is None:
        return (
            "predicted        these poses do not determine the calibration: turn about two different axes between them"
        )
    translation = ", ".join(f"{value:.3g}" for value in predicted.translation_mm)
    rotation = ", ".join(f"{value:.2g}" for value in predicted.rotation_deg)
    return (
        f"predicted        a measured point {predicted.point_mm:.3g} mm, U (k = 2) {predicted.expanded_mm:.3g} mm at"
        f" {predicted.worst_point}; translation ({translation}) mm along the"
        f" flange's axes, rotation ({rotation}) deg about the camera's (one standard deviation)"
    )


def _text(answer: "PlannedDocument") -> str:
    lines = ["pose   x mm       y mm       z mm       quaternion w, x, y, z                        target in view"]
    for number, pose in enumerate(answer.poses, start=1):
        x, y, z = (f"{value:10.2f}" for value in pose.base_T_flange.translation_mm)
        quaternion = ", ".join(f"{value:9.6f}" for value in pose.base_T_flange.quaternion_wxyz)
        lines.append(f"{number:>3} {x} {y} {z}   {quaternion}   {pose.target_in_view:8.0%}")
    return "\n".join([*lines, prediction_text(answer.predicted)])


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
