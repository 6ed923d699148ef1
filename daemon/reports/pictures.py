"""Pictures of a report: the worst views with the found points, a cloud from three sides, where its views disagree."""

import base64
from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.detect import detect
from calibration.documents.calibration import ViewResultDocument
from calibration.errors import DetectionError
from calibration.kinematics.stance import Stance
from calibration.problem import View
from calibration.solution import Solution, ViewResult
from calibration.targets import Target
from calibration.transforms import Array
from daemon.reports.charts import nice
from daemon.reports.context import DeviationMap, Picture
from daemon.tools.session_pictures.overlay import arrow_magnification, draw_view, reason_sentence

Levels = NDArray[np.uint8]

WIDTH_PX = 1000
MAX_PICTURES = 2
JPEG = (cv2.IMWRITE_JPEG_QUALITY, 82)
CLOUD_PX = 420
SIDES = {"above": (0, 1, 2), "front": (0, 2, 1), "side": (1, 2, 0)}
"""Axes across and up, and the axis of depth."""

LOW, HIGH = np.array([107, 79, 47.0]), np.array([214, 224, 236.0])
"""Colours of the farthest and the nearest point: blue, green, red."""


def worst_views(views: Sequence[ViewResultDocument]) -> list[ViewResultDocument]:
    """The view in use with the largest error, then the rejected one with the largest, as far as they have pictures."""
    seen = [view for view in views if view.image is not None and view.base_error_mm is not None]
    chosen = [[view for view in seen if (view.status == "rejected") is rejected] for rejected in (False, True)]
    return [max(group, key=lambda view: view.base_error_mm or 0.0) for group in chosen if group][:MAX_PICTURES]


def view_pictures(
    views: Sequence[ViewResultDocument],
    target: Target,
    read: Callable[[str], Levels | None],
    solution: Solution | None = None,
) -> tuple[Picture, ...]:
    """The worst of `views` with the found points; with a solution, its residuals as arrows.

    `read` gives the image (h, w) by its name, None for one that cannot be read.
    """
    solved = {result.index: result for result in solution.views} if solution else {}
    pictures = []
    for document in worst_views(views):
        assert document.image is not None
        image = read(document.image)
        if image is None:
            continue
        try:
            detection = detect(image, target)
        except DetectionError:
            detection = None
        result = solved.get(document.index) or ViewResult(
            document.index, document.image, document.status, document.reason, document.reprojection_px,
            document.base_error_mm, None,
        )  # fmt: skip
        view = View(document.index, Stance(np.eye(4)), detection, document.image)
        scale = arrow_magnification([result], image.shape[1])
        drawn = draw_view(image, view, result, scale, reason_sentence(view, result))
        caption = "picture.rejected" if document.status == "rejected" else "picture.used"
        pictures.append(_picture(drawn, caption, document.index))
    return tuple(pictures)


def _picture(drawn: NDArray[np.uint8], caption: str, view: int) -> Picture:
    height = round(drawn.shape[0] * WIDTH_PX / drawn.shape[1])
    small = cv2.resize(drawn, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    _, content = cv2.imencode(".jpg", small, JPEG)
    return Picture(_data("jpeg", content.tobytes()), WIDTH_PX, height, caption, {"view": view})


def _data(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


def cloud_pictures(points_mm: NDArray[np.float32]) -> tuple[Picture, ...]:
    """Points (n, 3) in the base from three sides, the nearer the lighter, the same scale in each."""
    found = []
    for side in SIDES if len(points_mm) else ():
        image, width_mm = draw_cloud(points_mm, side, CLOUD_PX)
        data = _data("png", cv2.imencode(".png", image)[1].tobytes())
        found.append(Picture(data, CLOUD_PX, CLOUD_PX, f"scan.{side}", {"width_mm": width_mm}))
    return tuple(found)


def draw_cloud(points_mm: NDArray[np.float32], side: str, px: int) -> tuple[Levels, float]:
    """Points (n, 3) seen from one of SIDES, the nearer the lighter: an image (px, px, 3), and its width in mm."""
    image = np.full((px, px, 3), 255, np.uint8)
    if len(points_mm) == 0:
        return image, 0.0
    across, up, depth = SIDES[side]
    low, high = np.percentile(points_mm, 0.1, axis=0), np.percentile(points_mm, 99.9, axis=0)
    centre, span = (low + high) / 2, max(float((high - low).max()), 1e-6)
    scale = 0.94 * px / span
    x = np.round((points_mm[:, across] - centre[across]) * scale + px / 2).astype(int)
    y = np.round(px / 2 - (points_mm[:, up] - centre[up]) * scale).astype(int)
    inside = (x >= 0) & (x < px) & (y >= 0) & (y < px)
    nearness = points_mm[inside, depth] if depth == 2 else -points_mm[inside, depth]
    order = np.argsort(nearness)
    shade = (nearness - nearness.min()) / max(float(np.ptp(nearness)), 1e-9) if len(order) else nearness
    image[y[inside][order], x[inside][order]] = (LOW + shade[order, None] * (HIGH - LOW)).astype(np.uint8)
    return image, span / 0.94


MAP_WIDTH_PX, MAX_MAP_HEIGHT_PX = 860, 860
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
    share_mm = float(np.quantile(np.abs(deviation[known]), WITHIN))
    end_mm = nice(share_mm, (1, 2, 5, 10)) if share_mm > 0 else 0.1
    places = np.stack([points[axis].astype(float) for axis in AXES], axis=1)
    edges = np.linspace(-end_mm, end_mm, BARS + 1)
    counts = np.histogram(np.clip(deviation[known], -end_mm, end_mm), edges)[0]
    return DeviationMap(
        picture=_map_picture(places, deviation, known, end_mm),
        end_mm=end_mm,
        middles_mm=tuple(((edges[1:] + edges[:-1]) / 2).tolist()),
        shares=tuple((counts / known.sum()).tolist()),
        rms_mm=float(np.sqrt(np.mean(deviation[known] ** 2))),
        alone=float(1 - known.mean()),
    )


def _map_picture(places: Array, deviation: Array, known: Array, end_mm: float) -> Picture:
    """Along the axis in which the part is thinnest; what deviates most lies on top."""
    low, high = np.percentile(places, 0.1, axis=0), np.percentile(places, 99.9, axis=0)
    thin = int(np.argmin(high - low))
    across, up = (axis for axis in range(3) if axis != thin)
    extent = np.maximum((high - low)[[across, up]], 1e-6)
    scale = min(MAP_WIDTH_PX / extent[0], MAX_MAP_HEIGHT_PX / extent[1]) * 0.96
    wide, tall = MAP_WIDTH_PX, max(60, round(extent[1] * scale / 0.96))
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
    caption = {"axis": AXES[thin], "across": AXES[across], "up": AXES[up], "width_mm": wide / scale}
    return Picture(_data("png", content.tobytes()), wide, tall, "scan.map-picture", caption)


def _colours(deviation: Array, known: Array, end_mm: float) -> Array:
    """(n, 3) blue, green, red."""
    share = np.clip(np.where(known, deviation, 0.0) / end_mm, -1.0, 1.0)[:, None]
    mixed = SAME + np.where(share < 0, -share * (BEHIND - SAME), share * (AHEAD - SAME))
    return np.where(known[:, None], mixed, ALONE).round().astype(np.uint8)
