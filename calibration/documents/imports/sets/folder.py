"""Any folder: its pictures or clouds, the robot's poses, and the camera's where there are any, in whatever files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any, Protocol

from calibration.documents.imports.arrays import load_npy
from calibration.documents.imports.intrinsics import Intrinsics, read_intrinsics
from calibration.documents.imports.leaves import table_of_data
from calibration.documents.imports.pairing import natural, pair, shown
from calibration.documents.imports.pose_files import FAMILIES, read_poses
from calibration.documents.imports.pose_table import PoseTable, concatenate
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sides import equal_sides, relation_of, rows_as_pairs, with_relation
from calibration.errors import DocumentError
from calibration.kinematics.conventions import LengthUnit, Side
from calibration.problem import Setup

PICTURES = frozenset((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm"))
CLOUDS = frozenset((".pcd", ".ply", ".npz"))
CAMERA_SUFFIXES = frozenset((".yaml", ".yml", ".xml", ".json"))
SHEETS = frozenset((".xlsx", ".xls", ".xlsm", ".ods"))
MAX_CANDIDATES = 2000
"""Files that are tried for poses when none are named."""


class Files(Protocol):
    """The files of a folder: their names relative to it, with slashes, and their content."""

    @property
    def origin(self) -> str:
        """The folder's name, for messages."""
        ...

    @property
    def names(self) -> Sequence[str]:
        """Regular files, in natural order."""
        ...

    def read(self, name: str) -> bytes:
        """The content of a file. Raises DocumentError."""
        ...


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


def of_suffix(names: Sequence[str], suffixes: frozenset[str]) -> tuple[str, ...]:
    """The names with one of the suffixes."""
    return tuple(name for name in names if PurePosixPath(name).suffix.lower() in suffixes)


def matching(names: Sequence[str], pattern: str) -> tuple[str, ...]:
    """The names that a glob fits, whole or in their last part, in natural order."""
    found = [name for name in names if fnmatchcase(name, pattern) or fnmatchcase(PurePosixPath(name).name, pattern)]
    return tuple(sorted(found, key=natural))


def read_named(files: Files, names: Sequence[str]) -> PoseTable:
    """The table of a file, or of files with a pose each; one error when these are wrong alike. Raises DocumentError."""
    if not names:
        raise refusal(files.origin, "poses", "no files with poses", "give them by --poses")
    tables = [read_poses(name, files.read(name)) for name in names]
    paths = [PurePosixPath(name) for name in names]
    labels = [path.stem for path in paths]
    labels = labels if len(set(labels)) == len(labels) else [path.parent.name for path in paths]
    return tables[0] if len(tables) == 1 else concatenate(tables, labels, files.origin)


def read(files: Files, chosen: Chosen, part: str | None = None) -> ImportedSet:
    """Poses and pictures of a folder, paired; or pairs of poses. `part`: the robot's frame, where records have several.

    Raises DocumentError.
    """
    poses = _poses(files, chosen.poses, "robot") if chosen.poses else find_poses(files, chosen.camera_poses)
    if poses.parts:
        if part not in poses.parts:
            what = f"poses of {len(poses.parts)} moving frames ({', '.join([*poses.parts][:12])})"
            raise refusal(poses.origin, "records", what, "name the one that carries the camera or target: --part FRAME")
        poses = replace(poses.parts[part], parts=poses.parts)
    if chosen.camera_poses:
        camera = _poses(files, chosen.camera_poses, "camera")
        poses = replace(poses, side="robot" if chosen.poses else poses.side, camera=camera)
    paired, notes, pictures = None, tuple[str, ...](), tuple[str, ...]()
    try:
        pictures = () if chosen.camera_poses and not chosen.images else tuple(_images(files, chosen.images))
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
        raise refusal(poses.origin, "pairs", what, "give one of each for every view", "pairs")
    if seen is not None and not pictures:
        words = "in the order of the files" if chosen.camera_poses else f"by {poses.origin}"
        return ImportedSet(
            "samples of pose pairs", poses, pairing=words, camera_poses=seen, setup=poses.setup, notes=notes
        )
    if paired is None:
        raise refusal(files.origin, "images", "no pictures and no clouds", "name them by --images", "pairs")
    taken = poses.take(paired.rows)
    return ImportedSet(
        "folder", taken, paired.images, paired.words, taken.camera, None, cameras[0] if len(cameras) == 1 else None,
        poses.setup,
    )  # fmt: skip


def _images(files: Files, pattern: str | None) -> Sequence[str]:
    """The pictures or clouds; none where the folder has none."""
    if pattern is not None:
        if found := matching(files.names, pattern):
            return found
        raise refusal(files.origin, "--images", f"no file fits {pattern}", "check the pattern", "pairs")
    images = of_suffix(files.names, PICTURES) or of_suffix(files.names, CLOUDS - {".npz"})
    folders = {str(PurePosixPath(name).parent) for name in images}
    of_views = len(folders) == len(images) and len({PurePosixPath(name).name for name in images}) == 1
    if len(folders) > 1 and not of_views:
        what = f"pictures in {len(folders)} folders ({shown(sorted(folders))})"
        raise refusal(files.origin, "images", what, "name those of the views: --images 'FOLDER/*'", "pairs")
    return images


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
    candidates = [name for name in files.names if PurePosixPath(name).suffix.lower() in FAMILIES and name not in others]
    for name in candidates[:MAX_CANDIDATES]:
        try:
            table = read_poses(name, files.read(name))
        except DocumentError as error:
            refused.append((name, error))
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
        return _named_by(*next(iter(several.items())), "robot")
    if both := _both_sides(several):
        return both
    if several:
        what = f"poses in several files ({shown([*several])})"
        raise refusal(files.origin, "poses", what, "name those of the robot by --poses")
    arrays = {
        PurePosixPath(name).stem: load_npy(files.read(name), name) for name in candidates if name.endswith(".npy")
    }
    if len(arrays) > 1:
        return table_of_data(arrays, files.origin)
    if (both := _both_sides(points)) is not None:
        return both
    refused += [(name, refusal(name, "rows", "3 numbers a row: points of one side", "give poses")) for name in points]
    lone = [names[0] for names in single.values() if len(names) == 1]
    refused += [
        (name, refusal(name, "poses", "one pose only", "give one of each picture, three or more")) for name in lone
    ]
    raise _nearest(files, refused)


def _both_sides(tables: dict[str, PoseTable]) -> PoseTable | None:
    """The robot's table with the camera's, of two files, or of files with one pose each in two groups, whose names or
    columns say whose they are; else None."""
    counts = {*map(len, tables.values())}
    if len(tables) != 2 or len(counts) > 1 or any(one.camera is not None for one in tables.values()):
        return None
    by_side = {}
    for name, table in tables.items():
        named = _named_by(name, table)
        by_side[named.side] = named
    if len(by_side) != 2 or "camera" not in by_side:
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
    ranked = []
    for name, error in refused:
        is_intrinsics = (
            PurePosixPath(name).suffix.lower() in CAMERA_SUFFIXES and find_intrinsics(files, name) is not None
        )
        likely = bool(re.search(r"pose|robot|tcp|arm|joint|flange|hand|sample|pair", name, re.IGNORECASE))
        if not is_intrinsics:
            ranked.append((not likely, error))
    if ranked:
        return min(ranked, key=lambda one: one[0])[1]
    sheets = [name for name in files.names if PurePosixPath(name).suffix.lower() in SHEETS]
    if sheets:
        return refusal(sheets[0], "file", "poses are not read from a sheet", "save it as CSV")
    texts = [name for name in files.names if PurePosixPath(name).suffix.lower() not in PICTURES | CLOUDS]
    what = "no file with poses" + (f" among {shown(texts)}" if texts else "")
    return refusal(files.origin, "poses", what, "name it by --poses")


def find_intrinsics(files: Files, name: str) -> Intrinsics | None:
    """The intrinsics of a file; None where it holds none."""
    try:
        return read_intrinsics(name, files.read(name))
    except DocumentError:
        return None
