"""Write a sheet as SVG 1.1; one user unit is 1 mm."""

from functools import singledispatch
from html import escape

from daemon.tools.target_print.shapes import Disc, Rectangles, Sheet, TextLine


def svg(sheet: Sheet, title: str) -> bytes:
    """The bytes of the SVG."""
    size = f'width="{_number(sheet.width)}mm" height="{_number(sheet.height)}mm"'
    view = f'viewBox="0 0 {_number(sheet.width)} {_number(sheet.height)}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {view}>',
        f"<title>{escape(title, quote=False)}</title>",
        '<rect width="100%" height="100%" fill="white"/>',
        *(_draw(shape) for shape in sheet.shapes),
        "</svg>\n",
    ]
    return "\n".join(lines).encode()


@singledispatch
def _draw(shape: object) -> str:
    raise TypeError(type(shape).__name__)


@_draw.register
def _(shape: Rectangles) -> str:
    path = "".join(
        f"M{_number(box.left)} {_number(box.top)}H{_number(box.right)}V{_number(box.bottom)}H{_number(box.left)}Z"
        for box in shape.boxes
    )
    return f'<path d="{path}" fill="{shape.ink}"/>'


@_draw.register
def _(shape: Disc) -> str:
    place = f'cx="{_number(shape.x)}" cy="{_number(shape.y)}" r="{_number(shape.radius)}"'
    return f'<circle {place} fill="{shape.ink}"/>'


@_draw.register
def _(shape: TextLine) -> str:
    place = f'x="{_number(shape.x)}" y="{_number(shape.y)}" font-size="{_number(shape.size)}"'
    return f'<text {place} font-family="Helvetica, Arial, sans-serif">{escape(shape.text, quote=False)}</text>'


def _number(value: float) -> str:
    return f"{value:.5f}".rstrip("0").rstrip(".")
