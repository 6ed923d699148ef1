"""Reads a folder of sweeps: profiles.json, and beside it a file of profiles and one of the path for each sweep."""

from dataclasses import dataclass
from pathlib import Path

from calibration.documents.validation import parse_document
from registration.documents import ProfilesDocument, TimeUnit
from registration.errors import ProfileError
from registration.io.durable_file import GuardedFile
from registration.profiles.files import read_path, read_profiles
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath

FILE = "profiles.json"
DOCUMENT_LIMIT = 1 << 24


@dataclass(frozen=True, eq=False)
class RecordedSweep:
    """One sweep of a folder; nothing is read before `read`. `artefact`: None of a part that is only registered."""

    name: str
    profiles: Path
    path: Path
    time_unit: TimeUnit
    artefact: str | None
    radius_mm: float | None

    def read(self) -> tuple[ProfileBlock, RobotPath]:
        """Raises CloudIOError, ProfileError, PathError."""
        return read_profiles(self.profiles, self.time_unit), read_path(self.path)


def read_profile_folder(folder: Path) -> list[RecordedSweep]:
    """The sweeps of a folder's profiles.json. Raises CloudIOError, DocumentError, ProfileError."""
    file = folder / FILE
    with GuardedFile.reading(file, str(file)) as opened:
        document = parse_document(ProfilesDocument, opened.read(min(DOCUMENT_LIMIT, file.stat().st_size)), str(file))
    radii = {artefact.name: artefact.radius_mm for artefact in document.artefacts}
    if len(radii) < len(document.artefacts):
        raise ProfileError(f"{file}: two artefacts have one name", "give each artefact a name of its own")
    if not document.sweeps:
        raise ProfileError(f"{file} has no sweeps", "add at least one")
    for index, sweep in enumerate(document.sweeps):
        for key, name in (("profiles", sweep.profiles), ("path", sweep.path)):
            if Path(name).name != name:
                raise ProfileError(f"{file}: sweeps[{index}].{key} leaves the folder", f"name a file beside {FILE}")
        if sweep.artefact is not None and sweep.artefact not in radii:
            what = f"{file}: sweeps[{index}].artefact {sweep.artefact!r} is not among the artefacts"
            raise ProfileError(what, "add it to artefacts, with radius_mm of a sphere, null of a plane")
    return [
        RecordedSweep(
            sweep.profiles, folder / sweep.profiles, folder / sweep.path, document.time_unit, sweep.artefact,
            None if sweep.artefact is None else radii[sweep.artefact],
        )
        for sweep in document.sweeps
    ]  # fmt: skip
