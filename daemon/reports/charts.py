"""Charts of a report as the shapes of an SVG, which parts.html writes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from calibration.documents.numbers import MINUS, significant

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640.0, 150.0, 52.0, 8.0, 14.0, 24.0
MAX_LABELS = 16

INK, SOFT, RULE, ACCENT, BAD = "#1b2126", "#56606a", "#c9d0d6", "#1f5a8c", "#a3251b"
LOOKS: Mapping[str, Mapping[str, str]] = MappingProxyType({
    "axis": {"stroke": INK, "stroke-width": "1", "fill": "none"},
    "mark": {"stroke": INK, "stroke-width": "3", "fill": "none"},
    "grid": {"stroke": RULE, "stroke-width": "0.6", "fill": "none"},
    "bar": {"fill": "#4d6f8f"},
    "rejected": {"fill": "#fff", "stroke": BAD, "stroke-dasharray": "3 2"},
    "line": {"stroke": ACCENT, "stroke-width": "1.6", "fill": "none"},
    "limit": {"stroke": BAD, "stroke-width": "1.2", "stroke-dasharray": "5 3", "fill": "none"},
    "dot": {"fill": ACCENT},
    "bubble": {"fill": "#9db4c8", "fill-opacity": "0.5", "stroke": INK, "stroke-width": "0.7"},
    "over": {"fill": "#fff", "stroke": BAD, "stroke-width": "1.6"},
    "accepted": {"fill": "#dfe7ee"},
    "word": {"fill": SOFT, "font-size": "9"},
    "value": {"fill": INK, "font-size": "9", "font-weight": "600"},
})  # fmt: skip
"""Attributes of shapes. A style sheet of the page would not reach them in WeasyPrint."""


@dataclass(frozen=True)
class Shape:
    """An element of SVG, with the text in it."""

    name: str
    attributes: Mapping[str, str]
    text: str = ""


@dataclass(frozen=True)
class Chart:
    """Its size in units of its own, and its shapes. Numbers have a point; `in_language` of a template replaces it."""

    width: float
    height: float
    shapes: tuple[Shape, ...]


@dataclass(frozen=True)
class Bar:
    """A value under a label; `rejected`: not in use, drawn hollow."""

    label: str
    value: float
    rejected: bool = False


def bar_chart(bars: Sequence[Bar], unit: str) -> Chart:
    """One bar each from zero; a rejected one beyond 1.5 times the others is cut off there, its value above it."""
    used = [bar.value for bar in bars if not bar.rejected] or [bar.value for bar in bars]
    top = nice(min(max(bar.value for bar in bars), 1.5 * max(used)))
    step = (WIDTH - LEFT - RIGHT) / len(bars)
    wide, every = min(0.7 * step, 46.0), -(-len(bars) // MAX_LABELS)
    shapes = [*_scale(top, unit)]
    for index, bar in enumerate(bars):
        x, y = LEFT + (index + 0.5) * step, _y(min(bar.value, top), top)
        kind = "rejected" if bar.rejected else "bar"
        height = HEIGHT - BOTTOM - y
        shapes.append(_shape("rect", kind, x=_f(x - wide / 2), y=_f(y), width=_f(wide), height=_f(height)))
        if len(bars) <= MAX_LABELS:
            shapes.append(_text(x, y - 3, significant(bar.value), "value"))
        if index % every == 0:
            shapes.append(_text(x, HEIGHT - BOTTOM + 12, bar.label))
    return Chart(WIDTH, HEIGHT, tuple(shapes))


@dataclass(frozen=True)
class ChartPoint:
    """A value at a moment, and the limit then, None while it is learnt; `over`: beyond it."""

    label: str
    value: float
    limit: float | None
    over: bool = False


def control_chart(points: Sequence[ChartPoint], unit: str) -> Chart:
    """Values in order, joined by a line, under their dashed limit."""
    top = nice(max([point.value for point in points] + [point.limit or 0.0 for point in points]))
    step = (WIDTH - LEFT - RIGHT) / max(len(points) - 1, 1)
    at = [(LEFT + index * step, _y(point.value, top)) for index, point in enumerate(points)]
    limit = [(x, _y(point.limit, top)) for (x, _), point in zip(at, points, strict=True) if point.limit is not None]
    shapes = [*_scale(top, unit), _shape("polyline", "line", points=_path(at))]
    if len(limit) > 1:
        shapes.append(_shape("polyline", "limit", points=_path(limit)))
    for (x, y), point in zip(at, points, strict=True):
        shapes.append(_shape("circle", "over" if point.over else "dot", cx=_f(x), cy=_f(y), r="3"))
    for index, anchor in ((0, "start"), (len(points) - 1, "end")):
        if index or len(points) > 1:
            shapes.append(_text(at[index][0], HEIGHT - BOTTOM + 12, points[index].label, anchor=anchor))
    return Chart(WIDTH, HEIGHT, tuple(shapes))


def limit_scale(value: float, limit: float, limit_words: str) -> Chart:
    """`value`, mm, on a scale from zero; the accepted part is shaded up to `limit`, under which `limit_words` stand."""
    height, bar_y, bar = 46.0, 17.0, 10.0
    top = max(1.15 * limit, 1.05 * value)
    end, at = LEFT + limit / top * (WIDTH - LEFT - RIGHT), LEFT + value / top * (WIDTH - LEFT - RIGHT)
    right = WIDTH - RIGHT
    shapes = [
        _shape("rect", "accepted", x=_f(LEFT), y=_f(bar_y), width=_f(end - LEFT), height=_f(bar)),
        _shape("path", "axis", d=f"M{_f(LEFT)} {_f(bar_y + bar)}H{_f(right)}"),
        _shape("path", "limit", d=f"M{_f(end)} {_f(bar_y - 5)}V{_f(bar_y + bar + 4)}"),
        _shape("path", "mark", d=f"M{_f(at)} {_f(bar_y - 4)}L{_f(at)} {_f(bar_y + bar)}"),
        _text(min(max(at, LEFT + 30), right - 40), bar_y - 7, f"U = {significant(value)} mm", "value"),
        _text(LEFT, bar_y + bar + 13, "0", anchor="start"),
        _text(end, bar_y + bar + 13, limit_words),
    ]
    return Chart(WIDTH, height, tuple(shapes))


def bubble_map(places: Sequence[tuple[float, float]], values: Sequence[float], largest: float) -> Chart:
    """A circle at each place (x, y) in mm, its radius in proportion to the value; `largest` has the largest circle."""
    side, edge, radius = 300.0, 40.0, 12.0
    low = [min(place[axis] for place in places) for axis in (0, 1)]
    high = [max(place[axis] for place in places) for axis in (0, 1)]
    span = max(high[0] - low[0], high[1] - low[1], 1.0) * 1.15
    start = [(low[axis] + high[axis] - span) / 2 for axis in (0, 1)]
    scale, floor = (side - edge) / span, side - edge / 2

    def at(place: tuple[float, float]) -> tuple[float, float]:
        return edge + (place[0] - start[0]) * scale, floor - (place[1] - start[1]) * scale

    step = nice(span / 3)
    shapes = [_shape("path", "axis", d=f"M{_f(edge)} {_f(floor - span * scale)}V{_f(floor)}H{_f(side)}")]
    for axis in (0, 1):
        for number in range(math.ceil(start[axis] / step), math.floor((start[axis] + span) / step) + 1):
            x, y = at((number * step, start[1]) if axis == 0 else (start[0], number * step))
            words = f"{number * step:.0f}".replace("-", MINUS)
            shapes.append(_text(x, floor + 12, words) if axis == 0 else _text(edge - 4, y + 3, words, anchor="end"))
    for place, value in zip(places, values, strict=True):
        x, y = at(place)
        shapes.append(_shape("circle", "bubble", cx=_f(x), cy=_f(y), r=_f(max(0.6, radius * value / (largest or 1.0)))))
    return Chart(side, side, tuple(shapes))


def _scale(top: float, unit: str) -> list[Shape]:
    """Three lines of the grid with their values."""
    lines = []
    for share in (0.0, 0.5, 1.0):
        y = _y(share * top, top)
        lines.append(_shape("path", "axis" if share == 0 else "grid", d=f"M{_f(LEFT)} {_f(y)}H{_f(WIDTH - RIGHT)}"))
        text = "0" if share == 0 else f"{share * top:.3g}" + (f" {unit}" if share == 1 else "")
        lines.append(_text(LEFT - 5, y + 3, text, anchor="end"))
    return lines


def nice(top: float, factors: Sequence[float] = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)) -> float:
    """The next of the factors times a power of ten; 1 for what is not above zero."""
    if not top > 0 or not math.isfinite(top):
        return 1.0
    power = 10.0 ** math.floor(math.log10(top))
    return power * next(factor for factor in factors if factor * power >= top * (1 - 1e-9))


def _y(value: float, top: float) -> float:
    return HEIGHT - BOTTOM - value / top * (HEIGHT - TOP - BOTTOM)


def _f(value: float) -> str:
    return f"{value:.1f}"


def _path(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{_f(x)},{_f(y)}" for x, y in points)


def _shape(name: str, look: str, **attributes: str) -> Shape:
    return Shape(name, {**attributes, **LOOKS[look]})


def _text(x: float, y: float, text: str, look: str = "word", anchor: str = "middle") -> Shape:
    return Shape("text", {"x": _f(x), "y": _f(y), "text-anchor": anchor, **LOOKS[look]}, text)
