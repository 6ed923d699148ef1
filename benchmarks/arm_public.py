"""Public sets with the arm's own errors and without: places of the target in views left out by region of joint space.

`python -m benchmarks.arm_public [--data DIR] [--seed N]`. Views are left out in up to six regions of joint space. X,
the target's place and the arm come from the others; a view left out then says where the target's middle is, in the
frame in which it does not move, by the camera that was found with X: the described one of metric_1 has its principal
point a pixel off, which shifts every place by 1.6 mm. `drawn` and `built` are the RMS distance to the place by the
others, in mm, with the arm as drawn and as built; a session whose arm is refused counts as drawn.

KinHEC (`pip install kinhec`) has an IRB 120 with joints: its track `robot_error` of tier small is generated with that
arm in place of its UR5e and iiwa, which are no arms of the list; its poses are projected as a board's. The sets of
`HANDEYED_DATA` have neither joints nor an arm's name: their poses are taken for those of the smallest listed arm that
reaches them all, so that they show what a wrong arm does.
"""

import argparse
import contextlib
import importlib.util
import io
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calibration.camera import CameraModel
from calibration.errors import CalibrationError
from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.stance import Stance
from calibration.likelihood.leave_out import split
from calibration.observations.view_poses import refine_poses
from calibration.preprocessing.prepare import PreparedSession, prepare
from calibration.problem import Detection, Problem, View, anchor_T_mount_of
from calibration.solve import estimate_session
from calibration.transforms import Array, map_points
from extensions.arm_identification.mathematics.identification import identify_arm_session
from tests.simulated.arms import least_travel
from tests.simulated.sessions import BOARD, CAMERA

SETS = ("ic_charuco", "ic_circles", "metric_1")
MAX_REGIONS, MIN_REGION_VIEWS = 6, 3
ABB_SIGNS = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
"""Of KinHEC's joints: its axis 3 turns the other way."""

MM = np.array([[1, 1, 1, 1e3]] * 3 + [[1, 1, 1, 1]])


@dataclass(frozen=True)
class HoldOut:
    """RMS misses, mm, as drawn and as built; in how many of the regions the errors were taken up, and refused."""

    drawn_mm: float
    built_mm: float
    taken_up: int
    refused: int
    regions: int


def main() -> None:
    """One line per set, and per level of KinHEC's errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("HANDEYED_DATA", "../shared/data")))
    parser.add_argument("--seed", type=int, help="of KinHEC's sequences, instead of its own")
    options = parser.parse_args()
    print(f"{'set':30} {'arm':>18} {'views':>5} {'taken up':>8} {'refused':>7} {'drawn':>8} {'built':>8} {'ratio':>6}")
    for name in SETS:
        if (options.data / name).is_dir():
            _print_set(name, options.data / name)
    if importlib.util.find_spec("kinhec") is None:
        print("kinhec is not installed: pip install kinhec")
        return
    for name, problem in _kinhec(options.seed):
        _print(name, find_arm("IRB 120-3/0.6"), problem)


def _print_set(name: str, folder: Path) -> None:
    from daemon.sessions.session_reader import load_problem, open_session

    problem = load_problem(open_session(folder))
    found = _with_joints(problem)
    if found is None:
        print(f"{name:30} no listed arm reaches its poses")
    else:
        _print(name, *found)


def _with_joints(problem: Problem) -> tuple[Arm, Problem] | None:
    """The smallest arm that reaches all poses, and the problem with its joints."""
    poses = [view.base_T_flange for view in problem.views]
    for arm in sorted(ARMS.values(), key=lambda one: one.reach_mm):
        try:
            joints = least_travel(arm, np.array(poses))
        except UnreachablePoseError:
            continue
        views = (view.standing(joints_rad=row) for view, row in zip(problem.views, joints, strict=True))
        return arm, replace(problem, views=tuple(views))
    return None


def _print(name: str, arm: Arm, problem: Problem) -> None:
    found = hold_out(arm, problem)
    print(
        f"{name:30} {arm.name:>18} {len(problem.views):5} {found.taken_up:>5}/{found.regions:<2} {found.refused:7}"
        f" {found.drawn_mm:8.3f} {found.built_mm:8.3f} {found.built_mm / found.drawn_mm:6.3f}",
        flush=True,
    )


def hold_out(arm: Arm, problem: Problem) -> HoldOut:
    """The misses of the views that a session uses."""
    whole = prepare(problem)
    problem = replace(problem, views=tuple(problem.views[row] for row in whole.seen.positions))
    joints = np.array([view.stance.joints_rad for view in problem.views])
    turns = np.concatenate([np.sin(joints), np.cos(joints)], axis=1)
    regions = split(turns, max(2, min(MAX_REGIONS, len(joints) // MIN_REGION_VIEWS)))
    squares, taken_up, refused = np.zeros(2), 0, 0
    for region in regions:
        left = np.isin(np.arange(len(joints)), region)
        kept = replace(problem, views=tuple(view for view, out in zip(problem.views, left, strict=True) if not out))
        best = estimate_session(kept).best
        poses = np.array([view.base_T_flange for view in problem.views])[left]
        x, target = best.chain.mount_T_camera, best.chain.anchor_T_target
        views = whole.take(left)
        drawn = _misses(views, best.camera, poses, x, target, best.scale)
        built = drawn
        try:
            fit = identify_arm_session(arm, [kept])
            if fit.taken_up:
                as_built = fit.base_T_flange(joints[left])
                x, target = fit.mount_T_camera, fit.anchor_T_target[0]
                built = _misses(views, fit.seen.camera, as_built, x, target, fit.target_scale)
                taken_up += 1
        except CalibrationError:
            refused += 1
        squares += np.array([np.sum(drawn**2), np.sum(built**2)])
    drawn_mm, built_mm = np.sqrt(squares / len(joints)).tolist()
    return HoldOut(drawn_mm, built_mm, taken_up, refused, len(regions))


def _misses(
    views: PreparedSession, camera: CameraModel, base_T_flange: Array, x: Array, target: Array, scale: float
) -> Array:
    """Of the target's middle (n,) in mm, seen by that camera, in the frame in which it stands still."""
    camera_T_target = refine_poses(
        replace(views.seen, points_mm=scale * views.seen.points_mm), camera, views.camera_T_target
    )
    middle = scale * views.nominal_mm.mean(axis=0, keepdims=True)
    found = map_points(anchor_T_mount_of(views.setup, base_T_flange) @ x @ camera_T_target, middle)[:, 0]
    return np.asarray(np.linalg.norm(found - map_points(target, middle)[0], axis=1))


def _kinhec(seed: int | None) -> Iterator[tuple[str, Problem]]:
    """Name and problem of each sequence of the track `robot_error` with an IRB 120."""
    import yaml
    from kinhec.cli import main as kinhec
    from kinhec.io import load_manifest, load_sequence
    from kinhec.plans import load_tier

    spec = load_tier("small")
    spec["tracks"] = {"robot_error": {**spec["tracks"]["robot_error"], "robots": ["irb120"]}}
    if seed is not None:
        spec["global_seed"] = seed
    with tempfile.TemporaryDirectory() as folder:
        tier = Path(folder) / "irb120.yaml"
        tier.write_text(yaml.safe_dump({key: value for key, value in spec.items() if key != "_path"}))
        out = Path(folder) / "sequences"
        with contextlib.redirect_stdout(io.StringIO()):
            kinhec(["generate", "--tier", str(tier), "--out", str(out), "--work-dir", folder, "--no-card"])
        manifest = load_manifest(out)
        for row in manifest.to_dict("records"):
            sequence = load_sequence(out, row["sequence_id"], manifest)
            level = row["level"].replace("joint_std=", "joints ").replace("dh_len_mm=", "").replace("dh_ang_deg=", "")
            yield f"KinHEC {level}", _problem_of(sequence)


def _problem_of(sequence) -> Problem:  # type: ignore[no-untyped-def]
    """The measured poses of a sequence as images of a board."""
    seen = sequence.camera.has_measurement
    poses, joints = MM * sequence.robot.T_base_ee_meas[seen], ABB_SIGNS * sequence.robot.q_meas[seen]
    target_T_middle = np.eye(4)
    target_T_middle[:3, 3] = -BOARD.points_mm.mean(axis=0)
    camera_T_target = MM * sequence.camera.T_cam_target_meas[seen] @ target_T_middle
    points = map_points(camera_T_target, BOARD.points_mm)
    pixels = CAMERA.project(points.reshape(-1, 3)).reshape(*points.shape[:2], 2)
    ids = np.arange(len(BOARD.points_mm))
    views = [View(row, Stance(poses[row], joints[row]), Detection(ids, pixels[row])) for row in range(len(poses))]
    return Problem("eye-in-hand", BOARD, CAMERA, CAMERA.image_size, tuple(views))


if __name__ == "__main__":
    main()
