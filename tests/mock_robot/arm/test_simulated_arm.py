"""Speed profiles, paths, and the difference between where the arm is and where it says it is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.kinematics.arm import OutsideJointLimits
from calibration.transforms import inverse, vector_from_rotation
from mock_robot.arm.built_arm import MAX_WARMTH_K, build_arm
from mock_robot.arm.paths import LinePath
from mock_robot.arm.simulated_arm import IN_POSITION_S, ArmNoise, Braked, SimulatedArm, Trapezoid, plan_motion
from tests.mock_robot.controller_client import ARM, AWAY, HOME

positive = st.floats(0.01, 100.0)


@given(length=positive, speed=positive, acceleration=positive)
def test_a_trapezoid_goes_the_whole_way_forward_within_its_speed(
    length: float, speed: float, acceleration: float
) -> None:
    profile = Trapezoid(length, speed, acceleration)
    times = np.linspace(-0.1, 1.1, 60) * profile.duration_s
    distances = np.array([profile.distance_at(t) for t in times])
    assert distances[0] == 0.0
    assert distances[-1] == pytest.approx(length)
    assert np.all(np.diff(distances) >= -1e-12 * length)
    assert np.diff(distances).max() <= speed * (times[1] - times[0]) * (1 + 1e-9)
    assert all(profile.speed_at(t) <= speed * (1 + 1e-12) for t in times)


@given(length=positive, speed=positive, acceleration=positive, part=st.floats(0.0, 1.0))
def test_braking_stands_before_the_end_and_never_goes_back(
    length: float, speed: float, acceleration: float, part: float
) -> None:
    whole = Trapezoid(length, speed, acceleration)
    braked = Braked(whole, part * whole.duration_s, acceleration)
    assert braked.duration_s <= whole.duration_s
    times = np.linspace(0.0, 1.2, 60) * whole.duration_s
    distances = np.array([braked.distance_at(t) for t in times])
    assert np.all(np.diff(distances) >= -1e-9 * length)
    assert distances[-1] <= length * (1 + 1e-12)
    assert distances[-1] == distances[-2], "what stands stands to the last bit"
    assert distances[-1] == pytest.approx(braked.distance_at(braked.duration_s))
    at_brake = whole.distance_at(part * whole.duration_s)
    stopping = whole.speed_at(part * whole.duration_s) ** 2 / (2 * acceleration)
    assert distances[-1] == pytest.approx(min(at_brake + stopping, length), rel=1e-6, abs=1e-9)


def test_a_slow_move_takes_its_way_over_its_speed_and_a_fast_one_the_slowest_axis() -> None:
    slow = plan_motion(ARM, HOME, AWAY, 20.0, False, 0.0)
    way_mm = np.linalg.norm(
        np.diff([ARM.forward(slow.joints_at(t))[:3, 3] for t in np.linspace(0, slow.end_s, 200)], axis=0), axis=1
    ).sum()
    assert slow.end_s == pytest.approx(way_mm / 20.0, rel=0.02)
    fast = plan_motion(ARM, HOME, AWAY, 1e6, False, 0.0)
    axis_s = (np.abs(AWAY - HOME) / np.array(ARM.speed_rad_s)).max()
    assert fast.end_s >= axis_s
    speeds = np.diff([fast.joints_at(t) for t in np.linspace(0, fast.end_s, 200)], axis=0) / (fast.end_s / 199)
    assert np.all(np.abs(speeds) <= np.array(ARM.speed_rad_s) * (1 + 1e-6))


def test_a_line_knows_how_far_it_can_be_followed() -> None:
    assert LinePath(ARM, HOME, AWAY).reachable_fraction == 1.0
    behind = np.radians([175.0, 15.0, 0.0, 0.0, 65.0, 0.0])
    assert 0.0 < LinePath(ARM, HOME, behind).reachable_fraction < 1.0


def test_standstill_counts_after_the_settling_time() -> None:
    arm = SimulatedArm(ARM, HOME, ArmNoise())
    assert arm.is_settled_at(0.0)
    arm.depart(AWAY, 250.0, False, 10.0)
    assert arm.is_moving_at(10.1)
    assert not arm.is_moving_at(arm.end_s)
    assert not arm.is_settled_at(arm.end_s + 0.9 * IN_POSITION_S)
    assert arm.is_settled_at(arm.end_s + IN_POSITION_S)
    np.testing.assert_array_equal(arm.joints_at(arm.end_s), AWAY)


def test_it_cannot_begin_outside_its_limits() -> None:
    with pytest.raises(OutsideJointLimits, match="axis 5"):
        SimulatedArm(ARM, np.radians([0, 0, 0, 0, 130.0, 0]), ArmNoise())


def test_the_true_pose_is_off_by_the_arms_error_which_stays_while_it_stands() -> None:
    arm = SimulatedArm(ARM, HOME, ArmNoise(0.3, np.radians(0.03), seed=5))
    first = inverse(arm.reported_base_T_flange(0.0)) @ arm.true_base_T_flange(0.0)
    later = inverse(arm.reported_base_T_flange(99.0)) @ arm.true_base_T_flange(99.0)
    np.testing.assert_array_equal(first, later)
    assert np.linalg.norm(first[:3, 3]) > 0.01
    arm.depart(AWAY, 250.0, False, 100.0)
    arm.depart(HOME, 250.0, False, arm.end_s)
    back = inverse(arm.reported_base_T_flange(1e3)) @ arm.true_base_T_flange(1e3)
    assert np.abs(back - first).max() > 0.01, "coming back to the same pose is another standstill"


def test_the_arms_error_has_the_stated_sigma_in_every_component_and_is_seeded() -> None:
    noise = ArmNoise(0.3, np.radians(0.03), seed=5)
    errors = np.array([noise.flange_T_true(k) for k in range(4000)])
    translations, turns = errors[:, :3, 3], vector_from_rotation(errors[:, :3, :3])
    assert np.all(np.abs(translations.std(0) / 0.3 - 1) < 0.05)
    assert np.all(np.abs(turns.std(0) / np.radians(0.03) - 1) < 0.05)
    assert np.all(np.abs(translations.mean(0)) < 0.02)
    assert np.all(np.abs(np.corrcoef(np.hstack([translations, turns]).T) - np.eye(6)) < 0.06)
    np.testing.assert_array_equal(noise.flange_T_true(3), ArmNoise(0.3, np.radians(0.03), seed=5).flange_T_true(3))
    assert np.abs(noise.flange_T_true(3) - ArmNoise(0.3, np.radians(0.03), seed=6).flange_T_true(3)).max() > 1e-6


def test_without_noise_the_arm_is_where_it_says() -> None:
    arm = SimulatedArm(ARM, HOME, ArmNoise())
    np.testing.assert_array_equal(arm.true_base_T_flange(0.0), arm.reported_base_T_flange(0.0))


def test_an_arm_as_built_reports_the_drawing_and_stands_elsewhere() -> None:
    built = build_arm(ARM, "standard", seed=3)
    arm = SimulatedArm(ARM, HOME, ArmNoise(), built=built)
    np.testing.assert_allclose(arm.reported_base_T_flange(0.0), ARM.forward(HOME))
    off = np.linalg.norm((arm.true_base_T_flange(0.0) - arm.reported_base_T_flange(0.0))[:3, 3])
    assert 0.05 < off < 5.0


def test_play_depends_on_the_side_from_which_an_axis_came() -> None:
    arm = SimulatedArm(ARM, HOME, ArmNoise(), built=build_arm(ARM, "worn", seed=3))
    aside = np.radians([10.0, 0, 0, 0, 0, 0])
    stood = []
    for start in (HOME - aside, HOME + aside):
        arm.jog(start, 1.0, arm.end_s)
        arm.jog(HOME, 1.0, arm.end_s)
        stood.append(arm.true_base_T_flange(arm.end_s))
    assert np.abs(stood[0] - stood[1])[:3, 3].max() > 1e-3


def test_an_arm_as_built_grows_while_it_runs_and_one_as_drawn_does_not() -> None:
    built = build_arm(ARM, "standard", seed=3)
    arm, drawn = (SimulatedArm(ARM, HOME, ArmNoise(), built=one) for one in (built, None))
    moved = [np.linalg.norm((arm.true_base_T_flange(at) - arm.true_base_T_flange(0.0))[:3, 3]) for at in (600, 7200)]
    expansion = abs(built.errors[built.model.index("expansion")])
    assert 0.0 < moved[0] < moved[1] <= expansion * MAX_WARMTH_K * 2 * ARM.reach_mm
    np.testing.assert_array_equal(drawn.true_base_T_flange(7200), drawn.true_base_T_flange(0.0))
    np.testing.assert_array_equal(arm.reported_base_T_flange(7200), arm.reported_base_T_flange(0.0))
