"""Sessions of arms as built: the controller reports the drawing's poses, the camera sees where the flange is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.load import NO_LOAD, Load
from calibration.kinematics.stance import Stance
from calibration.problem import Detection, Problem, View
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from mock_robot.arm.built_arm import SWITCHED_ON_C, BuiltArm
from tests.simulated.sessions import BOARD, CAMERA, CellNoise, looking

REPEATABILITY = CellNoise(0.05, float(np.radians(0.002)), 0.02)
"""What an arm scatters by about the same pose, and the pixels."""

MOUNT_T_CAMERA = transform(rotation_from_vector([0.03, -0.02, 1.2]), np.array([60.0, 10.0, 90.0]))


@dataclass(frozen=True, eq=False)
class ArmCell:
    """Sessions with an arm as built, one for each place of the target, and the truth."""

    built: BuiltArm
    problems: tuple[Problem, ...]
    mount_T_camera: Array


def reachable_views(
    rng: np.random.Generator,
    arm: Arm,
    base_T_target: Array,
    count: int,
    *,
    tilt_rad: float = float(np.radians(40.0)),
    any_posture: bool = True,
    one_posture: bool = False,
) -> Array:
    """Joints (count, 6) from which the camera sees the target at (4, 4); of each pose one of the arm's postures.

    `any_posture`: also with the arm turned back. `one_posture`: of cfx 0 only, as an operator jogs.
    """
    found: list[Array] = []
    for _ in range(100 * count):
        wanted = base_T_target @ inverse(MOUNT_T_CAMERA @ looking(rng, BOARD, tilt_rad))
        try:
            solutions = arm.inverse(wanted)
        except UnreachablePoseError:
            continue
        solutions = solutions[np.abs(solutions).max(axis=1) < np.radians(200.0)]
        if not any_posture:
            solutions = solutions[np.abs(solutions[:, 0]) < np.pi / 2]
        if one_posture:
            solutions = np.array([one for one in solutions if arm.configuration(one).cfx == 0])
        if len(solutions):
            found.append(solutions[rng.integers(len(solutions))])
        if len(found) == count:
            return np.array(found)
    raise ValueError(f"{arm.name} reaches too few views of that target")


def lengths_of(arm: Arm) -> dict[str, float]:
    """Drawn lengths, mm, by the names of their errors."""
    return {
        "link_1_tx": arm.shoulder_forward_mm, "link_2_tz": arm.lower_arm_mm, "link_3_tx": arm.forearm_mm,
        "link_3_tz": arm.elbow_up_mm, "link_5_tz": arm.wrist_offset_mm,
    }  # fmt: skip


def least_travel(arm: Arm, base_T_flange: Array) -> Array:
    """Joints (n, 6) of poses (n, 4, 4): of each the nearest to those before, at first to a wrist that is bent down."""
    near, found = np.radians([0.0, 0.0, 0.0, 0.0, 30.0, 0.0]), []
    for pose in base_T_flange:
        near = arm.nearest(pose, near)
        found.append(near)
    return np.array(found)


def target_before(arm: Arm, forward: float = 0.62, up: float = 0.0, aside: float = 0.0) -> Array:
    """base_T_target (4, 4) of a target that lies face up; places in shares of the reach from the base."""
    place = arm.reach_mm * np.array([forward, aside, up])
    flat = rotation_from_vector([np.pi, 0.0, 0.0])
    return transform(flat, place - flat @ BOARD.points_mm.mean(axis=0))


def arm_cell(
    rng: np.random.Generator,
    built: BuiltArm,
    joints_rad: Sequence[Array],
    base_T_targets: Sequence[Array] | Array,
    noise: CellNoise = REPEATABILITY,
    load: Load = NO_LOAD,
    temperatures_c: Sequence[Array] | None = None,
    mount_T_camera: Array = MOUNT_T_CAMERA,
) -> ArmCell:
    """The views from joints (n, 6) of each target (4, 4); axes come to a view from the one before.

    `temperatures_c` (n,) of the arm, which is as built at SWITCHED_ON_C; not known, and that, by default.
    """
    problems = []
    for place, (joints, base_T_target) in enumerate(zip(joints_rad, base_T_targets, strict=True)):
        approached = np.sign(np.diff(joints, axis=0, prepend=joints[:1] - 1.0))
        n = len(joints)
        scatter = draw_scatter(rng, n, noise)
        warm_c = None if temperatures_c is None else temperatures_c[place]
        warmth_k = None if warm_c is None else warm_c - SWITCHED_ON_C
        stands = built.base_T_flange(Postures(joints, load, approached, warmth_k)) @ scatter
        seen = inverse(stands @ mount_T_camera) @ base_T_target
        pixels = CAMERA.project(map_points(seen, BOARD.points_mm).reshape(-1, 3)).reshape(n, -1, 2)
        pixels = pixels + noise.image_px * rng.standard_normal(pixels.shape)
        ids, poses = np.arange(pixels.shape[1]), built.drawing.forward(joints)
        known_c = [None] * n if warm_c is None else [float(one) for one in warm_c]
        views = [
            View(row, Stance(poses[row], joints[row]), Detection(ids, pixels[row]), arm_temperature_c=known_c[row])
            for row in range(n)
        ]
        known = None if load == NO_LOAD else load
        problems.append(Problem("eye-in-hand", BOARD, CAMERA, CAMERA.image_size, tuple(views), load=known))
    return ArmCell(built, tuple(problems), mount_T_camera)


def draw_scatter(rng: np.random.Generator, count: int, noise: CellNoise = REPEATABILITY) -> Array:
    """Motions (count, 4, 4) of the flange about the pose at which it would stand, in its own frame."""
    turns = rotation_from_vector(noise.robot_rotation_rad * rng.standard_normal((count, 3)))
    return transform(turns, noise.robot_translation_mm * rng.standard_normal((count, 3)))


def draw_points(rng: np.random.Generator, count: int) -> Array:
    """Points (count, 3) of the camera's frame at the distance at which it looks, mm."""
    return np.column_stack([rng.uniform(-100, 100, (count, 2)), rng.uniform(450, 650, count)])


def rms_length(errors_mm: Array) -> float:
    """RMS of the lengths of errors (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(errors_mm**2, axis=1))))


def normalised_rms(errors_mm: Array, covariances: Array) -> float:
    """RMS of errors (n, 3) in units of what their covariances (n, 3, 3) claim: 1 where these hold."""
    squares = np.einsum("ni,nij,nj->n", errors_mm, np.linalg.inv(covariances), errors_mm)
    return float(np.sqrt(squares.mean() / 3))


def session_document(problem: Problem) -> dict[str, Any]:
    """session.json of the views, with corners in place of images, and joints."""
    return {
        "schema_version": 1,
        "setup": problem.setup,
        "target": {"kind": "chessboard", "columns": 11, "rows": 8, "pitch_mm": 15.0},
        "camera": CameraDocument.of(CAMERA).model_dump(mode="json"),
        "views": [_view_document(view) for view in problem.views],
    }


def _view_document(view: View) -> dict[str, Any]:
    assert view.stance.joints_rad is not None
    assert view.detection is not None
    corners = np.column_stack([view.detection.ids, view.detection.corners_px])
    return {
        "base_T_flange": PoseDocument.of(view.base_T_flange).model_dump(mode="json"),
        "joints_deg": np.degrees(view.stance.joints_rad).tolist(),
        "corners_px": [[int(name), u, v] for name, u, v in corners.tolist()],
    }


BOX_SHARES = np.array([[0.42, -0.35, 0.1], [0.75, 0.35, 0.5]])
"""Corners of the box of flange places, in shares of the arm's reach."""


def flange_above(rng: np.random.Generator, arm: Arm, shares: Array, tilt_rad: float) -> Array | None:
    """Joints (6,) with the flange at a place in shares of the reach (3,), looking down; None where out of reach."""
    tilt = rotation_from_vector(tilt_rad * np.append(rng.uniform(-1, 1, 2), 0.0))
    turn = rotation_from_vector([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    down = tilt @ rotation_from_vector([np.pi, 0.0, 0.0]) @ turn
    try:
        solutions = arm.inverse(transform(down, arm.reach_mm * shares))
    except UnreachablePoseError:
        return None
    usual = [one for one in solutions if arm.configuration(one).cfx < 2 and np.abs(one).max() < np.radians(200)]
    return usual[rng.integers(len(usual))] if usual else None


def box_postures(rng: np.random.Generator, arm: Arm, count: int) -> Array:
    """Joints (count, 6) anywhere in the box, tilted up to 40° from above."""
    found: list[Array] = []
    while len(found) < count:
        joints = flange_above(rng, arm, rng.uniform(*BOX_SHARES), float(np.radians(40.0)))
        if joints is not None:
            found.append(joints)
    return np.array(found)


def target_places(rng: np.random.Generator, arm: Arm, count: int) -> Array:
    """base_T_target (count, 4, 4), each where a posture of the box sees it; far from one another."""
    joints = box_postures(rng, arm, 40)
    flange = arm.forward(joints)
    places = flange[:, :3, 3]
    chosen = [int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))]
    while len(chosen) < count:
        apart = np.linalg.norm(places[:, None] - places[chosen], axis=-1).min(axis=1)
        chosen.append(int(np.argmax(apart)))
    return np.array([flange[row] @ MOUNT_T_CAMERA @ looking(rng, BOARD, float(np.radians(20.0))) for row in chosen])
