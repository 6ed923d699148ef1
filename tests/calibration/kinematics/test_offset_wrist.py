"""The GoFa's kinematics: an independent chain, all postures of a pose, singularities, and a plan that it can drive."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.arm import Arm, OutOfReach
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.planning.reachability import MIN_SINGULARITY_CLEARANCE, reachable_by
from calibration.transforms import Array, transform
from tests.calibration.kinematics.link_chain import urdf_chain

GOFAS = [arm for arm in ARMS.values() if arm.wrist_offset_mm]
GOFA = find_arm("CRB 15000-5/0.95")


def drawn(arm: Arm, count: int) -> Array:
    return np.random.default_rng(5).uniform(arm.lower_rad, arm.upper_rad, (count, 6))


def turned_apart(first: Array, second: Array) -> Array:
    """Largest difference (...) of angles, whole turns left out."""
    apart: Array = np.abs((first - second + np.pi) % (2 * np.pi) - np.pi).max(-1)
    return apart


@pytest.mark.parametrize("arm", GOFAS, ids=lambda arm: arm.name)
def test_every_posture_maps_back_and_the_original_is_among_them(arm: Arm) -> None:
    joints = drawn(arm, 100)
    poses = arm.forward(joints)
    np.testing.assert_allclose(poses, [urdf_chain(arm, each) for each in joints], atol=1e-9)
    branches = arm.branches(poses)
    pose, row = np.nonzero(np.isfinite(branches).all(-1))
    found = branches[pose, row]
    np.testing.assert_allclose(arm.forward(found), poses[pose], atol=1e-9)
    assert [arm.configuration(each).cfx for each in found] == (row % 8).tolist()
    assert np.bincount(pose).max() <= 16
    clear = arm.singularity_clearance(joints) >= MIN_SINGULARITY_CLEARANCE
    nearest = np.nanmin(turned_apart(branches, joints[:, None]), axis=1)
    assert clear.sum() > 70
    assert nearest[clear].max() < 1e-9


@pytest.mark.parametrize("arm", GOFAS, ids=lambda arm: arm.name)
def test_a_posture_at_round_angles_is_among_those_found(arm: Arm) -> None:
    """The equation in axis 6 is then exactly zero at one of the angles that are sampled."""
    joints = np.radians(
        [[0, 0, 0, 0, 30, 0], [0, 0, 0, 0, 90, 0], [0, 20, 10, 0, 40, 0], [0, 0, 0, 0, 30, 90], [90, 0, 0, 0, 30, 180]]
    )
    branches = arm.branches(arm.forward(joints))
    assert np.nanmin(turned_apart(branches, joints[:, None]), axis=1).max() < 1e-9


def test_a_search_from_many_starts_finds_no_other_posture() -> None:
    joints = drawn(GOFA, 2)
    rng = np.random.default_rng(1)
    for pose in GOFA.forward(joints):
        known = GOFA.branches(pose)
        known = known[np.isfinite(known).all(-1)]

        def off(q: Array, pose: Array = pose) -> Array:
            return np.concatenate([((GOFA.forward(q) - pose)[:3] / [[500, 500, 500, 1e5]] * 500).ravel()])

        for start in rng.uniform(-np.pi, np.pi, (20, 6)):
            end = least_squares(off, start, xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200)
            if np.abs(end.fun).max() < 1e-9:
                assert turned_apart(known, end.x).min() < 1e-5


def test_the_clearance_is_zero_where_two_postures_meet_and_follows_the_determinant() -> None:
    def determinant(q: Array) -> float:
        steps = 1e-6 * np.eye(6)
        moves = [np.linalg.inv(GOFA.forward(q - step)) @ GOFA.forward(q + step) / 2e-6 for step in steps]
        return float(np.linalg.det([[*m[:3, 3] / GOFA.reach_mm, m[2, 1], m[0, 2], m[1, 0]] for m in moves]))

    for q in drawn(GOFA, 20):
        along = q + np.linspace(0.0, 2.0, 401)[:, None] * np.eye(6)[4]
        signs = np.sign([determinant(each) for each in along[::40]])
        (changes,) = np.nonzero(signs[:-1] != signs[1:])
        for change in changes:
            assert GOFA.singularity_clearance(along[40 * change : 40 * change + 41]).min() < 0.02


def test_out_of_reach_is_given_with_its_size() -> None:
    pose = transform(np.eye(3), [0.0, 0.0, 2000.0])
    with pytest.raises(OutOfReach, match="beyond the reach") as refused:
        GOFA.inverse(pose)
    straight = np.hypot(GOFA.forearm_mm, GOFA.elbow_up_mm) + GOFA.lower_arm_mm
    wrist_mm = np.hypot(80.0, 2000.0 - 101.0 - 265.0)
    assert refused.value.excess_mm == pytest.approx(wrist_mm - straight, abs=0.1)


def test_a_move_keeps_its_posture_and_its_travel() -> None:
    start = np.radians([10.0, 20.0, 10.0, 20.0, 50.0, 30.0])
    near = start + np.radians(np.random.default_rng(2).uniform(-15, 15, (40, 6)))
    reachable = reachable_by(GOFA, start, np.radians(60.0))
    assert reachable(GOFA.forward(near)).mean() > 0.9
    for joints in near[:5]:
        pose, here = GOFA.forward(joints), GOFA.configuration(joints)
        np.testing.assert_allclose(GOFA.nearest(pose, joints), joints, atol=1e-9)
        np.testing.assert_allclose(GOFA.matching(pose, here, joints), joints, atol=1e-9)


def test_the_built_arm_without_errors_is_the_drawing() -> None:
    joints = drawn(GOFA, 10)
    model = ArmErrorModel(GOFA)
    np.testing.assert_allclose(model.forward(np.zeros(len(model)), Postures(joints)), GOFA.forward(joints), atol=1e-9)
