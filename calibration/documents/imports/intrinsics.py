"""A camera's intrinsics as the programs of a table, `cameras` in words.json, write them; a file may mix their names.

All use OpenCV's matrix; their distortion is OpenCV's plumb bob or rational model, or its fisheye ("equidistant"). One
rule holds for what is unknown (`unknown_in`): what holds distortion and is not understood is refused by its name; a
description without distortion is read as such. Keys are compared without signs and capitals (`_by_spelling`).
"""

import re
from collections import ChainMap
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np

from calibration.camera import COEFFICIENT_COUNTS, LensModel
from calibration.documents.imports.leaves import array_of, number_of
from calibration.documents.imports.pose_files import load_npy, load_npz
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sides import WORDS
from calibration.documents.imports.trees import read_json, read_xml_tree, read_yaml
from calibration.documents.session import CameraDocument
from calibration.documents.validation import validate_document
from calibration.transforms import Array

HEADING = "intrinsics"
Record = Mapping[str, Any]
Blocks = Sequence[tuple[str, dict[str, Any]]]  # mappings by their names, the nearest to a matrix first
Camera = tuple[list[float], Blocks]  # a matrix, nine numbers or four, whose mapping is the first
Keys = tuple[str, ...]  # a way to name numbers: the key of a list, or a key for each in order

MATRIX, FOUR, LISTS, TERMS, TERMS_OF_FISHEYE, SIZE, MODELS, DISTORTION_MODELS = (
    [tuple(way.split()) for row in WORDS["cameras"] for way in row.get(column, "").split(",") if way]
    for column in ("matrix", "four", "distortion", "terms", "terms_of_fisheye", "size", "model", "distortion_model")
)
LISTS += [(before + key,) for before in WORDS["before_distortion"].split() for (key,) in LISTS] + [("k",)]
DISTORTION: dict[LensModel, list[Keys]] = {"pinhole": LISTS + TERMS, "fisheye": LISTS + TERMS_OF_FISHEYE}
PINHOLES, FISHEYES, FLAGS, REALSENSE = (words.split() for words in WORDS["lens_models"].values())
(OF_LENS, OF_FISHEYE, OF_DISTORTION, FURTHER, OF_OTHERS, UNREAD_MODELS, OF_ZEROS, SIGNS, MODEL_SIGNS, NO_NUMBERS,
 DECIMALS) = (re.compile("|".join(words.split())) for words in WORDS["camera_patterns"].values())  # fmt: skip
"""In names: of blocks about the lens, of a fisheye's; of distortion, of what of it coefficients beside it do not hold;
of other rows; of models that are not read, of those that are a pinhole's if all are 0; what no spelling counts."""

SET, UNSET = ("1", "1.0", "true", "yes"), ("0", "0.0", "false", "no")  # flags as text in small letters
COUNTS = frozenset(range(1, 100)) - {9}  # of a distortion; nine are a matrix
MAX_SIDE_PX, MIN_FOCAL_PX, MAX_DEPTH, MAX_BESIDE = 1e6, 10, 3, 20
"""A longer side is no picture's; a shorter focal length is in mm or of the width."""


@dataclass(frozen=True)
class Intrinsics:
    """Matrix (3 x 3 rows), OpenCV's coefficients, the lens, the image's size where the file holds it, and whether it
    states the lens' distortion, if only that there is none."""

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
    """The intrinsics in a file: JSON, YAML, XML, numbers as text, .npy or .npz. Raises DocumentError."""
    suffix = PurePath(name).suffix.lower()
    if suffix in (".npy", ".npz"):
        arrays = load_npz(content, name) if suffix == ".npz" else {"k": load_npy(content, name)}
        return intrinsics_of({key: one.tolist() for key, one in arrays.items() if one.size <= max(COUNTS)}, name)
    if suffix in (".dat", ".cal") or b"ParGroup" in content[:1000]:
        what = "camera parameters of HALCON, whose distortion is of another kind than OpenCV's"
        raise refusal(name, "document", what, "leave them out: they are then estimated from the pictures", HEADING)
    if suffix == ".xml":
        return intrinsics_of(read_xml_tree(content, name, HEADING), name)
    return intrinsics_of((read_json if suffix == ".json" else read_yaml)(content, name), name)


def intrinsics_of(data: Any, origin: str) -> Intrinsics:
    """The intrinsics of the one camera in plain data, at its top or up to three levels below. Raises DocumentError."""
    cameras = [*cameras_in(_by_spelling(data if isinstance(data, Mapping) else {"k": data}))]  # np.savetxt's matrix
    found = [camera_of(*camera, origin) for camera in cameras]
    is_one = len({(one.matrix, one.distortion, one.lens) for one in found}) == 1
    if is_one and not any("camera2fx" in blocks[0][1] for _, blocks in cameras):
        return found[0]
    what = "several cameras" if found else "no intrinsics: neither a camera matrix nor fx, fy, cx, cy"
    raise refusal(origin, "document", what, "give camera_matrix and distortion_coefficients of one camera", HEADING)


def cameras_in(own: dict[str, Any], name: str = "camera", around: Blocks = (), depth: int = 0) -> Iterator[Camera]:
    """Each matrix with its mapping, those in it, and those around it and beside these; no fisheye that is disabled."""
    inner = {key: _by_spelling(one) for key, one in own.items() if isinstance(one, Mapping)}
    for key in filter(OF_FISHEYE.match, [*inner]):
        if str(inner[key].get("enabled")).lower() in UNSET:
            del inner[key]
    around = [*sorted(inner.items(), key=lambda one: not OF_LENS.search(one[0]))[:MAX_BESIDE], *around]
    if matrix := _numbers(own, MATRIX, (9,)) or _numbers(own, FOUR, (4,)):
        yield matrix, [(name, own), *around]
    said = {key: one for key, one in own.items() if key not in inner or OF_DISTORTION.search(key)}
    for key, one in inner.items() if depth < MAX_DEPTH else ():
        yield from cameras_in(one, "fisheye" if OF_FISHEYE.match(key) else name, [(name, said), *around], depth + 1)


def said_of_lens(blocks: Blocks) -> Record:
    """What the blocks say of the lens: those around the matrix, and those named after a camera, a lens or distortion.
    A fisheye's counts first if it is enabled; else for the matrix in it, or where no other has coefficients."""
    of_lens = [(OF_FISHEYE.match(name) is not None, one) for name, one in blocks if OF_LENS.search(name)]
    of_fisheye, others = ([one for is_fisheye, one in of_lens if is_fisheye is each] for each in (True, False))
    enabled = [one for one in of_fisheye if str(one.get("enabled")).lower() in SET]
    is_within = bool(enabled) or blocks[0][0] == "fisheye"
    if not is_within and any(_numbers(one, DISTORTION["fisheye"], COUNTS, 0.0) for one in others):
        return ChainMap(*others)
    is_fisheye = is_within or any(OF_DISTORTION.search(key) for one in of_fisheye for key in one)
    return ChainMap(*[{"infisheye": True}] * is_fisheye, *enabled, *(one for _, one in of_lens))


def camera_of(matrix: list[float], blocks: Blocks, origin: str) -> Intrinsics:
    """The camera of a matrix with what the blocks say of its lens and its pictures. Raises DocumentError."""
    fx, fy, cx, cy = matrix if len(matrix) == 4 else (matrix[at] for at in (0, 4, 2, 5))
    rows = np.array(matrix if len(matrix) == 9 else [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]).reshape(3, 3)
    if not (np.all(np.isfinite(rows)) and min(fx, fy) > MIN_FOCAL_PX and np.allclose(rows[2], [0, 0, 1])):
        raise refusal(origin, "camera matrix", "not one in px", "write fx, 0, cx / 0, fy, cy / 0, 0, 1", HEADING)
    of_lens = said_of_lens(blocks)
    lens = lens_of(of_lens)[0] or "pinhole"
    stated = _numbers(of_lens, DISTORTION[lens], COUNTS, missing=0.0)
    for place, what, fix in unknown_in(of_lens, stated, [fx, fy, cx, cy]):
        raise refusal(origin, place, what, fix, HEADING)
    distortion, counts = stated or [0.0] * (4 if lens == "fisheye" else 5), COEFFICIENT_COUNTS[lens]
    kept = max((at for at, one in enumerate(distortion, 1) if one != 0), default=0)
    least = min((count for count in counts if count >= kept), default=len(distortion))
    if len(distortion) not in counts and {kept, len(distortion)} != {3}:  # k1, k2, and p1 or k3
        distortion = (distortion[:kept] + [0.0] * least)[:least]  # filled with zeros to a number that a lens has
    every = ChainMap(*(one for _, one in blocks))
    sides = [int(side) for side in _numbers(every, SIZE, (2,)) or () if 0 < side < MAX_SIDE_PX]
    size = (sides[0], sides[1]) if len(sides) == 2 else None
    return Intrinsics(tuple(map(tuple, rows.tolist())), tuple(distortion), lens, size, origin, stated is not None)


def lens_of(of_lens: Record) -> tuple[LensModel | None, list[str]]:
    """The lens, None where no name or flag says it, and the models that are not read. That of the distortion decides
    before one of the camera, which may be a product's name."""
    nested = _by_spelling(of_lens["distortion"]) if isinstance(of_lens.get("distortion"), Mapping) else {}
    exact = of_lens.get("distortionmodel") or nested.get("type") or nested.get("model")
    first = [one for one in (exact, *(of_lens.get(key) for (key,) in DISTORTION_MODELS)) if one][:1]
    every = [*first, *(of_lens.get(key) for (key,) in MODELS), None if first else of_lens.get("lens")]
    by_number: dict[float | None, str] = dict(enumerate(REALSENSE)) if "ppx" in of_lens else {}
    said = [by_number.get(number_of(one), str(one).lower()) for one in every if one]
    words = {one: MODEL_SIGNS.sub("", one) for one in said}
    known = [word for word in words.values() if word in PINHOLES + FISHEYES]
    others = [one for one, word in words.items() if word and word not in known]
    unread = [one for one in others if (exact and one == said[0]) or UNREAD_MODELS.search(one)]
    is_flagged = any(str(of_lens.get(key)).lower() in SET for key in FLAGS)
    is_fisheye = is_flagged or any(word in FISHEYES for word in (known[:1] if first else known))
    return "fisheye" if is_fisheye else "pinhole" if known else None, unread


def unknown_in(of_lens: Record, stated: list[float] | None, four: list[float]) -> Iterator[tuple[str, str, str]]:
    """What holds distortion and is not understood, with what it is and what to do: models; k1 to k4 without a model;
    what is named after distortion and is not among the coefficients, or differs from them; and without coefficients a
    row of decimals as long as OpenCV's that is not named after something else."""
    lens, models = lens_of(of_lens)
    if stated is not None and not any(stated):
        models = [one for one in models if not OF_ZEROS.search(one)]
    fix = "calibrate as pinhole or fisheye, or have the camera estimated"
    yield from (("distortion model", f"{model!r} is not read", fix) for model in models)
    if lens is None and number_of(of_lens.get("k4")) and of_lens.keys().isdisjoint(("p1", "p2", "k5", "k6")):
        what = "k1 to k4 are a fisheye's, or with p1 and p2 a pinhole camera's"
        yield "distortion model", what, "add camera_model: fisheye or pinhole"
    of_k, p1_p2 = _numbers(of_lens, [("k",)], COUNTS), _numbers(of_lens, [("p",), ("p1", "p2")], (2,), missing=0.0)
    if p1_p2 and any(p1_p2) and "k1" not in of_lens and (of_k or 0 < len(stated or ()) <= 3):
        yield "p1 and p2", "beside coefficients that do not hold them", "write distortion_coefficients"
    is_matrix = number_of(of_lens.get("k")) is not None or _numbers(of_lens, [("k",)], (9,)) is not None
    has_place = "t3" in of_lens or (stated is not None and "k1" not in of_lens)
    elsewhere = {"k": is_matrix, "kappa": "phi" in of_lens, "s1": has_place, "t1": has_place, "t2": has_place}
    for key, one in of_lens.items():
        is_point = key[:-1] in ("p", "s", "t") and isinstance(one, list | Mapping)
        is_named = (FURTHER if stated else OF_DISTORTION).search(key) and not (elsewhere.get(key) or is_point)
        if is_named and ((_rank(one) and number_of(one) != 0) or DECIMALS.search(str(one))):
            yield key, "distortion that is not read", "write distortion_coefficients"
    for key, one in of_lens.items() if stated is None else ():
        row = _array(one) if not (isinstance(one, str) or OF_OTHERS.search(key)) else None
        counted = row is not None and row.size == max(row.shape) in COEFFICIENT_COUNTS["pinhole"] and np.any(row % 1)
        if counted and _flat(one) != _flat(four):
            yield key, "distortion that is not read", "write distortion_coefficients"
    for keys in DISTORTION[lens or "pinhole"] if stated else ():
        if (other := _numbers(of_lens, [keys], COUNTS, missing=0.0)) and _flat(other) != _flat(stated):
            yield keys[0], "other coefficients than by another name", "keep those of the camera"


def _by_spelling(record: Record) -> dict[str, Any]:
    """Values by keys of small letters and digits only; without ORB-SLAM's `Camera.`; k beside K is the distortion. Of
    keys that are then alike the highest `_rank` counts; two of numbers that differ are in a mapping."""
    plain: dict[str, Any] = {}
    for key, one in record.items():
        name = "kc" if key == "k" and "K" in record else SIGNS.sub("", str(key).lower())
        kept = plain.get(name)
        if _rank(one) == _rank(kept) > 0 and _flat(kept) != _flat(one):
            plain[name] = {"one": kept, "other": one}
        elif kept is None or _rank(one) > _rank(kept):
            plain[name] = one
    return plain


def _rank(value: Any) -> int:
    """2 for a list, a mapping or a text of several numbers, 1 for one number, 0 for other texts, bools and nothing."""
    is_list = bool(value) if isinstance(value, list | Mapping) else _array(value) is not None
    return 1 if number_of(value) is not None else 2 * is_list


def _flat(value: Any) -> Any:
    """The numbers of a value to the sixth place, without zeros at the end, to be compared; else the value."""
    array = _array(value)
    return value if array is None else np.trim_zeros(np.round(array.ravel(), 6), "b").tolist()


def _array(value: Any) -> Array | None:
    """The numbers of a list, of OpenCV's mapping of one, or of a text with any brackets and separators."""
    while isinstance(value, Mapping):
        value = value.get("data", value.get("parameters"))
    value = NO_NUMBERS.sub(" ", value).split() if isinstance(value, str) else value
    return array_of(value if isinstance(value, list) else [value])


def _numbers(of: Record, names: list[Keys], counts: Container[int], missing: float | None = None) -> list[float] | None:
    """The numbers of the first of the names that has as many; `missing` is for a key of several that is not there."""
    for keys in names:
        if (len(keys) == 1) == (number_of(of.get(keys[0])) is None):  # a number by the name of a list is a distance
            each = [number_of(of[key]) if key in of else missing for key in keys]
            array = _array(each if len(keys) > 1 else of.get(keys[0]))
            if array is not None and array.size in counts:
                return [float(number) for number in array.ravel()]
    return None
