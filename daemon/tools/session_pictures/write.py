"""Write the pictures of a solved session and their page into a folder; its charts are SVG without any script."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.problem import Problem, View
from calibration.solution import Solution, ViewResult
from calibration.transforms import Array
from daemon.tools.session_pictures.overlay import Picture, arrow_magnification, draw_view, reason_sentence

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720.0, 300.0, 56.0, 24.0, 22.0, 40.0
MAX_ARROWS = 4000
"""Arrows that one chart shows; of more residuals an even choice is drawn."""
CELLS_ACROSS = 12
"""Cells along the image's width in which residuals are averaged."""
MIN_POINTS_OF_CELL = 3
TICKS = 5
TOP_OF_USED = 1.5
"""Upper end of an axis over the largest value in use; a rejected view beyond it is cut off there, its value printed."""


def image_chart(pixels: Array, residuals_px: Array, image_size: tuple[int, int], magnification: float) -> str:
    """Residuals (n, 2) as arrows at their pixels (n, 2): all of them thin, their mean in each cell of a grid bold."""
    width, height = image_size
    line, step = width / 900, max(1, -(-len(pixels) // MAX_ARROWS))
    thin = [_arrow(at, by * magnification) for at, by in zip(pixels[::step], residuals_px[::step], strict=True)]
    bold = [_arrow(at, by * magnification) for at, by in _cell_means(pixels, residuals_px, width)]
    return (
        f'<svg class="image" viewBox="0 0 {width} {height}" role="img" aria-label="residuals over the image">'
        f'<rect width="{width}" height="{height}" class="frame" stroke-width="{line:.2f}"/>'
        f'<path class="thin" stroke-width="{line:.2f}" d="{"".join(thin)}"/>'
        f'<path class="bold" stroke-width="{3 * line:.2f}" d="{"".join(bold)}"/></svg>'
    )


def _cell_means(pixels: Array, residuals_px: Array, width: int) -> list[tuple[Array, Array]]:
    """Centre and mean residual of every cell that holds MIN_POINTS_OF_CELL points or more."""
    edge = width / CELLS_ACROSS
    cells, member, count = np.unique(np.floor(pixels / edge), axis=0, return_inverse=True, return_counts=True)
    means = np.column_stack([np.bincount(member.ravel(), residuals_px[:, axis]) for axis in range(2)]) / count[:, None]
    return [
        ((cell + 0.5) * edge, mean)
        for cell, mean, points in zip(cells, means, count, strict=True)
        if points >= MIN_POINTS_OF_CELL
    ]


def _arrow(start: Array, by: Array) -> str:
    """A line with a head of a quarter of its length."""
    end, across = start + by, np.array([-by[1], by[0]])
    one, other = end - 0.25 * by + 0.12 * across, end - 0.25 * by - 0.12 * across
    return f"M{_at(start)}L{_at(end)}M{_at(one)}L{_at(end)}L{_at(other)}"


def _at(point: Array) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}"


@dataclass(frozen=True)
class Mark:
    """A point of a chart: `kind`, its class, is the view's status; `title` its tooltip."""

    x: float
    y: float
    kind: str
    title: str


def scatter_chart(marks: Sequence[Mark], x_label: str, y_label: str) -> str:
    """Marks over two linear axes; y begins at 0."""
    x_ticks = nice_ticks(min(mark.x for mark in marks), max(mark.x for mark in marks))
    return _chart(marks, x_ticks, (x_ticks[0], x_ticks[-1]), 0.0, x_label, y_label)


def bar_chart(marks: Sequence[Mark], x_label: str, y_label: str) -> str:
    """One bar for each mark, at its whole number x."""
    first, last = min(mark.x for mark in marks), max(mark.x for mark in marks)
    x_ticks = np.unique(np.round(np.linspace(first, last, min(int(last - first) + 1, 12))))
    return _chart(marks, x_ticks, (first - 0.6, last + 0.6), 0.8, x_label, y_label)


def _chart(
    marks: Sequence[Mark], x_ticks: Array, x_range: tuple[float, float], bar: float, x_label: str, y_label: str
) -> str:
    """The chart; `bar`: width of a bar in units of x, 0 for dots."""
    from jinja2 import Template

    used = [mark.y for mark in marks if mark.kind != "rejected"] or [mark.y for mark in marks]
    top = min(max(mark.y for mark in marks), TOP_OF_USED * max(used))
    y_ticks = [tick for tick in nice_ticks(0.0, top) if tick <= top * (1 + 1e-9)]
    (low, high), template = x_range, Template(Path(__file__).with_name("chart.svg").read_text("utf-8"), autoescape=True)
    text: str = template.render(
        x=lambda value: LEFT + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT),
        y=lambda value: HEIGHT - BOTTOM - (min(value / top, 1.0) if top else 0.0) * (HEIGHT - TOP - BOTTOM),
        width=WIDTH, height=HEIGHT, left=LEFT, right=WIDTH - RIGHT, over=TOP - 8, bottom=HEIGHT - BOTTOM, top=top,
        middle=(TOP + HEIGHT - BOTTOM) / 2, marks=marks, x_ticks=x_ticks, y_ticks=y_ticks, bar=bar,
        x_label=x_label, y_label=y_label,
    )  # fmt: skip
    return text


def nice_ticks(low: float, high: float) -> NDArray[np.float64]:
    """About TICKS round numbers from below `low` to above `high`."""
    if not high > low:
        low, high = low - 0.5 * (low != 0), high + 0.5
    span = high - low
    power = 10.0 ** np.floor(np.log10(span / TICKS))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power * TICKS >= span)
    return np.asarray(np.arange(np.floor(low / step), np.ceil(high / step) + 0.5) * step)


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
