"""Write a sheet as a one-page PDF (ISO 32000-1), whose transform converts mm to points, or as SVG 1.1, in mm."""

from html import escape

from daemon.tools.target_print.shapes import Disc, Rectangles, Shape, Sheet, TextLine, number_text

POINTS_PER_MM = 72 / 25.4
CIRCLE_CONTROL_RATIO = 0.5522847498307936
"""Distance of the control points of a cubic quarter circle from its ends, relative to the radius: 4/3 (sqrt 2 - 1)."""

GREY = {"black": "0", "white": "1"}


def pdf(sheet: Sheet) -> bytes:
    """The bytes of the PDF, with PrintScaling None so that readers do not scale the page."""
    width, height = (number_text(side * POINTS_PER_MM) for side in (sheet.width, sheet.height))
    scale = f"{POINTS_PER_MM:.12f}"
    content = "\n".join(
        [f"{scale} 0 0 -{scale} 0 {sheet.height * POINTS_PER_MM:.9f} cm", *(_draw(shape) for shape in sheet.shapes)]
    ).encode("cp1252", "replace")
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R"
        " /Resources << /Font << /F 5 0 R >> >> >>".encode(),
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
        b"<< /Title (%s) /Producer (handeyed) >>" % _text(sheet.title).encode("cp1252", "replace"),
    ]
    out = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")
    offsets = []
    for number, body in enumerate(objects, start=1):
        offsets.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, body)
    table = len(out)
    out += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    out += b"".join(b"%010d 00000 n \n" % offset for offset in offsets)
    out += b"trailer\n<< /Size %d /Root 1 0 R /Info 6 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, table)
    return bytes(out)


def _draw(shape: Shape) -> str:
    match shape:
        case Rectangles():
            boxes = (_numbers(box.left, box.top, box.width, box.height) + " re" for box in shape.boxes)
            return "\n".join([f"{GREY[shape.ink]} g", *boxes, "f"])
        case Disc():
            x, y, r, arm = shape.x, shape.y, shape.radius, shape.radius * CIRCLE_CONTROL_RATIO
            curves = (
                (x + r, y + arm, x + arm, y + r, x, y + r),
                (x - arm, y + r, x - r, y + arm, x - r, y),
                (x - r, y - arm, x - arm, y - r, x, y - r),
                (x + arm, y - r, x + r, y - arm, x + r, y),
            )
            path = (_numbers(*curve) + " c" for curve in curves)
            return "\n".join([f"{GREY[shape.ink]} g", _numbers(x + r, y) + " m", *path, "h f"])
        case TextLine():
            place, size = _numbers(shape.x, shape.y), number_text(shape.size)
            return f"0 g BT /F {size} Tf 1 0 0 -1 {place} Tm ({_text(shape.text)}) Tj ET"


def _text(text: str) -> str:
    return text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")


def _numbers(*values: float) -> str:
    return " ".join(number_text(value) for value in values)


def svg(sheet: Sheet) -> bytes:
    size = f'width="{number_text(sheet.width)}mm" height="{number_text(sheet.height)}mm"'
    view = f'viewBox="0 0 {number_text(sheet.width)} {number_text(sheet.height)}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {view}>',
        f"<title>{escape(sheet.title, quote=False)}</title>",
        '<rect width="100%" height="100%" fill="white"/>',
        *(_element(shape) for shape in sheet.shapes),
        "</svg>\n",
    ]
    return "\n".join(lines).encode()


def _element(shape: Shape) -> str:
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
