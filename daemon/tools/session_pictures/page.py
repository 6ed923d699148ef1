"""The page of residuals: one HTML file that needs nothing but the pictures beside it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calibration.solution import Solution, ViewResult
from daemon.tools.session_pictures.charts import Mark, bar_chart, image_chart, scatter_chart

Figure = tuple[str, ViewResult, str]
"""One view's picture: the file's name beside the page, the view's result, and the reason for not using it."""


def residual_page(
    title: str, solution: Solution, image_size: tuple[int, int], figures: Sequence[Figure], magnification: float
) -> str:
    """The HTML: residuals over the image, over the distance and over the view, then the pictures, worst first."""
    from jinja2 import Template

    page: Any = Template(Path(__file__).with_suffix(".html").read_text("utf-8"), autoescape=True, trim_blocks=True)
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
