"""A file with a camera's intrinsics, for `solve --camera`."""

import json
from pathlib import Path

from calibration.documents.session import CameraDocument
from calibration.documents.validation import validate_document
from calibration.errors import DocumentError
from daemon.runtime.bounded_read import read_document

OTHERS = frozenset((".yaml", ".yml", ".xml"))
"""Suffixes of files that other programs have written."""


def read_camera(file: Path) -> CameraDocument:
    """The camera in a JSON file: by itself, or under `camera` as in session.json and calibration.json.

    YAML and XML are read as ROS, OpenCV, Kalibr and ViSP write them.

    Raises DocumentError.
    """
    if file.suffix.lower() in OTHERS:
        from calibration.documents.imports.intrinsics import read_intrinsics  # with PyYAML

        return read_intrinsics(str(file), read_document(file)).document(None)
    try:
        data = json.loads(read_document(file))
    except (ValueError, RecursionError) as error:
        fix = "give matrix, distortion and image_size as JSON"
        raise DocumentError.one(str(file), "document", f"not JSON ({error})", fix) from None
    if isinstance(data, dict) and isinstance(data.get("camera"), dict):
        data = {key: value for key, value in data["camera"].items() if key != "source"}
    return validate_document(CameraDocument, data, str(file))
