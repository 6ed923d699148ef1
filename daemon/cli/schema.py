"""`handeyed schema NAME`: the JSON Schema of a file that goes in or comes out."""

import json
from enum import StrEnum
from typing import Annotated

import typer


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
    from daemon.cli.file_schemas.schemas import schema_of

    typer.echo(json.dumps(schema_of(name.value), indent=1))
