"""The map of a scan's deviations: a picture of where its views disagree, and how many points by how much."""

import base64
import math
from collections.abc import Sequence

import cv2
import numpy as np

from calibration.transforms import Array
from daemon.reports.context import DeviationMap, Picture

WIDTH_PX, MAX_HEIGHT_PX = 860, 860
BEHIND, SAME, AHEAD = np.array([166, 77, 20.0]), np.array([225, 225, 225.0]), np.array([13, 46, 191.0])
"""Blue, green, red of a point behind the other views, where they are, and before them."""
ALONE = np.array([150, 150, 150.0])
WITHIN = 0.9
"""Share of the points that the scale of colours holds."""
BARS = 9
AXES = "xyz"
SPREAD = (*((down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if (down, right) != (0, 0)), (0, 0))
"""Pixels that a point fills, its own last: points stand up to three pixels apart."""


def deviation_map(surfaces: Sequence[bytes], record: np.dtype) -> DeviationMap | None:
    """Of the views' surfaces, records with x, y, z and `deviation`; None where no two views see the same place."""
    points = (
        np.concatenate([np.frombuffer(surface, record) for surface in surfaces]) if surfaces else np.empty(0, record)
    )
    deviation = points["deviation"].astype(float)
    known = np.isfinite(deviation)
    if not known.any():
        return None
    end_mm = _nice(float(np.quantile(np.abs(deviation[known]), WITHIN)))
    places = np.stack([points[axis].astype(float) for axis in AXES], axis=1)
    edges = np.linspace(-end_mm, end_mm, BARS + 1)
    counts = np.histogram(np.clip(deviation[known], -end_mm, end_mm), edges)[0]
    return DeviationMap(
        picture=_picture(places, deviation, known, end_mm),
        end_mm=end_mm,
        middles_mm=tuple(((edges[1:] + edges[:-1]) / 2).tolist()),
        shares=tuple((counts / known.sum()).tolist()),
        rms_mm=float(np.sqrt(np.mean(deviation[known] ** 2))),
        alone=float(1 - known.mean()),
    )


def _nice(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    if not value > 0:
        return 0.1
    power = 10.0 ** math.floor(math.log10(value))
    return power * next(factor for factor in (1, 2, 5, 10) if factor * power >= value * (1 - 1e-9))


def _picture(places: Array, deviation: Array, known: Array, end_mm: float) -> Picture:
    """Along the axis in which the part is thinnest; what deviates most lies on top."""
    low, high = np.percentile(places, 0.1, axis=0), np.percentile(places, 99.9, axis=0)
    thin = int(np.argmin(high - low))
    across, up = (axis for axis in range(3) if axis != thin)
    extent = np.maximum((high - low)[[across, up]], 1e-6)
    scale = min(WIDTH_PX / extent[0], MAX_HEIGHT_PX / extent[1]) * 0.96
    wide, tall = WIDTH_PX, max(60, round(extent[1] * scale / 0.96))
    middle = ((low + high) / 2)[[across, up]]
    x = np.round((places[:, across] - middle[0]) * scale + wide / 2).astype(int)
    y = np.round(tall / 2 - (places[:, up] - middle[1]) * scale).astype(int)
    inside = (x >= 1) & (x < wide - 1) & (y >= 1) & (y < tall - 1)
    order = np.argsort(np.where(known, np.abs(deviation), -1.0)[inside], kind="stable")
    image = np.full((tall, wide, 3), 255, np.uint8)
    colours = _colours(deviation, known, end_mm)[inside][order]
    for down, right in SPREAD:
        image[y[inside][order] + down, x[inside][order] + right] = colours
    _, content = cv2.imencode(".png", image)
    uri = f"data:image/png;base64,{base64.b64encode(content.tobytes()).decode()}"
    caption = {"axis": AXES[thin], "across": AXES[across], "up": AXES[up], "width_mm": wide / scale}
    return Picture(uri, wide, tall, "scan.map-picture", caption)


def _colours(deviation: Array, known: Array, end_mm: float) -> Array:
    """(n, 3) blue, green, red."""
    share = np.clip(np.where(known, deviation, 0.0) / end_mm, -1.0, 1.0)[:, None]
    mixed = SAME + np.where(share < 0, -share * (BEHIND - SAME), share * (AHEAD - SAME))
    return np.where(known[:, None], mixed, ALONE).round().astype(np.uint8)
