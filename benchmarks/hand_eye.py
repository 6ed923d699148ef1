"""Hand-eye calibration against truth, against the Cramér-Rao bound, and against the closed forms everybody uses.

`python -m benchmarks.hand_eye [--cells N] [--data DIR]`; OpenCV's own methods join where the installed one has them.
"""

import argparse
import json
import os
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from benchmarks.simulation import BOARD, CAMERA, Cell, CellNoise, observed, random_cell
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.planning.plan import plan_poses
from calibration.planning.viewpoints import Limits
from calibration.prediction import ExpectedNoise, Scene, point_weights, predict, working_points_mm
from calibration.prepare import Prepared
from calibration.solution import Solution
from calibration.solve import estimated, solve_hand_eye
from calibration.transforms import (
    Array,
    difference,
    inverse,
    rotation_from_vector,
    transform,
    transform_from_quaternion,
    vector_from_rotation,
)

Method = Callable[[Prepared], Array]
OPENCV_METHODS = ("TSAI", "PARK", "HORAUD", "ANDREFF", "DANIILIDIS")


def main() -> None:
    """Every table of hand-eye calibration."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=500, help="simulated cells of the uncertainty table")
    default = os.environ.get("HANDEYED_DATA", str(Path(__file__).resolve().parents[2] / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=Path(default), help="folder of the real sessions")
    options = parser.parse_args()
    uncertainty_table(options.cells)
    peers_table(trials=40)
    seed_table()
    speed_table()
    real_table(options.data)


def uncertainty_table(cells: int) -> None:
    """Normalised errors of X, noise estimates, and the registered point against its bound, by number of views."""
    print(f"Simulated cells ({cells}): 0.02 to 0.5 px, 0 to 0.5 mm, 0 to 0.05 deg, intrinsics given or not")
    print(f"{'views':>5} {'cells':>5} {'z rot':>6} {'z trans':>7} {'px':>5} {'deg':>5} {'mm':>5} {'point/bound':>11}")
    rng = np.random.default_rng(0)
    rows: dict[int, list[Array]] = defaultdict(list)
    for trial in range(cells):
        views = int(rng.choice([3, 4, 5, 6, 8, 10, 15, 20, 30]))
        rotation_deg, translation_mm = rng.uniform(0, 0.05), rng.uniform(0, 0.5)
        if rng.random() < 0.15:
            rotation_deg = translation_mm = 0.0
        noise = CellNoise(
            float(np.exp(rng.uniform(np.log(0.02), np.log(0.5)))), np.radians(rotation_deg), translation_mm
        )
        given = views < 6 or bool(rng.random() < 0.7)
        setup = "eye-in-hand" if trial % 2 else "eye-to-hand"
        cell = random_cell(rng, views, noise, setup=setup, camera_given=given)  # type: ignore[arg-type]
        solution = solve_hand_eye(cell.problem)
        rows[views].append(
            np.concatenate(
                [_normalised(cell, solution), _noise_ratios(solution, noise), [_against_bound(cell, noise, solution)]]
            )
        )
    for views, found in sorted(rows.items()):
        print(_uncertainty_row(f"{views:>5}", np.array(found)))
    every = np.concatenate([np.array(found) for found in rows.values()])
    print(_uncertainty_row("  all", every))
    print(f"standard deviation of all normalised errors: {np.nanstd(every[:, :6]):.3f}\n")


def _uncertainty_row(name: str, found: Array) -> str:
    z = np.sqrt(np.nanmean(found[:, :6].reshape(-1, 2, 3) ** 2, axis=(0, 2)))
    ratios = [
        float(np.median(column[np.isfinite(column)])) if np.any(np.isfinite(column)) else np.nan
        for column in found[:, 6:9].T
    ]
    bound = np.sqrt(np.nanmean(found[:, 9] ** 2))
    levels = " ".join(f"{ratio:5.2f}" for ratio in ratios)
    return f"{name} {len(found):>5} {z[0]:6.2f} {z[1]:7.2f} {levels} {bound:11.3f}"


def _normalised(cell: Cell, solution: Solution) -> Array:
    if solution.mount_T_camera is None or solution.uncertainty is None:
        return np.full(6, np.nan)
    normalised: Array = _error(cell, solution.mount_T_camera) / np.sqrt(np.diagonal(solution.uncertainty.covariance))
    return normalised


def _noise_ratios(solution: Solution, noise: CellNoise) -> Array:
    found = (solution.noise.image_px, solution.noise.robot_rotation_rad, solution.noise.robot_translation_mm)
    truth = (noise.image_px, noise.robot_rotation_rad, noise.robot_translation_mm)
    return np.array([np.nan if not t or f is None else f / t for f, t in zip(found, truth, strict=True)])


def _against_bound(cell: Cell, noise: CellNoise, solution: Solution) -> float:
    if solution.mount_T_camera is None:
        return np.nan
    error = _error(cell, solution.mount_T_camera)
    weights = point_weights(working_points_mm(cell.camera, 550.0))
    return float(np.sqrt(error @ weights @ error) / _bound_mm(cell, noise))


def _error(cell: Cell, mount_T_camera: Array) -> Array:
    """[rotation rad, translation mm] in the camera's frame."""
    off = inverse(cell.mount_T_camera) @ mount_T_camera
    return np.concatenate([vector_from_rotation(off[:3, :3]), off[:3, 3]])


def _scene(cell: Cell, noise: CellNoise) -> Scene:
    expected = ExpectedNoise(noise.image_px, noise.robot_rotation_rad, noise.robot_translation_mm)
    problem = cell.problem
    free = problem.camera is None
    return Scene(problem.setup, problem.target, cell.camera, cell.mount_T_camera, cell.anchor_T_target, expected, free)


def _bound_mm(cell: Cell, noise: CellNoise) -> float:
    poses = np.array([view.base_T_flange for view in cell.problem.views])
    return predict(_scene(cell, noise), poses).point_mm


def peers_table(trials: int) -> None:
    """RMS errors of X by method and number of views; OpenCV's methods where it has them."""
    print(
        f"RMS error of X over {trials} cells, 0.05 px, 0.02 deg, 0.1 mm: rotation deg / translation mm (point / bound)"
    )
    noise = CellNoise(0.05, float(np.radians(0.02)), 0.1)
    methods: dict[str, Method] = {name: _own(name) for name in CLOSED_FORMS if name != "three-pose"}
    methods |= {f"cv2 {name}": _opencv(name) for name in OPENCV_METHODS if hasattr(cv2, "calibrateHandEye")}
    print(f"{'':>16}" + "".join(f"{name:>24}" for name in ("5 views", "10 views", "20 views", "50 views")))
    table: dict[str, list[str]] = defaultdict(list)
    for views in (5, 10, 20, 50):
        squares: dict[str, list[Array]] = defaultdict(list)
        for trial in range(trials):
            setup = "eye-in-hand" if trial % 2 else "eye-to-hand"
            cell = random_cell(np.random.default_rng(1000 * views + trial), views, noise, setup=setup)  # type: ignore[arg-type]
            prepared, _, selection = estimated(cell.problem)
            weights = point_weights(working_points_mm(cell.camera, 550.0))
            bound = _bound_mm(cell, noise)
            solved = {"auto": selection.best.chain.mount_T_camera}
            solved |= {name: method(prepared) for name, method in methods.items()}
            for name, X in solved.items():
                error = _error(cell, X)
                square = np.array([error[:3] @ error[:3], error[3:] @ error[3:], error @ weights @ error / bound**2])
                squares[name].append(square)
        for name, found in squares.items():
            rotation, translation, point = np.sqrt(np.mean(found, axis=0))
            table[name].append(f"{np.degrees(rotation):8.4f} /{translation:6.3f} ({point:4.2f})")
    for name, cells in table.items():
        print(f"{name:>16}" + "".join(f"{cell:>24}" for cell in cells))
    print()


def _own(name: str) -> Method:
    return lambda prepared: CLOSED_FORMS[name](prepared.anchor_T_mount, prepared.camera_T_target)


def _opencv(name: str) -> Method:
    def solve(prepared: Prepared) -> Array:
        mount, camera = prepared.anchor_T_mount, prepared.camera_T_target
        rotation, translation = cv2.calibrateHandEye(
            list(mount[:, :3, :3]),
            list(mount[:, :3, 3]),
            list(camera[:, :3, :3]),
            list(camera[:, :3, 3]),
            method=getattr(cv2, f"CALIB_HAND_EYE_{name}"),
        )
        return transform(rotation, np.ravel(translation))

    return solve


SEED_WXYZ = [
    [0.169248, 0.338681, 0.630323, -0.677749],
    [0.316172, 0.15988, 0.408206, -0.841333],
    [0.00599902, -0.481792, -0.759899, 0.436341],
]
SEED_MM = [[128.36, -394.44, 1051.65], [155.78, -204.38, 979.51], [77.6, -584.51, 1036.17]]


def seed_table() -> None:
    """The paper's three poses against three planned ones in the same cell, with the same noise."""
    noise = CellNoise()
    seed_poses = transform_from_quaternion(SEED_MM, SEED_WXYZ)
    X = inverse(transform(rotation_from_vector([1.66, -0.71, -1.43]), [-101.2112, 285.4014, 538.4676]))
    turn = inverse(seed_poses[0] @ X)[:3, :3].T @ rotation_from_vector([0.25, 0.2, 0.0])
    middle = (seed_poses @ X @ np.array([0.0, 0.0, 600.0, 1.0]))[:, :3].mean(axis=0)
    Y = transform(turn, middle - turn @ BOARD.points_mm.mean(axis=0))
    rng = np.random.default_rng(0)
    cell = observed(rng, "eye-in-hand", BOARD, seed_poses, X, Y, noise)
    limits = Limits(float(np.radians(45.0)), float(np.radians(180.0)), (450.0, 750.0))
    planned = plan_poses(_scene(cell, noise), limits, 3).base_T_flange
    print("Three poses, 0.05 px, 0.05 mm, 0.005 deg: a registered point, mm")
    for name, poses in (("the seed's", seed_poses), ("planned", planned)):
        predicted = predict(_scene(cell, noise), poses).point_mm
        weights = point_weights(working_points_mm(CAMERA, 600.0))
        errors = []
        for _ in range(40):
            trial = observed(rng, "eye-in-hand", BOARD, poses, X, Y, noise)
            error = _error(trial, estimated(trial.problem)[2].best.chain.mount_T_camera)
            errors.append(error @ weights @ error)
        print(f"{name:>12}: predicted {predicted:7.3f}, reached {np.sqrt(np.mean(errors)):7.3f}")
    print()


def speed_table() -> None:
    """Milliseconds, the median of several runs."""
    print("Speed, ms (detection excluded)")
    for views in (50, 500):
        cell = random_cell(np.random.default_rng(views), views, CellNoise())
        prepared = estimated(cell.problem)[0]
        row = {
            "whole solve": _milliseconds(lambda cell=cell: solve_hand_eye(cell.problem), 3),
            "kronecker": _milliseconds(lambda prepared=prepared: _own("kronecker")(prepared), 50),
            "park": _milliseconds(lambda prepared=prepared: _own("park")(prepared), 5),
        }
        if hasattr(cv2, "calibrateHandEye"):
            row["cv2 PARK"] = _milliseconds(lambda prepared=prepared: _opencv("PARK")(prepared), 3)
        print(f"{views:>5} views: " + ", ".join(f"{name} {value:.2f}" for name, value in row.items()))
    print()


def _milliseconds(work: Callable[[], object], runs: int) -> float:
    times = []
    for _ in range(runs):
        before = time.perf_counter()
        work()
        times.append(time.perf_counter() - before)
    return 1000 * float(np.median(times))


def real_table(data: Path) -> None:
    """The real sessions, where they are there."""
    if not data.is_dir():
        print(f"Real sessions: none at {data}; give --data")
        return
    from daemon.session_folder import load_problem, open_session

    print("Real sessions: hold-out base error mm, reprojection px; uncertainty of a point mm; truth")
    for name in ("ic_charuco", "ic_circles", "metric_1"):
        session = open_session(data / name)
        solution = solve_hand_eye(load_problem(session))
        if solution.hold_out is None or solution.uncertainty is None or solution.mount_T_camera is None:
            print(f"{name:>12}: refused, {solution.findings[0].message}")
            continue
        held = solution.hold_out
        line = f"{held.base_error_mm:6.2f} {held.reprojection_px:6.2f} {solution.uncertainty.point_mm:6.2f}"
        print(f"{name:>12}: {line} {_against_truth(data / name / 'truth.json', solution.mount_T_camera)}")


def _against_truth(file: Path, mount_T_camera: Array) -> str:
    if not file.exists():
        return ""
    pose = json.loads(file.read_text(encoding="utf-8"))["base_T_camera"]
    truth = transform_from_quaternion(pose["translation_mm"], pose["quaternion_wxyz"])
    translation_mm, rotation_rad = difference(truth, mount_T_camera)
    return f"off by {translation_mm:.3f} mm and {np.degrees(rotation_rad):.4f} deg"


if __name__ == "__main__":
    main()
