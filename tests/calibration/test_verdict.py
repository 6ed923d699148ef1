"""The verdict: a table of what is said about which solution, and that judging never solves."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.problem import PosesOf, Setup
from calibration.solution import (
    Finding,
    HoldOutDocument,
    LeaveOutDocument,
    Noise,
    PointUncertainty,
    Severity,
    Solution,
    Uncertainty,
)
from calibration.verdict import VerdictLimits, judge, weigh
from tests.simulated.spoiled_sessions import solved_session

PROBLEM, SOLVED = solved_session()
PLACE = (0.0, 0.0, 500.0)


FOUR_MM = VerdictLimits().with_tolerance(4.0)


def uncertain(point_mm: float) -> Solution:
    """`point_mm`: one standard deviation at the worst point; U is twice that."""
    points = (
        PointUncertainty("a", "camera", PLACE, PLACE, 0.1),
        PointUncertainty("b", "base", PLACE, PLACE, point_mm),
    )
    return replace(SOLVED, uncertainty=Uncertainty(np.ones(3), np.ones(3), 0.1, np.eye(6), points))


def rejecting(count: int) -> Solution:
    views = [replace(view, status="rejected", reason="pose-disagrees") for view in SOLVED.views[:count]]
    return replace(SOLVED, views=(*views, *SOLVED.views[count:]))


def holding_out(error_mm: float, views: int) -> Solution:
    """Of that many views, each 0.1 mm off where it helped to solve, and `error_mm` where it was left out."""
    used = tuple(replace(view, base_error_mm=0.1) for view in SOLVED.views[:views])
    return replace(SOLVED, views=used, hold_out=HoldOutDocument(error_mm, 0.1))


ROWS: dict[str, tuple[Solution, str | None, bool]] = {
    "a good one": (SOLVED, None, True),
    "a point known to half a millimetre": (uncertain(0.49), None, True),
    "a point known to a millimetre": (uncertain(0.51), "point-uncertain", False),
    "a point known to three millimetres": (uncertain(3.0), "point-uncertain", False),
    "a point not known at all": (uncertain(np.inf), "point-uncertain", False),
    "a point that is not a number": (uncertain(np.nan), "point-uncertain", False),
    "a poor robot": (replace(SOLVED, noise=Noise(0.05, 0.01, 2.0)), "robot-noise", True),
    "a poor picture": (replace(SOLVED, noise=Noise(0.9, 1e-4, 0.1)), "image-noise", True),
    "three of ten views rejected": (rejecting(3), None, True),
    "four of ten views rejected": (rejecting(4), "many-rejected", False),
    "one of four views rejected": (replace(SOLVED, views=rejecting(1).views[:4]), "many-rejected", False),
    "one of five views rejected": (replace(SOLVED, views=rejecting(1).views[:5]), None, True),
    "nothing held out": (replace(SOLVED, hold_out=None), "nothing-held-out", True),
    "a hold-out out of all proportion": (replace(SOLVED, hold_out=HoldOutDocument(30.0, 90.0)), "hold-out-large", True),
    "four views, of which each one helped much": (holding_out(0.5, 4), None, True),
    "ten views, of which each one helped little": (holding_out(0.5, 10), "hold-out-large", True),
    "a hold-out that no cell explains": (
        replace(SOLVED, hold_out=HoldOutDocument(50.0, 90.0)),
        "poses-contradict-images",
        False,
    ),
    "more noise than any robot has": (
        replace(SOLVED, noise=replace(SOLVED.noise, robot_rotation_rad=0.05)),
        "poses-contradict-images",
        False,
    ),
    "an error of the solver's": (
        replace(SOLVED, findings=(Finding("x", "error", "what", "fix"),)),
        "x",
        False,
    ),
    "no transform": (replace(SOLVED, mount_T_camera=None), None, False),
}


@pytest.mark.parametrize("what", ROWS)
def test_what_is_said_of_a_solution(what: str) -> None:
    solution, code, accepted = ROWS[what]
    verdict = judge(PROBLEM, solution)
    said = {finding.code for finding in verdict.findings}
    assert verdict.accepted is accepted
    assert said >= ({code} if code else set())
    if code is None:
        assert not said
    assert all(finding.message and finding.fix for finding in verdict.findings)


def test_limits_can_be_set() -> None:
    assert not judge(PROBLEM, uncertain(0.49), VerdictLimits(tolerance_mm=0.3, point_warning_mm=0.1)).accepted


@pytest.mark.parametrize(
    ("sigma_mm", "tolerance_mm", "accepted", "warned"),
    [
        (0.4, None, True, False),
        (0.6, None, False, True),
        (0.6, 1.5, True, False),
        (0.6, 1.1, False, True),
        (1.9, 5.0, True, False),
    ],
)
def test_a_stated_tolerance_decides(sigma_mm: float, tolerance_mm: float | None, accepted: bool, warned: bool) -> None:
    limits = VerdictLimits().with_tolerance(tolerance_mm)
    verdict = judge(PROBLEM, uncertain(sigma_mm), limits)
    assert (verdict.accepted, bool(verdict.findings)) == (accepted, warned)
    assert verdict.limits is limits


@pytest.mark.parametrize(
    ("effect_mm", "expanded_mm", "given", "severity"),
    [
        (None, 1.0, "error", "error"),
        (0.19, 0.19, "error", "info"),
        (0.21, 0.21, "error", "warning"),
        (0.21, 1.0, "error", "info"),
        (0.9, 0.95, "error", "warning"),
        (1.1, 1.1, "error", "error"),
        (1.1, 2.0, "error", "info"),
        (1.1, 1.1, "warning", "warning"),
        (0.0, 0.1, "warning", "info"),
    ],
)
def test_a_finding_weighs_its_effect_beside_tolerance_and_uncertainty(
    effect_mm: float | None, expanded_mm: float, given: Severity, severity: Severity
) -> None:
    """The tolerance is 4 mm; U contains the effect."""
    found = weigh(Finding("x", given, "what", "fix", effect_mm), of_points(expanded_mm, expanded_mm), FOUR_MM)
    assert found.severity == severity


@pytest.mark.parametrize(
    ("code", "name", "size", "within", "limit", "severity"),
    [
        ("target-scale", "print_scale_share", -0.009, "warning", 0.01, "warning"),
        ("target-scale", "print_scale_share", -0.011, "warning", 0.01, "error"),
        ("target-scale", "print_scale_share", -0.011, "warning", 0.02, "warning"),
        ("intrinsics-do-not-fit", "lens_share", 0.006, "warning", 0.005, "error"),
        ("camera-noise", "possible_translation_mm", 3.0, "info", 15.0, "info"),
        ("camera-noise", "possible_translation_mm", 3.0, "info", 2.0, "error"),
    ],
)
def test_a_finding_is_an_error_only_beyond_a_limit_in_force(
    code: str, name: str, size: float, within: Severity, limit: float, severity: Severity
) -> None:
    given = Finding(code, "error", "what", "fix", sizes=((name, size),), within=within)
    found = weigh(given, None, replace(VerdictLimits(), **{name: limit}))  # type: ignore[arg-type]
    assert (found.severity, found.fix) == (severity, "none needed" if severity == "info" else "fix")


@pytest.mark.parametrize(
    ("lens_share", "least", "severity"),
    [(0.04, "info", "info"), (0.04, "warning", "warning"), (0.01, "info", "error")],
)
def test_neither_a_size_beyond_its_limit_nor_a_least_severity_is_lowered_by_a_small_effect(
    lens_share: float, least: Severity, severity: Severity
) -> None:
    lens = Finding("x", "error", "what", "fix", 0.0, (("lens_share", 0.02),), within="error", least=least)
    assert weigh(lens, of_points(0.5, 0.5), replace(FOUR_MM, lens_share=lens_share)).severity == severity


def test_from_which_probability_parting_is_mentioned_is_a_limit() -> None:
    solution = replace(SOLVED, leave_out=LeaveOutDocument(0.8, 4.0, 6.0, 0.6, "image", 4))
    for probability, mentioned in ((0.5, True), (0.7, False)):
        findings = judge(PROBLEM, solution, VerdictLimits(leave_out_probability=probability)).findings
        assert ("leave-out-larger" in {finding.code for finding in findings}) is mentioned


@pytest.mark.parametrize(
    ("effect_mm", "worst_mm", "severity"),
    [
        (0.3, 0.3, "warning"),
        (0.3, 1.2, "error"),
        (0.3, np.inf, "error"),
        (0.3, np.nan, "error"),
        (0.19, 0.6, "warning"),
    ],
)
def test_an_effect_weighs_what_it_is_at_the_worst_of_the_points_that_matter(
    effect_mm: float, worst_mm: float, severity: Severity
) -> None:
    """On average over the working volume U is the effect alone; at the worst point both are larger by one factor."""
    found = weigh(Finding("x", "error", "what", "fix", effect_mm), of_points(effect_mm, worst_mm), FOUR_MM)
    assert found.severity == severity


def of_points(expanded_mm: float, worst_mm: float) -> Uncertainty:
    """U on average, and at the worst point."""
    worst = PointUncertainty("a", "camera", PLACE, PLACE, worst_mm / 2)
    return Uncertainty(np.ones(3), np.ones(3), expanded_mm / 2, np.eye(6), (worst,))


def test_the_verdict_says_when_leaving_views_out_parts_from_the_model() -> None:
    parted = LeaveOutDocument(0.8, 4.0, 6.0, 0.9, "image", 4)
    said = [f for f in judge(PROBLEM, replace(SOLVED, leave_out=parted)).findings if f.code == "leave-out-larger"]
    assert [finding.severity for finding in said] == ["info"] and "2 times as far" in said[0].message
    agreeing = replace(parted, ratio=1.1, share=0.1)
    codes = [finding.code for finding in judge(PROBLEM, replace(SOLVED, leave_out=agreeing)).findings]
    assert "leave-out-larger" not in codes


@pytest.mark.parametrize(
    ("of", "setup", "severity", "said"),
    [
        (PosesOf("tGrip"), "eye-in-hand", "warning", "are of tGrip: flange_T_camera is the camera's pose in tGrip"),
        (PosesOf("tGrip", "wFix"), "eye-in-hand", "warning", "wFix: flange_T_camera is the camera's pose in tGrip"),
        (PosesOf("tGrip", "wFix"), "eye-to-hand", "warning", "tGrip, wFix: base_T_camera is the camera's pose in wFix"),
        (PosesOf(base="wFix"), "eye-in-hand", "info", "of wFix: base_T_target is the target's pose in wFix; the"),
        (PosesOf("tGrip"), "eye-to-hand", "info", "of tGrip: flange_T_target is the target's pose in tGrip"),
    ],
)  # fmt: skip
def test_poses_of_a_tool_or_a_work_object_are_said_by_what_is_named(
    of: PosesOf, setup: Setup, severity: Severity, said: str
) -> None:
    (found,) = [one for one in judge(replace(PROBLEM, poses_of=of, setup=setup), SOLVED).findings if one.code == TOOL]
    assert (found.severity, said in found.message) == (severity, True)


TOOL = "poses-of-a-tool"
