"""What a set holds, and the files that it is read from."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any, Protocol

from calibration.documents.imports.conventions import LengthUnit
from calibration.documents.imports.intrinsics import Intrinsics
from calibration.documents.imports.pairing import natural
from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.pose_table import PoseTable, concatenate
from calibration.documents.imports.refusal import refusal
from calibration.problem import Setup

PICTURES = frozenset((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm"))
CLOUDS = frozenset((".pcd", ".ply", ".npz"))


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


@dataclass(frozen=True, eq=False)
class ImportedSet:
    """The content of a set.

    images : pictures or clouds, one for each pose once `pairing` says how they were paired; else those of the folder.
    camera_poses : the target's pose in the camera, one for each pose, instead of images; a PoseTable of
        camera_T_target.
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


def read_one_each(files: Files, names: Sequence[str]) -> PoseTable:
    """One table of files with a pose each; one error when they are wrong alike. Raises DocumentError."""
    if not names:
        raise refusal(files.origin, "poses", "no files with poses", "give them by --poses")
    tables = [read_poses(name, files.read(name)) for name in names]
    return concatenate(tables, [PurePosixPath(name).stem for name in names], files.origin)
