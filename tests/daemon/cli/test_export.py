"""`handeyed export FILE|ID --as FORMAT`."""

import errno
import json
import os
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.exports.formats import FORMATS, POSE_FORMATS
from calibration.documents.pose import PoseDocument
from calibration.transforms import difference
from daemon.cli.output import write_whole
from tests.calibration.documents.exports.readers import READERS
from tests.calibration.documents.exports.some_poses import POSES
from tests.daemon.cli.running import handeyed

VERSION_1 = Path(__file__).parents[2] / "calibration" / "documents" / "calibration_version_1.json"


def planned(folder: Path) -> Path:
    """What `handeyed plan --json` prints."""
    poses = [{"base_T_flange": PoseDocument.of(pose).model_dump(), "target_in_view": 1.0} for pose in POSES]
    predicted = {"point_mm": 0.1, "translation_mm": [0.1] * 3, "rotation_deg": [0.01] * 3}
    file = folder / "planned.json"
    file.write_text(json.dumps({"poses": poses, "predicted": predicted}))
    return file


def test_a_file_is_exported_to_a_file_and_to_standard_output(tmp_path: Path) -> None:
    known = CalibrationDocument.model_validate_json(VERSION_1.read_bytes())
    assert known.flange_T_camera is not None
    for name in ("opencv", "gltf", "kuka"):
        ran = handeyed("export", VERSION_1, "--as", name, "--out", tmp_path / name)
        assert (ran.status, ran.out, ran.err) == (0, "", "")
        apart_mm, _ = difference(READERS[name]((tmp_path / name).read_bytes()), known.flange_T_camera.transform())
        assert apart_mm < 2e-4
    assert handeyed("export", VERSION_1, "--as", "kuka").out == (tmp_path / "kuka").read_text()


def test_a_full_disk_leaves_the_file_that_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk says so when it is asked to keep what was written."""
    out, of_another = tmp_path / "tcp.mod", tmp_path / ".tcp.mod.part"
    for file in (out, of_another):
        file.write_text("the one before")
    monkeypatch.setattr(os, "fsync", _failing(errno.ENOSPC))

    ran = handeyed("export", VERSION_1, "--as", "rapid", "--out", out)

    assert (ran.status, "cannot be written (no space left" in ran.err) == (1, True)
    assert {one.name: one.read_text() for one in tmp_path.iterdir()} == dict.fromkeys(
        ("tcp.mod", ".tcp.mod.part"), "the one before"
    )


def _failing(code: int) -> Callable[..., None]:
    def fail(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    return fail


def test_a_file_that_is_replaced_keeps_its_mode_and_owner(tmp_path: Path) -> None:
    out = tmp_path / "tcp.mod"
    out.write_text("the one before")
    out.chmod(0o640)
    if os.geteuid() == 0:
        os.chown(out, 1234, 1234)
    before = out.stat()
    write_whole(out, b"new")
    after = out.stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert (out.read_bytes(), after.st_ino == before.st_ino) == (b"new", False)


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM, errno.EBUSY, errno.EROFS])
def test_where_nothing_can_be_renamed_the_file_is_written_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    """A folder that is not writable, a sticky one, a file that is mounted alone into a container."""
    out = tmp_path / "tcp.mod"
    out.write_text("the one before")
    monkeypatch.setattr(Path, "replace", _failing(code))
    write_whole(out, b"new")
    assert [(one.name, one.read_bytes()) for one in tmp_path.iterdir()] == [("tcp.mod", b"new")]


def test_a_file_of_two_names_is_written_under_both_and_one_with_a_long_name(tmp_path: Path) -> None:
    out, other, long = tmp_path / "tcp.mod", tmp_path / "other.mod", tmp_path / ("a" * 250)
    out.write_text("the one before")
    other.hardlink_to(out)
    for file in (out, long):
        write_whole(file, b"new")
    assert (out.read_bytes(), other.read_bytes(), long.read_bytes()) == (b"new",) * 3


def test_a_folder_is_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in (".", "/", tmp_path):
        ran = handeyed("export", VERSION_1, "--as", "rapid", "--out", folder)
        assert (ran.status != 0, "directory" in ran.err) == (True, True), ran.err


def test_a_link_and_a_device_are_written_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "link.mod").symlink_to("tcp.mod")
    assert handeyed("export", VERSION_1, "--as", "rapid", "--out", tmp_path / "link.mod").status == 0
    assert (tmp_path / "link.mod").is_symlink() and (tmp_path / "tcp.mod").read_bytes()
    assert handeyed("export", VERSION_1, "--as", "rapid", "--out", "/dev/null").status == 0


def test_without_a_format_they_are_listed() -> None:
    listed = handeyed("export", VERSION_1).out.splitlines()
    assert [line.split()[0] for line in listed] == [*FORMATS, *POSE_FORMATS]


def test_a_file_is_not_written_without_a_format(tmp_path: Path) -> None:
    ran = handeyed("export", VERSION_1, "-o", tmp_path / "out")
    assert (ran.status, ran.out) == (2, "")
    assert "no format is named: name one, as --as rapid" in ran.err
    assert not (tmp_path / "out").exists()


def test_planned_poses_go_into_the_settings_and_into_rapid(tmp_path: Path) -> None:
    arm = ("--robot", "IRB 1600-6/1.45")
    text = handeyed("export", planned(tmp_path), "--as", "poses-toml", *arm).out
    taught = tomllib.loads(text)["poses"]
    assert np.allclose([pose["translation_mm"] for pose in taught], POSES[:, :3, 3], atol=1e-4)
    assert all(len(pose["configuration"]) == 4 for pose in taught)
    assert "robtarget he_pose_3" in handeyed("export", planned(tmp_path), "--as", "rapid-robtarget", *arm).out
    refused = handeyed("export", planned(tmp_path), "--as", "rapid-robtarget")
    assert refused.status == 2
    assert "the arm is not known" in refused.err


@pytest.mark.parametrize(("tool", "status"), [("", 0), ("tGrip", 2)])
def test_poses_of_a_session_are_exported_where_they_are_the_flange_s(tool: str, status: int, tmp_path: Path) -> None:
    poses = [PoseDocument.of(pose).model_dump() for pose in POSES]
    views = [{"base_T_flange": pose, "camera_T_target": pose} for pose in poses]
    session = {"schema_version": 1, "poses_of": {"tool": tool, "base": ""}, "setup": "eye-in-hand", "views": views}
    (tmp_path / "session.json").write_text(json.dumps(session))
    ran = handeyed("export", tmp_path / "session.json", "--as", "rapid-robtarget", "--robot", "IRB 1600-6/1.45")
    assert ran.status == status, ran.err


def test_a_folder_stands_for_its_calibration_and_no_path_for_an_id(tmp_path: Path) -> None:
    (tmp_path / "calibration.json").write_bytes(VERSION_1.read_bytes())
    for what in (tmp_path, tmp_path / "calibration.json"):
        assert handeyed("export", what, "--as", "kuka", "-o", tmp_path / "out").status == 0
    ran = handeyed("export", tmp_path / "nowhere" / "result", "--as", "kuka")
    assert (ran.status, "no such file" in ran.err) == (2, True)
    ran = handeyed("export", VERSION_1, "--as", "kuka", "-o", tmp_path / "nowhere" / "out")
    assert (ran.status, "cannot be written (no such file" in ran.err) == (1, True)


def test_what_cannot_be_exported_is_refused(tmp_path: Path) -> None:
    assert handeyed("export", tmp_path / "nowhere.json", "--as", "csv").status == 2
    wrong = handeyed("export", VERSION_1, "--as", "halkon")
    assert wrong.status == 2
    assert "did you mean 'halcon'" in wrong.err
    assert handeyed("export", VERSION_1, "--as", "csv", "--child", "a b").status == 2
    assert handeyed("export", "some-id", "--as", "csv", "--url", "http://127.0.0.1:1").status == 1
