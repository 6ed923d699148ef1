"""Profiles that were taken while the arm stood: a file of points (x, z) for each pose beside one file of the poses."""

from pathlib import Path

import numpy as np

from calibration.documents.imports.leaves import array_of
from calibration.documents.imports.number_tables import words_of
from calibration.documents.imports.pairing import natural, pair
from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.pose_table import PoseTable, find_conventions
from calibration.documents.imports.refusal import decode
from calibration.documents.imports.text_tables import rows_of
from calibration.documents.imports.trees import read_yaml
from calibration.errors import DocumentError, GeometryError
from calibration.transforms import Array
from extensions.sweeps.mathematics.profiler import ArtefactSweep
from registration.errors import CloudIOError, ProfileError
from registration.io.regular_file import read_regular
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath

SUFFIXES = (".csv", ".tsv", ".txt", ".yml", ".yaml", ".ls", ".src", ".mod")
FACES = ("left face", "right face")
MAX_FILE_BYTES = 16_000_000
MAX_COLUMNS = 4
"""A profile has x and z, perhaps y and a brightness; a pose has more numbers."""

MAX_Z_MM = 5_000.0
"""No line profiler measures farther; its makers mark missing points by numbers such as -10000."""


def read_standing_profiles(folder: Path, artefact: str, convention: str | None = None) -> list[ArtefactSweep]:
    """One sweep of one profile at each pose; of `edge` two, of its faces. `artefact`: sphere:RADIUS_MM, plane or edge.

    Raises CloudIOError, ProfileError, DocumentError, GeometryError.
    """
    kind, _, radius = artefact.partition(":")
    radius_mm = float(radius) if kind == "sphere" and radius.replace(".", "", 1).isdecimal() else None
    if kind not in ("sphere", "plane", "edge") or (kind == "sphere") != (radius_mm is not None):
        raise ProfileError(f"{artefact!r} is no artefact", "give sphere:RADIUS with its radius in mm, plane, or edge")
    blocks: dict[str, ProfileBlock] = {}
    tables: list[PoseTable] = []
    refused: list[DocumentError] = []
    for file in sorted(folder.iterdir(), key=lambda one: natural(one.name)):
        if file.suffix.lower() not in SUFFIXES or file.is_symlink():
            continue
        try:
            content = read_regular(file, MAX_FILE_BYTES)
        except OSError as error:
            what = f"it cannot be read ({(error.strerror or str(error)).lower()})"
            raise CloudIOError(file.name, "file", what, "check path and rights") from None
        try:
            if (block := _profile(content, file.name)) is not None:
                blocks[file.name] = block
            else:
                tables.append(read_poses(file.name, content))
        except DocumentError as error:
            refused.append(error)
    if refused and not tables:
        raise refused[0]
    if len(tables) != 1 or not blocks:
        what = f"{folder.name}: {len(blocks)} files of profiles (x, z) and {len(tables)} of poses"
        raise ProfileError(what, "put one file of poses beside a .csv of x_mm, z_mm for each, or write profiles.json")
    paired = pair([*blocks], tables[0])
    poses = _poses(tables[0].take(paired.rows), convention)
    paths = [RobotPath.of([-1.0, 1.0], [pose, pose]) for pose in poses]
    named = [(blocks[name], path) for name, path in zip(paired.images, paths, strict=True)]
    if kind == "edge":
        return [ArtefactSweep(*one, name, None, face) for one in named for face, name in enumerate(FACES)]
    return [ArtefactSweep(*one, kind, radius_mm) for one in named]


def _profile(content: bytes, name: str) -> ProfileBlock | None:
    """The profile of a text of points, or of x, y, z in turn below `profile` of a FileStorage; None of other texts."""
    if name.lower().endswith((".yml", ".yaml")):
        data = read_yaml(content, name)
        listed = array_of(data.get("profile")) if isinstance(data, dict) else None
        if listed is None or listed.size % 3 or not listed.size:
            return None
        x, _, z = listed.reshape(-1, 3).T
        return ProfileBlock.of([0.0], x[None], np.where(np.abs(z) < MAX_Z_MM, z, np.nan)[None])
    found = rows_of(decode(content, name).splitlines())
    widths = {len(row) for row in found.cells}
    width = widths.pop() if len(widths) == 1 else 0
    axes = [(words_of(one) or [""])[0] for one in found.names or ["x", "y", "z"][:: 2 if width == 2 else 1]]
    if not 2 <= width <= MAX_COLUMNS or not {"x", "z"} <= {*axes}:
        return None
    cells = [[row[axes.index(axis)] for row in found.cells] for axis in "xz"]
    if any(isinstance(cell, str) for column in cells for cell in column):
        return None
    x, z = np.array(cells, float)
    with np.errstate(invalid="ignore"):
        z[~(np.abs(z) < MAX_Z_MM)] = np.nan
    return ProfileBlock.of([0.0], x[None], z[None])


def _poses(table: PoseTable, convention: str | None) -> list[Array]:
    """base_T_flange of each row. Raises ProfileError, GeometryError for a convention that is not known."""
    stated = None if convention is None else find_conventions(convention)[0]
    fitting = [one for one in table.conventions() if stated is None or table.convention is not None or one in stated]
    units = table.units()
    frames = (table.frame,) if table.frame else table.named_frames or ("base_T_flange",)
    if not len(fitting) == len(units) == len(frames) == 1:
        what = f"{len(fitting)} conventions, and in {len(frames)} directions by their names"
        fix = "give --convention, such as kuka, abb or euler-ZYX, the unit in the header, and a name as base_T_flange"
        raise ProfileError(f"{table.origin}: its poses ({table.layout}) may be meant in {what}", fix)
    try:
        return [*table.poses(fitting[0], units[0], frames[0])]
    except GeometryError as error:
        raise ProfileError(f"{table.origin}: {error}", "correct the poses, or give another --convention") from None
