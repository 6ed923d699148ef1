"""`handeyed target ...`: write a calibration target to print, true to size."""

import json
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import CommandGroup, Json, print_answer, write_whole

if TYPE_CHECKING:
    from calibration.targets import PrintedTarget

app = typer.Typer(
    cls=CommandGroup, name="target", no_args_is_help=True, help="Write a target to print: PDF or SVG, true to size."
)

Out = Annotated[Path, typer.Option("--out", "-o", help="File to write; .pdf or .svg.")]
PageOption = Annotated[str, typer.Option("--page", help="A4, A3, A2, A1, A0, letter, tabloid, or WIDTHxHEIGHT in mm.")]
KINDS: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
"""By kind of target: what is said of it, and its settings, each as [usual value, help]."""

FLAGS = {"legacy": ("--legacy",)}
"""Settings that are an option without its opposite."""


def _command(kind: str, about: str, settings: dict[str, tuple[Any, str]]) -> None:
    """Add the command that writes targets of this kind; an option for each of its settings."""

    def write(page: str, out: Path, as_json: bool, **values: Any) -> None:
        if values.pop("large_origin", False):
            values["origin"] = "large-dot"
        _write({"kind": kind, **values}, page, out, as_json)

    options: dict[str, tuple[Any, Any]] = {
        name: (Annotated[type(usual), typer.Option(*FLAGS.get(name, ()), help=what)], usual)
        for name, (usual, what) in settings.items()
    }
    options |= {"page": (PageOption, "A4"), "out": (Out, Path("target.pdf")), "as_json": (Json, False)}
    write.__annotations__ = {name: form for name, (form, _) in options.items()}
    write.__signature__ = Signature(  # type: ignore[attr-defined] # Typer reads it
        [
            Parameter(name, Parameter.KEYWORD_ONLY, default=usual, annotation=form)
            for name, (form, usual) in options.items()
        ]
    )
    app.command(kind, help=about)(write)


for each_kind, row in KINDS.items():
    _command(each_kind, row["about"], row["settings"])


@app.command("from")
def from_file(
    file: Annotated[Path, typer.Argument(help="A session.json, plan.json or handeyed.toml that names a target.")],
    page: PageOption = "A4",
    out: Out = Path("target.pdf"),
    as_json: Json = False,
) -> None:
    """The target that a file names."""
    import tomllib

    from calibration.errors import DocumentError
    from daemon.runtime.bounded_read import read_document

    content = read_document(file)
    try:
        data = tomllib.loads(content.decode()) if file.suffix == ".toml" else json.loads(content)
        target = data["target"]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        fix = "give a file with a target in it"
        raise DocumentError.one(str(file), "target", f"not found ({error!s})", fix) from None
    _write(target, page, out, as_json, origin=str(file))


def _write(data: Any, page: str, out: Path, as_json: bool, origin: str = "target") -> None:
    from calibration.documents.target import TargetFile
    from calibration.documents.validation import validate_document
    from daemon.tools.target_print.layout import lay_out
    from daemon.tools.target_print.pdf import pdf, svg

    document = validate_document(TargetFile, {"target": data}, origin).target
    writers = {".pdf": pdf, ".svg": svg}
    if out.suffix.lower() not in writers:
        raise UnreadableInput(str(out), "neither .pdf nor .svg", "choose one of them")
    sheet = lay_out(document, page)
    write_whole(out, writers[out.suffix.lower()](sheet))
    page_mm, origin_mm = [sheet.width, sheet.height], list(sheet.target_origin)
    printed = {"file": str(out), "page_mm": page_mm, "target_origin_mm": origin_mm, "target": data}
    print_answer(as_json, printed, _summary(out, f"{sheet.width:g} x {sheet.height:g} mm", document))


def _summary(out: Path, size: str, target: "PrintedTarget") -> str:
    from calibration.documents.target import described, json_of_target
    from calibration.targets import orientation_advice
    from daemon.config.toml_text import toml_text
    from daemon.tools.target_print.layout import PRINT_NOTE

    advice = orientation_advice(target)
    turned = f"! This target looks the same turned by 180 deg, so a turned picture cannot be recognised: {advice}."
    return "\n".join(
        [
            f"{out}: {size}. {PRINT_NOTE}",
            *([] if advice is None else [turned]),
            f"\nIn handeyed.toml:\n\n{toml_text({'target': described(target)}).rstrip()}",
            f'\nIn session.json and plan.json:\n\n"target": {json_of_target(target)}',
        ]
    )
