"""A camera's intrinsics as ROS, OpenCV, Kalibr, aslam, ViSP, METRIC, BOP and industrial_calibration write them.

All use OpenCV's matrix; their distortion is OpenCV's plumb bob or rational model, or its fisheye ("equidistant").
"""

import re
from collections import ChainMap
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from calibration.camera import COEFFICIENT_COUNTS, LensModel
from calibration.documents.imports.leaves import array_of, number_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sides import WORDS
from calibration.documents.imports.trees import read_json, read_xml_tree, read_yaml
from calibration.documents.session import CameraDocument
from calibration.documents.validation import validate_document

HEADING = "intrinsics"
FISHEYE = ("equidistant", "fisheye", "kannala_brandt", "kb4")
MODELS = ("pinhole", "plumb_bob", "rational_polynomial", "radtan", "radial-tangential", "brown_conrady", "none", "")
READ = (*MODELS, *FISHEYE)
Record = Mapping[str, Any]
Maps = tuple[tuple[dict[str, Any], ...], tuple[dict[str, Any], ...]]
Keys = tuple[tuple[str, ...], ...]  # ways to name numbers: one key of a list, or a key for each

MATRIX, FOUR, DISTORTION, SIZE = (
    tuple(tuple(keys.split()) for keys in WORDS["intrinsics"][what])
    for what in ("matrix", "four", "distortion", "size")
)


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
    suffix = PurePath(name).suffix.lower()
    if suffix == ".xml":
        return intrinsics_of(read_xml_tree(content, name, HEADING), name)
    return intrinsics_of((read_json if suffix == ".json" else read_yaml)(content, name), name)


def intrinsics_of(data: Any, origin: str) -> Intrinsics:
    """The intrinsics of the one camera in plain data, at its top or up to three levels below. Raises DocumentError."""
    every = ((_numbers(own, MATRIX, (9,)) or _numbers(own, FOUR, (4,)), said) for own, said in _mappings(data))
    found = [intrinsics_within(*said, matrix, origin) for matrix, said in every if matrix is not None]
    if len({(one.matrix, one.distortion, one.lens) for one in found}) == 1:
        return found[0]
    what = "several cameras" if found else "no intrinsics: neither a camera matrix nor fx, fy, cx, cy"
    raise refusal(origin, "document", what, "give camera_matrix and distortion_coefficients of one camera", HEADING)


def _mappings(data: Any, around: Maps = ((), ()), depth: int = 0) -> Iterator[tuple[Record, tuple[Record, Record]]]:
    """Each mapping, what is said of its lens, and all that is said in, beside and around it. Keys in lower case.

    Of the lens: it, those around it, and those in and beside it that are named after a camera, a lens or distortion.
    """
    if isinstance(data, Mapping) and depth <= MAX_DEPTH:
        own = {str(key).lower(): value for key, value in data.items()}
        inner = {key: one for key, one in own.items() if isinstance(one, Mapping)}
        said = {key: one for key, one in own.items() if key not in inner or OF_DISTORTION.match(key)}
        of_lens, every = (
            [{str(key).lower(): value for key, value in inner[name].items()} for name in names[:MAX_BESIDE]]
            for names in (list(filter(OF_LENS.search, inner)), list(inner))
        )
        yield own, (ChainMap(own, *of_lens, *around[0]), ChainMap(own, *every, *around[1]))
        for one in inner.values():
            yield from _mappings(one, ((said, *of_lens, *around[0]), (own, *every, *around[1])), depth + 1)


def _numbers(plain: Record, names: Keys, counts: Container[int], missing: float | None = None) -> list[float] | None:
    """The numbers of the first of the names that has as many; `missing` is for a key of several that is not there."""
    for keys in names:
        if keys[0] not in plain or (len(keys) > 1 and number_of(plain[keys[0]]) is None):
            continue
        value: Any = plain[keys[0]]
        while isinstance(value, Mapping):
            value = value.get("data", value.get("parameters"))
        if len(keys) > 1:
            value = [number_of(plain[key]) if key in plain else missing for key in keys]
        array = array_of(value.split() if isinstance(value, str) else value if isinstance(value, list) else [value])
        if array is not None and array.size in counts:
            return [float(number) for number in array.ravel()]
    return None


def intrinsics_within(of_lens: Record, plain: Record, matrix: list[float], origin: str) -> Intrinsics:
    """The camera of a matrix (four numbers or nine), with what is said of its lens. Raises DocumentError."""
    if len(matrix) == 4:
        fx, fy, cx, cy = matrix
        matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    rows = np.array(matrix).reshape(3, 3)
    if not (np.all(np.isfinite(rows)) and np.diag(rows)[:2].min() > MIN_FOCAL_PX and np.allclose(rows[2], [0, 0, 1])):
        raise refusal(origin, "camera matrix", "not one in px", "write fx, 0, cx / 0, fy, cy / 0, 0, 1", HEADING)
    nested = of_lens.get("distortion")
    inner = {str(key).lower(): one for key, one in nested.items()} if isinstance(nested, Mapping) else {}
    stated_model = str(of_lens.get("distortion_model") or inner.get("type", inner.get("model")) or "").lower()
    named = (of_lens.get(key) for key in ("camera_model", "model_type", *["lens"] * (not stated_model)))
    words = [stated_model, *(one.lower() for one in named if isinstance(one, str))]
    for one in (one for at, one in enumerate(words) if one not in READ and (at == 0 or OTHER_MODELS.search(one))):
        raise refusal(origin, "distortion model", f"{one!r} is not read", "calibrate as pinhole or fisheye", HEADING)
    model = next((one for one in words if one and one in READ), "")
    lens: LensModel = "fisheye" if model in FISHEYE or number_of(of_lens.get("fisheye_model")) else "pinhole"
    stated = _numbers(of_lens, DISTORTION, range(1, MAX_COEFFICIENTS), missing=0.0)
    unread = (
        key for key, one in of_lens.items() if OF_DISTORTION.match(key) and not (key == "kappa" and "phi" in of_lens)
        and (number_of(one) or (isinstance(one, list | Mapping) and one and not POINT.match(key)))
    )  # fmt: skip
    if stated is None and model != "none" and (name := next(unread, "")):
        raise refusal(origin, name, "distortion that is not read", "write distortion_coefficients", HEADING)
    distortion = stated or [0.0] * (4 if lens == "fisheye" else 5)
    if len(distortion) not in COEFFICIENT_COUNTS[lens]:  # without zeros at the end, filled to a number that it has
        kept = max((at for at, one in enumerate(distortion, 1) if one != 0), default=0)
        least = min((count for count in COEFFICIENT_COUNTS[lens] if count >= kept), default=len(distortion))
        if least >= kept and {kept, len(distortion)} != {3}:  # k1, k2, and p1 or k3
            distortion = (distortion[:kept] + [0.0] * least)[:least]
    sides = [int(side) for side in _numbers(plain, SIZE, (2,)) or () if 0 < side < MAX_SIDE_PX]
    size = (sides[0], sides[1]) if len(sides) == 2 else None
    return Intrinsics(tuple(map(tuple, rows.tolist())), tuple(distortion), lens, size, origin, stated is not None)


MAX_COEFFICIENTS, MAX_SIDE_PX, MIN_FOCAL_PX, MAX_DEPTH, MAX_BESIDE = 100, 1e6, 10, 3, 20
"""More numbers are no distortion, a longer side is no picture's; a shorter focal length is in mm or of the width."""

POINT = re.compile(r"p\d$")
OF_DISTORTION = re.compile(r"dist(?!ance)|radial|tangential|coeff|kappa|kc|d$|xi$|[kp]\d$")
OF_LENS = re.compile(r"cam|lens|intrin|^(dist(?!ance)|radial|tangential|coeff|d$)")
OTHER_MODELS = re.compile(
    r"fish|equi|omni(?!v)|kannala|kb\d|division|(?<!a)spher|\bds\b|ucm|\bocam\b(?!-)|scaramuzza|\bmei\b|^fov$|atan$|polynom|graphic$"
)
"""In the name of a camera or lens, those of models that are not read; other words are names of products."""
