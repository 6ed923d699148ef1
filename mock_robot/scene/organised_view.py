"""An organised cloud of the target: a structured-light scanner with an intensity and a point for every pixel."""

import numpy as np

from calibration.camera import CameraModel
from calibration.targets import Target
from calibration.transforms import Array
from mock_robot.scene.camera_view import render
from mock_robot.scene.optics import Optics
from mock_robot.scene.printed_target import PrintOptions
from mock_robot.scene.scanner_view import ScannerModel
from registration.io.formats.pcd import format_header
from registration.points.layout import Layout

COLUMNS = Layout.of(np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")]))


def organised_pcd(
    scanner: ScannerModel,
    target: Target,
    scanner_T_target: Array,
    optics: Optics,
    rng: np.random.Generator,
    sheet: PrintOptions | None = None,
) -> bytes:
    """A PCD of rows × columns points, in mm, of the target's plane, with noise along each ray; NaN out of range."""
    centre = [(scanner.columns - 1) / 2, (scanner.rows - 1) / 2]
    matrix = np.array([[scanner.focal, 0, centre[0]], [0, scanner.focal, centre[1]], [0, 0, 1.0]])
    lens = CameraModel(matrix, np.zeros(5), (scanner.columns, scanner.rows))
    picture = render(lens, target, scanner_T_target, optics, rng, sheet)
    rays, normal = scanner.rays(), scanner_T_target[:3, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (normal @ scanner_T_target[:3, 3]) / (rays @ normal)
    depth = distance * rays[:, 2]
    near, far = scanner.range_mm
    distance[~((depth > near) & (depth < far))] = np.nan
    distance = distance + rng.normal(0.0, scanner.noise_mm, distance.shape) * (distance / scanner.reference_mm) ** 2
    rows = np.column_stack([rays * distance[:, None], picture.reshape(-1)]).astype("<f4")
    return format_header(COLUMNS, len(rows), rows=scanner.rows) + rows.tobytes()
