"""Writes docs/calibration.schema.json: python -m tests.calibration.documents.schema_file"""

import json
from pathlib import Path
from typing import Any

from calibration.documents.calibration import CalibrationDocument

FILE = Path(__file__).parents[3] / "docs" / "calibration.schema.json"


def calibration_schema() -> dict[str, Any]:
    """The JSON Schema of calibration.json as it is written: version 2."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **CalibrationDocument.model_json_schema(mode="serialization"),
    }


def main() -> None:
    FILE.write_text(json.dumps(calibration_schema(), indent=1) + "\n")


if __name__ == "__main__":
    main()
