"""Write a sheet as SVG 1.1; one user unit is 1 mm."""

from html import escape

from daemon.tools.target_print.shapes import Disc, Rectangles, Shape, Sheet, TextLine, number_text


def svg(sheet: Sheet) -> bytes:
    size = f'width="{number_text(sheet.width)}mm" height="{number_text(sheet.height)}mm"'
    view = f'viewBox="0 0 {number_text(sheet.width)} {number_text(sheet.height)}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {view}>',
        f"<title>{escape(sheet.title, quote=False)}</title>",
        '<rect width="100%" height="100%" fill="white"/>',
        *(_draw(shape) for shape in sheet.shapes),
        "</svg>\n",
    ]
    return "\n".join(lines).encode()


def _draw(shape: Shape) -> str:
    match shape:
        case Rectangles():
            corners = ([number_text(at) for at in (box.left, box.top, box.right, box.bottom)] for box in shape.boxes)
            path = "".join(f"M{left} {top}H{right}V{bottom}H{left}Z" for left, top, right, bottom in corners)
            return f'<path d="{path}" fill="{shape.ink}"/>'
        case Disc():
            place = f'cx="{number_text(shape.x)}" cy="{number_text(shape.y)}" r="{number_text(shape.radius)}"'
            return f'<circle {place} fill="{shape.ink}"/>'
        case TextLine():
            place = f'x="{number_text(shape.x)}" y="{number_text(shape.y)}" font-size="{number_text(shape.size)}"'
            return f'<text {place} font-family="Helvetica, Arial, sans-serif">{escape(shape.text, quote=False)}</text>'
