"""Circle grids: dots joined into a lattice, matched to the target, measured at full size, perspective bias removed."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.detection.dot_lattice import grow_dot_lattices
from calibration.detection.dots import Dots, find_dots
from calibration.detection.image import Grey, downscale, downscale_by, to_full_size
from calibration.detection.lattice import Lattice
from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import CircleGrid
from calibration.transforms import Array

# Offset of the centroid of a circle's image from the image of its centre, due to perspective and lens distortion.
#
# Source: Heikkilä, "Geometric camera calibration using circular control points", 2000; here the rim is measured point
# by point, so any camera model can be used.

RIM_POINTS = 48


def circle_centre_bias(project: Callable[[Array], Array], centres: Array, radii: Array) -> Array:
    """Centroid minus projected centre (n, 2) in px, of circles with `centres` (n, 2) and `radii` (n,) in the plane.

    `project` maps plane points (m, 2) to pixels (m, 2).
    """
    angle = np.arange(RIM_POINTS) * (2 * np.pi / RIM_POINTS)
    rim = centres[:, None] + radii[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    middle = project(centres)
    polygon = project(rim.reshape(-1, 2)).reshape(rim.shape) - middle[:, None]
    following = np.roll(polygon, -1, axis=1)
    cross = polygon[..., 0] * following[..., 1] - polygon[..., 1] * following[..., 0]
    centroid = ((polygon + following) * cross[..., None]).sum(axis=1) / (3 * cross.sum(axis=1))[:, None]
    return np.asarray(centroid)


SEARCH_PIXELS = (1.3e6, 1.3e7)
MIN_SHARE_FOUND = 0.75
MIN_LARGE_DOT_RATIO = 1.25
"""Least radius of the origin's dot over the median radius."""


@dataclass(frozen=True, eq=False)
class Layout:
    """`ids` (n,): the target point of each of the lattice's dots, -1 for none; `outside`: how many have none."""

    ids: NDArray[np.intp]
    outside: int


def detect_circles(image: Grey, target: CircleGrid) -> Detection:
    """The projected centres, at most a quarter of them missing.

    Raises DetectionError `not-found`, `other-board`, `origin-not-found`.
    """
    ink = image if target.dots == "black" else np.asarray(255 - image, np.uint8)
    size = (image.shape[1], image.shape[0])
    refusal = DetectionError(
        "not-found",
        Sentence("seen-no-circles", layout=target.layout, columns=target.columns, rows=target.rows, dots=target.dots),
        Sentence("see-circles"),
    )
    for pixels in SEARCH_PIXELS:
        small, factor = downscale(ink, pixels)
        dots = find_dots(small)
        for lattice, index in grow_dot_lattices(dots, int(MIN_SHARE_FOUND * target.columns * target.rows)):
            layouts = _fit_layouts(lattice, target)
            if not layouts:
                continue
            if layouts[0].outside >= max(2, min(target.columns, target.rows) // 2):
                shape = {"columns": target.columns, "rows": target.rows}
                what = Sentence("seen-another-grid", more=int(layouts[0].outside), **shape)
                refusal = DetectionError("other-board", what, Sentence("see-grid-size"))
                continue
            area = factor**2
            found = Dots(to_full_size(dots.centres[index], factor), dots.shapes[index] * area, dots.areas[index] * area)
            try:
                return _measure_grid(found, refine_dots(ink, found), layouts, target, size)
            except DetectionError as error:
                refusal = error
        if factor == 1:
            break
    raise refusal


def _measure_grid(
    seen: Dots, dots: Dots, layouts: list[Layout], target: CircleGrid, image_size: tuple[int, int]
) -> Detection:
    """The detection by the layout whose origin is the large dot, or whose rows run most to the right.

    `dots`: those `seen`, refined at full size; NaN for a dot cut off by the image's edge, which may still be the
    origin. Raises DetectionError `not-found`, `origin-not-found`.
    """
    candidates = []
    for layout in layouts:
        kept = (layout.ids >= 0) & np.isfinite(dots.areas)
        ids, centres = layout.ids[kept], dots.centres[kept]
        if len(ids) < MIN_SHARE_FOUND * target.columns * target.rows:
            continue
        points = target.points_mm[ids, :2]
        view, _ = fit_plane_view(points, centres, image_size)
        radii = _radii(view, points, dots.areas[kept])
        # Change of the pixel's column along the target's rows, at the middle.
        rightward = float(view.jacobian(points.mean(axis=0))[0, 0])
        rank = rightward if target.origin is None else _origin_ratio(view, layout, seen, target)
        usual = np.abs(np.log(radii / np.median(radii))) < np.log(MIN_LARGE_DOT_RATIO)
        bias = circle_centre_bias(view.map, points, np.where(usual, np.median(radii), radii))
        order = np.argsort(ids)
        candidates.append((rank, Detection(ids[order], (centres - bias)[order])))
    if not candidates:
        raise DetectionError("not-found", Sentence("seen-dots-unmeasured"), Sentence("see-whole-grid"))
    rank, detection = max(candidates, key=lambda candidate: candidate[0])
    if target.origin is not None and rank < MIN_LARGE_DOT_RATIO:
        what = Sentence("seen-no-large-dot", ratio=float(rank))
        raise DetectionError("origin-not-found", what, Sentence("see-large-dot"))
    return detection


def _origin_ratio(view: PlaneView, layout: Layout, seen: Dots, target: CircleGrid) -> float:
    """Radius of the dot with id 0 over the usual one; 0 when it is missing."""
    laid = layout.ids >= 0
    ids = layout.ids[laid]
    radii = _radii(view, target.points_mm[ids, :2], seen.areas[laid])
    return float(radii[ids == 0][0] / np.median(radii)) if np.any(ids == 0) else 0.0


def _radii(view: PlaneView, points: Array, areas_px: Array) -> Array:
    """Radii (n,) in the plane's unit, of dots with areas (n,) px² at plane points (n, 2)."""
    step = 1e-3 * float(np.abs(points - points.mean(axis=0)).max())
    u = (view.map(points + np.array([step, 0])) - view.map(points - np.array([step, 0]))) / (2 * step)
    v = (view.map(points + np.array([0, step])) - view.map(points - np.array([0, step]))) / (2 * step)
    return np.asarray(np.sqrt(areas_px / (np.pi * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))))


def _fit_layouts(lattice: Lattice, target: CircleGrid) -> list[Layout]:
    """Every placement of the target on the lattice with the largest overlap; none when an outer line is missing."""
    best: list[tuple[int, Layout]] = []
    for cells in _quarter_turns(_square_cells(target)):
        numbers = np.full(cells.max(axis=0)[::-1] + 1, -1)
        numbers[tuple(cells.T[::-1])] = np.arange(len(cells))
        occupied = np.zeros(lattice.cells.max(axis=0)[::-1] + 1)
        occupied[tuple(lattice.cells.T[::-1])] = 1
        overlap = np.rint(scipy.signal.correlate2d(occupied, (numbers >= 0).astype(float))).astype(np.intp)
        for shift in np.argwhere(overlap == overlap.max()) - np.array(numbers.shape) + 1:
            at = lattice.cells[:, ::-1] - shift
            inside = np.all((at >= 0) & (at < numbers.shape), axis=1)
            ids = np.full(len(at), -1)
            ids[inside] = numbers[tuple(at[inside].T)]
            if _covers_every_border(ids[ids >= 0], target):
                best.append((int(overlap.max()), Layout(ids, int((ids < 0).sum()))))
    most = max((count for count, _ in best), default=0)
    return [layout for count, layout in best if count == most]


def _square_cells(target: CircleGrid) -> NDArray[np.intp]:
    """Column and row (n, 2) of each target point in a square lattice."""
    v, u = np.mgrid[: target.rows, : target.columns].reshape(2, -1)
    if target.layout == "symmetric":
        return np.column_stack([u, v])
    x = 2 * u + v % 2
    return np.column_stack([(x + v) // 2, (v - x) // 2])


def _quarter_turns(cells: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """The cells (n, 2) after 0, 1, 2 and 3 quarter turns, shifted so that the least of each coordinate is 0."""
    for _ in range(4):
        yield cells - cells.min(axis=0)
        cells = np.column_stack([-cells[:, 1], cells[:, 0]])


def _covers_every_border(ids: NDArray[np.intp], target: CircleGrid) -> bool:
    """Whether at least half of every outer line of the target was found; otherwise a shift by a line is possible."""
    seen = np.zeros(target.rows * target.columns, bool)
    seen[ids] = True
    grid = seen.reshape(target.rows, target.columns)
    return bool(min(grid[0].mean(), grid[-1].mean(), grid[:, 0].mean(), grid[:, -1].mean()) >= 0.5)


# The share of a pixel that a dot covers follows from its grey value between paper and ink, in a band along the rim
# only. Further inside it is set to 1, further outside to 0, so that noise, stains and neighbours there have no effect,
# and blur does not bias the centroids and areas.

ITERATIONS = 3
SUFFICIENT_RADIUS_PX = 12.0
"""Larger dots are measured in a reduced image: averaging pixels does not bias a centroid."""
BAND_OF_RADIUS, BAND_OF_CLEARANCE, MIN_BAND_PX, MAX_BAND_PX = 0.5, 0.5, 1.2, 5.0
PAPER_OF_CLEARANCE, MIN_PAPER_PX, MAX_PAPER_PX = 0.3, 1.2, 2.5
"""Width of the ring outside the band in which the paper's brightness is read; both keep clear of the next dot."""
NEIGHBOURS = 6
GROUP_RATIO = 1.6


def refine_dots(image: Grey, dots: Dots) -> Dots:
    """The dots with centroids and areas from grey values, shapes scaled to their areas; NaN where it failed."""
    radius = np.sqrt(np.linalg.det(dots.shapes)) ** 0.5
    factor = max(1, int(np.median(radius) / SUFFICIENT_RADIUS_PX))
    small = downscale_by(image, factor)
    centres, shapes = (dots.centres + 0.5) / factor - 0.5, dots.shapes / factor**2
    areas = np.full(len(radius), np.nan)
    clearance = _clearance(centres, shapes)
    group = np.rint(np.log(radius / np.median(radius)) / np.log(GROUP_RATIO))
    for members in (np.flatnonzero(group == which) for which in np.unique(group)):
        for _ in range(ITERATIONS):
            centres[members], areas[members] = _measure(small, centres[members], shapes[members], clearance[members])
            grown = areas[members] / (np.pi * np.sqrt(np.linalg.det(shapes[members])))
            shapes[members] *= np.where(np.isfinite(grown), grown, 1.0)[:, None, None]
    return Dots(to_full_size(centres, factor), shapes * factor**2, areas * factor**2)


def _clearance(centres: Array, shapes: Array) -> Array:
    """Paper (n,) in px between each dot's rim and the next dot's."""
    _, near = scipy.spatial.cKDTree(centres).query(centres, k=min(NEIGHBOURS + 1, len(centres)))
    near = near[:, 1:]
    toward = centres[near] - centres[:, None]
    distance = np.hypot(*np.moveaxis(toward, -1, 0))
    toward = toward / distance[..., None]
    inverse = np.linalg.inv(shapes)
    own = 1 / np.sqrt(np.einsum("nki,nij,nkj->nk", toward, inverse, toward))
    other = 1 / np.sqrt(np.einsum("nki,nkij,nkj->nk", toward, inverse[near], toward))
    return np.asarray((distance - own - other).min(axis=1))


def _measure(image: Grey, centres: Array, shapes: Array, clearance: Array) -> tuple[Array, Array]:
    """Centroids (n, 2) px and areas (n,) px² of the ink near ellipses; NaN where paper and ink are not distinct."""
    minor = np.sqrt(np.linalg.eigvalsh(shapes)[:, 0])
    room = np.minimum(BAND_OF_RADIUS * minor, BAND_OF_CLEARANCE * clearance)
    band = np.clip(room, MIN_BAND_PX, MAX_BAND_PX)[:, None, None]
    ring = np.clip(PAPER_OF_CLEARANCE * clearance, MIN_PAPER_PX, MAX_PAPER_PX)[:, None, None]
    half = int(np.ceil(np.sqrt(shapes[:, [0, 1], [0, 1]].max()) + (band + ring).max() + 1))
    usable = np.all(np.isfinite(centres), axis=1)
    base = np.rint(np.where(usable[:, None], centres, 0.0)).astype(np.intp)
    reach = np.arange(-half, half + 1)
    rows, columns = base[:, 1, None] + reach, base[:, 0, None] + reach
    height, width = image.shape
    inside = ((rows >= 0) & (rows < height))[:, :, None] & ((columns >= 0) & (columns < width))[:, None, :]
    level = image[np.clip(rows, 0, height - 1)[:, :, None], np.clip(columns, 0, width - 1)[:, None, :]].astype(float)
    x = (columns - centres[:, :1])[:, None, :] + 0.0 * level
    y = (rows - centres[:, 1:])[:, :, None] + 0.0 * level
    distance = _distance_from_rim(x, y, shapes)
    paper = (distance > band) & (distance < band + ring) & inside
    relative = level / np.maximum(_plane_through(level, x, y, paper), 1.0)
    ink = distance < -band
    ink_level = (relative * ink).sum(axis=(1, 2)) / np.maximum(ink.sum(axis=(1, 2)), 1)
    darkest = np.where(distance < 0, relative, np.inf).min(axis=(1, 2))
    ink_level = np.where(ink.sum(axis=(1, 2)) >= 5, ink_level, darkest)[:, None, None]
    share = np.where(ink, 1.0, np.where(distance < band, (1 - relative) / np.maximum(1 - ink_level, 0.02), 0.0))
    area = share.sum(axis=(1, 2))
    cut = (~inside & (distance < band)).any(axis=(1, 2)) | (paper.sum(axis=(1, 2)) < 12) | (ink_level[:, 0, 0] > 0.95)
    bad = cut | (area < 1) | ~usable
    shift = (
        np.column_stack([(share * x).sum(axis=(1, 2)), (share * y).sum(axis=(1, 2))])
        / np.where(bad, 1.0, area)[:, None]
    )
    return np.where(bad[:, None], np.nan, centres + shift), np.where(bad, np.nan, area)


def _distance_from_rim(x: Array, y: Array, shapes: Array) -> Array:
    """Signed distance in px from ellipses (first order), negative inside."""
    inverse = np.linalg.inv(shapes)[:, :, :, None, None]
    gx, gy = inverse[:, 0, 0] * x + inverse[:, 0, 1] * y, inverse[:, 1, 0] * x + inverse[:, 1, 1] * y
    rho = np.sqrt(np.maximum(x * gx + y * gy, 1e-9))
    return np.asarray((rho - 1) * rho / np.maximum(np.hypot(gx, gy), 1e-9))


def _plane_through(level: Array, x: Array, y: Array, mask: Array) -> Array:
    """The brightness of the paper (n, h, w): a plane through the levels where `mask`."""
    basis = np.stack([np.ones_like(x), x, y])
    weighted = basis * mask
    normal = np.einsum("inhw,jnhw->nij", weighted, basis) + 1e-6 * np.eye(3)
    right = np.einsum("inhw,nhw->ni", weighted, level)
    plane = np.linalg.solve(normal, right[..., None])[..., 0]
    return np.asarray(np.einsum("ni,inhw->nhw", plane, basis))
