"""Sessions that do not belong together are named, never taken for errors of an arm."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.problem import Problem
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from extensions.arm_identification.mathematics.hypotheses import SessionsContradict
from extensions.arm_identification.mathematics.identification import identify_arm_session
from mock_robot.arm.built_arm import BuiltArm
from tests.simulated.arms import MOUNT_T_CAMERA, arm_cell, reachable_views, target_places
from tests.simulated.other_arms import FAMILIES, build_other_arm
from tests.support.cases import crossed

ARM = find_arm("IRB 2600-20/1.65")
SAME = np.eye(4)
MOVED_BY = transform(np.eye(3), np.array([0.6, -0.8, 0.0]))
TILTED_BY = transform(rotation_from_vector(np.radians([0.04, -0.03, 0.0])), np.zeros(3))


def draw(seed: int, views: Sequence[int]) -> tuple[np.random.Generator, list[Array], Array]:
    """Joints of as many views of each place, and the places."""
    rng = np.random.default_rng([seed, 6])
    targets = target_places(rng, ARM, len(views))
    return rng, [reachable_views(rng, ARM, *one) for one in zip([*targets], views, strict=True)], targets


def moved_half_way(built: BuiltArm, seed: int, moved_by: Array, camera_by: Array = SAME) -> list[Problem]:
    """20 views; before view 10 the target moves in the base, or the camera on the flange."""
    rng, (joints,), targets = draw(seed, (20,))
    first, second = (
        arm_cell(rng, built, [half], [place @ targets[0]], mount_T_camera=held @ MOUNT_T_CAMERA).problems[0]
        for half, place, held in ((joints[:10], SAME, SAME), (joints[10:], moved_by, camera_by))
    )
    later = tuple(replace(view, index=view.index + 10) for view in second.views)
    return [replace(first, views=first.views + later)]


def of_two(built: BuiltArm, other: BuiltArm, seed: int, camera_moved_by: Array) -> list[Problem]:
    """Three places, the last with another arm, or with the camera moved."""
    rng, joints, targets = draw(seed, (10, 10, 10))
    first = arm_cell(rng, built, joints[:2], targets[:2]).problems
    last = arm_cell(rng, other, joints[2:], targets[2:], mount_T_camera=camera_moved_by @ MOUNT_T_CAMERA).problems
    return [*first, *last]


CASES = [
    ("target", "target-or-base-moved", "moved before picture (10|11|12) of session 1"),
    ("base", "target-or-base-moved", "moved before picture (10|11|12) of session 1"),
    ("camera in a session", "camera-moved", "the camera moved before picture (10|11|12) of session 1"),
    ("arm", "other-arm", "session 3 is of another arm"),
    ("camera", "camera-remounted", "the camera sits elsewhere in session 3"),
]


@pytest.mark.parametrize(("case", "family"), crossed(CASES, FAMILIES))
def test_what_does_not_belong_together_is_named(case: tuple[str, str, str], family: str) -> None:
    changed, kind, words = case
    built, other = build_other_arm(ARM, family, 0), build_other_arm(ARM, family, 1)
    problems = {
        "target": lambda: moved_half_way(built, 0, MOVED_BY),
        "base": lambda: moved_half_way(built, 0, TILTED_BY),
        "camera in a session": lambda: moved_half_way(built, 0, SAME, MOVED_BY),
        "arm": lambda: of_two(built, other, 0, SAME),
        "camera": lambda: of_two(built, built, 0, MOVED_BY),
    }[changed]()
    with pytest.raises(SessionsContradict, match=words) as raised:
        identify_arm_session(ARM, problems)
    assert raised.value.found.kind == kind


@pytest.mark.parametrize("family", FAMILIES)
def test_an_arm_with_errors_of_another_form_is_one_arm(family: str) -> None:
    built = build_other_arm(ARM, family, 2)
    assert identify_arm_session(ARM, moved_half_way(built, 2, SAME)).contradiction is None
    assert identify_arm_session(ARM, of_two(built, built, 2, SAME)).contradiction is None


def test_a_focal_length_that_is_off_is_not_taken_for_errors_of_the_arm() -> None:
    """It is an unknown of every model; lengths of the arm would take it otherwise."""
    (problem,) = moved_half_way(build_other_arm(ARM, "stiffness", 3), 3, SAME)
    given = problem.camera
    assert given is not None
    matrix = given.matrix * np.array([[1.003, 1, 1], [1, 1.003, 1], [1, 1, 1]])
    fits = [identify_arm_session(ARM, [replace(problem, camera=one)]) for one in (given, replace(given, matrix=matrix))]
    off = [map_points(fit.mount_T_camera, np.array([[0.0, 0.0, 500.0]])) for fit in fits]
    assert np.linalg.norm(off[0] - off[1]) < 0.2
