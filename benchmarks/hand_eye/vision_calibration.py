"""PyPI's `vision-calibration` on the same sessions as ours: RMS errors of X, failures and time.

`python -m benchmarks.hand_eye.vision_calibration [--cells N] [--setups ...]`; needs `pip install vision-calibration`.
It takes no intrinsics but estimates them from the same views, as ours does in the rows marked so. Lengths in metres,
quaternions x-y-z-w, poses of the flange in the base. It has priors on the robot's error (0.5 deg, 1 mm by default;
"true priors" are the simulated noise) where ours estimates it.
"""

import argparse
import importlib.util
import multiprocessing
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.hand_eye.cells import draw_cell, error_of, point_error_mm
from calibration.problem import Problem, Setup
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, quaternion_from_rotation, transform_from_quaternion
from tests.simulated.sessions import Cell, CellNoise

VIEWS = (6, 10, 20, 30)
SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
OURS, OURS_FREE, PEER = "handeyed", "handeyed, intrinsics free", "vision-calibration"
FAR_MM = 25.0
"""A result that misplaces a point by more than this counts as wrong."""

MIN_PRIOR = 1e-6
Solve = Callable[[Cell, CellNoise], Array | None]


@dataclass(frozen=True)
class Answer:
    """Squares of [rad, mm, point mm], infinite without a result, and the processor time."""

    squares: Array
    seconds: float

    @property
    def is_missing(self) -> bool:
        """No result was given."""
        return not bool(np.isfinite(self.squares).all())

    @property
    def far(self) -> bool:
        """A result was given, but is wrong."""
        return not self.is_missing and bool(self.squares[2] > FAR_MM**2)


def main() -> None:
    """One block per number of views and setup."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=10, help="cells for each number of views and setup")
    parser.add_argument("--setups", nargs="*", choices=SETUPS, default=SETUPS)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    if importlib.util.find_spec("vision_calibration") is None:
        print("vision-calibration is not installed: pip install vision-calibration")
        return
    print(f"{options.cells} cells a row of 0.02 to 0.5 px, 0 to 0.5 mm, 0 to 0.05 deg. RMS over those that {PEER}")
    print(f"answers; refused, and far off (a point misplaced by more than {FAR_MM:g} mm, without a word), over all")
    print(f"{'':>34} {'cells':>5} {'deg':>8} {'mm':>8} {'point':>8} {'refused':>8} {'far off':>8} {'ms':>6}")
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for setup, views in product(options.setups, VIEWS):
            rng = np.random.default_rng([4, SETUPS.index(setup), views])
            drawn = [draw_cell(rng, views, setup) for _ in range(options.cells)]
            answered = list(pool.map(_answers, drawn))
            answers = {name: [one[name] for one in answered] for name in SOLVERS}
            _print(f"{setup}, {views} views", answers)


def _answers(drawn: tuple[Cell, CellNoise]) -> dict[str, Answer]:
    return {name: _answer(*drawn, solve) for name, solve in SOLVERS.items()}


def _answer(cell: Cell, noise: CellNoise, solve: Solve) -> Answer:
    before = time.process_time()
    X = solve(cell, noise)
    seconds = time.process_time() - before
    if X is None:
        return Answer(np.full(3, np.inf), seconds)
    error = error_of(cell, X)
    return Answer(np.array([error[:3] @ error[:3], error[3:] @ error[3:], point_error_mm(cell, X) ** 2]), seconds)


def _print(heading: str, answers: dict[str, list[Answer]]) -> None:
    answered = [not (one.far or one.is_missing) for one in answers[PEER]]
    rms = {}
    for name, found in answers.items():
        kept = [one.squares for one, chosen in zip(found, answered, strict=True) if chosen]
        kept = [squares for squares in kept if name in (OURS, OURS_FREE) or squares[2] <= FAR_MM**2]
        rms[name] = np.sqrt(np.mean(kept, axis=0)) if kept else np.full(3, np.nan)
    beaten = {name: "yes" if np.all(rms[name] <= rms[PEER]) else "NO" for name in (OURS, OURS_FREE)}
    print(
        f"{heading}: {PEER} beaten in every column: {beaten[OURS]}; by ours with intrinsics free: {beaten[OURS_FREE]}"
    )
    for name, found in answers.items():
        rotation, translation, point = rms[name]
        refused, far = sum(one.is_missing for one in found), sum(one.far for one in found)
        milliseconds = 1000 * float(np.median([one.seconds for one in found]))
        print(
            f"{name:>34} {sum(answered):>5} {np.degrees(rotation):8.4f} {translation:8.3f} {point:8.3f}"
            f" {refused:>8} {far:>8} {milliseconds:6.0f}",
            flush=True,
        )


def theirs(problem: Problem, noise: CellNoise | None) -> Array | None:
    """mount_T_camera by `vision-calibration`, or None where it gives up."""
    import vision_calibration as vc

    views = [
        vc.SingleCamHandeyeView(
            vc.Observation(problem.target.points_mm[view.detection.ids] / 1e3, view.detection.corners_px),
            _pose(vc, view.base_T_flange),
        )
        for view in problem.views
        if view.detection is not None
    ]
    in_hand = problem.setup == "eye-in-hand"
    robot = (
        vc.RobotPoseConfig()
        if noise is None
        else vc.RobotPoseConfig(
            rot_sigma=max(noise.robot_rotation_rad, MIN_PRIOR),
            trans_sigma=max(noise.robot_translation_mm / 1e3, MIN_PRIOR),
        )
    )
    config = vc.SingleCamHandeyeCalibrationConfig(
        intrinsics=vc.IntrinsicsInitConfig(fix_k3=True, fix_tangential=False),
        handeye_init=vc.HandeyeInitConfig(handeye_mode="EyeInHand" if in_hand else "EyeToHand"),
        solver=vc.SolverConfig(max_iters=200),
        robot_poses=robot,
    )
    try:
        found = vc.run_single_cam_handeye(vc.SingleCamHandeyeDataset(views), config)
    except (RuntimeError, ValueError):
        return None
    if in_hand:
        return _transform(found.gripper_se3_camera)
    return inverse(_transform(found.camera_se3_base))  # there the mount is the base


def _pose(vc, base_T_flange: Array):  # type: ignore[no-untyped-def]
    w, x, y, z = quaternion_from_rotation(base_T_flange[:3, :3])
    return vc.Pose((x, y, z, w), tuple(base_T_flange[:3, 3] / 1e3))


def _transform(pose) -> Array:  # type: ignore[no-untyped-def]
    x, y, z, w = pose.rotation_xyzw
    return transform_from_quaternion(1e3 * np.array(pose.translation_xyz), [w, x, y, z])


SOLVERS: dict[str, Solve] = {
    OURS: lambda cell, noise: solve_hand_eye(cell.problem).mount_T_camera,
    OURS_FREE: lambda cell, noise: solve_hand_eye(replace(cell.problem, camera=None)).mount_T_camera,
    PEER: lambda cell, noise: theirs(cell.problem, None),
    f"{PEER}, true priors": lambda cell, noise: theirs(cell.problem, noise),
}

if __name__ == "__main__":
    main()
