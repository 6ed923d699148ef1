"""Whole sets by the table of their layouts, and any folder: its pictures or clouds, and poses of one or both sides."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any, Protocol

from calibration.documents.imports.intrinsics import Intrinsics, intrinsics_of, read_intrinsics
from calibration.documents.imports.leaves import array_of, number_of, setup_of, table_of_data
from calibration.documents.imports.number_tables import table_of_rows, words_of
from calibration.documents.imports.pairing import MAX_SHOWN, align_sides, natural, pair, shown
from calibration.documents.imports.pose_files import FAMILIES, load_npy, read_poses
from calibration.documents.imports.pose_table import PoseTable, concatenate
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.sides import WORDS, equal_sides, relation_of, rows_as_pairs, with_relation
from calibration.documents.imports.text_tables import rows_of
from calibration.documents.imports.trees import read_json, read_json_lines, read_yaml
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.conventions import CONVENTIONS, Frame, LengthUnit, Side
from calibration.problem import Setup
from calibration.targets import MARKER_COUNTS

PICTURES = frozenset((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm"))
CLOUDS, TIFF = frozenset((".pcd", ".ply", ".npz")), frozenset((".tif", ".tiff"))
DEPTH = frozenset(WORDS["of_depth"].split())
"""Words of pictures beside a camera's own; so is a TIFF called as another picture is."""

CAMERA_SUFFIXES = frozenset((".yaml", ".yml", ".xml", ".json"))
UNREAD = {suffix: row["said"] for row in WORDS["unread"] for suffix in row["suffixes"].split()}
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
    try:
        pictures = () if chosen.camera_poses and not chosen.images else tuple(_images(files, chosen.images, poses))
        if pictures and (poses.camera is None or poses.kind != "points"):
            paired = pair(pictures, poses)
    except DocumentError:
        if poses.camera is None or chosen.images:
            raise
    if poses.camera is not None and paired is None and not chosen.camera_poses:
        notes, pictures = ("pictures and clouds are not used: the file has the camera's side",) * bool(pictures), ()
    if not pictures and poses.camera is None and poses.kind != "points":
        poses = rows_as_pairs(poses) or poses
    lenses = [find_intrinsics(files, name) for name in of_suffix(files.names, CAMERA_SUFFIXES)[:MAX_CANDIDATES]]
    cameras, seen = [one for one in lenses if one is not None], poses.camera
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
        "folder", taken, paired.images, paired.words, taken.camera, None, cameras[0] if len(cameras) == 1 else None,
        poses.setup, notes,
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
    for name in images:
        series.setdefault(re.sub(r"\d+", "*", name), []).append(name)
    fitting = {glob: one for glob, one in series.items() if len(one) == len(poses) and _are_of_one_folder(one)}
    fitting = {} if poses.images else fitting  # the table names its own
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
    if table.camera is not None:
        return table.camera if side == "camera" else table
    return _named_by(names[0], table, side)


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
    for (stem, suffix), names in single.items():
        if len(names) > 1:
            several[f"{stem}...{suffix}"] = read_named(files, sorted(names, key=natural))
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


LIKELY = re.compile(r"pos|robot|tcp|arm|joint|flange|hand|sample|pair", re.IGNORECASE)  # in the name of a file of poses


def _nearest(files: Files, refused: Sequence[tuple[str, DocumentError]]) -> DocumentError:
    """The error of the file that is nearest to being one of poses: intrinsics are none."""
    for name, error in sorted(refused, key=lambda one: LIKELY.search(one[0]) is None):
        if suffix_of(name) not in CAMERA_SUFFIXES or find_intrinsics(files, name) is None:
            return error
    texts = [name for name in files.names if suffix_of(name) not in PICTURES | CLOUDS]
    what = "no file with poses" + (f" among {shown(texts)}" if texts else "")
    return refusal(files.origin, "poses", what, "name it by --poses")


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
    folder. describe : further fields of an ImportedSet. parts : names whose group `part` is one of several parts,
    `example` one.
    """

    name: str
    markers: Sequence[str]
    poses: str
    images: str
    unit: LengthUnit
    heading: str
    describe: Callable[[Files, str], dict[str, Any]]
    frame: Frame = "base_T_flange"
    convention: str | None = None
    parts: str | None = None
    example: str = ""

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
                raise refusal(files.origin, "--part", what, f"name one: --part {self.example}", self.heading)
        poses = self._table(files, self._names_of(files, self.poses, chosen))
        listed = self._names_of(files, self.images, chosen)
        clouds = of_suffix(listed, CLOUDS)
        images = of_suffix(listed, PICTURES) or of_suffix(clouds, frozenset(suffix_of(name) for name in clouds[:1]))
        described = self.describe(files, chosen)
        if not images and of_suffix(listed, frozenset((".zdf",))):
            what, fix = "only .zdf, the camera's own format", "save PNG, PLY or NPZ beside them with Zivid's SDK"
            raise refusal(files.origin, "images", what, fix, self.heading)
        paired = pair(images, poses)
        return ImportedSet(self.name, poses.take(paired.rows), paired.images, paired.words, **described)

    def _names_of(self, files: Files, pattern: str, part: str) -> list[str]:
        inside = pattern.replace("{part}/", f"{re.escape(part)}/" if part else "")
        return [name for name in files.names if re.search(inside, name)]

    def _table(self, files: Files, names: Sequence[str]) -> PoseTable:
        table = read_named(files, names)
        convention = table.convention if self.convention is None else CONVENTIONS[self.convention]
        return replace(table, unit=self.unit, frame=self.frame, convention=convention, side="robot", named_frames=())


def _metric(files: Files, part: str) -> dict[str, Any]:
    data = read_yaml(files.read("CalibrationInfo.yaml"), "CalibrationInfo.yaml")
    info: dict[str, Any] = data if isinstance(data, dict) else {}
    lens = f"{part}/intrinsic_pars_file.yaml"
    return {
        "target": _target(info, "pattern_type"),
        "camera": read_intrinsics(lens, files.read(lens)) if lens in files.names else None,
        "setup": "eye-to-hand" if number_of(info.get("calibration_setup")) else "eye-in-hand",
    }


def _rwhe(files: Files, part: str) -> dict[str, Any]:
    name = "calibration_object.txt"
    text = decode(files.read(name), name) if name in files.names else ""
    said, target = dict(re.findall(r"(chess_\w+)\s+([-+.\d]+)", text)), None
    if {"chess_mm_width", "chess_width", "chess_height"} <= set(said):
        counts = {"columns": said["chess_width"], "rows": said["chess_height"]}
        target = {"kind": "chessboard", **counts, "pitch_mm": said["chess_mm_width"]}
    return {"target": target, "setup": "eye-in-hand"}


def _bop(files: Files, part: str) -> dict[str, Any]:
    origin = f"{part}/scene_camera.json" if part else "scene_camera.json"
    data = read_json(files.read(origin), origin)
    camera = intrinsics_of(data[min(data, key=natural)], origin) if isinstance(data, dict) and data else None
    note = "the camera's pose in the world is taken as the flange's in the base"
    return {"camera": camera, "setup": "eye-in-hand", "notes": (note,)}


def _visp(files: Files, part: str) -> dict[str, Any]:
    found = (find_intrinsics(files, name) for name in files.names if name.endswith(".xml"))
    return {"camera": next(filter(None, found), None)}


DESCRIPTIONS = {"METRIC": _metric, "BOP": _bop, "RWHE": _rwhe, "ViSP": _visp}
LAYOUTS = tuple(Layout(describe=DESCRIPTIONS.get(row["name"], lambda *_: {}), **row) for row in WORDS["sets"])

CONFIGURATION = "cal_data.yaml"
DICTIONARIES = tuple(MARKER_COUNTS)[:17]  # OpenCV's, of which a set may state the number only


def _industrial_calibration(files: Files, part: str | None) -> ImportedSet:
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
        camera=intrinsics_of(data["intrinsics"], CONFIGURATION) if isinstance(data.get("intrinsics"), dict) else None,
        setup=None if static is None else "eye-to-hand" if static else "eye-in-hand",
    )  # fmt: skip


def _target(stated: Any, kind: str) -> dict[str, Any] | None:
    """The target that a mapping states, whose lengths are m, with its kind by that key; None where it is not known."""
    data: dict[str, Any] = stated if isinstance(stated, dict) else {}
    row = WORDS["targets"].get(str(data.get(kind)), {"fixed": {}, "stated": ""})
    fixed, names, of_lengths = row["fixed"], row["stated"].split(), WORDS["lengths_of_targets"]
    lengths = {of_lengths[key]: number for key in of_lengths if (number := number_of(data.get(key))) is not None}
    given: dict[str, Any] = {name: round(1000 * metres, 9) for name, metres in lengths.items()}
    if "pitch_mm" in names and "square_mm" in given:
        given["pitch_mm"] = given["square_mm"]
    given["columns"] = data.get("cols", data.get("number_of_columns"))
    given["rows"] = data.get("rows", data.get("number_of_rows"))
    number, given["dictionary"] = number_of(data.get("dictionary")), data.get("dictionary")
    if number is not None and 0 <= number < len(DICTIONARIES):
        given["dictionary"] = DICTIONARIES[int(number)]
    whole = names and all(given.get(name) is not None for name in names if name.endswith("_mm"))
    return {**fixed, **{name: given.get(name) for name in names}} if whole else None


SPEC = "dataset_spec.json"
ROTATIONS = WORDS["rotations"]


def _dataset_spec(files: Files, part: str | None) -> ImportedSet:
    """One camera of the set, which states every convention; `part` is its id."""
    data = read_json(files.read(SPEC), SPEC)
    spec: dict[str, Any] = data if isinstance(data, dict) else {}
    cameras = {str(one.get("id")): one for one in spec.get("cameras") or [] if isinstance(one, dict)}
    chosen = part or (next(iter(cameras)) if len(cameras) == 1 else None)
    if chosen not in cameras:
        what = f"{len(cameras)} cameras ({', '.join(list(cameras)[:6])})"
        raise refusal(SPEC, "cameras", what, "name one: --part ID", "dataset_spec")
    poses = _poses_of_spec(files, spec)
    images = cameras[str(chosen)].get("images")
    listed = images.get("pattern", images.get("paths")) if isinstance(images, dict) else images
    names = matching(files.names, listed) if isinstance(listed, str) else [str(name) for name in listed or []]
    paired = pair(names, poses)  # a token's regular expression is not run: it may take for ever
    target = _target(spec.get("target"), "kind")
    return ImportedSet("dataset_spec", poses.take(paired.rows), paired.images, paired.words, target=target)


def _poses_of_spec(files: Files, spec: dict[str, Any]) -> PoseTable:
    source, stated = spec.get("robot_poses"), spec.get("pose_convention")
    if not isinstance(source, dict) or not isinstance(stated, dict):
        raise refusal(SPEC, "robot_poses", "no robot_poses with a pose_convention", "add both", "dataset_spec")
    rotation = ROTATIONS.get(str(stated.get("rotation_format")))
    if rotation is None or stated.get("translation_units") not in ("m", "mm"):
        what = f"rotation {stated.get('rotation_format')!r} in {stated.get('translation_units')!r}"
        raise refusal(SPEC, "pose_convention", what, f"one of {', '.join(ROTATIONS)} in m or mm", "dataset_spec")
    name, columns, field = str(source.get("path")), source.get("columns"), source.get("matrix_field")
    content, wanted = files.read(name), [str(field)]
    if isinstance(columns, dict):
        turn = [str(one) for one in columns.get("rotation") or []]
        wanted = turn if len(turn) == 16 else [str(columns.get(key)) for key in ("tx", "ty", "tz")] + turn
    if not isinstance(columns, dict) and not isinstance(field, str):
        table = read_poses(name, content)
    else:
        if name.endswith((".json", ".jsonl")):
            records = read_json_lines(content, name) if name.endswith("l") else read_json(content, name)
        else:
            rows = rows_of(decode(content, name).splitlines())
            records = [dict(zip(rows.names or (), cells, strict=False)) for cells in rows.cells]
        found = array_of([[one.get(key) if isinstance(one, dict) else None for key in wanted] for one in records])
        if found is None or (field and found[0].size != 16):
            what = f"not all have {', '.join(wanted)}" + (" as a 4 x 4 matrix" if field else " as numbers")
            raise refusal(name, "records", what, "correct it", "dataset_spec")
        table = table_of_rows(name, found.reshape(len(found), -1))
    if table.kind != CONVENTIONS[rotation].kind:
        what = f"the poses are {table.layout}, not {stated.get('rotation_format')}"
        raise refusal(SPEC, "pose_convention.rotation_format", what, "make them agree", "dataset_spec")
    inverted = str(stated.get("transform")) in ("t_tcp_base", "t_tcp_world")
    return replace(
        table, convention=CONVENTIONS[rotation], by_axis=False, unit=stated["translation_units"],
        frame="flange_T_base" if inverted else "base_T_flange", camera=None,
    ).checked()  # fmt: skip


OWN = ("session.json", "scan.json")


def _own(files: Files, part: str | None) -> ImportedSet:
    """A session or scan of ours, imported again to change or check what it states of its poses."""
    name = next(name for name in files.names if name in OWN)
    data = read_json(files.read(name), name)
    views = data.get("views") if isinstance(data, dict) else None
    if not isinstance(views, list) or not views or not all(isinstance(view, dict) for view in views):
        raise refusal(name, "views", "no list of views", "give one record for each view", name.replace(".", ""))
    for key in ("corners_px", "points_mm"):  # solved as it is
        if key in views[0]:
            fix = f"run handeyed solve {files.origin}"
            raise refusal(files.origin, name, f"a session with {key}", fix, "own-files")
    poses = table_of_data([view.get("base_T_flange") for view in views], name)
    in_mm = "translation_mm" in poses.layout or len(poses.units()) > 1
    poses = replace(poses, unit="mm" if in_mm else poses.unit, frame=poses.frame or "base_T_flange", side="robot")
    setup = setup_of(data)
    if "camera_T_target" in views[0]:
        seen = table_of_data([view.get("camera_T_target") for view in views], name)
        seen = replace(seen, unit="mm" if "translation_mm" in seen.layout else seen.unit, side=None)
        return ImportedSet("samples of pose pairs", poses, pairing=f"by {name}", camera_poses=seen, setup=setup)
    images = tuple(str(view.get("image") or view.get("cloud")) for view in views)
    units, camera = {view.get("unit") for view in views}, data.get("camera")
    return ImportedSet(
        "handeyed", replace(poses, images=images), images, f"by {name}", target=data.get("target"),
        camera=intrinsics_of(camera, name) if isinstance(camera, dict) else None, setup=setup,
        cloud_unit=next(iter(units)) if len(units) == 1 and units <= {"m", "mm"} else None,
    )  # fmt: skip


STATED: dict[str, tuple[str, Callable[[Files, str | None], ImportedSet]]] = {
    CONFIGURATION: ("industrial_calibration", _industrial_calibration),
    SPEC: ("dataset_spec", _dataset_spec),
    **dict.fromkeys(OWN, ("handeyed", _own)),
}
"""Files that state what stands in their folder, with the name of their kind."""


def read_set(files: Files, part: str | None, chosen: Chosen, arm: str | None = None) -> ImportedSet:
    """The set in a folder; with globs given it is read as any folder. `arm`: of joints. Raises DocumentError."""
    imported = _read_set(files, part, chosen)
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


def _read_set(files: Files, part: str | None, chosen: Chosen) -> ImportedSet:
    if chosen == Chosen():
        for name, (_, read) in STATED.items():
            if name in files.names:
                return read(files, part)
        for layout in LAYOUTS:
            if all(any(re.search(marker, name) for name in files.names) for marker in layout.markers):
                return layout.read(files, part)
    return read_folder(files, chosen, part)
