"""Sub-pixel corners of black squares: the crossings of their edges, each fitted along its length.

Blur rounds a square's corner but does not move its edges. Each edge is measured relative to its place in the plane's
view, which includes the lens's distortion.
"""

import numpy as np
import scipy

from calibration.detection.image import Grey
from calibration.detection.plane_view import fit_plane_view
from calibration.transforms import Array

CORNER_MARGIN, MIN_SAMPLES, MAX_SAMPLES = 0.08, 16, 160
REACHES_PX, MIN_REACH_PX = (7.0, 4.0), 1.5
"""Half widths of the profile across an edge: wide to capture it, then as narrow as blur allows, for less noise."""
PLATEAU_OF_REACH = 0.6
"""Beyond this share of the reach the grey value is the ink's on one side, the paper's on the other."""


def refine_squares(image: Grey, plane: Array, corners_px: Array, clear_of_side: float) -> Array:
    """Corners (n, 4, 2) in px of squares with `plane` corners (n, 4, 2), in order around them.

    `clear_of_side`: width of plain ink and of plain paper beside an edge, as a share of the side. Squares too small
    for that are returned as they are.
    """
    corners = corners_px.astype(float)
    side_px = float(np.median(np.hypot(*np.moveaxis(np.roll(corners, -1, axis=1) - corners, -1, 0))))
    if clear_of_side * side_px < MIN_REACH_PX:
        return corners
    along = np.linspace(CORNER_MARGIN, 1 - CORNER_MARGIN, int(np.clip(side_px, MIN_SAMPLES, MAX_SAMPLES)))
    for reach_px in REACHES_PX:
        corners = _refine_once(image, plane, corners, along, min(reach_px, clear_of_side * side_px))
    return corners


def _refine_once(image: Grey, plane: Array, corners: Array, along: Array, reach_px: float) -> Array:
    view, _ = fit_plane_view(plane.reshape(-1, 2), corners.reshape(-1, 2), (image.shape[1], image.shape[0]))
    start, side = plane[:, :, None], (np.roll(plane, -1, axis=1) - plane)[:, :, None]
    on_edge = view.map((start + along[:, None] * side).reshape(-1, 2)).reshape(*plane.shape[:2], len(along), 2)
    tangent = np.gradient(on_edge, axis=2)
    outward = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1) / np.hypot(*np.moveaxis(tangent, -1, 0))[..., None]
    shift = _edge_shift(image, on_edge, outward, along, reach_px)
    # Four corners do not show the lens's distortion, so the edges of a single square may be bowed.
    if len(plane) == 1:
        start_of, end_of = np.vander([0.0, 1.0], 3) @ np.linalg.pinv(np.vander(along, 3))  # of the fitted parabolas
        at_start, at_end = np.asarray(shift @ start_of), np.asarray(shift @ end_of)
    else:
        slope, middle = _line(along, shift)
        at_start, at_end = middle - slope * 0.5, middle + slope * 0.5
    # A corner is the crossing of the edge that ends in it and the edge that starts in it.
    normals = np.stack([np.roll(outward[:, :, -1], 1, axis=1), outward[:, :, 0]], axis=2)
    shifts = np.stack([np.roll(at_end, 1, axis=1), at_start], axis=2)
    move = np.linalg.solve(normals, shifts[..., None])[..., 0]
    expected = view.map(plane.reshape(-1, 2)).reshape(plane.shape)
    usable = np.isfinite(move).all(axis=(1, 2)) & (np.abs(move).max(axis=(1, 2)) < reach_px)
    return np.where(usable[:, None, None], expected + np.nan_to_num(move), corners)


def _edge_shift(image: Grey, on_edge: Array, outward: Array, along: Array, reach_px: float) -> Array:
    """Outward offset (n, 4, samples) in px of the edge from `on_edge`, from the paper's share of a profile across."""
    count = int(np.ceil(2 * reach_px))
    across = (np.arange(count) + 0.5) / count * 2 * reach_px - reach_px
    at = on_edge[..., None, :] + across[:, None] * outward[..., None, :]
    level = scipy.ndimage.map_coordinates(image, [at[..., 1], at[..., 0]], order=1, mode="nearest", output=float)
    ink = _along_the_edge(along, level[..., across < -PLATEAU_OF_REACH * reach_px].mean(axis=3))[..., None]
    paper = _along_the_edge(along, level[..., across > PLATEAU_OF_REACH * reach_px].mean(axis=3))[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(paper > ink, (level - ink) / (paper - ink), np.nan).mean(axis=3)
    return np.asarray(reach_px - 2 * reach_px * share)


def _along_the_edge(along: Array, level: Array) -> Array:
    """The line (n, 4, samples) through grey values along each edge: keeps uneven lighting, removes noise."""
    slope, middle = _line(along, level)
    return middle[..., None] + slope[..., None] * (along - 0.5)


def _line(along: Array, value: Array) -> tuple[Array, Array]:
    """Slope and middle (n, 4) of the lines through values (n, 4, samples) along edges, their length being 1."""
    centred = along - 0.5
    return np.asarray(value @ centred / (centred @ centred)), np.asarray(value.mean(axis=2))
