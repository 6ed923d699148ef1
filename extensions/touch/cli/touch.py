"""`handeyed touch TOUCHES`: where the camera sees points, beside where a known tip touched them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput, require_finite
from daemon.cli.output import Json, progress_bar, write_document

if TYPE_CHECKING:
    from calibration.documents.calibration_in_use import CalibrationInUse
    from extensions.touch.mathematics.report import SeenPoint


def touch(
    touches: Annotated[
        Path,
        typer.Argument(metavar="TOUCHES", help="touches.json: the points, and the pose in which the tip touched each."),
    ],
    calibration: Annotated[Path, typer.Option(help="calibration.json.")],
    tip: Annotated[Path, typer.Option(help="tip.json of `handeyed tip`.")],
    session: Annotated[
        Path | None, typer.Option(help="Session that looked at the target whose points were touched, by id.")
    ] = None,
    arm: Annotated[
        Path | None, typer.Option(help="arm.json of solve --arm: the poses are those of the arm as built.")
    ] = None,
    arm_temperature: Annotated[float | None, typer.Option(help="With --arm: of the arm's links, in °C.")] = None,
    tolerance_mm: Annotated[
        float | None, typer.Option(min=1e-6, help="Largest miss, decided with its uncertainty.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE", help="JSON file to write.")] = None,
    json: Json = False,
) -> None:
    """Judge a touch test: the misses between camera and tip, what the stated uncertainties explain, the tolerance.

    Exit status: 0 accepted, 3 beyond the tolerance, or not decided, or the misses contradict what is stated;
    2 unreadable input.
    """
    from calibration.documents.tip import TipDocument
    from calibration.documents.touches import TouchesDocument
    from calibration.errors import GeometryError
    from calibration.kinematics.arm import UnreachablePoseError
    from daemon.cli.compare import read_calibration, read_in_use
    from daemon.runtime.bounded_read import read_as
    from extensions.touch.mathematics.report import touch_test_text
    from extensions.touch.mathematics.with_arm import touch_test_with_arm

    require_finite(tolerance_mm=tolerance_mm, arm_temperature=arm_temperature)
    given = read_in_use(read_calibration(calibration), arm, arm_temperature)
    known_tip, points = read_as(TipDocument, tip), read_as(TouchesDocument, touches)
    seen = {} if session is None else _seen(session, given)
    try:
        found = touch_test_with_arm(given, known_tip, points, seen, tolerance_mm, str(touches))
    except (GeometryError, UnreachablePoseError) as error:
        fix = f"correct it, or {tip.name}"
        raise UnreadableInput(str(touches), str(error), fix) from None
    typer.echo(found.model_dump_json() if json else touch_test_text(found))
    if out is not None:
        write_document(out, found)
    raise typer.Exit(ExitStatus.OK if found.accepted else ExitStatus.NOT_ACCEPTED)


def _seen(folder: Path, given: "CalibrationInUse") -> "dict[int, SeenPoint]":
    """The target's points by id, as the session's views see them. Raises CalibrationError."""
    from dataclasses import replace

    import numpy as np

    from calibration.errors import DocumentError
    from calibration.monitoring.target_scatter import verify
    from daemon.sessions.session_reader import load_problem, open_session
    from extensions.touch.mathematics.report import verified_points
    from extensions.touch.mathematics.with_arm import with_joints

    with progress_bar(folder.resolve().name) as progress:
        problem = load_problem(open_session(folder), progress)
    calibration = given.document
    camera = calibration.camera.camera() if calibration.camera else problem.camera
    pose = calibration.mount_T_camera
    if calibration.setup != "eye-in-hand" or pose is None or camera is None or problem.in_space:
        what = "its target's points cannot be touched: that needs pictures by a camera on the flange"
        raise DocumentError.one(str(folder), "session", what, "give camera_mm in touches.json")
    problem = with_joints(given, replace(problem, camera=camera))
    found = verify(given.correct(problem), calibration)
    joints_rad = None if given.arm is None else np.array(found.joints_rad)
    return verified_points(found.ids.tolist(), found.base_T_flange, pose.transform(), found.points_mm, joints_rad)
