"""Renders the camera's image of a planar target with exact geometry.

Every pixel's corners are mapped back through the lens onto the sheet (no bitmap is warped), and the share of the
pixel that the print covers is computed there. Pixel (0, 0) is the centre of the first pixel, as in `CameraModel`.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.targets import Target
from calibration.transforms import Array, transform
from mock_robot.scene.optics import Optics, Picture, clutter, expose
from mock_robot.scene.pixel_coverage import CellCoverage, dot_coverage
from mock_robot.scene.printed_target import PrintedTarget, PrintOptions, print_target

TILE_PX = 192
NODES = 14
"""Chebyshev nodes per tile and axis: the inverse of any invertible lens is then accurate to 1e-9 px."""
BACK_OF_THE_SHEET = 0.9
FAR_MM = 1e9


def render(
    camera: CameraModel,
    target: Target,
    camera_T_target: Array,
    optics: Optics,
    rng: np.random.Generator,
    sheet: PrintOptions | None = None,
    surroundings: np.random.Generator | None = None,
) -> NDArray[np.uint8]:
    """Image (h, w). The target may lie partly or wholly outside it, behind the camera, or show its back.

    `camera_T_target` (4, 4); or (n, 4, 4): the target passes through them while the image is exposed, evenly in time.
    `surroundings`: what lies around the target is drawn from it, by default from `rng`, as the noise is.
    """
    printed, rng_around = print_target(target, sheet), surroundings or rng
    if len(poses := np.reshape(camera_T_target, (-1, 4, 4))) == 1:
        return expose(scene_reflectance(camera, printed, poses[0], optics, rng_around), optics, rng)
    around, total = int(rng_around.integers(2**32)), np.zeros(camera.image_size[::-1], np.float32)
    for pose in poses:
        total += scene_reflectance(camera, printed, pose, optics, np.random.default_rng(around))
    return expose((total / len(poses)).astype(np.float32), optics, rng)


def sketch(
    camera: CameraModel,
    target: PrintedTarget,
    camera_T_target: Array,
    optics: Optics,
    surroundings: np.random.Generator,
    width: int,
) -> NDArray[np.uint8]:
    """Image (h, w), `width` px wide, without noise and with jagged edges, in a tenth of the time of `render`."""
    scale = min(1.0, width / camera.image_size[0])
    matrix = np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2], [0, 0, 1]]) @ camera.matrix
    columns, rows = (round(scale * side) for side in camera.image_size)
    small = replace(camera, matrix=matrix, image_size=(columns, rows))
    quiet = replace(optics, blur_px=max(0.5, scale * optics.blur_px), read_noise=0.0, electrons_per_level=0.0)
    scene = scene_reflectance(small, target, camera_T_target, quiet, surroundings, exact=False)
    return expose(scene, quiet, surroundings)


def scene_reflectance(
    camera: CameraModel,
    target: PrintedTarget,
    camera_T_target: Array,
    optics: Optics,
    rng: np.random.Generator,
    exact: bool = True,
) -> Picture:
    """Reflectance (h, w) averaged over each pixel's square; the sheet covers its surroundings."""
    width, height = camera.image_size
    scene = clutter((height, width), optics.background, rng)
    seen_from_behind = camera_T_target[:3, 2] @ camera_T_target[:3, 3] <= 0
    sheet_from_ray: Array = np.linalg.inv(camera_T_target[:3, [0, 1, 3]]).astype(float)
    paint = CellCoverage(target.cells, exact)
    for rows, columns in _tiles(camera, target, camera_T_target):
        u, v = _sheet_coordinates(camera, sheet_from_ray, rows, columns)
        white, on_sheet = paint(u, v)
        if not on_sheet.any():
            continue
        if seen_from_behind:
            white = np.float32(BACK_OF_THE_SHEET) * on_sheet
        elif target.dots is not None:
            covered = dot_coverage(target.dots, u, v)
            white += covered * (np.float32(target.dots.value) * on_sheet - white)
        tile = scene[rows.start : rows.stop, columns.start : columns.stop]
        tile *= 1 - on_sheet
        tile += white
    return scene


def _tiles(camera: CameraModel, target: PrintedTarget, camera_T_target: Array) -> Iterator[tuple[range, range]]:
    """Row and column ranges of the blocks that the sheet's image may touch."""
    width, height = camera.image_size
    left, top, right, bottom = _bounds(camera, target, camera_T_target)
    for y in range(top, bottom, TILE_PX):
        for x in range(left, right, TILE_PX):
            yield range(y, min(y + TILE_PX, bottom, height)), range(x, min(x + TILE_PX, right, width))


def _bounds(camera: CameraModel, target: PrintedTarget, camera_T_target: Array) -> tuple[int, int, int, int]:
    """left, top, right, bottom in px around the sheet's image; the whole image when the outline projects unsafely."""
    width, height = camera.image_size
    corners = target.outline_mm
    along = np.linspace(0.0, 1.0, 33)[:, None]
    outline = np.concatenate([a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    points = outline @ camera_T_target[:3, :2].T + camera_T_target[:3, 3]
    if np.any(points[:, 2] <= 0):
        return (0, 0, width, height) if np.any(points[:, 2] > 0) else (0, 0, 0, 0)
    pixels = camera.project(points)
    back = camera.normalise(pixels)
    if not np.all(np.abs(back - points[:, :2] / points[:, 2:]) < 1e-6):
        return 0, 0, width, height
    low, high = np.floor(pixels.min(axis=0)) - 2, np.ceil(pixels.max(axis=0)) + 3
    (left, top), (right, bottom) = (np.clip(edge, 0, (width, height)).astype(int) for edge in (low, high))
    return int(left), int(top), int(right), int(bottom)


def _sheet_coordinates(camera: CameraModel, sheet_from_ray: Array, rows: range, columns: range) -> tuple[Array, Array]:
    """u, v in mm (h + 1, w + 1) at the corners of a block's pixels; FAR_MM where the ray misses the sheet's plane."""
    y = np.arange(float(rows.start), rows.stop + 1) - 0.5
    x = np.arange(float(columns.start), columns.stop + 1) - 0.5
    ray_x, ray_y = _rays(camera, x, y)
    u, v, w = (a * ray_x + b * ray_y + c for a, b, c in sheet_from_ray)
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = w > 1e-12
        return np.where(hit, u / w, FAR_MM), np.where(hit, v / w, FAR_MM)


def _rays(camera: CameraModel, x: Array, y: Array) -> tuple[Array, Array]:
    """Ideal normalised coordinates on the grid x × y: Newton's method at Chebyshev nodes, interpolated between them."""
    nodes = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    node_x, node_y = _map_to_interval(nodes, x), _map_to_interval(nodes, y)
    grid_x, grid_y = np.meshgrid(node_x, node_y)
    rays = camera.normalise(np.column_stack([grid_x.ravel(), grid_y.ravel()]))
    if np.isnan(rays).any():
        grid_x, grid_y = np.meshgrid(x, y)
        exact = camera.normalise(np.column_stack([grid_x.ravel(), grid_y.ravel()]))
        return exact[:, 0].reshape(grid_x.shape), exact[:, 1].reshape(grid_x.shape)
    along_x, along_y = _interpolation(node_x, x), _interpolation(node_y, y)
    on_grid = rays.T.reshape(2, NODES, NODES)
    return along_y @ on_grid[0] @ along_x.T, along_y @ on_grid[1] @ along_x.T


def _map_to_interval(nodes: Array, x: Array) -> Array:
    """Map nodes of [-1, 1] to the interval spanned by x."""
    stretched: Array = (x[0] + x[-1]) / 2 + nodes * (x[-1] - x[0]) / 2
    return stretched


def _interpolation(nodes: Array, x: Array) -> Array:
    """(len(x), n) barycentric Lagrange weights (Berrut and Trefethen, 2004, Eq. 4.2) at Chebyshev nodes."""
    k = np.arange(len(nodes))
    weights = (-1.0) ** k * np.sin(np.pi * (k + 0.5) / len(nodes))
    gaps = x[:, None] - nodes
    gaps[gaps == 0] = 1e-300
    terms = weights / gaps
    matrix: Array = terms / terms.sum(axis=1, keepdims=True)
    return matrix


def facing(distance_mm: float, target: PrintedTarget) -> Array:
    """camera_T_target of a sheet parallel to the image plane, centred on the optical axis."""
    middle = target.outline_mm.mean(axis=0)
    return transform(np.eye(3), [-middle[0], -middle[1], distance_mm])
