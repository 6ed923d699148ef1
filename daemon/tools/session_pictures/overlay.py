"""One image of a session with the found points, their residuals and, when it is not used, the reason."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.problem import View
from calibration.solution import ViewResult
from calibration.transforms import Array

MIN_WIDTH_PX = 1280
"""Smaller images are enlarged by a whole factor, so that marks and words do not hide the target."""
ARROW_OF_WIDTH = 0.03
"""Length of a typical residual's arrow, as a share of the image's width."""

GREEN, RED, AMBER, WHITE, BLACK = (60, 200, 40), (40, 40, 235), (0, 170, 255), (255, 255, 255), (24, 24, 24)
"""Blue, green, red."""

REASONS = {
    "pose-disagrees": "the robot's pose contradicts the image and all other pictures",
    "image-disagrees": "the points do not lie as those of this target do",
    "beyond-the-first-three": "the three-pose method uses three pictures",
    "board-turned": "the target was read turned; its points were numbered anew",
}
"""Sentences for codes of pictures in which points were found; others come with the view, or stand for themselves."""

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Pen:
    """Sizes in pixels of what is drawn into an image `width` pixels wide."""

    width: int

    @property
    def line(self) -> int:
        return max(1, round(self.width / 1300))

    @property
    def mark(self) -> int:
        return max(4, round(self.width / 220))

    @property
    def text(self) -> float:
        """OpenCV's scale of its font, which is 22 px high at 1."""
        return self.width / 1900


def draw_view(image: Picture, view: View, result: ViewResult, magnification: float, reason: str) -> Picture:
    """The image (h, w) in colour, enlarged when it is small, above a caption of two lines.

    Green circles are points in use, red crosses are outlying points; arrows are the residuals, `magnification` times
    as long. `reason` is the sentence for a view that is not used.
    """
    factor = max(1, -(-MIN_WIDTH_PX // image.shape[1]))
    large = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    canvas = np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), np.uint8)
    pen = Pen(canvas.shape[1])
    rejected = result.status == "rejected"
    if result.points is not None:
        points = result.points
        _draw_points(canvas, _enlarge(points.pixels, factor), points.used, pen)
        begins = _enlarge(points.pixels, factor)
        ends = begins + points.residuals_px * factor * magnification
        for start, end in zip(_in_range(begins), _in_range(ends), strict=True):
            cv2.arrowedLine(canvas, start, end, BLACK, 3 * pen.line, cv2.LINE_AA, tipLength=0.2)
            cv2.arrowedLine(canvas, start, end, AMBER, pen.line, cv2.LINE_AA, tipLength=0.2)
    elif view.detection is not None:
        found = view.detection.corners_px
        _draw_points(canvas, _enlarge(found, factor), np.full(len(found), not rejected), pen)
    if rejected:
        cv2.rectangle(canvas, (0, 0), (canvas.shape[1] - 1, canvas.shape[0] - 1), RED, 4 * pen.line)
    return np.vstack([canvas, _caption(_lines(view, result, magnification, reason), rejected, pen)])


def reason_sentence(view: View, result: ViewResult) -> str:
    """Why a view is not used, or used otherwise than given; empty for a usual one."""
    if view.missing is not None:
        return view.missing[1]
    return REASONS.get(result.reason or "", (result.reason or "").replace("-", " "))


def arrow_magnification(results: Sequence[ViewResult], width_px: int) -> float:
    """A round number, 1 or more, that makes the median residual at most ARROW_OF_WIDTH of the image's width."""
    lengths = [result.points.lengths_px[result.points.used] for result in results if result.points is not None]
    typical_px = float(np.median(np.concatenate(lengths))) if lengths else 0.0
    if not typical_px > 0:
        return 1.0
    wanted = max(ARROW_OF_WIDTH * width_px / typical_px, 1.0)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(factor for factor in (1, 2, 5) if factor * power <= wanted))


def _enlarge(pixels: Array, factor: int) -> Array:
    return (pixels + 0.5) * factor - 0.5


def _draw_points(canvas: Picture, pixels: Array, used: NDArray[np.bool_], pen: Pen) -> None:
    for (x, y), good in zip(_in_range(pixels), used, strict=True):
        if good:
            cv2.circle(canvas, (x, y), pen.mark, GREEN, pen.line, cv2.LINE_AA)
        else:
            cv2.drawMarker(canvas, (x, y), RED, cv2.MARKER_TILTED_CROSS, 2 * pen.mark, 2 * pen.line, cv2.LINE_AA)


def _in_range(pixels: Array) -> list[tuple[int, int]]:
    """Whole pixels that OpenCV can draw to; a point far outside is moved to the same side of the image."""
    near = np.clip(np.nan_to_num(pixels), -30000, 30000)
    return [(round(float(x)), round(float(y))) for x, y in near]


def _lines(view: View, result: ViewResult, magnification: float, reason: str) -> tuple[str, str]:
    count = 0 if view.detection is None else len(view.detection.ids)
    title = f"picture {result.index + 1}  {result.image or 'no image'}  {result.status}  {count} points"
    if result.points is None:
        return title, reason
    outliers = int(np.count_nonzero(~result.points.used))
    title += f" ({outliers} outlying, red)" if outliers else ""
    pose = "as reported" if result.status == "rejected" else "corrected"
    arrows = f"arrows: predicted minus found, robot's pose {pose}, x {magnification:g}"
    return title, "; ".join(filter(None, [reason, arrows, f"RMS {result.reprojection_px:.3g} px"]))


def _caption(lines: tuple[str, str], rejected: bool, pen: Pen) -> Picture:
    height = round(34 * pen.text)
    strip: Any = np.full((round(2.6 * height), pen.width, 3), BLACK, np.uint8)
    for row, (line, colour) in enumerate(zip(lines, (WHITE, RED if rejected else AMBER), strict=True), start=1):
        words = line.replace("×", "x").replace("°", " deg").encode("ascii", "replace").decode()
        (length, _), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, pen.text, pen.line)
        scale = pen.text * min(1.0, (pen.width - 2 * height) / max(length, 1))
        place = (height // 2, row * height + (row - 1) * height // 5)
        cv2.putText(strip, words, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, pen.line, cv2.LINE_AA)
    return np.asarray(strip, np.uint8)
