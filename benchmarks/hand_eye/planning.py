"""Planned poses: computing time and accuracy, compared with the paper's three poses and with poses jogged by advice."""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from calibration.kinematics.stance import Stance
from calibration.likelihood.predicted_uncertainty import Scene, predict
from calibration.planning.jog_advice import advise
from calibration.planning.next_view import StoppingRule, next_view, plan_ahead
from calibration.planning.plan import plan_poses
from calibration.planning.scene_belief import ScenePrior
from calibration.planning.viewpoints import flange_poses
from calibration.problem import Detection, Problem, View
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from tests.calibration.planning.scenes import WIDE, seed_poses, seed_scene

Made = TypeVar("Made")

COUNTS = (3, 4, 5, 6, 8, 10, 12, 15)
STATIONS = 8
BY_HAND = 6
JOG_DEG, JOG_MM = 2.0, 8.0
"""Accuracy with which a person jogs to the advised pose, one standard deviation per axis."""


def main() -> None:
    """Print the tables. Times are processor time of one core, independent of other load."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    scene = seed_scene()
    print(f"the seed's three poses: a measured point {predict(scene, seed_poses()).point_mm:.3g} mm")
    print("\nposes planned at once: seconds of one core, predicted uncertainty of a measured point")
    for count in COUNTS:
        plan, seconds = _time(lambda count=count: plan_poses(scene, WIDE, count))
        print(f"{count:>5} poses {seconds:8.2f} s {plan.predicted.point_mm:8.3f} mm")
    _step_by_step(scene)
    _by_hand(scene)


def _step_by_step(scene: Scene) -> None:
    """As a run plans: one view after another, from X known to 25 mm and 5 degrees."""
    print("\nplanned step by step, X guessed 30 mm and 5 deg off: seconds before the arm moves on, with and without")
    print("planning while it moves; predicted uncertainty before and after")
    guess, poses = _guess(scene), [_look(scene)]
    wish, foreseen = StoppingRule(STATIONS), None
    while True:
        problem = _observe(scene, poses)
        anew, seconds = _time(lambda p=problem, w=wish: next_view(guess, p, WIDE, w, base_T_flange_now=poses[-1]))
        advice, shorter = _time(
            lambda p=problem, w=wish, f=foreseen: next_view(guess, p, WIDE, w, base_T_flange_now=poses[-1], prepared=f)
        )
        now = "not yet" if advice.now_mm is None else f"{advice.now_mm:.3f}"
        if advice.base_T_flange is None:
            print(f"    after {len(poses) - 1:>2}: {now} mm")
            return
        other = "" if foreseen is None else f"  ({anew.planned_mm or np.nan:.3f} planned anew)"
        gives = f"{now} -> {advice.planned_mm or np.nan:.3f} mm{other}"
        print(f"    before {len(poses):>2}: {seconds:5.2f} s, {shorter:5.2f} s   {gives}")
        foreseen = plan_ahead(advice, problem, WIDE, wish)
        poses.append(advice.base_T_flange)
        wish = replace(wish, views_left=wish.views_left - 1)


def _by_hand(scene: Scene) -> None:
    """One or two rotations at a time, as a person jogs."""
    print("\njogged to by advice, X guessed 30 mm and 5 deg off, or not at all")
    for name, guess in (("guessed", _guess(scene)), ("unknown", replace(_guess(scene), mount_T_camera=None))):
        rng, poses = np.random.default_rng(0), [_look(scene)]
        while len(poses) < BY_HAND:
            advice = advise(guess, _observe(scene, poses), WIDE, StoppingRule(100), base_T_flange_now=poses[-1])
            pose = advice.base_T_flange
            if pose is None:
                axis = advice.instruction.split("about its ")[1][0]
                turn = np.radians(15.0) * np.array([axis == "x", axis == "y", axis == "z"], float)
                pose = poses[-1] @ transform(rotation_from_vector(turn), np.zeros(3))
            off = np.radians(JOG_DEG) * rng.standard_normal(3), JOG_MM * rng.standard_normal(3)
            poses.append(pose @ transform(rotation_from_vector(off[0]), off[1]))
        known = [predict(scene, np.array(poses[:n])).point_mm for n in range(3, BY_HAND + 1)]
        print(f"{name:>10}: " + ", ".join(f"{n} views {mm:.3f} mm" for n, mm in enumerate(known, start=3)))


def _guess(scene: Scene) -> ScenePrior:
    rng = np.random.default_rng(0)
    turn, shift = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    off = transform(rotation_from_vector(np.radians(5.0) * turn), 30.0 * shift)
    return ScenePrior("eye-in-hand", scene.target, scene.camera, scene.mount_T_camera @ off, None, scene.noise)


def _look(scene: Scene) -> Array:
    pose: Array = flange_poses(scene, np.array([[0.05, 0.1, 0.3, 650.0, 0.1, -0.1]]))[0]
    return pose


def _observe(scene: Scene, poses: list[Array]) -> Problem:
    """Images with the scene's noise; the true poses differ from the reported ones by the robot's noise."""
    rng, views, noise = np.random.default_rng(1), [], scene.noise
    for index, pose in enumerate(poses):
        error = noise.robot_rotation_rad * rng.standard_normal(3), noise.robot_translation_mm * rng.standard_normal(3)
        stands = pose @ transform(rotation_from_vector(error[0]), error[1])
        pixels = scene.camera.project(map_points(scene.camera_T_target(stands[None])[0], scene.target.points_mm))
        pixels = pixels + noise.image_px * rng.standard_normal(pixels.shape)
        views.append(View(index, Stance(pose), Detection(np.arange(len(pixels)), pixels)))
    return Problem("eye-in-hand", scene.target, scene.camera, scene.camera.image_size, tuple(views))


def _time(work: Callable[[], Made]) -> tuple[Made, float]:
    """Result of the work and its processor time in seconds."""
    began = time.process_time()
    return work(), time.process_time() - began


if __name__ == "__main__":
    main()
