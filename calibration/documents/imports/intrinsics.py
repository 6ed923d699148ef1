"""A camera's intrinsics as ROS, OpenCV, Kalibr, aslam, ViSP, METRIC, BOP and industrial_calibration write them.

All use OpenCV's matrix; their distortion is OpenCV's plumb bob or rational model, or its fisheye ("equidistant").
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from calibration.camera import COEFFICIENT_COUNTS, LensModel
from calibration.documents.imports.leaves import array_of, number_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.trees import read_json, read_xml_tree, read_yaml
from calibration.documents.session import CameraDocument
from calibration.documents.validation import validate_document

HEADING = "intrinsics"
FISHEYE = ("equidistant", "fisheye", "kannala_brandt", "kb4")
MODELS = ("pinhole", "plumb_bob", "rational_polynomial", "radtan", "radial-tangential", "brown_conrady", "none", "")
MATRIX_KEYS = ("camera_matrix", "cameramatrix", "matrix", "k", "cam_k", "intrinsic_matrix", "intrinsic", "mtx")
DISTORTION_KEYS = (
    "distortion_coefficients", "distortioncoefficients", "distcoeffs", "dist_coeffs", "distortion_coeffs", "distortion",
    "dist_coeff", "d", "dist",
)  # fmt: skip
SIZE_KEYS = (
    ("image_width", "image_height"), ("img_width", "img_height"), ("width", "height"), ("imagewidth", "imageheight"),
)  # fmt: skip


@dataclass(frozen=True)
class Intrinsics:
    """Matrix (3 x 3 rows), OpenCV's coefficients, the lens, and the image's size where the file holds it.

    `has_distortion`: whether the file states the lens' distortion, if only that there is none.
    """

    matrix: tuple[tuple[float, ...], ...]
    distortion: tuple[float, ...]
    lens: LensModel
    image_size: tuple[int, int] | None
    origin: str
    has_distortion: bool = True

    def document(self, image_size: tuple[int, int] | None) -> CameraDocument:
        """The document; `image_size` is used where the file has none. Raises DocumentError."""
        size = self.image_size or image_size
        if size is None:
            raise refusal(self.origin, "image_size", "missing, and no image shows it", "add width and height", HEADING)
        data = {"matrix": self.matrix, "distortion": list(self.distortion), "image_size": size, "lens": self.lens}
        return validate_document(CameraDocument, data, self.origin)


def read_intrinsics(name: str, content: bytes) -> Intrinsics:
    """The intrinsics in a file: JSON, YAML or XML. Raises DocumentError."""
    match PurePath(name).suffix.lower():
        case ".json":
            data = read_json(content, name)
        case ".xml":
            data = read_xml_tree(content, name, HEADING)
        case _:
            data = read_yaml(content, name)
    return intrinsics_of(data, name)


def intrinsics_of(data: Any, origin: str) -> Intrinsics:
    """The intrinsics in plain data, at its top or one or two levels below. Raises DocumentError."""
    for record in _mappings(data):
        plain = {str(key).lower(): value for key, value in record.items()}
        if (matrix := _matrix(plain)) is not None:
            return _intrinsics(plain, matrix, origin)
    what = "no intrinsics: neither a camera matrix nor fx, fy, cx, cy"
    raise refusal(origin, "document", what, "give camera_matrix and distortion_coefficients", HEADING)


def _mappings(data: Any, depth: int = 0) -> Iterator[Mapping[Any, Any]]:
    if isinstance(data, Mapping):
        yield data
        if depth < 3:
            for value in data.values():
                yield from _mappings(value, depth + 1)


def _list(value: Any) -> list[float] | None:
    """The numbers of a list, of nested lists, or of a mapping {rows, cols, data}."""
    if isinstance(value, Mapping):
        value = value.get("data", value.get("parameters"))
        return _list(value)
    if isinstance(value, str):
        value = value.split()
    array = array_of(value)
    return None if array is None else [float(number) for number in array.ravel()]


def _matrix(plain: Mapping[str, Any]) -> list[float] | None:
    """The nine numbers of the camera matrix, row by row."""
    for key in MATRIX_KEYS:
        numbers = _list(plain.get(key)) if key in plain else None
        if numbers is not None and len(numbers) == 9:
            return numbers
    for keys in (("fx", "fy", "cx", "cy"), ("px", "py", "u0", "v0")):
        given = [number_of(plain.get(key)) for key in keys]
        if all(number is not None for number in given):
            fx, fy, cx, cy = (float(number or 0.0) for number in given)
            return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    listed = _list(plain.get("intrinsics")) if "intrinsics" in plain else None
    if listed is not None and len(listed) == 4:
        fx, fy, cx, cy = listed
        return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    return None


def _intrinsics(plain: Mapping[str, Any], matrix: list[float], origin: str) -> Intrinsics:
    rows = np.array(matrix).reshape(3, 3)
    if not (np.all(np.isfinite(rows)) and rows[0, 0] > 0 and rows[1, 1] > 0 and np.allclose(rows[2], [0, 0, 1])):
        fix = "write fx, 0, cx / 0, fy, cy / 0, 0, 1"
        raise refusal(origin, "camera matrix", "not one of a camera", fix, HEADING)
    model = _model(plain)
    if model not in (*MODELS, *FISHEYE):
        raise refusal(origin, "distortion model", f"{model!r} is not read", "calibrate as pinhole or fisheye", HEADING)
    lens: LensModel = "fisheye" if model in FISHEYE or number_of(plain.get("fisheye_model")) else "pinhole"
    stated = _distortion(plain)
    distortion = stated or [0.0] * (4 if lens == "fisheye" else 5)
    distortion = distortion if len(distortion) in COEFFICIENT_COUNTS[lens] else _shorten(distortion, lens)
    matrix_rows = tuple(tuple(float(number) for number in row) for row in rows)
    return Intrinsics(matrix_rows, tuple(distortion), lens, _size(plain), origin, stated is not None)


def _model(plain: Mapping[str, Any]) -> str:
    nested = plain.get("distortion")
    kind = nested.get("type", "") if isinstance(nested, Mapping) else ""
    camera = str(plain.get("camera_model", "pinhole")).lower()
    if camera not in ("pinhole", "fisheye", "equidistant"):
        return camera
    given = plain.get("distortion_model") or plain.get("lens") or kind or ""
    return str(given).lower()


def _distortion(plain: Mapping[str, Any]) -> list[float] | None:
    for key in DISTORTION_KEYS:
        value = plain.get(key)
        if isinstance(value, Mapping) and isinstance(value.get("parameters"), Mapping | list):
            value = value["parameters"]
        if value is not None and (numbers := _list(value)) is not None:
            return numbers
    for names in (
        ("dist_k0", "dist_k1", "dist_px", "dist_py", "dist_k2", "dist_k3", "dist_k4", "dist_k5"),
        ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    ):
        if names[0] in plain:
            return [number_of(plain.get(name)) or 0.0 for name in names]
    kud = number_of(plain.get("kud"))
    return None if kud is None else [kud, 0.0, 0.0, 0.0, 0.0]


def _shorten(distortion: list[float], lens: LensModel) -> list[float]:
    """The coefficients without zeros at the end, filled to a number that the lens has."""
    kept = len(distortion)
    while kept and distortion[kept - 1] == 0:
        kept -= 1
    fitting = [count for count in COEFFICIENT_COUNTS[lens] if count >= kept]
    return (distortion[:kept] + [0.0] * min(fitting))[: min(fitting)] if fitting else distortion


def _size(plain: Mapping[str, Any]) -> tuple[int, int] | None:
    pairs = [(plain.get(width), plain.get(height)) for width, height in SIZE_KEYS]
    for key in ("resolution", "image_size", "imagesize"):
        listed = _list(plain.get(key)) if key in plain else None
        if listed is not None and len(listed) == 2:
            pairs.append((listed[0], listed[1]))
    for pair in pairs:
        width, height = (number_of(side) for side in pair)
        if width and height and 0 < width < 1e6 and 0 < height < 1e6:
            return int(width), int(height)
    return None
