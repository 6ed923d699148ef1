"""`handeyed solve CAMERA SCANNER --together`: camera_T_scanner, its uncertainty, rig.json."""

import json
from pathlib import Path

import jsonschema_rs
import numpy as np
import pytest

from calibration.documents.rig import RigDocument
from calibration.transforms import difference, inverse, map_points, rotation_from_vector, transform
from tests.calibration.documents.file_schemas import schema_of
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import (
    FLANGE_T_CAMERA,
    TARGET,
    TILTS_RAD,
    camera_T_target,
    pose_json,
    session,
    with_corners,
)

CAMERA_T_SCANNER = transform(rotation_from_vector([0.3, 0.1, -0.4]), [-140.0, 25.0, 40.0])


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The camera's session, and the scanner's at the same stations."""
    root = tmp_path_factory.mktemp("rig")
    rng, views = np.random.default_rng(7), []
    for tilt in TILTS_RAD:
        seen = map_points(inverse(CAMERA_T_SCANNER) @ camera_T_target(tilt), TARGET.points_mm)
        seen += rng.normal(0.0, 0.05, seen.shape)
        views.append({"points_mm": [[at, *point] for at, point in enumerate(seen.tolist())],
                      "base_T_flange": pose_json(tilt)})  # fmt: skip
    scanner = root / "scanner"
    scanner.mkdir()
    document = session(views)
    del document["camera"]
    (scanner / "session.json").write_text(json.dumps(document))
    return with_corners(root / "camera"), scanner


def test_the_scanner_is_calibrated_beside_the_camera(folders: tuple[Path, Path], tmp_path: Path) -> None:
    ran = handeyed("solve", *folders, "--together", "--out", tmp_path)

    assert ran.status == 0, ran.err
    assert "camera + scanner  accepted" in ran.out
    assert "flange_T_scanner" in ran.out
    written = (tmp_path / "rig.json").read_text()
    jsonschema_rs.validator_for(schema_of("rig")).validate(json.loads(written))
    document = RigDocument.model_validate_json(written)
    (pair,) = document.relative
    off_mm, _ = difference(CAMERA_T_SCANNER, pair.a_T_b.transform())
    assert off_mm < 0.3
    assert 0 < pair.uncertainty.expanded_mm < 1
    assert document.shared_stations == len(TILTS_RAD)
    scanner = document.sensors[1]
    assert difference(FLANGE_T_CAMERA @ CAMERA_T_SCANNER, scanner.mount_T_sensor.transform())[0] < 0.5
    assert scanner.alone_expanded_mm is not None
    assert scanner.uncertainty.expanded_mm < 1.1 * scanner.alone_expanded_mm
    assert (tmp_path / "scanner" / "calibration.json").exists()


def test_one_folder_is_refused(folders: tuple[Path, Path]) -> None:
    ran = handeyed("solve", folders[0], "--together")
    assert ran.status == 2
    assert "--together: it needs two folders" in ran.err
