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
from calibration.documents.imports.pose_files import load_npy, load_npz
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sides import WORDS
from calibration.documents.imports.trees import read_json, read_xml_tree, read_yaml
from calibration.documents.session import CameraDocument
from calibration.documents.validation import validate_document
from calibration.transforms import Array

HEADING = "intrinsics"
Record = Mapping[str, Any]
Maps = tuple[tuple[dict[str, Any], ...], tuple[dict[str, Any], ...]]
Keys = tuple[tuple[str, ...], ...]  # ways to name numbers: one key of a list, or a key for each

MATRIX, FOUR, DISTORTION, OF_FISHEYE, SIZE = (
    tuple(tuple(keys.split()) for keys in WORDS["intrinsics"][what])
    for what in ("matrix", "four", "distortion", "distortion_of_fisheye", "size")
)
FISHEYE, FLAGS, PINHOLE, REALSENSE, OF_MODELS, OF_LENS_MODELS, BEFORE = (
    WORDS["intrinsics"][what].split()
    for what in ("fisheye", "fisheye_flags", "pinhole", "realsense", "models", "lens_models", "before_distortion")
)
DISTORTION += tuple((before + one[0],) for before in BEFORE for one in DISTORTION if len(one) == 1)


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
    """The intrinsics in a file: JSON, YAML, XML, numbers as text, .npy or .npz. Raises DocumentError."""
    suffix = PurePath(name).suffix.lower()
    if suffix in (".npy", ".npz"):
        arrays = load_npz(content, name) if suffix == ".npz" else {"k": load_npy(content, name)}
        return intrinsics_of({key: one.tolist() for key, one in arrays.items() if one.size <= MAX_COEFFICIENTS}, name)
    if suffix in (".dat", ".cal") or b"ParGroup" in content[:1000]:
        what = "camera parameters of HALCON, whose distortion is of another kind than OpenCV's"
        raise refusal(name, "document", what, "leave them out: they are then estimated from the pictures", HEADING)
    if suffix == ".xml":
        return intrinsics_of(read_xml_tree(content, name, HEADING), name)
    return intrinsics_of((read_json if suffix == ".json" else read_yaml)(content, name), name)


def intrinsics_of(data: Any, origin: str) -> Intrinsics:
    """The intrinsics of the one camera in plain data, at its top or up to three levels below. Raises DocumentError."""
    data = {"k": data} if isinstance(data, str | list) else data  # a matrix alone, as np.savetxt writes it
    mappings = list(_mappings(data))
    every = ((_numbers(own, MATRIX, (9,)) or _numbers(own, FOUR, (4,)), own, said) for own, said in mappings)
    found = [intrinsics_within(own, *said, matrix, origin) for matrix, own, said in every if matrix is not None]
    is_stereo = any("camera2fx" in own for own, _ in mappings)
    if len({(one.matrix, one.distortion, one.lens) for one in found}) == 1 and not is_stereo:
        return found[0]
    what = "several cameras" if found else "no intrinsics: neither a camera matrix nor fx, fy, cx, cy"
    raise refusal(origin, "document", what, "give camera_matrix and distortion_coefficients of one camera", HEADING)


def _mappings(data: Any, around: Maps = ((), ()), depth: int = 0) -> Iterator[tuple[Record, tuple[Record, Record]]]:
    """Each mapping, what is said of its lens, and all that is said in, beside and around it. Keys as `_by_spelling`.

    Of the lens: it, those around it, and those in and beside it that are named after a camera, a lens or distortion;
    one named after a fisheye only where no other has coefficients.
    """
    if isinstance(data, Mapping) and depth <= MAX_DEPTH:
        own = _by_spelling(data)
        inner = {key: dict(one) for key, one in own.items() if isinstance(one, Mapping)}
        for key, one in inner.items():
            if OF_BLOCK.match(key) and any(map(OF_DISTORTION.match, _by_spelling(one))):
                one["infisheye"] = True
        said = {key: one for key, one in own.items() if key not in inner or OF_DISTORTION.match(key)}
        of_lens, every = (
            [_by_spelling(inner[name]) for name in names[:MAX_BESIDE]]
            for names in (list(filter(OF_LENS.search, inner)), list(inner))
        )
        maps = [own, *(one for one in (*of_lens, *around[0]) if "infisheye" not in one)]
        if "infisheye" in own or not any(_numbers(one, OF_FISHEYE + DISTORTION + OF_K, COUNTS, 0.0) for one in maps):
            maps = [own, *of_lens, *around[0]]
        yield own, (ChainMap(*maps), ChainMap(own, *every, *around[1]))
        for one in inner.values():
            yield from _mappings(one, ((said, *of_lens, *around[0]), (own, *every, *around[1])), depth + 1)


def _by_spelling(record: Record) -> dict[str, Any]:
    """Values by keys of small letters and digits only; without ORB-SLAM's `Camera.`; k beside K is the distortion.

    Of keys that are then alike the highest `_rank` counts; two lists that differ are in a mapping, which is no list.
    """
    plain: dict[str, Any] = {}
    for key, one in sorted(record.items(), key=lambda item: _rank(item[1])):
        name = "kc" if key == "k" and "K" in record else SIGNS.sub("", str(key).lower())
        kept = plain.setdefault(name, one)
        is_one = kept is one or kept == one or not _rank(one)[0] or _rank(kept) < _rank(one)
        if not is_one and (array := _array(kept)) is not None and (other := _array(one)) is not None:
            is_one = np.array_equal(array.ravel(), other.ravel())
        plain[name] = one if is_one else {"one": kept, "other": one}
    return plain


def _rank(value: Any) -> tuple[bool, bool, bool]:
    """Higher for a list or a mapping than for a number, a text or bool without numbers, and nothing, in this order."""
    has_numbers = bool(isinstance(value, list | Mapping) and value) or _array(value) is not None
    return has_numbers, number_of(value) is None, value is not None


def _array(value: Any) -> Array | None:
    """The numbers of a list, of OpenCV's mapping of one, or of a text with any brackets and separators."""
    while isinstance(value, Mapping):
        value = value.get("data", value.get("parameters"))
    value = NO_NUMBERS.sub(" ", value).split() if isinstance(value, str) else value
    return array_of(value if isinstance(value, list) else [value])


def _numbers(plain: Record, names: Keys, counts: Container[int], missing: float | None = None) -> list[float] | None:
    """The numbers of the first of the names that has as many; `missing` is for a key of several that is not there."""
    for keys in names:
        if keys[0] not in plain or (len(keys) > 1) == (number_of(plain[keys[0]]) is None):
            continue  # a number by one name is a distance
        each = [number_of(plain[key]) if key in plain else missing for key in keys]
        array = _array(each if len(keys) > 1 else plain[keys[0]])
        if array is not None and array.size in counts:
            return [float(number) for number in array.ravel()]
    return None


def _model(stated: Any, of_lens: Record) -> str:
    """A model's name in small letters; librealsense's number beside its ppx is the name of it."""
    by_number: dict[float | None, str] = dict(enumerate(REALSENSE)) if "ppx" in of_lens else {}
    return by_number.get(number_of(stated), str(stated).lower())


def intrinsics_within(own: Record, of_lens: Record, plain: Record, matrix: list[float], origin: str) -> Intrinsics:
    """The camera of a matrix (four numbers or nine) in `own`, with what is said of its lens. Raises DocumentError."""
    if len(matrix) == 4:
        fx, fy, cx, cy = matrix
        matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    rows = np.array(matrix).reshape(3, 3)
    if not (np.all(np.isfinite(rows)) and np.diag(rows)[:2].min() > MIN_FOCAL_PX and np.allclose(rows[2], [0, 0, 1])):
        raise refusal(origin, "camera matrix", "not one in px", "write fx, 0, cx / 0, fy, cy / 0, 0, 1", HEADING)
    nested = of_lens.get("distortion")
    inner = _by_spelling(nested) if isinstance(nested, Mapping) else {}
    strict = of_lens.get("distortionmodel") or inner.get("type") or inner.get("model")
    stated_model = next((_model(one, of_lens) for one in (strict, *map(of_lens.get, OF_LENS_MODELS)) if one), "")
    named = (of_lens.get(key) for key in (*OF_MODELS, *["lens"] * (not stated_model)))
    words = {one: MODEL_SIGNS.sub("", one) for one in (stated_model, *(_model(one, of_lens) for one in named if one))}
    known = [one for one in words.values() if one in PINHOLE or one in FISHEYE]
    is_flagged = any(str(of_lens.get(key)).lower() in ("1", "1.0", "true", "yes") for key in FLAGS)
    is_fisheye = is_flagged or not {*FISHEYE}.isdisjoint(known[:1] if stated_model else known)
    lens: LensModel = "fisheye" if is_fisheye else "pinhole"
    names = OF_FISHEYE + DISTORTION if is_fisheye else DISTORTION
    stated = _numbers(of_lens, names, COUNTS, missing=0.0) or _numbers(of_lens, OF_K, COEFFICIENT_COUNTS[lens])
    for at, (said, word) in enumerate(words.items()):
        is_other = word and word not in known and ((at == 0 and strict) or OTHER_MODELS.search(said))
        if is_other and not (OF_ZEROS.search(word) and stated is not None and not any(stated)):
            fix = "calibrate as pinhole or fisheye, or have the camera estimated"
            raise refusal(origin, "distortion model", f"{said!r} is not read", fix, HEADING)
    if not (known or is_flagged) and number_of(of_lens.get("k4")) and of_lens.keys().isdisjoint(NOT_FISHEYE):
        what = "k1 to k4 are a fisheye's, or with p1 and p2 a pinhole camera's"
        raise refusal(origin, "distortion model", what, "add camera_model: fisheye or pinhole", HEADING)
    unread = (
        key for key, one in of_lens.items() if OF_DISTORTION.match(key) and not (key == "kappa" and "phi" in of_lens)
        and not (key in ("s1", "t1", "t2") and ("t3" in of_lens or (stated and "k1" not in of_lens)))
        and (stated is None or PARTLY.match(key))
        and not (key == "k" and (number_of(one) or _numbers(of_lens, OF_K, (9,))))
        and (number_of(one) or (isinstance(one, list | Mapping) and one and not POINT.match(key))
             or (isinstance(one, str) and (_numbers(of_lens, ((key,),), range(2, 100)) or DECIMALS.search(one))))
    )  # fmt: skip
    lists = ((key, _array(one)) for key, one in of_lens.items() if stated is None and not isinstance(one, str))
    flat = ((key, array) for key, array in lists if array is not None and array.size == max(array.shape) in OF_OPENCV)
    four = [*np.diag(rows)[:2], *rows[:2, 2]]
    others = (key for key, one in flat if np.any(one % 1) and [*one.flat] != four and not NO_DISTORTION.search(key))
    if name := next(unread, "") or next(others, ""):
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

COUNTS, OF_OPENCV = {*range(1, MAX_COEFFICIENTS)} - {9}, (4, 5, 8, 12, 14)
"""Of a distortion (nine are a matrix), and those that OpenCV writes."""

NO_NUMBERS = re.compile(r"^\s*((np|numpy)\.)?array|dtype=[\w.]+|[,;|()\[\]{}]")
NOT_FISHEYE, OF_K = ("p1", "p2", "k5", "k6"), (("k",),)
SIGNS, MODEL_SIGNS = re.compile(r"^camera1?\.|[^a-z0-9]"), re.compile(r"^distortion\.|[^a-z0-9]")
POINT, OF_BLOCK = re.compile(r"[pst]\d$"), re.compile("(is|use)?fisheye")
DECIMALS = re.compile(r"(?s)(?<![\w.])\d*\.\d.*(?<![\w.])\d*\.\d")  # two or more in a text
OF_DISTORTION = re.compile(
    rf"({'|'.join(BEFORE)})?(dist(?!ance)|coef|d$)|radial|tangential|kappa|k$|kc|xi$|[kps]\d$|t[12]$|.*(?<!un)distort"
)
PARTLY = re.compile(r"radial|tangential|xi$|k[07-9]$|p[03-9]$|s\d$|t[12]$")  # what coefficients beside it do not hold
NO_DISTORTION = re.compile(
    r"^(p\d?|r|t|data)$|matrix|mtx|intrin|proj|rect|pose|quat|rot|trans|[rtq]vec|extrin|posit|orient|size|resol|shape|roi|box|crop|err|rms|std"
    r"|^q$|xyzw|wxyz|time|date|ids?$|range|balance|backgr|corner|points|distance|hand|2"
)
"""In the names of lists beside a matrix that are no distortion; others as long as OpenCV's are refused."""

OF_ZEROS = re.compile("inverse|theta")  # models of RealSense that are a pinhole's where the coefficients are 0
OF_LENS = re.compile(r"cam|lens|intrin|fisheye|pinhole|^(dist(?!ance)|radial|tangential|coeff|d$)")
OTHER_MODELS = re.compile(
    r"fish|equi|omni(?!v)|kannala|kb\d|division|(?<!a)spher|\bds\b|ucm|\bocam\b(?!-)|ocam_?calib|scaramuzza|\bmei\b|^fov$|atan$|polynom|graphic$|inverse|theta"
)
"""In the name of a camera or lens, those of models that are not read; other words are names of products."""
