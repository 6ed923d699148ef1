"""Cases of public bug reports in HANDEYED_DATA: how each is imported, and the X that it holds."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.transforms import (
    Array,
    difference,
    map_points,
    nearest_rotation,
    transform,
    transform_from_quaternion,
)

X = transform_from_quaternion([45.0, -20.0, 95.0], [0.7193, -0.0069, 0.0431, 0.6933])
IN_HAND = ("--setup", "eye-in-hand")
PICTURES = ("--target", "chessboard:9x6:25", "--camera", "camera.yaml", *IN_HAND)
SEEN_MM, SEEN_OF_POINTS_MM = (0.0, 0.0, 600.0), (300.0, -10.0, 930.0)
"""Where the camera sees the targets, and the middle of the touched points, from which the other place is 450 mm."""
ARM = ("--arm", "IRB 1600-6/1.45")

BASE_T_CAMERA = transform(
    nearest_rotation(np.array([[-0.981, -0.173, 0.087], [-0.177, 0.984, -0.035], [-0.080, -0.049, -0.996]]))[0],
    [820.0, 40.0, 1150.0],
)
"""Rows as the case's README has them, of three decimals."""


@dataclass(frozen=True, eq=False)
class Case:
    """A folder of `cases`: options of the import beside --out, files that hold the poses, and the right X.

    `seen_mm`: a point that the camera sees.
    """

    name: str
    stated: Sequence[str]
    files: Sequence[str]
    X: Array
    seen_mm: tuple[float, float, float] = SEEN_MM

    def options(self, folder: Path) -> list[str]:
        """The options with the camera's file by its path."""
        return [str(folder / one) if one == "camera.yaml" else one for one in self.stated]

    def error_of(self, calibration: str) -> tuple[float, float]:
        """Distance in mm of a point that the camera sees, and angle in degrees, between the X of a calibration.json and
        the right one."""
        document = CalibrationDocument.model_validate_json(calibration)
        found = document.flange_T_camera or document.base_T_camera
        assert found is not None
        _, off_rad = difference(self.X, found.transform())
        seen_mm = np.array(self.seen_mm)
        apart = map_points(found.transform(), seen_mm) - map_points(self.X, seen_mm)
        return float(np.linalg.norm(apart)), float(np.degrees(off_rad))

    def is_mirrored(self, calibration: str) -> bool:
        """Whether the X of a calibration.json is the right one in a mirror."""
        document = CalibrationDocument.model_validate_json(calibration)
        found = document.flange_T_camera or document.base_T_camera
        assert found is not None
        mirrors = (np.diag([*signs, 1.0]) for signs in np.ones((3, 3)) - 2 * np.eye(3))
        apart = (difference(mirror @ self.X @ mirror, found.transform()) for mirror in mirrors)
        return any(off_mm < 1.0 and off_rad < 0.003 for off_mm, off_rad in apart)

    def ratio_of(self, calibration: str) -> float:
        """How many times as long the translation of the X of a calibration.json is as the right one, along it."""
        document = CalibrationDocument.model_validate_json(calibration)
        found = document.flange_T_camera or document.base_T_camera
        assert found is not None
        right = self.X[:3, 3]
        return float(found.transform()[:3, 3] @ right / (right @ right))


def data_folder() -> Path:
    """HANDEYED_DATA."""
    return Path(os.environ.get("HANDEYED_DATA", Path(__file__).resolve().parents[3].parent / "shared/data"))


CASES = (
    Case("camera_poses_in_metres", (*IN_HAND, "--poses", "robot.csv", "--camera-poses", "camera.csv"),
         ("robot.csv", "camera.csv"), X),
    Case("joints_with_names", (*PICTURES, "--poses", "joints.csv", *ARM), ("joints.csv",), X),
    Case("joints_without_names", (*PICTURES, *ARM), ("angles.txt",), X),
    Case("pairs_nested_rotation_translation", IN_HAND, ("pairs.json",), X),
    Case("pairs_opencv_json", IN_HAND, ("samples.json",), X),
    Case("pairs_opencv_npz", IN_HAND, ("samples.npz",), X),
    Case("pairs_same_file", (*IN_HAND, "--poses", "poses.yml", "--camera-poses", "poses.yml"), ("poses.yml",), X),
    Case("pairs_twelve_numbers", IN_HAND, ("pairs.csv",), X),
    Case("point_pairs", ("--setup", "eye-to-hand"), ("points.csv",), BASE_T_CAMERA, SEEN_OF_POINTS_MM),
    Case("poses_xml_filestorage", (*PICTURES, "--poses", "robot_pose.xml"), ("robot_pose.xml",), X),
    Case("rapid_track_not_in_poses", PICTURES, ("Teach.mod",), X),
    Case("record_with_camera_pose", PICTURES, ("records.json",), X),
    Case("timestamps_with_underscore", PICTURES, ("poses.json",), X),
    Case("translation_axis_reversed", (*PICTURES, "--axes", "x,-y,z"), ("poses.csv",), X),
    Case("urscript_tool_variable", PICTURES, ("cell.script",), X),
    Case("yaml_named_lists", (*PICTURES, "--poses", "robot_poses.yaml"), ("robot_poses.yaml",), X),
)  # fmt: skip
