"""The page of residuals: one HTML file that needs nothing but the pictures beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from calibration.solution import Solution, ViewResult
from daemon.tools.session_pictures.charts import Mark, bar_chart, image_chart, scatter_chart

STYLE = """
:root { color-scheme: light dark; --ink: #1c2430; --paper: #fff; --line: #c9ced6; --used: #1f7a4d; --off: #c62828; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e9ee; --paper: #14181f; --line: #3a424e; --used: #57c08a; --off: #ff7a70; }
}
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 24px auto;
  max-width: 1180px; padding: 0 16px; }
h1 { font-size: 22px; } h2 { font-size: 17px; margin: 28px 0 4px; } p { margin: 4px 0 10px; }
svg { width: 100%; height: auto; } svg.image { max-height: 640px; } svg text { font-size: 12px; fill: var(--ink); }
.grid, .frame { stroke: var(--line); fill: none; } .thin, .bold { fill: none; stroke-linejoin: round; }
.thin { stroke: var(--used); opacity: .55; } .bold { stroke: var(--off); }
.used, .corrected { fill: var(--used); } .rejected { fill: var(--off); }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(460px, 1fr)); gap: 16px; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(270px, 1fr)); gap: 14px; }
figure { margin: 0; } figure img { width: 100%; display: block; } figcaption { font-size: 13px; }
figure.rejected { outline: 2px solid var(--off); outline-offset: 3px; }
"""


@dataclass(frozen=True)
class Figure:
    """One view's picture: the file's name beside the page, the view's result, and the reason for not using it."""

    file: str
    result: ViewResult
    reason: str


def residual_page(
    title: str, solution: Solution, image_size: tuple[int, int], figures: Sequence[Figure], magnification: float
) -> str:
    """The HTML: residuals over the image, over the distance and over the view, then the pictures, worst first."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}: residuals</title><style>{STYLE}</style></head><body>"
        f"<h1>{escape(title)}: residuals</h1>"
        f"{_charts(solution, image_size, magnification)}"
        f'<h2>Pictures, the worst first</h2><div class="pictures">{"".join(map(_figure, figures))}</div>'
        "</body></html>\n"
    )


def _charts(solution: Solution, image_size: tuple[int, int], magnification: float) -> str:
    fitted = [view for view in solution.views if view.points is not None]
    used = [view.points for view in fitted if view.points is not None and view.status != "rejected"]
    if not used:
        reasons = "".join(f"<p>{escape(finding.message)}</p>" for finding in solution.findings)
        return f"<p>No X was found, so there are no residuals.</p>{reasons}"
    pixels = np.concatenate([points.pixels[points.used] for points in used])
    residuals_px = np.concatenate([points.residuals_px[points.used] for points in used])
    rms_px = float(np.sqrt(np.mean(residuals_px**2)))
    over_image = image_chart(pixels, residuals_px, image_size, magnification)
    return (
        f"<p>A residual is the predicted minus the found point, with the robot's pose corrected by its estimated error;"
        f" for rejected views with the pose as reported. RMS {rms_px:.3g} px an axis,"
        f" {len(pixels)} points in {len(used)} views.</p>"
        f"<h2>Over the image</h2><p>Arrows are {magnification:g} times as long as the residuals: thin for each point,"
        " bold for the mean of a cell. Bold arrows that form a pattern mean that the lens is not as the intrinsics"
        f" describe it.</p>{over_image}"
        '<div class="charts"><div><h2>Over the distance</h2><p>One dot a view.</p>'
        f"{scatter_chart([_by_distance(view) for view in fitted], 'distance along the camera axis, mm', 'RMS, px')}"
        "</div><div><h2>Over the view</h2><p>Residual in the image.</p>"
        f"{bar_chart([_by_view(view, view.reprojection_px, 'px') for view in fitted], 'view', 'RMS, px')}"
        "</div><div><h2>The robot over the view</h2><p>Distance in the target's anchor between the view and all"
        " views, by the robot's pose as reported.</p>"
        f"{bar_chart([_by_view(view, view.base_error_mm, 'mm') for view in fitted], 'view', 'RMS, mm')}</div></div>"
    )


def _by_distance(view: ViewResult) -> Mark:
    assert view.points is not None
    distance_mm = float(np.median(view.points.distances_mm))
    return Mark(distance_mm, view.reprojection_px or 0.0, view.status, f"view {view.index}: {distance_mm:.0f} mm")


def _by_view(view: ViewResult, value: float | None, unit: str) -> Mark:
    return Mark(float(view.index), value or 0.0, view.status, f"view {view.index}: {value or 0.0:.3g} {unit}")


def _figure(figure: Figure) -> str:
    result, file = figure.result, escape(figure.file, quote=True)
    size = "" if result.reprojection_px is None else f": {result.reprojection_px:.3g} px, {result.base_error_mm:.3g} mm"
    reason = f"<br>{escape(figure.reason)}" if figure.reason else ""
    kind = ' class="rejected"' if result.status == "rejected" else ""
    return (
        f'<figure{kind}><a href="{file}"><img src="{file}" loading="lazy" alt="view {result.index}"></a>'
        f"<figcaption>view {result.index}, {result.status}{size}{reason}</figcaption></figure>"
    )
