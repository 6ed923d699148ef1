"""A bar of known length between two places of the target: the scale of the arm, which neither views nor pitch tell."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.problem import Problem
from calibration.solve import estimate_session
from calibration.transforms import Array, map_points, transform_from_vector
from extensions.arm_identification.mathematics.documents import disagreements
from extensions.arm_identification.mathematics.identification import ArmFit, identify_arm_session
from extensions.arm_identification.mathematics.linear_models import fix_unknowns
from extensions.arm_identification.mathematics.session import (
    CheckedDistance,
    KnownDistance,
    TargetViews,
    begin_arm_session,
)
from mock_robot.arm.built_arm import BuiltArm
from tests.simulated.arms import ArmCell, arm_cell, lengths_of, reachable_views, target_before
from tests.simulated.sessions import BOARD

ARM = find_arm("IRB 2600-20/1.65")
LONGER = 1e-3
TARGETS = (target_before(ARM, 0.45, 0.0, 0.3), target_before(ARM, 0.6, 0.3), target_before(ARM, 0.6, -0.3))
BAR_SIGMA_MM = 0.02


def middle_of(base_T_target: Array, size: float = 1.0) -> Array:
    return np.asarray(map_points(base_T_target, size * BOARD.points_mm.mean(axis=0, keepdims=True))[0])


@cache
def longer_arm() -> tuple[ArmCell, tuple[Problem, ...], KnownDistance]:
    """All lengths of arm and target are 0.1 % more than drawn, so that pictures and poses agree with the drawing; and
    the true distance between the second and the third place."""
    model, rng = ArmErrorModel(ARM), np.random.default_rng(3)
    errors = np.zeros(len(model))
    for name, length_mm in lengths_of(ARM).items():
        errors[model.index(name)] = LONGER * length_mm
    joints = [reachable_views(rng, ARM, target, count) for target, count in zip(TARGETS, (9, 12, 10), strict=True)]
    cell = arm_cell(rng, BuiltArm(model, errors), joints, TARGETS)
    described = replace(BOARD, pitch_mm=BOARD.pitch_mm / (1 + LONGER))
    bar_mm = float(np.linalg.norm(middle_of(TARGETS[2]) - middle_of(TARGETS[1])))
    problems = tuple(replace(problem, target=described) for problem in cell.problems)
    return cell, problems, KnownDistance(1, 2, bar_mm, BAR_SIGMA_MM)


@cache
def other_postures() -> Postures:
    return Postures(reachable_views(np.random.default_rng(9), ARM, TARGETS[0], 30))


def scale_of(parameters: Array) -> float:
    """Of the flange's paths between postures, by the arm with these errors, to the true one; less 1."""
    cell, _, _ = longer_arm()
    joints = other_postures()
    places = (cell.built.model.forward(parameters, joints), cell.built.base_T_flange(joints))
    found, true = (one[:, :3, 3] - one[:, :3, 3].mean(axis=0) for one in places)
    return float(np.sum(found * true) / np.sum(true**2)) - 1


def scale_sigma(fit: ArmFit) -> float:
    """One standard deviation of `scale_of`, by the covariance of the parameters."""
    steps = np.diag(1e-3 * fit.model.sigmas)
    by = [(scale_of(fit.parameters + step) - scale_of(fit.parameters)) / step.sum() for step in steps]
    return float(np.sqrt(by @ fit.covariance[6:, 6:] @ by))


def test_a_distance_is_observed_by_the_places_and_the_size_of_the_target() -> None:
    """Its derivatives against the lengths after steps; the places are in another order than the sessions."""
    _, problems, bar = longer_arm()
    estimates = [estimate_session(problem) for problem in problems]
    views = [TargetViews(one.prepared, one.selection.used, one.best) for one in estimates]
    joints = np.array([view.stance.joints_rad for problem in problems for view in problem.views])
    session = begin_arm_session(ArmErrorModel(ARM), views, Postures(joints), (bar,))
    model = session.add_distances(session.linearise())
    middle, size = session.best.scale * problems[0].target.points_mm.mean(axis=0), session.size_place()
    assert model.unknowns == 34

    def length(step: Array) -> float:
        second, third = (
            session.chains[place].anchor_T_target @ transform_from_vector(step[6 + 6 * place : 12 + 6 * place])
            for place in (1, 2)
        )
        ends = map_points(np.array([second, third]), (1 + step[size]) * middle[None])[:, 0]
        return float(np.linalg.norm(ends[1] - ends[0]))

    steps = 1e-5 * np.eye(model.unknowns)
    by = np.array([length(step) - length(-step) for step in steps]) / 2e-5
    row = np.append(by, length(np.zeros(model.unknowns)) - bar.distance_mm) / bar.sigma_mm
    assert model.direct is not None
    np.testing.assert_allclose(model.direct, np.outer(row, row), atol=1e-4 * np.abs(row).max() ** 2)
    fixed = fix_unknowns(model, np.array([size]), np.array([LONGER]))
    assert fixed.direct is not None
    assert fixed.direct[-1, -1] == pytest.approx((row[-1] + LONGER * row[size]) ** 2, rel=1e-3)


@pytest.mark.slow
def test_a_bar_shows_that_all_lengths_are_a_thousandth_too_long_as_well_as_it_is_known() -> None:
    cell, problems, bar = longer_arm()
    worse = replace(bar, sigma_mm=2.5 * BAR_SIGMA_MM)
    poor = replace(bar, sigma_mm=0.1)
    without, found, less_known, poorly_known = (
        identify_arm_session(ARM, problems, distances=known) for known in ((), (bar,), (worse,), (poor,))
    )
    assert scale_of(without.parameters) < -0.9 * LONGER
    assert found.taken_up
    assert found.target_scale == pytest.approx(1 + LONGER, abs=2e-4)
    sigma = scale_sigma(found)
    assert abs(scale_of(found.parameters)) < 3 * sigma < 0.3 * LONGER
    off_mm = [np.linalg.norm((fit.mount_T_camera - cell.mount_T_camera)[:3, 3]) for fit in (without, found)]
    assert off_mm[1] < off_mm[0] / 3
    assert abs(scale_of(less_known.parameters)) < 3 * scale_sigma(less_known)
    assert scale_sigma(less_known) > 1.5 * sigma
    assert [disagreements(fit.distances) for fit in (without, found, less_known)] == [[], [], []]
    (ignored,) = disagreements(poorly_known.distances)
    assert ignored.effect_mm == pytest.approx(LONGER * bar.distance_mm, rel=0.2)


@pytest.mark.parametrize(
    ("known", "sentences"),
    [
        (CheckedDistance(990.0, 0.1, 989.7, 0.02), []),
        (CheckedDistance(990.0, 0.1, 989.0, 0.6), []),
        (
            CheckedDistance(990.0, 0.1, 989.01, 0.02),
            ["a distance of 990.000 ± 0.1 mm between places of the target is found as 989.010 ± 0.02 mm, -0.100 %:"
             " points are registered at that scale"],
        ),
    ],
)  # fmt: skip
def test_a_distance_disagrees_when_it_is_off_by_more_than_both_know(
    known: CheckedDistance, sentences: list[str]
) -> None:
    assert [str(finding.message) for finding in disagreements([known])] == sentences
