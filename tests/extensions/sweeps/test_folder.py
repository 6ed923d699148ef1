"""A folder of sweeps by its profiles.json."""

import json
from pathlib import Path
from typing import Any

import pytest

from calibration.errors import DocumentError
from extensions.sweeps.mathematics.folder import read_profile_folder
from registration.errors import ProfileError, RegistrationError
from registration.profiles.profile_block import ProfileBlock
from tests.support.profile_files import write_npz


def write_profiles_json(folder: Path, **change: Any) -> None:
    document = {"schema_version": 1, "time_unit": "s", "sweeps": [{"profiles": "a.npz", "path": "a.csv"}]}
    (folder / "profiles.json").write_text(json.dumps(document | change))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"sweeps": []}, ProfileError),
        ({"sweeps": [{"profiles": "../a.npz", "path": "a.csv"}]}, ProfileError),
        ({"sweeps": [{"profiles": "a.npz", "path": "a.csv", "artefact": "cube"}]}, ProfileError),
        ({"artefacts": [{"name": "a", "radius_mm": 1.0}, {"name": "a", "radius_mm": 2.0}]}, ProfileError),
        ({"time_unit": "h"}, DocumentError),
        ({"sweep": []}, DocumentError),
    ],
)
def test_a_folder_that_contradicts_itself_is_refused(tmp_path: Path, change: dict, error: type[Exception]) -> None:
    write_profiles_json(tmp_path, **change)
    with pytest.raises(error):
        read_profile_folder(tmp_path)


@pytest.mark.parametrize("name", ["a\0.npz", "a\ud800.npz", ".."])
def test_what_no_file_is_called_is_refused_when_it_is_read(tmp_path: Path, name: str) -> None:
    write_profiles_json(tmp_path, sweeps=[{"profiles": name, "path": "a.csv"}])
    (sweep,) = read_profile_folder(tmp_path)
    with pytest.raises(RegistrationError, match="cannot be read"):
        sweep.read()


def test_a_folder_names_a_missing_file_only_when_it_is_read(tmp_path: Path) -> None:
    write_profiles_json(tmp_path)
    (sweep,) = read_profile_folder(tmp_path)
    with pytest.raises(RegistrationError, match=r"a\.npz"):
        sweep.read()
    write_npz(tmp_path / "a.npz", ProfileBlock.of([0.0], [1.0], [[1.0]]))
    with pytest.raises(RegistrationError, match=r"a\.csv"):
        sweep.read()
