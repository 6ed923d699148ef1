"""`handeyed schema NAME`: the JSON Schema of a file that goes in or comes out."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

_PLACES = (Path(__file__).parent / "schemas", Path(__file__).parents[2] / "docs")
"""Of the schemas that `tests.calibration.documents.schema_file` writes: when installed, in the repository."""


class SchemaName(StrEnum):
    """Files with a schema."""

    SESSION = "session"
    SCAN = "scan"
    PROFILES = "profiles"
    PLAN = "plan"
    PLANNED = "planned"
    POINTS = "points"
    TIP = "tip"
    TOUCHES = "touches"
    CALIBRATION = "calibration"
    ARM = "arm"
    RIG = "rig"
    REPORT = "report"
    MANIFEST = "manifest"
    OUTCOME = "outcome"
    ASSESSED = "assessed"
    COMPARISON = "comparison"
    TOUCH_TEST = "touch-test"
    STITCHING = "stitching"
    SCANNER = "scanner"
    DETECTIONS = "detections"
    ACCEPTANCE = "acceptance"
    SETUP = "setup"
    BACKUP = "backup"


def schema(name: Annotated[SchemaName, typer.Argument(metavar="|".join(SchemaName))]) -> None:
    """Print the JSON Schema of a file: session.json, scan.json, plan.json, ..., and what is written."""
    folder = next(place for place in _PLACES if place.is_dir())
    typer.echo((folder / f"{name.value}.schema.json").read_text(encoding="utf-8"), nl=False)
