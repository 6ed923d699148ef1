"""Findings on what the solver changed in the input and what it assumed; `verdict` decides on acceptance."""

from collections.abc import Iterator

import numpy as np

from calibration.closed_forms.three_pose import solve_three_pose
from calibration.kinematics.robot_accuracy import PRIOR_NOISE
from calibration.likelihood.noise_marginalisation import MAX_PRIOR_VIEWS
from calibration.observability import distinct_stations
from calibration.observations.observations import IMAGE_REPEATED
from calibration.preprocessing.prepare import IMAGE_DISAGREES, PreparedSession
from calibration.problem import Problem
from calibration.solution import Finding, Severity
from calibration.solver.closed_form import THREE_POSE
from calibration.solver.initial_guess import InitialGuess
from calibration.solver.view_outliers import Selection

MAX_PRINT_SCALE_ERROR = 0.01
"""Largest scale error of a printer; a larger one is a wrong number in the description."""


def solver_findings(
    problem: Problem, prepared: PreparedSession, start: InitialGuess, selection: Selection
) -> tuple[Finding, ...]:
    """The solver's findings, in the order of its steps."""
    return (
        *_images(problem, prepared),
        *_target(prepared, selection),
        *_systematic_errors(prepared, selection),
        *_poses(problem, prepared, selection),
        *_estimate(prepared, start, selection),
    )


def _images(problem: Problem, prepared: PreparedSession) -> Iterator[Finding]:
    by_reason: dict[tuple[str, str], list[int]] = {}
    for position, why in sorted(prepared.unusable.items()):
        by_reason.setdefault((why.code, why.what), []).append(problem.views[position].index)
    for (code, what), indices in by_reason.items():
        fix = "check lighting, focus and that the whole target is in view, or leave these views out"
        if code == IMAGE_DISAGREES.code:
            fix = "compare the target's description with the target, and look at these images"
        if code == IMAGE_REPEATED:
            fix = "take a new image at every pose: the camera, or what reads it, gave an old one"
        severity: Severity = "warning" if code == IMAGE_REPEATED else "info"
        yield Finding(code, severity, f"{_views(indices)} not used: {what}", fix)
    if left_out := int(np.count_nonzero((prepared.seen.weights == 0) & (prepared.seen.present > 0))):
        yield Finding(
            "corners-left-out", "info", f"{left_out} corners lie too far from where their view's others put them",
            "nothing, unless they are many: then look at the images for glare and blur",
        )  # fmt: skip
    if np.any(prepared.board_turned):
        indices = [problem.views[position].index for position in prepared.seen.positions[prepared.board_turned]]
        yield Finding(
            "board-turned",
            "warning",
            f"{_views(indices)}: the board was read the wrong way round; the corners were renumbered",
            "use a target with an unambiguous orientation: a ChArUco board or a grid with a large dot",
        )


def _target(prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    if prepared.shape is not None:
        yield Finding(
            "target-not-as-drawn",
            "info",
            f"the target's points are {prepared.shape.in_plane_mm:.2f} mm from the drawing in its plane and"
            f" {prepared.shape.out_of_plane_mm:.2f} mm out of it (RMS); their true places were estimated and used",
            "print the target on a flat, stiff plate for the best accuracy",
        )
    if (share := selection.best.scale - 1) != 0.0:
        size = "larger" if share > 0 else "smaller"
        yield Finding(
            "target-scale",
            "error" if abs(share) > MAX_PRINT_SCALE_ERROR else "warning",
            f"measured by the robot's travel, the target is {100 * abs(share):.2f} % {size} than described;"
            " the solution uses the measured size",
            "measure the target's pitch over its whole length with a ruler and correct the description",
        )


def _systematic_errors(prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    best, errors = selection.best, prepared.systematic_errors
    if errors.given_camera is not None:
        right, down = best.camera.matrix[:2, 2] - errors.given_camera.matrix[:2, 2]
        yield Finding(
            "principal-point-off",
            "info",
            f"views and robot agree better with the given principal point moved by ({right:+.2f}, {down:+.2f}) px;"
            " the solution uses the moved one",
            "calibrate the camera anew; half a pixel in both says that its program counts from the first pixel's"
            " corner, where (0, 0) is the middle of it here",
        )
    if errors.trend:
        follows = np.sqrt(best.trend_variances())
        yield Finding(
            "robot-trend",
            "info",
            "the robot's errors are alike in neighbouring poses: about"
            f" {follows[1]:.2g} mm and {np.degrees(follows[0]):.2g} degrees follow the pose; what this adds to the"
            " uncertainty is counted",
            "take the views near where the robot works, or have its geometry calibrated (absolute accuracy)",
        )


def _poses(problem: Problem, prepared: PreparedSession, selection: Selection) -> Iterator[Finding]:
    positions = prepared.seen.positions
    if not np.all(selection.used):
        indices = [problem.views[position].index for position in positions[~selection.used]]
        yield Finding(
            "pose-disagrees",
            "warning",
            f"{_views(indices)} not used: the robot's pose and the image contradict all other views",
            "check these poses for a typing error, an arm still moving, or a target that was moved",
        )
    distinct = distinct_stations(prepared.seen.base_T_flange)
    if repeated := sorted(set(range(len(positions))) - set(distinct)):
        indices = [problem.views[position].index for position in positions[repeated]]
        yield Finding(
            "duplicate-poses",
            "warning",
            f"{_views(indices)} repeat the robot pose of an earlier view: they add little",
            "use each pose once; if the arm had moved, the pose is stale: read it anew for every image",
        )


def _estimate(prepared: PreparedSession, start: InitialGuess, selection: Selection) -> Iterator[Finding]:
    if start.other_optima:
        yield Finding(
            "starts-disagree",
            "error" if start.ambiguous else "warning",
            f"started from {', '.join(start.other_optima)} the solution ends elsewhere; "
            + (
                "both are about as likely, and which is right is not certain"
                if start.ambiguous
                else "the likelier one is given"
            ),
            "add views with larger turns about different axes",
        )
    if not selection.best.converged:
        yield Finding(
            "not-converged",
            "error",
            "the estimate did not settle",
            "look at the views' errors for one that does not belong, or add views",
        )
    if np.count_nonzero(selection.used) <= MAX_PRIOR_VIEWS:
        translation_mm, rotation_deg = PRIOR_NOISE.translation_mm, np.degrees(PRIOR_NOISE.rotation_rad)
        yield Finding(
            "noise-assumed",
            "info",
            f"{np.count_nonzero(selection.used)} views do not determine the robot's noise well: levels around"
            f" {translation_mm:g} mm and {rotation_deg:g} degrees were assumed as likely",
            "take eight or more views to have it measured",
        )


def method_findings(method: str, rows: PreparedSession) -> tuple[Finding, ...]:
    """Findings of a closed form on its own accuracy; only three-pose has one."""
    if method != THREE_POSE:
        return ()
    three_pose = solve_three_pose(rows.anchor_T_mount, rows.camera_T_target)
    return (
        Finding(
            "three-pose",
            "info",
            f"Eq. 7 gave a matrix {three_pose.distance_from_rotation:.2g} from a rotation (Frobenius norm),"
            " which was projected to one;"
            f" the axes of the two motions are {np.degrees(three_pose.axis_angle_rad):.1f} degrees apart;"
            " the paper's X is camera_T_flange, the inverse of the transform given here",
            "use the method auto, which is more accurate from the same views",
        ),
    )


def _views(indices: list[int]) -> str:
    listed = ", ".join(map(str, indices[:12])) + (f" and {len(indices) - 12} more" if len(indices) > 12 else "")
    return f"view {listed}" if len(indices) == 1 else f"views {listed}"
