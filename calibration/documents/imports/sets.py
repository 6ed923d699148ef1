"""Whole sets by the table of their layouts, and any folder: its pictures or clouds, and poses of one or both sides."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any, Protocol

from calibration.documents.imports.intrinsics import Intrinsics, read_intrinsics
from calibration.documents.imports.leaves import DEPTH, number_of, table_of_data
from calibration.documents.imports.number_tables import words_of
from calibration.documents.imports.pairing import MAX_SHOWN, align_sides, natural, pair, shown
from calibration.documents.imports.pose_files import FAMILIES, load_npy, read_poses
from calibration.documents.imports.pose_table import PoseTable, concatenate
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.sides import WORDS, equal_sides, relation_of, rows_as_pairs, with_relation
from calibration.documents.imports.trees import read_yaml
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.conventions import CONVENTIONS, Frame, LengthUnit, Side
from calibration.problem import Setup
from calibration.targets import MARKER_COUNTS

PICTURES = frozenset((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm"))
CLOUDS, TIFF = frozenset((".pcd", ".ply", ".npz")), frozenset((".tif", ".tiff"))
CAMERA_TEXTS, CAMERA_ARRAYS = frozenset((".yaml", ".yml", ".xml", ".json")), frozenset((".npz", ".npy"))
UNREAD = {suffix: row["said"] for row in WORDS["unread"] for suffix in row["suffixes"].split()}
LIKELY = re.compile(r"pos|robot|tcp|arm|joint|flange|hand|sample|pair", re.IGNORECASE)  # in the name of a file of poses
MAX_CANDIDATES = 2000  # files that are tried for poses when none are named


class Files(Protocol):
    """The files of a folder: its name, for messages; their names relative to it, with slashes, in natural order; and
    their content, of which `read` raises DocumentError."""

    @property
    def origin(self) -> str: ...

    @property
    def names(self) -> Sequence[str]: ...

    def read(self, name: str) -> bytes: ...


@dataclass(frozen=True)
class Chosen:
    """What the user names: globs of images, of poses and of the camera's poses of the target."""

    images: str | None = None
    poses: str | None = None
    camera_poses: str | None = None


@dataclass(frozen=True, eq=False)
class ImportedSet:
    """The content of a set.

    images : pictures or clouds, one for each pose once `pairing` says how they were paired; else those of the folder.
    camera_poses : the target's pose in the camera, one for each pose; a PoseTable of camera_T_target.
    target : as in session.json; cloud_unit: of the clouds' points, where the set states it.
    """

    kind: str
    poses: PoseTable
    images: tuple[str, ...] = ()
    pairing: str = ""
    camera_poses: PoseTable | None = None
    target: dict[str, Any] | None = None
    camera: Intrinsics | None = None
    setup: Setup | None = None
    notes: tuple[str, ...] = ()
    cloud_unit: LengthUnit | None = None


def suffix_of(name: str) -> str:
    """The suffix of a name in lower case, with its point."""
    return PurePosixPath(name).suffix.lower()


def of_suffix(names: Sequence[str], suffixes: frozenset[str]) -> tuple[str, ...]:
    """The names with one of the suffixes."""
    return tuple(name for name in names if suffix_of(name) in suffixes)


def matching(names: Sequence[str], pattern: str) -> tuple[str, ...]:
    """The name that is the pattern; else those that a glob fits, whole or in their last parts, in natural order."""
    ends = {name: "/".join(name.split("/")[-1 - pattern.count("/") :]) for name in names}
    found = [name for name, end in ends.items() if fnmatchcase(name, pattern) or fnmatchcase(end, pattern)]
    return (pattern,) if pattern in ends else tuple(sorted(found, key=natural))


def read_named(files: Files, names: Sequence[str]) -> PoseTable:
    """The table of a file, or of files with a pose each; one error when these are wrong alike. Raises DocumentError."""
    if not names:
        raise refusal(files.origin, "poses", "no files with poses", "give them by --poses")
    tables = [read_poses(name, files.read(name)) for name in names]
    paths = [PurePosixPath(name) for name in names]
    labels = [path.stem for path in paths]
    labels = labels if len(set(labels)) == len(labels) else [path.parent.name for path in paths]
    return tables[0] if len(tables) == 1 else concatenate(tables, labels, files.origin)


def read_folder(files: Files, chosen: Chosen, part: str | None = None) -> ImportedSet:
    """Poses and pictures of a folder, paired; or pairs of poses. `part`: the robot's frame, where records have several.

    Raises DocumentError.
    """
    poses = _poses(files, chosen.poses, "robot") if chosen.poses else find_poses(files, chosen.camera_poses)
    if poses.parts:
        if part is None or part not in poses.parts:
            what = f"poses of {len(poses.parts)} moving frames ({', '.join([*poses.parts][:12])})"
            raise refusal(poses.origin, "records", what, "name the one that carries the camera or target: --part FRAME")
        poses = replace(poses.parts[part], parts=poses.parts)
    if chosen.camera_poses:
        camera = _poses(files, chosen.camera_poses, "camera")
        poses = replace(poses, side="robot" if chosen.poses else poses.side, camera=camera)
    poses = poses if poses.camera is None else align_sides(poses, poses.camera)
    paired, notes, pictures = None, tuple[str, ...](), tuple[str, ...]()
    within = poses.pictures if chosen == Chosen(poses=chosen.poses) else ()
    names = tuple(f"view_{at:03}.png" for at in range(len(within)))
    poses = replace(poses, pictures=within, images=names or poses.images)
    try:
        if chosen.images or not chosen.camera_poses:
            pictures = names or tuple(_images(files, chosen.images, poses))
        if pictures and (poses.camera is None or poses.kind != "points"):
            paired = pair(pictures, poses)
    except DocumentError:
        if poses.camera is None or chosen.images:
            raise
    if poses.camera is not None and paired is None and not chosen.camera_poses:
        notes, pictures = ("pictures and clouds are not used: the file has the camera's side",) * bool(pictures), ()
    if not pictures and poses.camera is None and poses.kind != "points":
        poses = rows_as_pairs(poses) or poses
    seen = poses.camera
    if seen is not None and len(seen) != len(poses):
        what = f"{len(poses)} poses of the robot and {len(seen)} of the camera"
        raise refusal(poses.origin, "pairs", what, "give one of each for every picture", "pairs")
    if seen is not None and not pictures:
        words = "in the order of the files" if chosen.camera_poses else f"by {poses.origin}"
        kind = "samples of pose pairs"
        return ImportedSet(kind, poses, pairing=words, camera_poses=seen, setup=poses.setup, notes=notes)
    if paired is None:
        fix = "name them by --images, or the camera's poses by --camera-poses; of a line scanner: handeyed profiles"
        unread = [note for note in poses.notes if note.startswith("not read: ")]
        unread += [f"{name}: {', '.join(UNREAD[suffix_of(name)])}" for name in files.names if suffix_of(name) in UNREAD]
        raise refusal(
            files.origin, "images", "; ".join(["no pictures and no clouds", *unread[:MAX_SHOWN]]), fix, "pairs"
        )
    taken = poses.take(paired.rows)
    if chosen.images is None and (others := len(of_suffix(files.names, PICTURES)) - len(pictures)) > 0:
        notes = (f"{others} other pictures are not used",)
    return ImportedSet(
        "folder", taken, paired.images, paired.words, taken.camera, poses.target, _camera(files), poses.setup, notes,
        poses.cloud_unit,
    )  # fmt: skip


def _images(files: Files, pattern: str | None, poses: PoseTable) -> Sequence[str]:
    """The pictures or clouds but those of depth: all, or of several series the one with as many as poses."""
    if pattern is not None:
        if found := matching(files.names, pattern):
            return found
        raise refusal(files.origin, "--images", f"no file fits {pattern}", "check the pattern", "pairs")
    every = of_suffix(files.names, PICTURES) or of_suffix(files.names, CLOUDS - {".npz"})
    stems = {name.rpartition(".")[0] for name in every if suffix_of(name) not in TIFF}
    own = [name for name in every if DEPTH.isdisjoint(word.rstrip("0123456789") for word in words_of(name))]
    images = [name for name in own if suffix_of(name) not in TIFF or name.rpartition(".")[0] not in stems] or every
    images = sorted({*every} & {*(poses.images or ())}, key=natural) or images
    series: dict[str, list[str]] = {}
    for name in () if poses.images else images:  # a table with names of pictures names its own
        series.setdefault(re.sub(r"\d+", "*", name), []).append(name)
    fitting = {glob: one for glob, one in series.items() if len(one) == len(poses) and _are_of_one_folder(one)}
    if len(fitting) == 1:
        return next(iter(fitting.values()))
    if len(fitting) > 1 or not _are_of_one_folder(images):
        folders = sorted({str(PurePosixPath(name).parent) for name in images})
        what = f"pictures in {len(folders)} folders ({shown(folders)})"
        what = f"{len(poses)} poses, and as many pictures each of {shown([*fitting])}" if fitting else what
        fix = f"name those of the session: --images '{next(iter(fitting), 'FOLDER/*')}'"
        raise refusal(files.origin, "images", what, fix, "pairs")
    return images


def _are_of_one_folder(images: Sequence[str]) -> bool:
    """Whether all lie in one folder, or each in one of its own and is called as the others are."""
    folders = {str(PurePosixPath(name).parent) for name in images}
    alike = {re.sub(r"\d+", "", PurePosixPath(name).name) for name in images}
    return len(folders) <= 1 or (len(folders) == len(images) and len(alike) == 1)


def _poses(files: Files, pattern: str, side: Side) -> PoseTable:
    """The poses of one side in the named files, which may hold the other's as well."""
    names = matching(files.names, pattern)
    option = "--poses" if side == "robot" else "--camera-poses"
    if not names:
        raise refusal(files.origin, option, f"no file fits {pattern}", "check the pattern")
    table = read_named(files, names)
    return table.camera if side == "camera" and table.camera is not None else _named_by(names[0], table, side)


def find_poses(files: Files, but: str | None = None) -> PoseTable:
    """The poses of a folder: one file with several, files with one each, or a file for each side; none that `but`, a
    glob, names. Raises DocumentError."""
    several: dict[str, PoseTable] = {}
    points: dict[str, PoseTable] = {}
    single: dict[tuple[str, str], list[str]] = {}
    refused: list[tuple[str, DocumentError]] = []
    others = set() if but is None else set(matching(files.names, but))
    candidates = [name for name in files.names if suffix_of(name) in FAMILIES and name not in others]
    for name in sorted(candidates, key=lambda name: suffix_of(name) == ".py")[:MAX_CANDIDATES]:
        if suffix_of(name) == ".py" and (several or points or any(len(own) > 1 for own in single.values())):
            break  # sources are read only where no other file has poses
        try:
            table = read_poses(name, files.read(name))
        except DocumentError as error:
            refused += [(name, error)] * (suffix_of(name) != ".py")
            continue
        if table.kind == "points" and table.camera is None:
            points[name] = table
        elif len(table) > 1:
            if not any(equal_sides(table, other) for other in several.values()):
                several[name] = table
        else:
            path = PurePosixPath(name)
            stem, folder = re.sub(r"\d+", "", path.stem), str(path.parent)
            folder = folder if stem != path.stem else re.sub(r"\d+", "", folder)  # one of a view: pose_07/data.json
            single.setdefault((f"{folder}/{stem}", path.suffix), []).append(name)
    for names in (sorted(own, key=natural) for own in single.values() if len(own) > 1):
        first, last = (PurePosixPath(names[at]) for at in (0, -1))
        numbered = last.name if first.parent == last.parent else names[-1]  # else one of a view
        several[names[-1].removesuffix(numbered) + re.sub(r"\d+", "*", numbered)] = read_named(files, names)
    if len(several) == 1:
        ((name, table),) = several.items()
        unread = [f"not read: {name}: {error.problems[0].what}" for name, error in refused if LIKELY.search(name)]
        return _named_by(name, replace(table, notes=(*table.notes, *unread)), "robot")
    if both := _both_sides(several):
        return both
    if several:
        what = f"poses in several files ({shown([*several])})"
        raise refusal(files.origin, "poses", what, "name the robot's by --poses, the camera's by --camera-poses")
    arrays = {PurePosixPath(one).stem: load_npy(files.read(one), one) for one in candidates if one.endswith(".npy")}
    if len(arrays) > 1:
        return table_of_data(arrays, files.origin)
    if (both := _both_sides(points)) is not None:
        return both
    refused += [(name, refusal(name, "rows", "3 numbers a row: points of one side", "give poses")) for name in points]
    refused += [(name, refusal(name, "file", *said)) for name in files.names if (said := UNREAD.get(suffix_of(name)))]
    lone, fix = [names[0] for names in single.values() if len(names) == 1], "give one of each picture, three or more"
    refused += [(name, refusal(name, "poses", "one pose only", fix)) for name in lone]
    raise _nearest(files, refused)


def _both_sides(tables: dict[str, PoseTable]) -> PoseTable | None:
    """The robot's table with the camera's, of two files, or of files with one pose each in two groups, whose names or
    columns say whose they are; else None."""
    by_side = {one.side: one for one in map(_named_by, tables, tables.values()) if one.camera is None}
    if len(tables) != 2 or len(by_side) != 2 or "camera" not in by_side:
        return None
    camera = by_side.pop("camera")
    return replace(*by_side.values(), side="robot", camera=replace(camera, side="camera"))


def _named_by(name: str, table: PoseTable, side: Side | None = None) -> PoseTable:
    """The table with what the name of its file says, unless that is the other side."""
    said = relation_of(str(PurePosixPath(name).with_suffix("")))
    silent = said is None or table.camera is not None or side not in (None, said.side)
    return table if silent else with_relation(table, said)


def _nearest(files: Files, refused: Sequence[tuple[str, DocumentError]]) -> DocumentError:
    """The error of the file that is nearest to being one of poses: intrinsics are none."""
    for name, error in sorted(refused, key=lambda one: LIKELY.search(one[0]) is None):
        if suffix_of(name) not in CAMERA_TEXTS | CAMERA_ARRAYS or find_intrinsics(files, name) is None:
            return error
    texts = [name for name in files.names if suffix_of(name) not in PICTURES | CLOUDS]
    what = "no file with poses" + (f" among {shown(texts)}" if texts else "")
    return refusal(files.origin, "poses", what, "name it by --poses")


def _camera(files: Files, folder: str = "") -> Intrinsics | None:
    """The intrinsics below a folder, where one file has some; numpy's files count where no text has any."""
    for suffixes in (CAMERA_TEXTS, CAMERA_ARRAYS):
        named = [name for name in of_suffix(files.names, suffixes) if name.startswith(folder)][:MAX_CANDIDATES]
        if found := [one for name in named if (one := find_intrinsics(files, name)) is not None]:
            return found[0] if len(found) == 1 else None
    return None


def find_intrinsics(files: Files, name: str) -> Intrinsics | None:
    """The intrinsics of a file; None where it holds none."""
    try:
        return read_intrinsics(name, files.read(name))
    except DocumentError:
        return None


@dataclass(frozen=True)
class Layout:
    """A set by the names of its files: regular expressions, in which {part} is a camera's or scene's folder.

    Their rows stand in words.json. markers : files that every such set has; pairs of poses without pictures are any
    folder. parts : names whose group `part` is one of several parts, `example` one.
    """

    name: str
    markers: Sequence[str]
    poses: str
    images: str
    unit: LengthUnit
    frame: Frame = "base_T_flange"
    convention: str = ""
    parts: str | None = None
    example: str = ""
    setup: Setup | None = None
    notes: Sequence[str] = ()

    def read(self, files: Files, part: str | None) -> ImportedSet:
        """The set; `part` names one of several parts. Raises DocumentError."""
        chosen = ""
        if self.parts is not None:
            found = (re.search(self.parts, name) for name in files.names)
            parts = [*dict.fromkeys(match["part"] or "" for match in found if match)]
            chosen = part.strip("/") if part else parts[0] if len(parts) == 1 else "?"
            if chosen not in parts:
                kind = "cameras" if "camera" in self.example else "scenes"
                what = f"{len(parts)} {kind} ({', '.join(parts[:6])})"
                raise refusal(files.origin, "--part", what, f"name one: --part {self.example}", self.name.lower())
        inside = f"{re.escape(chosen)}/" if chosen else ""
        named, listed = (
            [name for name in files.names if re.search(pattern.replace("{part}/", inside), name)]
            for pattern in (self.poses, self.images)
        )
        table = read_named(files, named)
        convention = CONVENTIONS.get(self.convention, table.convention)
        poses = replace(table, unit=self.unit, frame=self.frame, convention=convention, side="robot", named_frames=())
        paired = pair(of_suffix(listed, PICTURES), poses)
        target, setup = None, self.setup
        if self.name == "METRIC":
            data = read_yaml(files.read("CalibrationInfo.yaml"), "CalibrationInfo.yaml")
            info: dict[str, Any] = data if isinstance(data, dict) else {}
            target = _target(info, "pattern_type")
            setup = "eye-to-hand" if number_of(info.get("calibration_setup")) else "eye-in-hand"
        if BOARD in files.names:
            said = dict(re.findall(r"(chess_\w+)\s+([-+.\d]+)", decode(files.read(BOARD), BOARD)))
            counts = {field: said.get(word) for field, word in WORDS["board"].items()}
            target = {"kind": "chessboard", **counts} if all(counts.values()) else None
        return ImportedSet(
            self.name, poses.take(paired.rows), paired.images, paired.words, None, target,
            _camera(files, chosen and f"{chosen}/"), setup, tuple(self.notes),
        )  # fmt: skip


BOARD = "calibration_object.txt"  # of RWHE
LAYOUTS = tuple(Layout(**row) for row in WORDS["sets"])

CONFIGURATION, OWN = "cal_data.yaml", "session.json"
DICTIONARIES = tuple(MARKER_COUNTS)[:17]  # OpenCV's, of which a set may state the number only


def _industrial_calibration(files: Files) -> ImportedSet:
    """cal_data.yaml with a pose file and an image for each view: metres, qx, qy, qz, qw."""
    data = read_yaml(files.read(CONFIGURATION), CONFIGURATION)
    views: Any = data.get("data") if isinstance(data, dict) else None
    listed = views if isinstance(views, list) else [None]
    if not all(isinstance(view, dict) and {"pose", "image"} <= set(view) for view in listed):
        fix = "give a list of mappings with pose and image"
        raise refusal(CONFIGURATION, "data", "no list of poses and images", fix, "industrial_calibration")
    poses = read_named(files, [str(view["pose"]) for view in views])
    static = data.get("static_camera")
    return ImportedSet(
        "industrial_calibration", replace(poses, unit="m", frame="base_T_flange"),
        tuple(str(view["image"]) for view in views), f"by {CONFIGURATION}",
        target=_target(data.get("target_finder"), "type"),
        camera=find_intrinsics(files, CONFIGURATION),
        setup=None if static is None else "eye-to-hand" if static else "eye-in-hand",
    )  # fmt: skip


def _target(stated: Any, kind: str) -> dict[str, Any] | None:
    """The target that a mapping states, whose lengths are m, with its kind by that key; None where it is not known."""
    data: dict[str, Any] = stated if isinstance(stated, dict) else {}
    row = WORDS["targets"].get(str(data.get(kind)), {"fixed": {}, "stated": ""})
    fixed, names, of_lengths = row["fixed"], row["stated"].split(), WORDS["lengths_of_targets"]
    lengths = {of_lengths[key]: number for key in of_lengths if (number := number_of(data.get(key))) is not None}
    given: dict[str, Any] = {name: round(1000 * metres, 9) for name, metres in lengths.items()}
    given["columns"] = data.get("cols", data.get("number_of_columns"))
    given["rows"] = data.get("rows", data.get("number_of_rows"))
    number, given["dictionary"] = number_of(data.get("dictionary")), data.get("dictionary")
    if number is not None and 0 <= number < len(DICTIONARIES):
        given["dictionary"] = DICTIONARIES[int(number)]
    whole = names and all(given.get(name) is not None for name in names if name.endswith("_mm"))
    return {**fixed, **{name: given.get(name) for name in names}} if whole else None


def read_set(files: Files, part: str | None, chosen: Chosen, arm: str | None = None) -> ImportedSet:
    """The set in a folder; with globs given it is read as any folder. `arm`: of joints. Raises DocumentError."""
    if chosen == Chosen() and OWN in files.names and re.search(rb'"(corners_px|points_mm)"\s*:', files.read(OWN)):
        raise refusal(files.origin, OWN, "corners or points", f"run handeyed solve {files.origin}", "own-files")
    known = [one for one in LAYOUTS if all(any(re.search(mark, name) for name in files.names) for mark in one.markers)]
    if chosen != Chosen() or not (known or CONFIGURATION in files.names):
        imported = read_folder(files, chosen, part)
    else:
        imported = _industrial_calibration(files) if CONFIGURATION in files.names else known[0].read(files, part)
    return imported if imported.poses.kind != "joints" else replace(imported, poses=with_arm(imported.poses, arm))


def with_arm(joints: PoseTable, name: str | None) -> PoseTable:
    """The table of joints with the arm of that name. Raises DocumentError."""
    if name is None:
        fix = "give the arm by --arm (`handeyed arms` lists them), or poses of the flange"
        raise refusal(joints.origin, "joints", "joint states, no poses", fix, "joint-states")
    try:
        return replace(joints, arm=find_arm(name), side="robot")
    except GeometryError as error:
        raise refusal("--arm", name, str(error), "correct it", "joint-states") from None
