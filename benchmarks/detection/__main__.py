"""Detection compared with OpenCV: `python -m benchmarks.detection [--views N]` prints a Markdown table.

Errors are root mean squares per axis over all points of the detected views, each compared with the nearest true point.
Times are medians over the views, from image in memory to points, on this machine.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.detection import peers
from benchmarks.detection.bound import bound_px
from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.targets import AprilTagGrid, Charuco, Chessboard, CircleGrid, Target
from calibration.transforms import Array
from tests.simulated.views import BLURRED, ORDINARY, TruePicture, industrial_camera, take_picture

BOUND_WINDOW_PX = 9
WRONG_PX = 5.0
SIZES = {"5 MP": (2448, 2048), "12 MP": (4096, 3000)}
OPTICS = {"ordinary": ORDINARY, "blur 2 px, noise 3": BLURRED}
Method = Callable[[Any, Any], Array | None]


def ours(image: Any, target: Target) -> Array | None:
    """Result of `detect`, or None."""
    try:
        return detect(image, target).corners_px
    except DetectionError:
        return None


ROWS: dict[str, tuple[Target, dict[str, Method]]] = {
    "chessboard 11×8": (
        Chessboard(11, 8, 20.0),
        {
            "handeyed": ours,
            "findChessboardCornersSB": peers.find_chessboard_corners_sb,
            "cornerSubPix": peers.corner_sub_pix,
        },
    ),
    "ChArUco 9×7": (
        Charuco(9, 7, 20.0, 15.0, "DICT_5X5_100"),
        {"handeyed": ours, "CharucoDetector": peers.charuco_detector},
    ),
    "circles 9×7": (
        CircleGrid("symmetric", 9, 7, 20.0),
        {"handeyed": ours, "findCirclesGrid": peers.circles_grid},
    ),
    "circles 4×11 asymmetric": (
        CircleGrid("asymmetric", 4, 11, 40.0),
        {"handeyed": ours, "findCirclesGrid": peers.circles_grid},
    ),
    "AprilTags 6×4": (AprilTagGrid(6, 4, 30.0, 9.0), {"handeyed": ours}),
}


def main() -> None:
    """Every target, image size and light, by every method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=8, help="of each row")
    count = parser.parse_args().views
    print("| target | image | light | method | found | RMS px | worst px | bound px | ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, (target, methods) in ROWS.items():
        for size, pixels in SIZES.items():
            for light, optics in OPTICS.items():
                rng = np.random.default_rng(5)
                views = [take_picture(industrial_camera(*pixels), target, rng, optics) for _ in range(count)]
                corners = isinstance(target, Chessboard | Charuco)
                bounds = [bound_px(view, target, optics, BOUND_WINDOW_PX) for view in views] if corners else []
                bound = f"{np.sqrt(np.mean(np.square(bounds))):.4f}" if bounds else ""
                for method, call in methods.items():
                    found, rms, worst, milliseconds = measure(call, views, target)
                    cells = (name, size, light, method, f"{found}/{count}", rms, worst, bound, milliseconds)
                    print("| " + " | ".join(cells) + " |", flush=True)


def measure(call: Method, views: list[TruePicture], target: Target) -> tuple[int, str, str, str]:
    """Views detected correctly, RMS and worst error in px, median time in ms."""
    errors, times = [], []
    for view in views:
        started = time.perf_counter()
        points = call(view.image, target)
        times.append(time.perf_counter() - started)
        if points is not None and len(points):
            _, nearest = cKDTree(view.pixels).query(points)
            off = points - view.pixels[nearest]
            if np.abs(off).max() < WRONG_PX:
                errors.append(off)
    every = np.concatenate(errors) if errors else np.full((1, 2), np.nan)
    rms, worst = np.sqrt(np.mean(every**2)), np.hypot(*every.T).max()
    return len(errors), f"{rms:.4f}", f"{worst:.3f}", f"{1e3 * np.median(times):.0f}"


if __name__ == "__main__":
    main()
