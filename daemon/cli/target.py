"""`handeyed target ...`: write a calibration target to print, true to size."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.output import CommandGroup, Json, writing

if TYPE_CHECKING:
    from calibration.documents.target import TargetDocument

app = typer.Typer(cls=CommandGroup, no_args_is_help=True, help="Write a target to print: PDF or SVG, true to size.")

Out = Annotated[Path, typer.Option("--out", "-o", help="File to write; .pdf or .svg.")]
PageOption = Annotated[str, typer.Option("--page", help="A4, A3, A2, A1, A0, letter, tabloid, or WIDTHxHEIGHT in mm.")]
Columns = Annotated[int, typer.Option(help="Along a row.")]
Rows = Annotated[int, typer.Option()]


@app.command()
def chessboard(
    columns: Annotated[int, typer.Option(help="Inner corners along a row.")] = 9,
    rows: Annotated[int, typer.Option(help="Inner corners down a column.")] = 6,
    pitch_mm: Annotated[float, typer.Option(help="A square's edge.")] = 20.0,
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """A chessboard, counted in inner corners."""
    _write({"kind": "chessboard", "columns": columns, "rows": rows, "pitch_mm": pitch_mm}, page, out, json)


@app.command()
def charuco(
    columns: Annotated[int, typer.Option(help="Squares along a row.")] = 7,
    rows: Annotated[int, typer.Option(help="Squares down a column.")] = 9,
    square_mm: Annotated[float, typer.Option(help="A square's edge.")] = 22.0,
    marker_mm: Annotated[float, typer.Option(help="A marker's edge with its black border.")] = 16.5,
    dictionary: Annotated[str, typer.Option(help="OpenCV's name.")] = "DICT_5X5_100",
    legacy: Annotated[bool, typer.Option("--legacy", help="The pattern of OpenCV before 4.6.")] = False,
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """A ChArUco board, counted in squares: may be partly visible; its orientation is unambiguous."""
    board = {"columns": columns, "rows": rows, "square_mm": square_mm, "marker_mm": marker_mm}
    _write({"kind": "charuco", **board, "dictionary": dictionary, "legacy": legacy}, page, out, json)


@app.command()
def circles(
    layout: Annotated[str, typer.Option(help="symmetric or asymmetric.")] = "symmetric",
    columns: Columns = 9,
    rows: Rows = 11,
    pitch_mm: Annotated[float, typer.Option(help="Centre to centre in a row.")] = 18.0,
    dots: Annotated[str, typer.Option(help="black or white.")] = "black",
    large_origin: Annotated[
        bool, typer.Option(help="The first dot larger than the rest: it marks the orientation.")
    ] = True,
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """A grid of dots."""
    grid = {"layout": layout, "columns": columns, "rows": rows, "pitch_mm": pitch_mm, "dots": dots}
    _write({"kind": "circles", **grid, "origin": "large-dot" if large_origin else None}, page, out, json)


@app.command()
def apriltag_grid(
    columns: Columns = 5,
    rows: Rows = 7,
    tag_mm: Annotated[float, typer.Option(help="A tag's edge with its black border.")] = 24.0,
    gap_mm: Annotated[float, typer.Option(help="White between two tags.")] = 8.0,
    family: Annotated[str, typer.Option(help="tag36h11, tag36h10, tag25h9 or tag16h5.")] = "tag36h11",
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """A grid of AprilTags: may be partly visible."""
    grid = {"columns": columns, "rows": rows, "tag_mm": tag_mm, "gap_mm": gap_mm, "family": family}
    _write({"kind": "apriltag-grid", **grid}, page, out, json)


@app.command()
def aruco_grid(
    columns: Columns = 5,
    rows: Rows = 7,
    marker_mm: Annotated[float, typer.Option(help="A marker's edge with its black border.")] = 24.0,
    gap_mm: Annotated[float, typer.Option(help="White between two markers.")] = 8.0,
    dictionary: Annotated[str, typer.Option(help="OpenCV's name.")] = "DICT_5X5_100",
    first_id: Annotated[int, typer.Option(help="Number of the first marker.")] = 0,
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """An ArUco board (OpenCV's GridBoard): may be partly visible."""
    grid = {"columns": columns, "rows": rows, "marker_mm": marker_mm, "gap_mm": gap_mm}
    _write({"kind": "aruco-grid", **grid, "dictionary": dictionary, "first_id": first_id}, page, out, json)


@app.command()
def aruco_marker(
    marker_mm: Annotated[float, typer.Option(help="The marker's edge with its black border.")] = 90.0,
    dictionary: Annotated[str, typer.Option(help="OpenCV's name.")] = "DICT_5X5_100",
    marker_id: Annotated[int, typer.Option("--id", help="Number of the marker.")] = 0,
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """One ArUco marker: four points; a board is far more accurate."""
    marker = {"marker_mm": marker_mm, "dictionary": dictionary, "id": marker_id}
    _write({"kind": "aruco-marker", **marker}, page, out, json)


@app.command("from")
def from_file(
    file: Annotated[Path, typer.Argument(help="A session.json, plan.json or handeyed.toml that names a target.")],
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    json: Json = False,
) -> None:
    """The target that a file names."""
    import tomllib
    from json import loads

    from calibration.errors import DocumentError, DocumentProblem
    from daemon.runtime.bounded_read import read_document

    content = read_document(file)
    try:
        data = tomllib.loads(content.decode()) if file.suffix == ".toml" else loads(content)
        target = data["target"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        problem = DocumentProblem("target", f"not found ({error!s})", "give a file with a target in it")
        raise DocumentError(str(file), [problem]) from None
    _write(target, page, out, json, origin=str(file))


def _write(data: Any, page: str, out: Path, json: bool, origin: str = "target") -> None:
    from calibration.documents.target import TargetFile
    from calibration.documents.validation import validate_document
    from daemon.tools.target_print.layout import lay_out, parse_page
    from daemon.tools.target_print.pdf import pdf
    from daemon.tools.target_print.svg import svg

    document = validate_document(TargetFile, {"target": data}, origin).target
    writers = {".pdf": pdf, ".svg": svg}
    if out.suffix.lower() not in writers:
        raise CommandError(str(out), "neither .pdf nor .svg", "choose one of them", ExitStatus.UNREADABLE)
    snippet, title = document.model_dump_json(), f"handeyed target: {document.kind}"
    sheet = lay_out(document.target(), parse_page(page), title, snippet)
    with writing(out):
        out.write_bytes(writers[out.suffix.lower()](sheet, title))
    if json:
        from json import dumps

        page_mm, origin_mm = [sheet.width, sheet.height], list(sheet.target_origin)
        typer.echo(dumps({"file": str(out), "page_mm": page_mm, "target_origin_mm": origin_mm, "target": data}))
    else:
        typer.echo(_summary(out, f"{sheet.width:g} x {sheet.height:g} mm", document))


def _summary(out: Path, size: str, target: "TargetDocument") -> str:
    from daemon.config.toml_text import toml_text
    from daemon.tools.target_print.layout import PRINT_NOTE

    note = _ambiguity_note(target)
    return "\n".join(
        [
            f"{out}: {size}. {PRINT_NOTE}",
            *([f"! {note}"] if note else []),
            f"\nIn handeyed.toml:\n\n{toml_text({'target': target.model_dump(exclude_none=True)}).rstrip()}",
            f'\nIn session.json and plan.json:\n\n"target": {target.model_dump_json()}',
        ]
    )


def _ambiguity_note(target: "TargetDocument") -> str | None:
    """A warning when the target looks the same rotated by 180 degrees; else None."""
    from calibration.targets import orientation_advice

    if (advice := orientation_advice(target.target())) is None:
        return None
    return f"This target looks the same turned by 180 deg, so a turned picture cannot be recognised: {advice}."
