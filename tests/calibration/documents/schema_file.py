"""Writes docs/*.schema.json: python -m tests.calibration.documents.schema_file"""

import json
from pathlib import Path
from typing import Any

from tests.calibration.documents.file_schemas import FILES, schema_of

DOCS = Path(__file__).parents[3] / "docs"
FILE = DOCS / "calibration.schema.json"


def calibration_schema() -> dict[str, Any]:
    """The JSON Schema of calibration.json as it is written: version 2."""
    return schema_of("calibration")


def main() -> None:
    for name in FILES:
        (DOCS / f"{name}.schema.json").write_text(json.dumps(schema_of(name), indent=1) + "\n")


if __name__ == "__main__":
    main()
