"""`handeyed schema NAME`: the JSON Schema of a file that goes in or comes out."""

from pathlib import Path
from typing import Annotated

import typer

SUFFIX = ".schema.json"
FOLDER = next(
    place for place in (Path(__file__).parent / "schemas", Path(__file__).parents[2] / "docs") if place.is_dir()
)
"""Of the schemas that `tests.calibration.documents.schema_file` writes: when installed, in the repository."""


NAMES = sorted(path.name.removesuffix(SUFFIX) for path in FOLDER.glob(f"*{SUFFIX}"))


def schema(name: Annotated[str, typer.Argument(metavar="|".join(NAMES))]) -> None:
    """Print the JSON Schema of a file: session.json, scan.json, plan.json, ..., and what is written."""
    if name not in NAMES:
        raise typer.BadParameter(f"give one of {', '.join(NAMES)}")
    typer.echo((FOLDER / f"{name}{SUFFIX}").read_text(encoding="utf-8"), nl=False)
