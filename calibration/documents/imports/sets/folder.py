"""Any folder: pictures or clouds, and poses in one file or one file a pose; the last of the kinds."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from calibration.documents.imports.intrinsics import Intrinsics, read_intrinsics
from calibration.documents.imports.pairing import natural, pair, shown
from calibration.documents.imports.pose_files import FAMILIES, read_poses
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import (
    CLOUDS,
    PICTURES,
    Files,
    ImportedSet,
    matching,
    of_suffix,
    read_one_each,
)
from calibration.errors import DocumentError

CAMERA_SUFFIXES = frozenset((".yaml", ".yml", ".xml", ".json"))
SHEETS = frozenset((".xlsx", ".xls", ".xlsm", ".ods"))
MAX_CANDIDATES = 2000
"""Files that are tried for poses when none are named."""


@dataclass(frozen=True)
class Chosen:
    """What the user names: globs of images, of poses and of the camera's poses of the target."""

    images: str | None = None
    poses: str | None = None
    camera_poses: str | None = None


def read(files: Files, chosen: Chosen) -> ImportedSet:
    """Poses and pictures of a folder, paired. Raises DocumentError."""
    poses = _poses(files, chosen.poses) if chosen.poses else find_poses(files)
    if chosen.camera_poses:
        return _pose_pairs(poses, _poses(files, chosen.camera_poses))
    images = _images(files, chosen.images)
    paired = pair(images, poses)
    return ImportedSet("folder", poses.take(paired.rows), paired.images, paired.words, camera=_camera(files))


def _pose_pairs(poses: PoseTable, seen: PoseTable) -> ImportedSet:
    if len(seen) != len(poses):
        what = f"{len(poses)} poses of the robot and {len(seen)} of the camera"
        raise refusal(poses.origin, "pairs", what, "give one of each for every view", "pairs")
    return ImportedSet("folder", poses, pairing="in the order of the files", camera_poses=seen)


def _images(files: Files, pattern: str | None) -> Sequence[str]:
    if pattern is not None:
        if found := matching(files.names, pattern):
            return found
        raise refusal(files.origin, "--images", f"no file fits {pattern}", "check the pattern", "pairs")
    images = of_suffix(files.names, PICTURES) or of_suffix(files.names, CLOUDS - {".npz"})
    folders = {str(PurePosixPath(name).parent) for name in images}
    if not images:
        raise refusal(files.origin, "images", "no pictures and no clouds", "name them by --images", "pairs")
    if len(folders) > 1:
        what = f"pictures in {len(folders)} folders ({shown(sorted(folders))})"
        raise refusal(files.origin, "images", what, "name those of the views: --images 'FOLDER/*'", "pairs")
    return images


def _poses(files: Files, pattern: str) -> PoseTable:
    names = matching(files.names, pattern)
    if not names:
        raise refusal(files.origin, "--poses", f"no file fits {pattern}", "check the pattern")
    return read_poses(names[0], files.read(names[0])) if len(names) == 1 else read_one_each(files, names)


def find_poses(files: Files) -> PoseTable:
    """The only poses of a folder: one file with several, or files with one each. Raises DocumentError."""
    several: list[PoseTable] = []
    single: dict[tuple[str, str], list[str]] = {}
    refused: list[tuple[str, DocumentError]] = []
    for name in [name for name in files.names if PurePosixPath(name).suffix.lower() in FAMILIES][:MAX_CANDIDATES]:
        try:
            table = read_poses(name, files.read(name))
        except DocumentError as error:
            refused.append((name, error))
            continue
        if len(table) > 1:
            if not any(_are_same(table, other) for other in several):
                several.append(table)
        else:
            path = PurePosixPath(name)
            stem = re.sub(r"\d+", "", path.stem)
            single.setdefault((f"{path.parent}/{stem}", path.suffix), []).append(name)
    groups = sorted((names for names in single.values() if len(names) > 1), key=len)
    if len(several) + len(groups) == 1:
        return several[0] if several else read_one_each(files, sorted(groups[0], key=natural))
    if several or groups:
        found = [table.origin for table in several] + [f"{names[0]} ..." for names in groups]
        what = f"poses in several files ({shown(found)})"
        raise refusal(files.origin, "poses", what, "name those of the robot by --poses")
    if refused:
        raise refused[0][1]
    sheets = [name for name in files.names if PurePosixPath(name).suffix.lower() in SHEETS]
    if sheets:
        raise refusal(sheets[0], "file", "poses are not read from a sheet", "save it as CSV")
    raise refusal(files.origin, "poses", "no file with poses", "name it by --poses")


def _are_same(one: PoseTable, other: PoseTable) -> bool:
    """Whether two files hold the same numbers, such as poses.txt and poses.npz."""
    if one.kind != other.kind or len(one) != len(other):
        return False
    pairs = ((one.lengths, other.lengths), (one.numbers, other.numbers))
    return all(np.allclose(mine, its, rtol=1e-5, atol=1e-6) for mine, its in pairs)


def _camera(files: Files) -> Intrinsics | None:
    """The only intrinsics in the folder."""
    found = []
    for name in of_suffix(files.names, CAMERA_SUFFIXES)[:MAX_CANDIDATES]:
        try:
            found.append(read_intrinsics(name, files.read(name)))
        except DocumentError:
            continue
    return found[0] if len(found) == 1 else None
