"""Acceptance of a solution, by a table of rules over it; nothing is solved again."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE, MAX_USUAL_NOISE
from calibration.observability import summarise_motion
from calibration.problem import Problem
from calibration.solution import COVERAGE_FACTOR, Finding, Noise, Solution


@dataclass(frozen=True)
class VerdictLimits:
    """Limits of acceptance. Beyond the tolerance or what is `possible` for a robot or a view left out, a solution is
    rejected; the others raise warnings of likely causes. Each is a key of `calibration.documents.requirement`.

    tolerance_mm : largest U (k = 2) at the worst of the points that matter.
    point_warning_mm : the same, for a warning. A tolerance that somebody has stated is both: see `with_tolerance`.
    """

    tolerance_mm: float = 4.0
    point_warning_mm: float = 1.0
    axis_angle_rad: float = float(np.radians(15.0))
    robot_translation_mm: float = MAX_USUAL_NOISE.translation_mm
    robot_rotation_rad: float = MAX_USUAL_NOISE.rotation_rad
    possible_translation_mm: float = MAX_POSSIBLE_NOISE.translation_mm
    possible_rotation_rad: float = MAX_POSSIBLE_NOISE.rotation_rad
    image_px: float = 0.5
    rejected_share: float = 0.34
    hold_out_ratio: float = 3.0
    possible_hold_out_mm: float = 40.0

    def with_tolerance(self, tolerance_mm: float | None) -> "VerdictLimits":
        """These limits with a stated tolerance, below which nothing is warned of; unchanged with None."""
        if tolerance_mm is None:
            return self
        return replace(self, tolerance_mm=tolerance_mm, point_warning_mm=tolerance_mm)


DEFAULT_VERDICT_LIMITS = VerdictLimits()


@dataclass(frozen=True)
class Verdict:
    """Whether a solution may be used, all findings of solver and rules, and the limits in force."""

    accepted: bool
    findings: tuple[Finding, ...]
    limits: VerdictLimits


CONTRADICTIONS = ("pose-disagrees", "image-disagrees")
"""Reasons for rejecting a view although the target was found in it."""

Rule = Callable[[Problem, Solution, VerdictLimits], Iterator[Finding]]


def judge(problem: Problem, solution: Solution, limits: VerdictLimits = DEFAULT_VERDICT_LIMITS) -> Verdict:
    """The verdict: the solution's findings and those of the rules; accepted when X exists and none is an error."""
    rules = RULES if solution.mount_T_camera is not None else ()
    findings = (*solution.findings, *(finding for rule in rules for finding in rule(problem, solution, limits)))
    return verdict_of(solution, findings, limits)


def verdict_of(solution: Solution, findings: tuple[Finding, ...], limits: VerdictLimits) -> Verdict:
    """Accepted when X exists and none of the findings is an error."""
    accepted = solution.mount_T_camera is not None and not any(finding.severity == "error" for finding in findings)
    return Verdict(accepted, findings, limits)


def point_findings(solution: Solution, limits: VerdictLimits, fix: str) -> Iterator[Finding]:
    """When the worst of the points that matter is more uncertain than `limits` allow: what to do is `fix`."""
    if solution.uncertainty is None:
        return
    worst = solution.uncertainty.worst_point
    if not worst.expanded_mm <= limits.point_warning_mm:
        weakest = solution.observability.weakest_direction
        yield Finding(
            "point-uncertain",
            "error" if not worst.expanded_mm <= limits.tolerance_mm else "warning",
            f"a mapped point is uncertain by U = {worst.expanded_mm:.2g} mm (k = {COVERAGE_FACTOR:g}, at {worst.name};"
            f" tolerance {limits.tolerance_mm:g} mm), most by {weakest}",
            fix,
        )


def robot_findings(noise: Noise, limits: VerdictLimits, fix: str) -> Iterator[Finding]:
    """When the robot's poses scatter more than `limits` allow, as far as `noise` has been estimated."""
    translation_mm, rotation_rad = noise.robot_translation_mm, noise.robot_rotation_rad
    if (translation_mm or 0.0) > limits.robot_translation_mm or (rotation_rad or 0.0) > limits.robot_rotation_rad:
        and_turns = "" if rotation_rad is None else f" and {np.degrees(rotation_rad):.2g} degrees"
        yield Finding("robot-noise", "warning", f"the robot's poses scatter by {translation_mm:.2g} mm{and_turns}", fix)


def contradiction_findings(
    noise: Noise, hold_out_mm: float | None, limits: VerdictLimits, fix: str
) -> Iterator[Finding]:
    """When poses and images disagree by more than any robot errs: whatever X is found says nothing then.

    `hold_out_mm`: by how much views left out are missed, None when none were.
    """
    translation_mm, rotation_rad = noise.robot_translation_mm or 0.0, noise.robot_rotation_rad or 0.0
    missed = "" if hold_out_mm is None else f", and views left out are missed by {hold_out_mm:.3g} mm"
    if (
        translation_mm > limits.possible_translation_mm
        or rotation_rad > limits.possible_rotation_rad
        or (hold_out_mm or 0.0) > limits.possible_hold_out_mm
    ):
        yield Finding(
            "poses-contradict-images",
            "error",
            f"poses and images contradict each other by {translation_mm:.2g} mm and {np.degrees(rotation_rad):.2g}"
            f" degrees, more than any robot errs by{missed}",
            fix,
        )


def rejection_findings(rejected: int, views: int, limits: VerdictLimits, suffix: str, fix: str) -> Iterator[Finding]:
    """When too large a share of `views` was `rejected` for contradicting the others; `suffix` ends the sentence."""
    if rejected > limits.rejected_share * views:
        what = f"{rejected} of {views} views contradict the others{suffix}"
        yield Finding("many-rejected", "error", what, fix)


def _point(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    fix = "add views turned by 30 degrees or more about different axes, or let the poses be planned"
    return point_findings(solution, limits, fix)


def _axes(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    used = {view.index for view in solution.views if view.status != "rejected"}
    poses = np.array([view.base_T_flange for view in problem.views if view.index in used])
    angle = summarise_motion(poses).axis_angle_rad
    if angle < limits.axis_angle_rad:
        yield Finding(
            "axes-nearly-parallel",
            "warning",
            f"the axes of the robot's motions are within {np.degrees(angle):.1f} degrees of each other",
            "choose poses that turn the flange about different axes: 60 degrees apart or more is good",
        )


def _robot(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    fix = "check tool and work object of the reported pose, the settling time, the camera mount and the arm's zero"
    return robot_findings(solution.noise, limits, fix)


def _contradiction(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    hold_out_mm = None if solution.hold_out is None else solution.hold_out.base_error_mm
    fix = "check the convention, the units and the order of the poses, the setup, and which image belongs to which pose"
    return contradiction_findings(solution.noise, hold_out_mm, limits, fix)


def _image(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    if (solution.noise.image_px or 0.0) > limits.image_px:
        yield Finding(
            "image-noise",
            "warning",
            f"corners scatter by {solution.noise.image_px:.2g} px",
            "check focus, motion blur, the target's flatness, and the camera's intrinsics when they were given",
        )


def _rejections(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    seen = [view for view in solution.views if view.status != "rejected" or view.reason in CONTRADICTIONS]
    rejected = sum(view.status == "rejected" for view in seen)
    suffix = ": which of the two are right is not certain"
    fix = "check the reported poses and the target, and run the calibration again"
    return rejection_findings(rejected, len(seen), limits, suffix, fix)


def _hold_out(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    if solution.hold_out is None:
        yield Finding(
            "nothing-held-out",
            "info",
            "three views leave none to check the others with",
            "take four or more views to have the solution checked",
        )
        return
    expected = _typical_base_error(solution)
    if expected and solution.hold_out.base_error_mm > limits.hold_out_ratio * expected:
        yield Finding(
            "hold-out-large",
            "warning",
            f"views left out are missed by {solution.hold_out.base_error_mm:.2g} mm, {expected:.2g} mm was expected",
            "look for views with a large base error, or a target or camera that moved during the session",
        )


def _typical_base_error(solution: Solution) -> float | None:
    errors = [view.base_error_mm for view in solution.views if view.status != "rejected" and view.base_error_mm]
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None


RULES: tuple[Rule, ...] = (_contradiction, _point, _axes, _robot, _image, _rejections, _hold_out)
