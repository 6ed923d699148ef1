"""Seconds of the arm to a stated U: `python -m benchmarks.hand_eye.seconds_to_u [--cells 12] [--tolerance-mm 0.5]`

Runs of cells drawn at random: an ABB arm, a camera on its flange, a measured board before it, X guessed 30 mm and 5
degrees off. The mock's arm tells how long each move takes; a stop takes STOP_S beside it. Each cell runs twice: with
poses that leave the least U, whatever the way to them, as on 00fb5088, and with those that save the arm's time.
"""

import argparse
import time
from dataclasses import dataclass, replace

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.robot_accuracy import USUAL_BELIEF
from calibration.kinematics.stance import Stance
from calibration.knowledge import Knowledge, TargetKnowledge
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.planning.next_view import StoppingRule, next_view, plan_ahead
from calibration.planning.reachability import reachable_by
from calibration.planning.route import STOP_S
from calibration.planning.scene_belief import ScenePrior
from calibration.planning.viewpoints import ViewpointLimits, flange_poses, random_viewpoints, within_limits
from calibration.problem import Detection, Problem, View
from calibration.targets import Chessboard
from calibration.transforms import Array, map_points, rotation_from_vector, transform, transform_from_vector
from daemon.runs.run_modules import load_run_modules
from mock_robot.arm.simulated_arm import plan_motion
from mock_robot.links.cb_program import speeds_sharing

MODELS = ("IRB 1600-6/1.45", "IRB 2600-20/1.65", "IRB 4600-40/2.55")
BOARD = Chessboard(11, 8, 20.0)
CAMERA = CameraModel(np.array([[1800.0, 0, 640], [0, 1800, 512], [0, 0, 1]]), np.zeros(5), (1280, 1024))
LIMITS = ViewpointLimits(float(np.radians(40.0)), float(np.radians(90.0)), (400.0, 800.0))
KNOWN = Knowledge(TargetKnowledge("certified"), "this-session", "absolute-accuracy")
NOISE = ExpectedNoise(0.05, float(np.radians(0.005)), 0.05)
SPEED_MM_S, REACH_MM = 250.0, 400.0
MAX_VIEWS = 12


@dataclass(frozen=True, eq=False)
class SimulatedCell:
    """A cell with the arm's first joints (6,), which show the board, and a guess of X."""

    arm: Arm
    scene: Scene
    joints_rad: Array
    guess: ScenePrior


def draw_cell(seed: int) -> SimulatedCell:
    """A cell whose arm can take the first pose, with half a metre of room around it."""
    rng = np.random.default_rng(seed)
    arm = find_arm(MODELS[seed % len(MODELS)])
    while True:
        mount_T_camera = transform(
            rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
            @ rotation_from_vector(rng.uniform(-0.3, 0.3, 3)),
            rng.uniform([-90.0, -90.0, 40.0], [90.0, 90.0, 160.0]),
        )
        ahead_mm = rng.uniform(0.5, 0.7) * arm.reach_mm
        facing_up = rotation_from_vector(np.array([np.pi, 0.0, 0.0])) @ rotation_from_vector(rng.uniform(-0.4, 0.4, 3))
        board = transform(facing_up, np.array([ahead_mm, rng.uniform(-200, 200), rng.uniform(0, 300)]))
        scene = Scene("eye-in-hand", BOARD, CAMERA, mount_T_camera, board, NOISE, knowledge=KNOWN)
        pose = flange_poses(scene, random_viewpoints(replace(LIMITS, tilt_rad=0.3), 1, rng))
        if not within_limits(scene, LIMITS, pose).all():
            continue
        try:
            joints = arm.nearest(pose[0], np.zeros(6))
        except UnreachablePoseError:
            continue
        near = flange_poses(scene, random_viewpoints(LIMITS, 200, rng))
        if reachable_by(arm, joints, np.pi)(near).mean() > 0.3:
            break
    turn, shift = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    off = transform(rotation_from_vector(np.radians(5.0) * turn), 30.0 * shift)
    guess = ScenePrior("eye-in-hand", BOARD, CAMERA, mount_T_camera @ off, None, NOISE, knowledge=KNOWN)
    return SimulatedCell(arm, scene, joints, guess)


@dataclass
class Ran:
    """The arm's seconds of a run, those of processor time for which it waits for plans, its views, and U at its end."""

    arm_s: float = 0.0
    planning_s: float = 0.0
    views: int = 1
    expanded_mm: float = np.inf


def run(cell: SimulatedCell, seed: int, tolerance_mm: float, speed_mm_s: float | None) -> Ran:
    """One run until U meets the tolerance, or MAX_VIEWS."""
    rng, ran = np.random.default_rng(seed), Ran()
    joints, pose = cell.joints_rad, cell.arm.forward(cell.joints_rad)
    limits = replace(LIMITS, speed_mm_s=speed_mm_s)
    wish, foreseen = StoppingRule(MAX_VIEWS - 1, None, tolerance_mm, speed_mm_s is not None), None
    views = [_look(cell.scene, 0, pose, rng)]
    while True:
        problem = Problem(
            "eye-in-hand",
            BOARD,
            CAMERA,
            CAMERA.image_size,
            tuple(views),
            robot_noise=USUAL_BELIEF,
            knowledge=KNOWN,
            poses_from_controller=True,
        )
        reachable = reachable_by(cell.arm, joints, np.pi)
        began_s = time.process_time()
        found = next_view(
            cell.guess,
            problem,
            limits,
            wish,
            base_T_flange_now=pose,
            reachable=reachable,
            prepared=foreseen,
        )
        ran.planning_s += time.process_time() - began_s
        if found.now_mm is not None:
            ran.expanded_mm = found.now_mm
        if found.base_T_flange is None:
            return ran
        there = cell.arm.nearest(found.base_T_flange, joints)
        began_s = time.process_time()
        foreseen = plan_ahead(found, problem, limits, wish, reachable_by(cell.arm, there, np.pi))
        ahead_s = time.process_time() - began_s
        mm_s, rad_s = speeds_sharing(pose, found.base_T_flange, SPEED_MM_S, REACH_MM)
        arm_s = plan_motion(cell.arm, joints, there, mm_s, False, 0.0, rad_s).end_s + STOP_S
        ran.arm_s += arm_s
        ran.planning_s += max(ahead_s - arm_s, 0.0)
        joints, pose = there, found.base_T_flange
        ran.views += 1
        views.append(_look(cell.scene, len(views), pose, rng))
        wish = replace(wish, views_left=wish.views_left - 1)


def _look(scene: Scene, index: int, pose: Array, rng: np.random.Generator) -> View:
    error = np.concatenate(
        [NOISE.robot_rotation_rad * rng.standard_normal(3), NOISE.robot_translation_mm * rng.standard_normal(3)]
    )
    stands = pose @ transform_from_vector(error)
    pixels = CAMERA.project(map_points(scene.camera_T_target(stands[None])[0], BOARD.points_mm))
    pixels = pixels + NOISE.image_px * rng.standard_normal(pixels.shape)
    inside = np.all((pixels > 0) & (pixels < np.array(CAMERA.image_size)), axis=1).all()
    return View(index, Stance(pose), Detection(np.arange(len(pixels)), pixels) if inside else None)


def main() -> None:
    """Print a line for each cell, then the ratio of the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=12)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tolerance-mm", type=float, default=0.5)
    given = parser.parse_args()
    load_run_modules()  # as the daemon does before a run
    print("cell   least U                               least time")
    rows = []
    for seed in range(given.first, given.first + given.cells):
        cell = draw_cell(seed)
        both = [run(cell, seed, given.tolerance_mm, speed_mm_s) for speed_mm_s in (None, SPEED_MM_S)]
        rows.append([[one.arm_s for one in both], [one.arm_s + one.planning_s for one in both]])
        print(
            f"{seed:4d}  "
            + "  ".join(
                f"{one.arm_s:6.1f} + {one.planning_s:4.1f} s {one.views:2d} views U {one.expanded_mm:5.3f} mm"
                for one in both
            ),
            flush=True,
        )
    for name, (before_s, after_s) in zip(("the arm", "with waiting"), np.median(rows, axis=0), strict=True):
        print(f"median, {name:13s} {before_s:5.1f} s, {after_s:5.1f} s: {after_s / before_s:.2f} (bar 0.67)")


if __name__ == "__main__":
    main()
