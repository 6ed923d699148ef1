"""Write the pictures of a solved session and their page into a folder."""

from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import cv2
import numpy as np

from calibration.problem import Problem, View
from calibration.solution import Solution, ViewResult
from daemon.tools.session_pictures.charts import Mark, bar_chart, image_chart, scatter_chart
from daemon.tools.session_pictures.overlay import Picture, arrow_magnification, draw_view, reason_sentence

PAGE_FILE = "residuals.html"
JPEG = (cv2.IMWRITE_JPEG_QUALITY, 88, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
"""Colours at full resolution: lines are one or two pixels wide."""
GREY_LEVEL = 96
"""Of the ground on which points are drawn that a session holds without an image."""


def write_pictures(
    folder: Path, title: str, problem: Problem, solution: Solution, order: Sequence[int], read: Callable[[str], Picture]
) -> Path:
    """One JPEG a view and PAGE_FILE in `folder`, which is made; returns the page. Raises OSError.

    `order`: indices of the views as the page lists them. `read` gives a view's image (h, w) by its name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    used = [result for result in solution.views if result.status != "rejected"]
    magnification = arrow_magnification(used, problem.image_size[0])
    results = {result.index: result for result in solution.views}
    views = {view.index: view for view in problem.views}
    figures = []
    for index in order:
        view, result = views[index], results[index]
        reason = reason_sentence(view, result)
        own = result.status == "rejected"  # its residuals are of another size
        scale = arrow_magnification([result], problem.image_size[0]) if own else magnification
        picture = draw_view(_image(view, problem.image_size, read), view, result, scale, reason)
        stem = PurePosixPath(view.image).stem if view.image else "points"
        file = f"{index:03d}_{stem}.jpg"
        encoded = cv2.imencode(".jpg", picture, JPEG)[1]
        (folder / file).write_bytes(np.asarray(encoded, np.uint8).tobytes())
        figures.append((file, result, reason))
    page = folder / PAGE_FILE
    page.write_text(residual_page(title, solution, problem.image_size, figures, magnification), encoding="utf-8")
    return page


def _image(view: View, image_size: tuple[int, int], read: Callable[[str], Picture]) -> Picture:
    if view.image is not None:
        return read(view.image)
    return np.full((image_size[1], image_size[0]), GREY_LEVEL, np.uint8)


Figure = tuple[str, ViewResult, str]
"""One view's picture: the file's name beside the page, the view's result, and the reason for not using it."""


def residual_page(
    title: str, solution: Solution, image_size: tuple[int, int], figures: Sequence[Figure], magnification: float
) -> str:
    """The HTML: residuals over the image, over the distance and over the view, then the pictures, worst first."""
    from jinja2 import Template

    page: Any = Template(Path(__file__).with_name("page.html").read_text("utf-8"), autoescape=True, trim_blocks=True)
    fitted = [view for view in solution.views if view.points is not None]
    used = [view.points for view in fitted if view.points is not None and view.status != "rejected"]
    if not used:
        return f"{page.render(title=title, figures=figures, findings=solution.findings)}\n"
    pixels = np.concatenate([points.pixels[points.used] for points in used])
    residuals_px = np.concatenate([points.residuals_px[points.used] for points in used])
    distances = []
    for view, points in ((view, view.points) for view in fitted if view.points is not None):
        away_mm, name = float(np.median(points.distances_mm)), f"picture {view.index + 1}"
        distances.append(Mark(away_mm, view.reprojection_px or 0.0, view.status, f"{name}: {away_mm:.0f} mm"))
    text: str = page.render(
        title=title,
        figures=figures,
        used=len(used),
        points=len(pixels),
        rms_px=float(np.sqrt(np.mean(residuals_px**2))),
        magnification=magnification,
        over_image=image_chart(pixels, residuals_px, image_size, magnification),
        over_distance=scatter_chart(distances, "distance along the camera axis, mm", "RMS, px"),
        over_view=bar_chart([_by_view(view, view.reprojection_px, "px") for view in fitted], "picture", "RMS, px"),
        robot=bar_chart([_by_view(view, view.base_error_mm, "mm") for view in fitted], "picture", "RMS, mm"),
    )  # fmt: skip
    return text + "\n"


def _by_view(view: ViewResult, value: float | None, unit: str) -> Mark:
    return Mark(view.index + 1, value or 0.0, view.status, f"picture {view.index}: {value or 0.0:.3g} {unit}")
