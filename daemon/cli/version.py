"""`handeyed version` and `handeyed schema NAME`: what this release is made of, and the schemas of its files."""

import platform
from pathlib import Path
from typing import Annotated

import typer

from daemon.cli.output import Json, print_answer

NUMERICS = ("numpy", "scipy", "opencv-python-headless")
"""Libraries whose version can change numerical results."""


def version(json: Json = False) -> None:
    """Print the version, and those of the libraries that numerical results depend on."""
    from importlib import metadata

    versions = {name: metadata.version(name) for name in ("handeyed", *NUMERICS)}
    versions["python"] = platform.python_version()
    print_answer(json, versions, "\n".join(f"{name} {number}" for name, number in versions.items()))


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
