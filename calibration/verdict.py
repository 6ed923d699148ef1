"""Acceptance of a solution, by a table of rules over it; nothing is solved again."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from calibration.closed_forms.inverted_poses import misfit_of_inverted_poses
from calibration.closed_forms.observability import distinct_stations, summarise_motion
from calibration.kinematics.abb_arms import ARMS
from calibration.kinematics.joint_check import any_arm_fits
from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE, MAX_USUAL_NOISE
from calibration.problem import ANCHORS, MOUNTS, PosesOf, Problem, Setup
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR, Finding, Noise, Severity, Solution, Uncertainty, used_views

DEFAULT_TOLERANCE_MM = 1.0


@dataclass(frozen=True)
class VerdictLimits:
    """Limits of acceptance. Beyond the tolerance or what is `possible` for a robot or a view left out, a solution is
    rejected; the others raise warnings of likely causes. Each is a key of `calibration.documents.requirement`.

    tolerance_mm : largest U (k = 2) at the worst of the points that matter.
    tolerance_stated : whether somebody stated it: see `with_tolerance`.
    point_warning_mm : the same, for a warning. A stated tolerance is both.
    negligible_share, warning_share : of the tolerance: a contradiction that moves a measured point by less is
        information, or a warning.
    print_scale_share : largest scale error of a print fitted to its page; more is a wrong number in the target's
        description.
    lens_share : largest shift of the target over its distance by other intrinsics for a warning; more is another camera
        or focus.
    points_size_share : largest difference of a target measured by its points from the described size, for a warning.
    leave_out_probability : posterior probability of errors beyond the model from which the verdict mentions them.
    mount_sigma : how far from its expected mount the camera may be found, in sigmas of that expectation.
    """

    tolerance_mm: float = DEFAULT_TOLERANCE_MM
    tolerance_stated: bool = False
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
    negligible_share: float = 0.05
    warning_share: float = 0.25
    print_scale_share: float = 0.06
    lens_share: float = 0.04
    points_size_share: float = 0.01
    leave_out_probability: float = 0.5
    mount_sigma: float = 2.0

    def with_tolerance(self, tolerance_mm: float | None) -> "VerdictLimits":
        """These limits with a stated tolerance, below which nothing is warned of; unchanged with None."""
        if tolerance_mm is None:
            return self
        return replace(self, tolerance_mm=tolerance_mm, tolerance_stated=True, point_warning_mm=tolerance_mm)


DEFAULT_VERDICT_LIMITS = VerdictLimits()


@dataclass(frozen=True)
class Verdict:
    """Whether a solution may be used, all findings of solver and rules, and the limits in force."""

    accepted: bool
    findings: tuple[Finding, ...]
    limits: VerdictLimits


CONTRADICTIONS = ("pose-disagrees", "image-disagrees")
"""Reasons for rejecting a view although the target was found in it."""

MIN_AGREEING = 4
"""Least views that outvote one that contradicts them: any three agree, with inverted poses as well. A turn of 180
degrees about the common perpendicular of two screw axes reverses both motions, so that three views fit X either way."""

INVERTED_SIGMA = 3.0
"""Inverted poses agree as well when they need a robot that scatters up to so many times as much as the estimated one.
Data that are inverted leave about the scatter that their inverses need, right ones far less."""

INVERTED_CAUSES = frozenset({"poses-inverted", "setup-swapped"})

MAX_AXIS_OFF_RAD = float(np.radians(5.0))
"""Largest usual angle between a direction as drawn and as built; more is a wrong sign or another axis."""

SEVERITIES: tuple[Severity, ...] = ("info", "warning", "error")
"""In rising order."""

Rule = Callable[[Problem, Solution, VerdictLimits], Iterator[Finding]]


def judge(problem: Problem, solution: Solution, limits: VerdictLimits = DEFAULT_VERDICT_LIMITS) -> Verdict:
    """The verdict: the solution's findings and those of the rules; accepted when X exists and none is an error."""
    rules = RULES if solution.mount_T_camera is not None else ()
    weighed = (weigh(finding, solution.uncertainty, limits) for finding in solution.findings)
    findings = (*weighed, *(finding for rule in rules for finding in rule(problem, solution, limits)))
    return verdict_of(solution, findings, limits)


def weigh(finding: Finding, uncertainty: Uncertainty | None, limits: VerdictLimits) -> Finding:
    """The finding with its severity lowered to what its sizes and its effect at the worst of the points deserve.

    The effect is known on average over the working volume; at the worst point it is larger by as much as the
    uncertainty is there. The uncertainty contains the effects (see `calibration.diagnosis.explain`). An effect within
    the rest of it, or far below the tolerance, is information; one well below the tolerance a warning. A size beyond
    its limit stays what it is, however little moves with it: such a description belongs to something else.
    """
    if any(abs(size) > getattr(limits, name) for name, size in finding.sizes):
        return finding
    if finding.sizes:
        fix = Sentence("none-needed") if finding.within == "info" else finding.fix
        finding = replace(finding, severity=min(finding.severity, finding.within, key=SEVERITIES.index), fix=fix)
    if finding.effect_mm is None or uncertainty is None:
        return finding
    expanded_mm = COVERAGE_FACTOR * uncertainty.point_mm
    worst_mm = uncertainty.worst_point.expanded_mm
    effect_mm = finding.effect_mm * (worst_mm / expanded_mm if expanded_mm > 0 else 1.0)
    without_mm = float(np.sqrt(max(worst_mm**2 - effect_mm**2, 0.0)))
    deserved: Severity = "error"
    if effect_mm <= limits.warning_share * limits.tolerance_mm:
        deserved = "warning"
    if effect_mm <= max(without_mm, limits.negligible_share * limits.tolerance_mm):
        deserved = "info"
    deserved = max(deserved, finding.least, key=SEVERITIES.index)
    return replace(finding, severity=min(finding.severity, deserved, key=SEVERITIES.index))


def verdict_of(solution: Solution, findings: tuple[Finding, ...], limits: VerdictLimits) -> Verdict:
    """Accepted when X exists and none of the findings is an error."""
    accepted = solution.mount_T_camera is not None and not any(finding.severity == "error" for finding in findings)
    return Verdict(accepted, findings, limits)


def point_findings(solution: Solution, limits: VerdictLimits, fix: Sentence) -> Iterator[Finding]:
    """When the worst of the points that matter is more uncertain than `limits` allow: what to do is `fix`."""
    if solution.uncertainty is None:
        return
    worst = solution.uncertainty.worst_point
    if not worst.expanded_mm <= limits.point_warning_mm:
        weakest = solution.observability.weakest_direction
        yield Finding(
            "point-uncertain",
            "error" if not worst.expanded_mm <= limits.tolerance_mm else "warning",
            Sentence(
                "point-uncertain",
                expanded_mm=worst.expanded_mm,
                coverage_factor=COVERAGE_FACTOR,
                point=worst.name,
                tolerance_mm=limits.tolerance_mm,
                weakest=weakest,
            ),
            fix,
        )


def robot_findings(noise: Noise, limits: VerdictLimits, fix: Sentence) -> Iterator[Finding]:
    """When the robot's poses scatter more than `limits` allow, as far as `noise` has been estimated."""
    translation_mm, rotation_rad = noise.robot_translation_mm, noise.robot_rotation_rad
    if (translation_mm or 0.0) > limits.robot_translation_mm or (rotation_rad or 0.0) > limits.robot_rotation_rad:
        message = (
            Sentence("robot-noise-translation", translation_mm=translation_mm)
            if rotation_rad is None
            else Sentence("robot-noise", translation_mm=translation_mm, rotation_deg=degrees(rotation_rad))
        )
        yield Finding("robot-noise", "warning", message, fix)


def contradiction_findings(
    noise: Noise, hold_out_mm: float | None, limits: VerdictLimits, fix: Sentence
) -> Iterator[Finding]:
    """When poses and images disagree by more than any robot errs: whatever X is found says nothing then.

    `hold_out_mm`: by how much views left out are missed, None when none were.
    """
    translation_mm, rotation_rad = noise.robot_translation_mm or 0.0, noise.robot_rotation_rad or 0.0
    if (
        translation_mm > limits.possible_translation_mm
        or rotation_rad > limits.possible_rotation_rad
        or (hold_out_mm or 0.0) > limits.possible_hold_out_mm
    ):
        sizes = {"translation_mm": translation_mm, "rotation_deg": degrees(rotation_rad)}
        message = (
            Sentence("poses-contradict-images", **sizes)
            if hold_out_mm is None
            else Sentence("poses-contradict-images-held-out", **sizes, hold_out_mm=hold_out_mm)
        )
        yield Finding("poses-contradict-images", "error", message, fix)


def rejection_findings(
    rejected: int, views: int, limits: VerdictLimits, sentence_id: str, fix: Sentence
) -> Iterator[Finding]:
    """When too large a share of `views` was `rejected` for contradicting the others: a sentence of this id."""
    if rejected > limits.rejected_share * views:
        yield Finding("many-rejected", "error", Sentence(sentence_id, rejected=rejected, views=views), fix)


def _point(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    advice = "add-turned-views-or-plan" if solution.axis_offset is None else "measure-offset-or-add-views"
    return point_findings(solution, limits, Sentence(advice))


def _axes(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    poses = np.array([view.base_T_flange for view in used_views(problem, solution)])
    angle = summarise_motion(poses).axis_angle_rad
    if solution.axis_offset is None and angle < limits.axis_angle_rad:
        yield Finding(
            "axes-nearly-parallel",
            "warning",
            Sentence("axes-nearly-parallel", angle_deg=degrees(angle)),
            Sentence("turn-about-different-axes"),
        )


def _inverted(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    """When the poses agree as well read as their inverses, with another X, and nothing shows which is right."""
    if problem.poses_from_controller or INVERTED_CAUSES & {finding.code for finding in solution.findings}:
        return
    if any(_contradiction(problem, solution, limits)):  # refused, and anything fits such poses
        return
    used = used_views(problem, solution)
    poses = np.array([view.base_T_flange for view in used])
    misfit_mm, misfit_rad = misfit_of_inverted_poses(poses[distinct_stations(poses)])
    allowed_mm = INVERTED_SIGMA * (solution.noise.robot_translation_mm or 0.0)
    allowed_rad = INVERTED_SIGMA * (solution.noise.robot_rotation_rad or 0.0)
    if misfit_mm > allowed_mm or misfit_rad > allowed_rad:
        return
    joints = [view.stance.joints_rad for view in used if view.stance.joints_rad is not None]
    if len(joints) == len(used) and any_arm_fits(ARMS.values(), joints, poses):
        return
    yield Finding(
        "inverted-fits-as-well", "error", Sentence("inverted-fits-as-well"), Sentence("take-a-view-turned-otherwise")
    )


def _robot(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    return robot_findings(solution.noise, limits, Sentence("check-robot"))


def _contradiction(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    hold_out_mm = None if solution.hold_out is None else solution.hold_out.base_error_mm
    return contradiction_findings(solution.noise, hold_out_mm, limits, Sentence("check-poses-and-images"))


def _image(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    if (solution.noise.image_px or 0.0) > limits.image_px:
        yield Finding(
            "image-noise", "warning", Sentence("image-noise", image_px=solution.noise.image_px), Sentence("check-image")
        )


def _rejections(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    seen = [view for view in solution.views if view.status != "rejected" or view.reason in CONTRADICTIONS]
    rejected = sum(view.status == "rejected" for view in seen)
    if rejected and len(seen) - rejected < MIN_AGREEING:
        limits = replace(limits, rejected_share=0.0)
    return rejection_findings(rejected, len(seen), limits, "many-rejected", Sentence("check-poses-and-target"))


def _hold_out(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    if solution.hold_out is None:
        yield Finding("nothing-held-out", "info", Sentence("nothing-held-out"), Sentence("take-four-views"))
        return
    expected = _expected_hold_out_mm(solution)
    if expected and solution.hold_out.base_error_mm > limits.hold_out_ratio * expected:
        yield Finding(
            "hold-out-large",
            "warning",
            Sentence("hold-out-large", hold_out_mm=solution.hold_out.base_error_mm, expected_mm=expected),
            Sentence("look-for-movement"),
        )


def _leave_out(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    left_out = solution.leave_out
    if left_out is not None and left_out.share > limits.leave_out_probability:
        yield Finding(
            "leave-out-larger",
            "info",
            Sentence(
                "leave-out-larger",
                grouped_by=Sentence(f"grouped-by-{left_out.grouped_by}"),
                times=float(np.sqrt(left_out.ratio)),
                sigma_mm=left_out.point_mm,
            ),
            Sentence("check-shared-errors"),
        )


def _expected_hold_out_mm(solution: Solution) -> float | None:
    """RMS of the views' errors, each divided by 1 - its leverage, as a view left out is missed (Allen 1974, PRESS).

    n views of six numbers each determine twelve: the leverage is 2 / n on average.
    """
    errors = [view.base_error_mm for view in solution.views if view.status != "rejected" and view.base_error_mm]
    if len(errors) <= 2:
        return None
    return float(np.sqrt(np.mean(np.square(errors)))) / (1 - 2 / len(errors))


def _external_axis(problem: Problem, solution: Solution, limits: VerdictLimits) -> Iterator[Finding]:
    """What the axis is and how uncertain it leaves a registered point; far from the given one is a warning."""
    found = solution.external_axis
    if found is None:
        return
    kind, (x, y, z) = found.axis.kind, found.axis.direction.tolist()
    severity: Severity = "info"
    fix = Sentence("none-needed")
    if found.off_rad > MAX_AXIS_OFF_RAD:
        severity, fix = "warning", Sentence("correct-the-direction")
    if not found.expanded_mm <= limits.tolerance_mm:
        severity, fix = "error", Sentence(f"move-the-{kind}")
    message = Sentence(f"{kind}-found", x=x, y=y, z=z, off_deg=degrees(found.off_rad), expanded_mm=found.expanded_mm)
    yield Finding("external-axis", severity, message, fix)


def tool_findings(of: PosesOf | None, setup: Setup) -> Iterator[Finding]:
    """Of what X is, or only the target's pose, where the robot's poses are not the flange's in the base."""
    frames = {} if of is None else {"flange": of.tool, "base": of.base}
    names, fix = ", ".join(filter(None, frames.values())), "compose-with-tool"
    if frame := frames.get(MOUNTS[setup]):
        message = Sentence("poses-of-a-tool", names=names, x=f"{MOUNTS[setup]}_T_camera", frame=frame)
        yield Finding("poses-of-a-tool", "warning", message, Sentence(fix, frame=frame))
    elif frame := frames.get(ANCHORS[setup]):
        message = Sentence("target-of-a-tool", names=names, x=f"{ANCHORS[setup]}_T_target", frame=frame)
        yield Finding("poses-of-a-tool", "info", message, Sentence(fix, frame=frame))


RULES: tuple[Rule, ...] = (
    _contradiction, _point, _axes, _inverted, _robot, _image, _rejections, _hold_out, _leave_out, _external_axis,
    lambda problem, solution, limits: tool_findings(problem.poses_of, problem.setup),
)  # fmt: skip
