"""Sub-pixel centroids and areas of dots from grey values; blur does not bias them.

The share of a pixel that the dot covers follows from its grey value between paper and ink, in a band along the rim
only. Further inside it is set to 1, further outside to 0, so that noise, stains and neighbours there have no effect.
"""

import numpy as np
import scipy

from calibration.detection.dots import Dots
from calibration.detection.image import Grey, downscale_by, to_full_size
from calibration.transforms import Array

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
