"""Misses of a touch test: as large as claimed, larger, and against a tolerance."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from calibration.errors import GeometryError
from calibration.transforms import Array, map_points, transform_from_vector
from extensions.touch.mathematics.misses import (
    SharedError,
    TouchTest,
    evaluate_touch_test,
    mapping_error,
    pose_error,
    seen_points_mm,
    tip_error,
)

X = transform_from_vector([0.1, -0.2, 1.5, 40.0, -60.0, 90.0])
X_SIGMA = np.array([1e-3, 1e-3, 2e-3, 0.2, 0.3, 0.4])
TIP, TIP_SIGMA = np.array([0.0, 20.0, 200.0]), np.array([0.1, 0.1, 0.2])
ROBOT = (2e-4, 0.05)
PLACING_MM = 0.1
LOOK = transform_from_vector([2.0, 2.2, 0.1, 900.0, 100.0, 800.0])
CAMERA_MM = np.array([[-150.0, -100, 480], [150, -100, 500], [150, 100, 520], [-150, 100, 500], [0, 0, 500]])
N = len(CAMERA_MM)


@dataclass(frozen=True)
class Errors:
    """What errs: X, tip, looking pose (6,), touching poses (n, 6), placing (n, 3)."""

    x: Array
    tip: Array
    look: Array
    touches: Array
    placing: Array

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Errors":
        pose = np.repeat(ROBOT, 3)
        return cls(
            rng.normal(0, X_SIGMA), rng.normal(0, TIP_SIGMA), rng.normal(0, pose), rng.normal(0, pose, (N, 6)),
            rng.normal(0, PLACING_MM, (N, 3)),
        )  # fmt: skip


NONE = Errors(np.zeros(6), np.zeros(3), np.zeros(6), np.zeros((N, 6)), np.zeros((N, 3)))


def touching_poses(points_mm: Array, rng: np.random.Generator) -> Array:
    """True base_T_flange (n, 4, 4) with the true tip at the points, each turned otherwise."""
    poses = transform_from_vector(np.column_stack([rng.uniform([2, -1, -1], [4, 1, 1], (N, 3)), np.zeros((N, 3))]))
    poses[:, :3, 3] = points_mm - poses[:, :3, :3] @ TIP
    return poses


def touched(errors: Errors, tolerance_mm: float | None = None) -> TouchTest:
    """The touch test of true points that a camera with these errors sees and a tip with these errors touches.

    A robot that errs reports another pose than the true one: true = reported @ exp(error).
    """
    true_mm = map_points(LOOK @ transform_from_vector(errors.look) @ X @ transform_from_vector(errors.x), CAMERA_MM)
    true_poses = touching_poses(true_mm + errors.placing, np.random.default_rng(3))
    reported = true_poses @ np.linalg.inv(transform_from_vector(errors.touches))
    looks = np.broadcast_to(LOOK, (N, 4, 4))
    flange_mm = map_points(X, CAMERA_MM)
    tips = np.broadcast_to(TIP, (N, 3))
    one_each = [pose_error(reported[i : i + 1], tips[:1], *ROBOT).of_points() for i in range(N)]
    return evaluate_touch_test(
        seen_points_mm(looks, X, CAMERA_MM),
        map_points(reported, (TIP + errors.tip)[None, None])[:, 0],
        mapping_error(looks, X, CAMERA_MM, np.diag(X_SIGMA**2)),
        [tip_error(reported, np.diag(TIP_SIGMA**2)), pose_error(looks, flange_mm, *ROBOT)],
        np.array(one_each) + PLACING_MM**2 * np.eye(3),
        tolerance_mm,
    )


def test_without_errors_there_are_no_misses() -> None:
    found = touched(NONE, 1.0)
    np.testing.assert_allclose(found.base_miss_mm, 0, atol=1e-9)
    assert (found.agree, found.outlying.any()) == (True, False)
    assert found.conformance == "within"


def test_misses_are_as_large_as_the_stated_errors_make_them() -> None:
    rng = np.random.default_rng(8)
    found = [touched(Errors.drawn(rng)) for _ in range(200)]
    probabilities = np.array([one.probability for one in found])
    assert np.mean(probabilities < 0.5) == pytest.approx(0.5, abs=0.1)
    assert np.mean(probabilities < 0.1) == pytest.approx(0.1, abs=0.06)
    assert np.mean([np.all(one.lengths_mm < one.claimed_mm) for one in found]) > 0.9
    assert np.mean([one.agree for one in found]) > 0.97


@pytest.mark.parametrize("part", ["x", "tip", "look", "touches", "placing"])
def test_each_error_moves_the_misses_as_its_derivative_says(part: str) -> None:
    """One error alone at the size of its sigmas makes misses that the covariance contains; six times it does not."""
    drawn = Errors.drawn(np.random.default_rng(12))
    size = {"x": X_SIGMA, "tip": TIP_SIGMA, "placing": PLACING_MM}.get(part, np.repeat(ROBOT, 3))
    alone = replace(NONE, **{part: np.broadcast_to(size, getattr(drawn, part).shape)})
    assert touched(alone).agree
    assert touched(alone).lengths_mm.max() > 0.01


@pytest.mark.parametrize(("x", "tip"), [
    ([0, 0, 0, 5.0, 0, 0], [0, 0, 0]), ([0.02, 0, 0, 0, 0, 0], [0, 0, 0]), ([0, 0, 0, 0, 0, 0], [0, 0, 3.0]),
], ids=["camera moved", "camera turned", "tip bent"])  # fmt: skip
def test_a_wrong_camera_or_tip_contradicts_what_is_claimed(x: list[float], tip: list[float]) -> None:
    found = touched(replace(NONE, x=np.array(x), tip=np.array(tip)), 1.0)
    assert not found.agree
    assert found.conformance == "beyond"


def test_one_blunder_is_named() -> None:
    placing = np.zeros((N, 3))
    placing[2] = [0.0, 12.0, 0.0]
    found = touched(replace(NONE, placing=placing))
    assert found.outlying.tolist() == [False, False, True, False, False]
    assert not found.agree


def simple(miss_mm: float, tolerance_mm: float) -> TouchTest:
    """One point with U = 0.6 mm of the check, and an X that claims nothing worth mentioning."""
    own = np.diag([0.09, 0.0, 0.0])[None] + 1e-12 * np.eye(3)
    mapping = SharedError(np.eye(3)[None], 4.0 * np.eye(3))
    return evaluate_touch_test(np.zeros((1, 3)), np.array([[0.0, miss_mm, 0.0]]), mapping, [], own, tolerance_mm)


@pytest.mark.parametrize(("miss_mm", "conformance"), [
    (0.0, "within"), (0.39, "within"), (0.41, "undecided"), (1.59, "undecided"), (1.61, "beyond"),
])  # fmt: skip
def test_conformance_counts_the_uncertainty_of_the_check_not_of_x(miss_mm: float, conformance: str) -> None:
    found = simple(miss_mm, 1.0)
    assert found.conformance == conformance
    assert found.expanded_mm[0] == pytest.approx(0.6, abs=1e-4)
    assert found.claimed_mm[0] == pytest.approx(2 * np.sqrt(12.09), rel=1e-4)


def test_what_cannot_be_judged_is_refused() -> None:
    nothing = SharedError(np.zeros((1, 3, 1)), np.zeros((1, 1)))
    with pytest.raises(GeometryError, match="no point"):
        evaluate_touch_test(np.zeros((0, 3)), np.zeros((0, 3)), nothing, [], np.zeros((0, 3, 3)))
    with pytest.raises(GeometryError, match="not finite"):
        evaluate_touch_test(np.full((1, 3), np.nan), np.zeros((1, 3)), nothing, [], np.eye(3)[None])
    with pytest.raises(GeometryError, match="without any uncertainty"):
        evaluate_touch_test(np.zeros((1, 3)), np.zeros((1, 3)), nothing, [], np.zeros((1, 3, 3)))


@pytest.mark.parametrize(
    ("own", "tolerance_mm"), [(0.0, None), (1e308, None), (0.01, np.nan), (0.01, np.inf), (0.01, 0.0)]
)
def test_no_uncertainty_of_the_touching_and_no_tolerance_are_refused(own: float, tolerance_mm: float | None) -> None:
    """X's uncertainty alone does not make a miss a measurement of X."""
    mapping = SharedError(np.zeros((1, 3, 6)) + np.eye(3, 6), np.eye(6))
    with pytest.raises(GeometryError):
        evaluate_touch_test(np.zeros((1, 3)), np.zeros((1, 3)), mapping, [], own * np.eye(3)[None], tolerance_mm)
