"""The arm's errors from ordinary and from several targets: what was learnt helps, what was not stays uncertain."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import extensions.arm_identification.mathematics.identification as arm_identification
from calibration.documents.arm import FIRST_PARAMETERS, ArmErrorsDocument, arm_summary
from calibration.errors import GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.joint_check import JointsDisagree
from calibration.solve import estimate_session
from calibration.solver.registered_points import registered_points
from calibration.transforms import Array, map_points
from extensions.arm_identification.mathematics.documents import identify_arm_document
from extensions.arm_identification.mathematics.identification import ArmFit, UnusualArm, identify_arm_session
from mock_robot.arm.built_arm import ArmClass, build_arm
from tests.simulated.arms import (
    REPEATABILITY,
    ArmCell,
    arm_cell,
    normalised_rms,
    reachable_views,
    rms_length,
    target_before,
    target_places,
)

ARM = find_arm("IRB 2600-20/1.65")
TARGETS = (target_before(ARM), target_before(ARM, 0.45, 0.1, 0.45), target_before(ARM, 0.5, 0.05, -0.4))
WHERE = np.array([[0.0, 0.0, 550.0]])
MADE = {"created_at": "2026-11-22T12:00:00Z", "software": "handeyed 0"}


def draw_cell(arm_class: ArmClass, seed: int, views: Sequence[int]) -> ArmCell:
    """As many views of each place of the target."""
    rng = np.random.default_rng(seed)
    joints = [reachable_views(rng, ARM, target, count) for target, count in zip(TARGETS, views, strict=False)]
    return arm_cell(rng, build_arm(ARM, arm_class, seed), joints, TARGETS[: len(views)])


@cache
def identified(arm_class: ArmClass, seed: int = 0) -> tuple[ArmCell, Array, ArmFit]:
    """A cell with twelve views of one target, X without errors of the arm, and the fit."""
    cell = draw_cell(arm_class, seed, (12,))
    return (
        cell,
        estimate_session(cell.problems[0]).best.chain.mount_T_camera,
        identify_arm_session(ARM, cell.problems),
    )


def errors_of(cell: ArmCell, fit: ArmFit, x: Array) -> tuple[Array, Array, Array]:
    """Errors (n, 3) of points before and after, and their covariances (n, 3, 3), at poses that were not seen."""
    joints = reachable_views(np.random.default_rng(99), ARM, target_before(ARM), 40)
    at = Postures(joints)
    truth = map_points(cell.built.base_T_flange(at) @ cell.mount_T_camera, WHERE)[:, 0]
    before = map_points(ARM.forward(joints) @ x, WHERE)[:, 0]
    after, covariance = registered_points(fit, at, np.repeat(WHERE, len(joints), axis=0))
    return before - truth, after - truth, covariance


@pytest.mark.parametrize("seed", range(3))
def test_ordinary_views_of_a_standard_arm_make_points_better_and_say_how_good(seed: int) -> None:
    cell, x, fit = identified("standard", seed)
    before, after, covariance = errors_of(cell, fit, x)
    assert fit.taken_up
    assert rms_length(after) < 0.85 * rms_length(before)
    assert 0.4 < normalised_rms(after, covariance) < 1.6


@pytest.mark.parametrize("seed", range(2))
def test_a_perfect_arm_is_left_alone(seed: int) -> None:
    cell, x, fit = identified("perfect", seed)
    before, after, _ = errors_of(cell, fit, x)
    assert not fit.taken_up and not np.any(fit.parameters)
    assert rms_length(after) < 1.05 * rms_length(before)


@pytest.mark.slow
def test_views_that_only_the_arms_errors_explain_are_used_and_a_wrong_one_is_not() -> None:
    """Without the arm's errors the estimate leaves out one of the right views."""
    cell = draw_cell("standard", 1, (14, 10, 8))
    left_out = [int(np.count_nonzero(~estimate_session(problem).selection.used)) for problem in cell.problems]
    assert sum(left_out) > 0, left_out
    assert len(identify_arm_session(ARM, cell.problems).seen.postures) == 32
    first, *others = cell.problems
    joints = first.views[5].stance.joints_rad
    assert joints is not None
    turned = joints + np.radians([0.2, 0, 0, 0, 0, 0])
    moved = first.views[5].standing(joints_rad=turned, base_T_flange=ARM.forward(turned))
    spoilt = replace(first, views=(*first.views[:5], moved, *first.views[6:]))
    assert len(identify_arm_session(ARM, [spoilt, *others]).seen.postures) == 31


def test_a_view_that_shows_most_of_the_errors_is_not_left_out_for_it() -> None:
    """The other eleven alone look like a calibrated arm, which the twelfth contradicts."""
    arm, rng = find_arm("IRB 6700-200/2.60"), np.random.default_rng([1, 2])
    targets = target_places(rng, arm, 1)
    views = reachable_views(rng, arm, targets[0], 12)
    cell = arm_cell(rng, build_arm(arm, "standard", 1), [views], targets)
    assert np.count_nonzero(estimate_session(cell.problems[0]).selection.used) < 12
    assert len(identify_arm_session(arm, cell.problems).seen.postures) == 12


def test_errors_that_views_left_out_contradict_are_not_taken_up_but_count_in_the_uncertainty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cell, x, believed = identified("standard")
    monkeypatch.setattr(arm_identification, "MAX_HOLD_OUT_SIGMAS", -np.inf)
    fit = identify_arm_session(ARM, cell.problems)
    _, after, covariance = errors_of(cell, fit, x)
    assert believed.taken_up and not fit.taken_up and not np.any(fit.parameters)
    assert 0.4 < normalised_rms(after, covariance) < 1.6


def test_play_is_found_by_the_side_from_which_the_axes_came() -> None:
    """What is left is the scatter about one pose; play not modelled would triple it."""
    cell = draw_cell("worn", 0, (14, 14, 14))
    fit = identify_arm_session(ARM, cell.problems)
    play = fit.model.indices("play")
    found, true = fit.parameters[play], cell.built.errors[play]
    assert np.corrcoef(found, true)[0, 1] > 0.8
    assert np.sqrt(fit.variances.translation) < 2 * REPEATABILITY.robot_translation_mm


def test_a_point_is_less_certain_away_from_where_views_were_taken() -> None:
    cell, _, fit = identified("standard")
    seen = np.array([view.stance.joints_rad for view in cell.problems[0].views])
    away = seen * [1, 0, 0, 1, 1, 1] + np.radians([0.0, 85.0, -25.0, 0.0, 0.0, 0.0])  # stretched
    where = np.repeat(WHERE, len(seen), axis=0)
    near, far = (np.trace(registered_points(fit, Postures(q), where)[1], axis1=1, axis2=2).mean() for q in (seen, away))
    assert far > 1.5 * near


def test_the_ladder_names_what_each_group_explains() -> None:
    _, _, fit = identified("standard")
    assert fit.ladder[0].up_to is None and fit.ladder[0].log_evidence == 0.0
    assert sum(row.probability for row in fit.ladder) == pytest.approx(1.0)
    best = max(fit.ladder, key=lambda row: row.probability)
    assert best.hold_out_mm < 0.5 * fit.ladder[0].hold_out_mm


def test_several_places_of_the_target_show_more_of_the_arm() -> None:
    _, _, one_place = identified("standard")
    several = identify_arm_session(ARM, draw_cell("standard", 0, (8, 8, 8)).problems)
    assert len(several.anchor_T_target) == 3
    at = Postures(reachable_views(np.random.default_rng(5), ARM, TARGETS[0], 40))
    where = np.repeat(WHERE, 40, axis=0)
    one, three = (
        np.trace(registered_points(fit, at, where)[1], axis1=1, axis2=2).mean() for fit in (one_place, several)
    )
    assert three < 0.65 * one  # both contain the common scale of all lengths, which no picture shows


def test_arm_json_keeps_the_arm_and_x() -> None:
    cell, _, fit = identified("standard")
    written = identify_arm_document(ARM, cell.problems, **MADE)
    read = ArmErrorsDocument.model_validate_json(written.model_dump_json()).estimate()
    at, where = Postures(reachable_views(np.random.default_rng(5), ARM, TARGETS[0], 1)), WHERE
    for one, other in zip(registered_points(fit, at, where), registered_points(read, at, where), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6)
    assert "taken up" in arm_summary(written)


def test_an_arm_json_of_the_first_version_places_points_as_it_did() -> None:
    cell, _, _ = identified("standard")
    written = identify_arm_document(ARM, cell.problems, **MADE)
    known = 6 + FIRST_PARAMETERS
    covariance = [row[:known] for row in written.covariance[:known]]
    parameters = written.parameters[:FIRST_PARAMETERS]
    first = written.model_copy(update={"parameters": parameters, "covariance": covariance})
    read, later = first.estimate(), written.estimate()
    at = Postures(reachable_views(np.random.default_rng(5), ARM, TARGETS[0], 1))
    cut = later.parameters * (np.arange(len(later.parameters)) < FIRST_PARAMETERS)
    np.testing.assert_allclose(read.model.forward(read.parameters, at), later.model.forward(cut, at))
    points_mm, covariances = registered_points(read, at, WHERE)
    assert np.all(np.isfinite(points_mm)) and np.all(np.linalg.eigvalsh(covariances) > 0)
    with pytest.raises(GeometryError, match="not those of this version"):
        first.model_copy(update={"parameters": first.parameters[:-1]}).estimate()


def test_six_views_are_too_few_and_a_session_in_one_posture_asks_for_another() -> None:
    rng, target = np.random.default_rng(7), TARGETS[0]
    for count, one_posture in ((6, True), (12, True), (12, False)):
        joints = reachable_views(rng, ARM, target, count, one_posture=one_posture)
        cell = arm_cell(rng, build_arm(ARM, "standard", 4), [joints], [target])
        written = identify_arm_document(ARM, cell.problems, **MADE)
        assert written.taken_up is (count >= 10)
        assert ("in one posture of the wrist" in arm_summary(written)) is one_posture


def test_joints_of_another_arm_are_refused_not_fitted() -> None:
    cell, _, _ = identified("standard")
    with pytest.raises(JointsDisagree, match="IRB 2600"):
        identify_arm_session(find_arm("IRB 6700-200/2.60"), cell.problems)


@pytest.mark.parametrize(
    ("mistaken", "code"),
    [
        (lambda q: q[[0, 1, 2, 4, 3, 5]], "joints-in-other-order"),
        (np.radians, "joints-in-radians"),
        (lambda q: q * [1, 1, -1, 1, -1, 1], "joints-with-other-signs"),
        (lambda q: q + np.radians([0, 90, 0, 0, 0, 0]), "joints-with-shifted-zeros"),
        (lambda q: q * [-1, 1, 1, -1, 1, -1] + np.radians([0, -90, 90, 0, 0, 0]), "joints-of-another-maker"),
    ],
)
def test_joints_of_another_convention_are_refused_not_fitted(mistaken: Callable[[Array], Array], code: str) -> None:
    (problem,) = draw_cell("standard", 0, (12,)).problems
    views = [view.standing(joints_rad=mistaken(np.array(view.stance.joints_rad))) for view in problem.views]
    with pytest.raises(JointsDisagree) as refused:
        identify_arm_session(ARM, [replace(problem, views=tuple(views))])
    assert refused.value.mistake.code == code


def test_a_zero_that_is_off_by_a_degree_is_no_error_of_an_arm() -> None:
    """The revolution counters are wrong: correcting the arm would hide it."""
    built = build_arm(ARM, "perfect", 0)
    errors = np.radians(1.0) * (np.arange(len(built.errors)) == built.model.index("zero_3"))
    rng = np.random.default_rng(0)
    joints = [reachable_views(rng, ARM, target, 8) for target in TARGETS]
    with pytest.raises(UnusualArm, match=r"revolution counters.* gears for play") as refused:
        identify_arm_session(ARM, arm_cell(rng, replace(built, errors=errors), joints, TARGETS).problems)
    assert refused.value.parameters[0] == "zero_3"


@pytest.mark.parametrize("seed", [4, 17])
def test_a_worn_arm_s_play_that_seems_a_little_beyond_the_largest_is_no_other_arm_s(seed: int) -> None:
    *_, fit = identified("worn", seed)
    play = fit.model.index("play_2")
    assert abs(fit.parameters[play]) > fit.model.parameters[play].largest
    assert fit.taken_up


@pytest.mark.parametrize(("parameter", "size_rad", "usual"), [
    ("sine_3", 3e-4, True), ("sine_3", 5e-4, False), ("sine2_3", 3e-4, True), ("cosine3_6", 5e-4, False),
])  # fmt: skip
def test_higher_harmonics_are_judged_as_a_gear_s_first_one(parameter: str, size_rad: float, usual: bool) -> None:
    *_, fit = identified("standard")
    changed = fit.parameters.copy()
    changed[fit.model.index(parameter)] = size_rad
    assert (parameter not in replace(fit, parameters=changed).beyond_usual()) is usual
