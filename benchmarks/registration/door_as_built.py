"""The mock cell's door in twelve views of a standard arm: deviation from the truth by what is known of the arm.

The arm is identified from a hand-eye session of its own: 12 ordinary views of the target on its table, or 40 views
of four places, planned for the postures that see the door. The scans repeat as REPEATABILITY says.
`bound`: by the Cramer-Rao bound of X and the arm's errors, how far the middles of the views are off along the door's
normal in an unbiased estimate from the same views; without the scatter of the scans, which `true poses` shows.
"""

from collections.abc import Sequence

import numpy as np

from benchmarks.registration.door import COLUMNS_MM, ROWS_MM, deviation_mm, looking_at, surface_of
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.robot_accuracy import MIN_POSE_NOISE, RobotNoise
from calibration.likelihood.mixed_model import Variances
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.solve import estimate_session
from calibration.solver.registered_points import registered_points
from calibration.transforms import Array, inverse, transform
from extensions.arm_identification.mathematics.identification import identify_arm_session
from extensions.arm_identification.mathematics.joints import approach_sides
from extensions.arm_identification.mathematics.views import ArmExperiment, PointsOfInterest
from mock_robot.arm.built_arm import BuiltArm, build_arm
from mock_robot.scene.scanner_view import ScannerModel, scan
from mock_robot.truth.truth import IRB_1600, PART_FACING_THE_ROBOT, PART_MIDDLE_MM, TARGET_FACING_UP, TARGET_MIDDLE_MM
from mock_robot.truth.truth_sheet import DISTANCE_MM
from registration.fusion.pose_adjustment import refine_poses
from registration.points.surface import Surface
from tests.simulated.arms import (
    MOUNT_T_CAMERA,
    REPEATABILITY,
    ArmCell,
    arm_cell,
    draw_scatter,
    reachable_views,
    target_places,
)
from tests.simulated.sessions import BOARD, CAMERA

BASE_T_DOOR = transform(PART_FACING_THE_ROBOT, PART_MIDDLE_MM)
BASE_T_TARGET = transform(
    TARGET_FACING_UP, np.array(TARGET_MIDDLE_MM) - TARGET_FACING_UP @ BOARD.points_mm.mean(axis=0)
)
ORDINARY, PLACES, CANDIDATES = 12, 4, 50

SESSIONS = {"12 ordinary views": None, "40 planned views": 40}
"""By name the number of views that are planned for the door."""


def door_as_built_table(seeds: range, _: Sequence[str] = ()) -> None:
    """RMS over the arms, and the worst arm."""
    print(f"Door of 1.2 m in 12 views, standard {IRB_1600} ({len(seeds)} arms): deviation from the truth in mm, worst")
    print(f"{'arm from':22}{'plain':>14}{'refined':>14}{'arm':>14}{'both':>14}{'true poses':>14}{'bound':>14}")
    for name, planned in SESSIONS.items():
        rows = np.array([_deviations(planned, seed) for seed in seeds])
        cells = [f"{np.sqrt(np.mean(column**2)):.3f} {column.max():.3f}" for column in rows.T]
        print(f"{name:22}" + "".join(f"{cell:>14}" for cell in cells), flush=True)


def _deviations(planned: int | None, seed: int) -> Array:
    """Deviations (5,) plain, refined, with the arm, with both, and at the true poses; and the bound."""
    rng, arm = np.random.default_rng([seed, 11]), find_arm(IRB_1600)
    built = build_arm(arm, "standard", seed)
    joints = _door_joints(arm)
    cell = _ordinary(rng, built) if planned is None else _planned(rng, built, joints, planned)
    best = estimate_session(max(cell.problems, key=lambda problem: len(problem.views))).best
    fit = identify_arm_session(arm, cell.problems)
    stands, surfaces = _scanned(rng, built, joints)
    drawn, as_built = arm.forward(joints), fit.model.forward(fit.parameters, Postures(joints))
    plain, with_arm = drawn @ best.chain.mount_T_camera, as_built @ fit.mount_T_camera
    refined = _refine(surfaces, plain, drawn, best.variances)
    both = _refine(surfaces, with_arm, as_built, best.variances)
    placed = (plain, refined, with_arm, both, stands @ MOUNT_T_CAMERA)
    return np.array(
        [deviation_mm(surfaces, list(poses), inverse(BASE_T_DOOR)) for poses in placed] + [_bound_mm(cell, joints)]
    )


def _bound_mm(cell: ArmCell, door_joints: Array) -> float:
    """RMS along the door's normal of the points that the scans of the door have in their middles."""
    model = cell.built.model
    targets = [estimate_session(problem).best.chain.anchor_T_target for problem in cell.problems]
    scenes = [Scene("eye-in-hand", BOARD, CAMERA, MOUNT_T_CAMERA, target, _expected_noise()) for target in targets]
    views = [Postures(np.array([view.stance.joints_rad for view in problem.views])) for problem in cell.problems]
    points = np.tile([0.0, 0.0, DISTANCE_MM], (len(door_joints), 1))
    interest = PointsOfInterest(Postures(door_joints), points)
    experiment = ArmExperiment(model, scenes, views, interest, model.sigmas)
    kept = np.r_[0:6, 6 + 6 * len(scenes) : 6 + 6 * len(scenes) + len(model)]
    covariance = experiment.covariance(range(sum(map(len, views))))[np.ix_(kept, kept)]
    of_arm = ArmEstimate(model, np.zeros(len(model)), covariance, MOUNT_T_CAMERA)
    normal = BASE_T_DOOR[:3, 2]
    return float(np.sqrt(np.mean(normal @ registered_points(of_arm, interest.postures, points)[1] @ normal)))


def _expected_noise() -> ExpectedNoise:
    return ExpectedNoise(REPEATABILITY.image_px, REPEATABILITY.robot_rotation_rad, REPEATABILITY.robot_translation_mm)


def _door_joints(arm: Arm) -> Array:
    """Joints (12, 6) row by row in alternating direction, in one posture."""
    found: list[Array] = []
    for row, y in enumerate(ROWS_MM):
        for x in COLUMNS_MM if row % 2 == 0 else COLUMNS_MM[::-1]:
            solutions = arm.inverse(BASE_T_DOOR @ looking_at(x, y) @ inverse(MOUNT_T_CAMERA))
            before = found[-1] if found else np.zeros(6)
            found.append(solutions[np.argmin(np.abs(solutions - before).max(axis=1))])
    return np.array(found)


def _scanned(rng: np.random.Generator, built: BuiltArm, joints: Array) -> tuple[Array, list[Surface]]:
    """Where the flange truly stood (n, 4, 4), and what the scanner saw from there."""
    n = len(joints)
    scatter = draw_scatter(rng, n)
    stands = built.base_T_flange(Postures(joints, sides=approach_sides(joints))) @ scatter
    seen_from = inverse(BASE_T_DOOR) @ stands @ MOUNT_T_CAMERA
    return stands, [surface_of(scan(ScannerModel(), [pose], rng)) for pose in seen_from]


def _refine(surfaces: Sequence[Surface], base_T_camera: Array, base_T_flange: Array, levels: Variances) -> Array:
    noise = RobotNoise(
        max(float(np.sqrt(levels.translation)), MIN_POSE_NOISE.translation_mm),
        max(float(np.sqrt(levels.rotation)), MIN_POSE_NOISE.rotation_rad),
    )
    found = refine_poses(surfaces, list(base_T_camera), list(base_T_flange), noise)
    return np.array([one.motion @ pose for one, pose in zip(found.corrections, base_T_camera, strict=True)])


def _ordinary(rng: np.random.Generator, built: BuiltArm) -> ArmCell:
    views = reachable_views(rng, built.drawing, BASE_T_TARGET, ORDINARY)
    return arm_cell(rng, built, [views], [BASE_T_TARGET])


def _planned(rng: np.random.Generator, built: BuiltArm, door_joints: Array, views: int) -> ArmCell:
    arm = built.drawing
    model, targets = ArmErrorModel(arm), target_places(rng, arm, PLACES)
    points = np.tile([0.0, 0.0, DISTANCE_MM], (len(door_joints), 1))
    candidates = [Postures(reachable_views(rng, arm, target, CANDIDATES)) for target in targets]
    scenes = [Scene("eye-in-hand", BOARD, CAMERA, MOUNT_T_CAMERA, target, _expected_noise()) for target in targets]
    interest = PointsOfInterest(Postures(door_joints), points)
    chosen, _ = ArmExperiment(model, scenes, candidates, interest, model.sigmas).choose(views)
    joints = [candidates[place].joints_rad[[row for at, row in chosen if at == place]] for place in range(PLACES)]
    return arm_cell(rng, built, joints, targets)
