"""Errors of results against the truth: a merged cloud against the part's skin, a calibration against the true X."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from calibration.transforms import Array, difference, inverse, map_points
from mock_robot.scene.part import DOOR, surface_samples
from mock_robot.truth.truth import CellTruth

SCORED_POINTS = 200_000
COVERED_WITHIN_MM = 5.0
STRAY_MM = 5.0
WORKING_DISTANCE_MM = 600.0


class Unscorable(ValueError):
    """Nothing can be compared with the truth; the message says why."""


def score_cloud(truth: CellTruth, ply: bytes) -> dict[str, Any]:
    """Deviation of a merged cloud (PLY, base frame, mm) from the true skin, and the share of the part it covers.

    Large clouds are scored on an even selection of `SCORED_POINTS` points. Covered is the share of the skin within
    `COVERED_WITHIN_MM` of a point; stray is the share of points farther than `STRAY_MM` from the skin (they count).
    """
    points = read_points(ply)
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        raise Unscorable("the cloud holds no finite point: scan the part again")
    scored = map_points(inverse(truth.base_T_part), finite[:: -(-len(finite) // SCORED_POINTS)])
    deviation = DOOR.deviation(scored)
    distance = np.abs(deviation)
    nearest, _ = cKDTree(scored).query(surface_samples(COVERED_WITHIN_MM, DOOR), distance_upper_bound=COVERED_WITHIN_MM)
    return {
        "points": len(points),
        "not_finite": len(points) - len(finite),
        "scored": len(scored),
        "rms_mm": float(np.sqrt(np.mean(deviation**2))),
        "mean_mm": float(np.mean(deviation)),
        "p95_mm": float(np.percentile(distance, 95)),
        "max_mm": float(distance.max()),
        "stray": float(np.mean(distance > STRAY_MM)),
        "covered": float(np.mean(np.isfinite(nearest))),
    }


def score_calibration(
    truth: CellTruth, mount_T_camera: Array, distance_mm: float = WORKING_DISTANCE_MM
) -> dict[str, float]:
    """Error of X, and the RMS error over the working volume of points mapped from the camera to the base.

    The volume is that of `point_mm` in calibration.json: 3×3 pixels over the central 80 % of the image at 0.9, 1.0 and
    1.1 times the distance. The robot's pose does not change the error's size.
    """
    translation_mm, rotation_rad = difference(truth.mount_T_camera, mount_T_camera)
    volume = _working_volume(truth, distance_mm)
    off = map_points(mount_T_camera, volume) - map_points(truth.mount_T_camera, volume)
    return {
        "translation_mm": translation_mm,
        "rotation_deg": float(np.degrees(rotation_rad)),
        "point_rms_mm": float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
        "point_max_mm": float(np.linalg.norm(off, axis=1).max()),
    }


def _working_volume(truth: CellTruth, distance_mm: float) -> Array:
    """27 points (27, 3) in the camera frame."""
    width, height = truth.camera.image_size
    shares = np.array([0.1, 0.5, 0.9])
    x, y = np.meshgrid(shares * (width - 1), shares * (height - 1))
    rays = np.column_stack([truth.camera.normalise(np.column_stack([x.ravel(), y.ravel()])), np.ones(x.size)])
    return np.concatenate([factor * distance_mm * rays for factor in (0.9, 1.0, 1.1)])


# A PLY reader independent of the product's own, so that the score does not share its defects.

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
ENDIANS = {"binary_little_endian": "<", "binary_big_endian": ">"}


class UnreadablePly(ValueError):
    """The bytes are not a PLY file with x, y, z; the message says what is wrong."""


def read_points(ply: bytes) -> Array:
    """x, y, z (n, 3) of the first element, which must be the vertices. Raises UnreadablePly."""
    head, mark, body = ply.partition(b"end_header\n")
    words = [line.split() for line in head.decode("latin-1").splitlines()]
    if not mark or not words or words[0] != ["ply"]:
        raise UnreadablePly("it does not begin with a PLY header: is it the merged cloud?")
    endian = next((ENDIANS.get(line[1]) for line in words if line[:1] == ["format"] and len(line) > 1), None)
    elements = [index for index, line in enumerate(words) if line[:1] == ["element"]]
    if endian is None or not elements or words[elements[0]][1:2] != ["vertex"]:
        raise UnreadablePly("its header names no binary format, or its first element is not the vertices")
    promised = b"".join(word.encode() for word in words[elements[0]][2:3])
    if not promised.isdigit():
        raise UnreadablePly("its header does not say how many vertices there are")
    count = int(promised)
    until = elements[1] if len(elements) > 1 else len(words)
    fields = [(line[2], line[1]) for line in words[elements[0] : until] if line[:1] == ["property"]]
    names = [name for name, _ in fields]
    if not {"x", "y", "z"} <= set(names) or not all(kind in TYPES for _, kind in fields):
        raise UnreadablePly(f"its vertices have {', '.join(names) or 'no properties'}: x, y and z are needed")
    record = np.dtype([(name, endian + TYPES[kind]) for name, kind in fields])
    if len(body) < count * record.itemsize:
        raise UnreadablePly(f"its header promises {count} points, it ends after {len(body) // record.itemsize}")
    table = np.frombuffer(body, record, count)
    return np.column_stack([table[axis].astype(float) for axis in "xyz"])
