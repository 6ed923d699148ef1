"""An arm that was identified with one load on its flange, and carries another one then."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.errors import GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.load import NO_LOAD, Load
from calibration.solver.registered_points import registered_points
from calibration.transforms import map_points
from extensions.arm_identification.mathematics.identification import identify_arm_session
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import (
    arm_cell,
    box_postures,
    draw_points,
    normalised_rms,
    reachable_views,
    rms_length,
    target_places,
)
from tests.support.cases import seeds

ARM = find_arm("IRB 6700-200/2.60")
HEAVY, LIGHT = Load(150.0, (0.0, 0.0, 200.0)), Load(20.0, (0.0, 0.0, 80.0))
ARMS, PLACES, VIEWS, HELD_OUT = 8, 3, 8, 50


def errors_of(seed: int) -> tuple[float, float, float]:
    """RMS errors of points under the light load, mm, by the heavy one's sag and by its own; these over the claim."""
    rng = np.random.default_rng([seed, 3])
    targets, built = target_places(rng, ARM, PLACES), build_arm(ARM, "standard", seed)
    joints = [reachable_views(rng, ARM, target, VIEWS) for target in targets]
    fit = identify_arm_session(ARM, arm_cell(rng, built, joints, targets, load=HEAVY).problems)
    assert fit.load == HEAVY
    cell = arm_cell(rng, built, joints, targets, load=LIGHT)
    held_out = box_postures(rng, ARM, HELD_OUT)
    points = draw_points(rng, HELD_OUT)
    true = map_points(built.base_T_flange(Postures(held_out, LIGHT)) @ cell.mount_T_camera, points[:, None])[:, 0]
    off = []
    for load in (HEAVY, LIGHT):
        estimate = replace(fit, load=load)
        found, covariances = registered_points(estimate, estimate.postures(held_out), points)
        off.append(found - true)
    return rms_length(off[0]), rms_length(off[1]), normalised_rms(off[1], covariances)


@pytest.mark.slow
def test_the_sag_under_another_load_is_predicted_and_how_well_is_claimed() -> None:
    as_before, for_load, claimed = np.sqrt(
        np.mean(np.square([errors_of(seed) for seed in seeds(ARMS, every=2)]), axis=0)
    )
    print(f"points under another load: {as_before:.2f} mm by the sag of the first, {for_load:.2f} mm by its own,"
          f" {claimed:.2f} of what is claimed")  # fmt: skip
    assert for_load < 0.9 * as_before
    assert 0.85 < claimed < 1.15


def test_views_with_different_loads_are_refused() -> None:
    rng = np.random.default_rng(0)
    targets, built = target_places(rng, ARM, 2), build_arm(ARM, "standard", 0)
    joints = [reachable_views(rng, ARM, target, 4) for target in targets]
    first, second = arm_cell(rng, built, joints, targets, load=HEAVY).problems
    with pytest.raises(GeometryError, match="150 and 20 kg"):
        identify_arm_session(ARM, [first, replace(second, load=LIGHT)])


def test_a_load_beyond_the_payload_is_refused() -> None:
    rng = np.random.default_rng(0)
    targets, built = target_places(rng, ARM, 1), build_arm(ARM, "standard", 0)
    (problem,) = arm_cell(rng, built, [reachable_views(rng, ARM, targets[0], 4)], targets, load=HEAVY).problems
    with pytest.raises(GeometryError, match=r"500 kg, an IRB 6700-200/2\.60 carries 200 kg"):
        identify_arm_session(ARM, [replace(problem, load=replace(HEAVY, mass_kg=500.0))])


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (HEAVY, True),
        (replace(HEAVY, mass_kg=160.0), True),
        (replace(HEAVY, mass_kg=170.0), False),
        (replace(HEAVY, centre_mm=(0.0, 15.0, 200.0)), True),
        (replace(HEAVY, centre_mm=(0.0, 25.0, 200.0)), False),
        (LIGHT, False),
        (NO_LOAD, False),
    ],
)
def test_loads_of_about_the_same_weight_and_centre_count_as_one(other: Load, same: bool) -> None:
    assert HEAVY.is_as(other) is other.is_as(HEAVY) is same
