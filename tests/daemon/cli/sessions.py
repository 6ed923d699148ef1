"""Session folders for the command line's tests: a known X, looked at from a few sides."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calibration.camera import CameraModel
from calibration.documents.pose import PoseDocument
from calibration.kinematics.external_axis import ExternalAxis
from calibration.targets import Charuco
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform

TARGET = Charuco(7, 5, 30.0, 22.0, "DICT_5X5_100")
CAMERA = CameraModel(np.array([[900.0, 0, 319.5], [0, 900.0, 239.5], [0, 0, 1]]), np.zeros(5), (640, 480))
FLANGE_T_CAMERA = transform(rotation_from_vector([0.1, -0.2, 1.4]), [35.0, -20.0, 90.0])
BASE_T_TARGET = transform(rotation_from_vector([3.1, 0.1, 0.0]), [900.0, 50.0, 100.0])

TILTS_RAD = (
    (0.6, 0.0, 0.1),
    (-0.6, 0.1, 0.8),
    (0.1, 0.6, -0.7),
    (0.0, -0.6, 1.9),
    (0.5, 0.4, -1.5),
    (-0.4, -0.4, 0.3),
)

Change = Callable[[dict[str, Any]], None]


NEAR_MM, FAR_MM = 400.0, 700.0
"""Distances of every other view: one distance leaves the focal length open."""


def camera_T_target(tilt_rad: tuple[float, float, float], share_of_turns: float = 1.0) -> Array:
    """The board's middle in front of the camera, turned by a share of `tilt_rad`, one of TILTS_RAD."""
    middle = TARGET.points_mm.mean(axis=0)
    rotation = rotation_from_vector(share_of_turns * np.array(tilt_rad))
    distance_mm = (NEAR_MM, FAR_MM)[TILTS_RAD.index(tilt_rad) % 2]
    return transform(rotation, np.array([0.0, 0.0, distance_mm]) - rotation @ middle)


def base_T_flange(tilt_rad: tuple[float, float, float], share_of_turns: float = 1.0) -> Array:
    return BASE_T_TARGET @ inverse(camera_T_target(tilt_rad, share_of_turns)) @ inverse(FLANGE_T_CAMERA)


@cache
def picture(tilt_rad: tuple[float, float, float]) -> bytes:
    """What the camera sees, a PNG: the printed board, warped."""
    scale = 8  # px per mm of the print
    board = cv2.aruco.CharucoBoard(
        (TARGET.columns, TARGET.rows), TARGET.square_mm, TARGET.marker_mm,
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100),
    )  # fmt: skip
    size = (int(TARGET.columns * TARGET.square_mm * scale), int(TARGET.rows * TARGET.square_mm * scale))
    sheet = cv2.copyMakeBorder(board.generateImage(size), *[20 * scale] * 4, cv2.BORDER_CONSTANT, value=255)
    corners_mm = np.array([[-20.0, -20, 0], [230, -20, 0], [230, 170, 0], [-20, 170, 0]])
    seen = CAMERA.project(map_points(camera_T_target(tilt_rad), corners_mm))
    height, width = sheet.shape
    printed = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    homography = cv2.getPerspectiveTransform(printed.astype(np.float32), seen.astype(np.float32))
    large = cv2.warpPerspective(sheet, np.diag([4.0, 4.0, 1.0]) @ homography, (2560, 1920), borderValue=128)
    return cv2.imencode(".png", cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA))[1].tobytes()


def session(views: list[dict[str, Any]]) -> dict[str, Any]:
    """session.json of `views`."""
    return {
        "schema_version": 1,
        "setup": "eye-in-hand",
        "target": {"kind": "charuco", "columns": 7, "rows": 5, "square_mm": 30.0, "marker_mm": 22.0,
                   "dictionary": "DICT_5X5_100"},
        "camera": {"matrix": CAMERA.matrix.tolist(), "distortion": [0.0] * 5, "image_size": [640, 480]},
        "views": views,
    }  # fmt: skip


def pose_json(tilt_rad: tuple[float, float, float], share_of_turns: float = 1.0) -> dict[str, Any]:
    return PoseDocument.of(base_T_flange(tilt_rad, share_of_turns)).model_dump(mode="json")


def with_images(folder: Path, change: Change = lambda document: None) -> Path:
    """A folder with six pictures; `change` may spoil session.json before it is written."""
    folder.mkdir(parents=True, exist_ok=True)
    views = []
    for index, tilt in enumerate(TILTS_RAD):
        name = f"view_{index:03}.png"
        (folder / name).write_bytes(picture(tilt))
        views.append({"image": name, "base_T_flange": pose_json(tilt)})
    return written(folder, session(views), change)


def with_corners(
    folder: Path, change: Change = lambda document: None, noise_px: float = 0.03, share_of_turns: float = 1.0
) -> Path:
    """A folder whose session.json holds the detections already; from sides that turn by a share of the usual."""
    rng = np.random.default_rng(5)
    views = []
    for tilt in TILTS_RAD:
        exact = CAMERA.project(map_points(camera_T_target(tilt, share_of_turns), TARGET.points_mm))
        seen = exact + rng.normal(0, noise_px, (24, 2))
        corners = [[index, float(u), float(v)] for index, (u, v) in enumerate(seen)]
        views.append({"corners_px": corners, "base_T_flange": pose_json(tilt, share_of_turns)})
    return written(folder, session(views), change)


def written(folder: Path, document: dict[str, Any], change: Change) -> Path:
    change(document)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "session.json").write_text(json.dumps(document))
    return folder


BUILT_TRACK = ExternalAxis("track", 2, np.array([0.004, 0.99999, -0.003]), np.zeros(3))
GIVEN_TRACK = {"kind": "track", "number": 2, "direction": [0, 1, 0]}
TRAVEL_MM = 1500.0


def on_a_track(**axis: Any) -> Change:
    """The session as the controller reports it, every other view from 1500 mm."""

    def change(document: dict[str, Any]) -> None:
        document["external_axis"] = {**GIVEN_TRACK, **axis}
        for index, view in enumerate(document["views"]):
            reading = TRAVEL_MM * (index % 2)
            at_zero = PoseDocument.model_validate(view["base_T_flange"]).transform()
            reported = inverse(BUILT_TRACK.motion(reading)) @ at_zero
            view["base_T_flange"] = PoseDocument.of(reported).model_dump(mode="json")
            view["external_axes"] = [None, reading]

    return change
