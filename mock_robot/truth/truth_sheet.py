"""The cell as JSON documents: the full truth, and the sheet with what an integrator knows."""

from dataclasses import asdict
from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.problem import ANCHORS, MOUNTS
from calibration.transforms import Array, inverse, transform
from mock_robot.scene.part import DOOR
from mock_robot.truth.truth import CellTruth, Nominal

DISTANCE_MM = 740.0
COLUMNS_MM = (-450.0, -150.0, 150.0, 450.0)
ROWS_MM = (-155.0, 155.0)
"""Views are half a metre wide: they overlap and reach past the door's edge although guess and rack are slightly off."""


def scan_poses_of(truth: CellTruth) -> list[Array]:
    """base_T_flange of each taught view, from nominal data only. None of a scanner that stands."""
    return scan_poses(truth.nominal) if truth.setup == "eye-in-hand" else []


def scan_poses(nominal: Nominal) -> list[Array]:
    """Poses row by row in alternating direction, for a short path; the camera looks along the skin's normal."""
    camera_T_flange = inverse(nominal.mount_T_camera)
    poses = []
    for row, y in enumerate(ROWS_MM):
        for x in COLUMNS_MM if row % 2 == 0 else COLUMNS_MM[::-1]:
            # part_T_camera at DISTANCE_MM from the skin at (x, y), its x along the door, its y down.
            aim = np.array([x, y, float(DOOR.height(np.array(x), np.array(y)))])
            out = np.array([x / DOOR.radius_along, y / DOOR.radius_up, 1.0])
            out /= np.linalg.norm(out)
            down = np.cross(-out, [1.0, 0.0, 0.0])
            down /= np.linalg.norm(down)
            rotation = np.column_stack([np.cross(down, -out), down, -out])
            part_T_camera = transform(rotation, aim + DISTANCE_MM * out)
            poses.append(nominal.base_T_part @ part_T_camera @ camera_T_flange)
    return poses


BOX_MM = ((-900.0, -700.0, 200.0), (1400.0, 1150.0, 1500.0))
"""Allowed volume of the flange: around the table in front of the robot and the rack at its left."""
WIDE_BOX_MM = ((-2000.0, -2000.0, 0.0), (2000.0, 2000.0, 2500.0))
"""Of a cell with an axis beside the arm, of whose motion the reported poses know nothing."""


def truth_document(truth: CellTruth) -> dict[str, Any]:
    """All true values, in the documents' style: mm, degrees, w first."""
    return {
        "schema_version": 1,
        "seed": truth.seed,
        "arm": truth.arm,
        "arm_class": truth.arm_class,
        "arm_errors": _arm_errors(truth),
        "setup": truth.setup,
        f"{MOUNTS[truth.setup]}_T_camera": _pose(truth.mount_T_camera),
        f"{MOUNTS[truth.setup]}_T_scanner": _pose(truth.mount_T_scanner),
        f"{ANCHORS[truth.setup]}_T_target": _pose(truth.anchor_T_target),
        "base_T_part": _pose(truth.base_T_part),
        **{f"mount_T_{name}": _pose(at) for name, at in {**truth.further_cameras, **truth.further_scanners}.items()},
        **truth.mounting.document(drawn=False),
        "target": asdict(truth.target),
        "camera": CameraDocument.of(truth.camera).model_dump(mode="json"),
        "noise": {
            "robot_translation_mm": truth.noise.robot_translation_mm,
            "robot_rotation_deg": truth.noise.robot_rotation_deg,
            "scanner_mm": truth.noise.scanner_mm,
        },
    }


def cell_sheet(truth: CellTruth) -> dict[str, Any]:
    """What an integrator knows: nominal poses, the camera's certificate, taught poses. Nothing of the truth."""
    return {
        "schema_version": 1,
        "arm": None if truth.scara else truth.arm,
        "target": asdict(truth.target),
        "camera": CameraDocument.of(truth.camera).model_dump(mode="json"),
        "setup": truth.setup,
        f"{MOUNTS[truth.setup]}_T_camera_guess": _pose(_round_to_mm(truth.nominal.mount_T_camera)),
        f"{ANCHORS[truth.setup]}_T_target_guess": _pose(_round_to_mm(truth.nominal.anchor_T_target)),
        "box_mm": [list(corner) for corner in (WIDE_BOX_MM if truth.mounting.beside else BOX_MM)],
        **truth.mounting.document(drawn=True),
        "scan_poses": [_pose(pose) for pose in scan_poses_of(truth)],
    }


def _arm_errors(truth: CellTruth) -> dict[str, float]:
    """By parameter, in rad, mm and as `arm_errors.ErrorParameter` has them; none of an arm as drawn."""
    built = truth.built_arm()
    if built is None:
        return {}
    return {one.name: float(size) for one, size in zip(built.model.parameters, built.errors, strict=True)}


def _pose(a_T_b: Array) -> dict[str, Any]:
    return PoseDocument.of(a_T_b).model_dump(mode="json")


def _round_to_mm(a_T_b: Array) -> Array:
    """Round lengths to the millimetre, as a tape measure gives them."""
    rounded = a_T_b.copy()
    rounded[:3, 3] = np.rint(rounded[:3, 3])
    return rounded
