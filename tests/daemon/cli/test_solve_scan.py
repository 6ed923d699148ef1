"""`handeyed solve SCAN_DIR --artefact ...`: X without a photograph, with the same output and exit statuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from calibration.transforms import Array, difference, inverse, map_points, rotation_from_vector, transform
from tests.daemon.calibrations import a_calibration
from tests.daemon.cli.running import handeyed
from tests.daemon.fakes import FLANGE_T_CAMERA, ply_of

pytestmark = pytest.mark.slow

RADIUS_MM = 25.4
CENTRE = np.array([850.0, 40.0, 260.0])
TURNS = ((0, 0, 0), (0.6, 0, 0.4), (-0.5, 0.3, -0.6), (0.1, 0.6, 1.2), (0.2, -0.6, -1.0), (-0.4, -0.4, 2.0))
OFFSETS = ((0, 0, 400), (70, 40, 430), (-80, 50, 380), (60, -70, 450), (-60, -60, 420), (20, 80, 360))


def flange_poses() -> list[Array]:
    """Turned about different axes, the sphere at different places of the picture."""
    down = rotation_from_vector([np.pi, 0, 0])
    poses = []
    for turn, offset in zip(TURNS, OFFSETS, strict=True):
        rotation = down @ rotation_from_vector(turn)
        base_T_camera = transform(rotation, CENTRE - rotation @ np.array(offset, float))
        poses.append(base_T_camera @ inverse(FLANGE_T_CAMERA))
    return poses


def sphere_from(base_T_camera: Array, rng: np.random.Generator) -> Array:
    """The half that looks at the camera, with 0.02 mm noise, in the camera's frame."""
    normals = rng.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centre = map_points(inverse(base_T_camera), CENTRE[None])[0]
    seen = normals[normals @ centre < -0.4 * np.linalg.norm(centre)]
    return centre + seen * (RADIUS_MM + rng.normal(0, 0.02, (len(seen), 1)))


def scan(folder: Path, views: int = 6) -> Path:
    folder.mkdir()
    rng = np.random.default_rng(2)
    documents = []
    for index, pose in enumerate(flange_poses()[:views]):
        (folder / f"view_{index}.ply").write_bytes(ply_of(sphere_from(pose @ FLANGE_T_CAMERA, rng)))
        told = PoseDocument.of(pose).model_dump(mode="json")
        documents.append({"cloud": f"view_{index}.ply", "unit": "mm", "base_T_flange": told})
    content = {"schema_version": 1, "source": "test", "setup": "eye-in-hand", "views": documents}
    (folder / "scan.json").write_text(json.dumps(content))
    return folder


def test_x_is_found_from_a_sphere_and_can_register_at_once(tmp_path: Path) -> None:
    folder, out = scan(tmp_path / "scan"), tmp_path / "calibration.json"
    ran = handeyed(
        "solve", folder, "--artefact", "sphere", "--radius-mm", str(RADIUS_MM), "--json", "--out", out
    )  # fmt: skip
    assert ran.status == 0, ran.out
    document = json.loads(ran.out)
    found = document["flange_T_camera"]
    np.testing.assert_allclose(found["translation_mm"], FLANGE_T_CAMERA[:3, 3], atol=0.2)
    assert document["verdict"]["accepted"]
    assert document["uncertainty"]["point_mm"] < 0.5
    assert json.loads(out.read_text()) == document
    assert handeyed("register", folder, "--calibration", out, "--out", tmp_path / "all.ply").status == 0


def test_views_that_do_not_fix_x_are_refused_without_a_transform(tmp_path: Path) -> None:
    ran = handeyed(
        "solve", scan(tmp_path / "scan", views=3), "--artefact", "sphere", "--radius-mm", str(RADIUS_MM), "--json"
    )
    document = json.loads(ran.out)
    assert ran.status == 3
    assert document["flange_T_camera"] is None
    assert document["verdict"]["findings"][0]["severity"] == "error"


def test_a_person_reads_the_same_summary_as_with_images(tmp_path: Path) -> None:
    folder = scan(tmp_path / "scan")
    ran = handeyed("solve", folder, "--artefact", "sphere", "--radius-mm", str(RADIUS_MM))
    assert ran.out.startswith(f"{folder}  accepted\n")
    assert "accuracy         U = " in ran.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--artefact", "sphere"), "--radius-mm: the sphere's radius is not given"),
        (("--artefact", "sphere", "--radius-mm", "-3"), "-3.0 mm is no radius"),
        (("--artefact", "sphere", "--radius-mm", "nan"), "nan mm is no radius"),
        (("--artefact", "cube"), "none is called 'cube'"),
        (("--artefact", "sphere", "--radius-mm", "20", "--rough", "x.json"), "--rough"),
        (("--radius-mm", "20"), "only a sphere has a radius"),
        (("--artefact", "sphere", "--radius-mm", "20", "--method", "kronecker"), "--method"),
    ],
)
def test_options_that_do_not_fit_are_reported(tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    ran = handeyed("solve", tmp_path, *options)
    assert (ran.status, ran.out) == (2, "")
    assert words in ran.err


def test_a_folder_that_is_no_scan_does_not_stop_the_next(tmp_path: Path) -> None:
    good = scan(tmp_path / "scan")
    ran = handeyed("solve", tmp_path / "no", good, "--artefact", "sphere", "--radius-mm", str(RADIUS_MM), "--json")
    assert ran.status == 2
    assert str(tmp_path / "no") in ran.err
    assert json.loads(ran.out)["flange_T_camera"] is not None


def test_a_rough_x_that_cannot_be_read_names_its_file(tmp_path: Path) -> None:
    rough = tmp_path / "rough.json"
    rough.write_text(a_calibration("c", solved=False).model_dump_json())
    ran = handeyed("solve", scan(tmp_path / "scan"), "--artefact", "none", "--rough", rough)
    assert ran.status == 2
    assert "no flange_T_camera" in ran.err


def part_scan(folder: Path, relief_mm: float, views: int = 7) -> Path:
    """Views of a panel, the robot erring by 0.2 mm."""
    folder.mkdir()
    documents, rng = [], np.random.default_rng(5)
    for index in range(views):
        down = rotation_from_vector([np.pi, 0, 0])
        turn = rotation_from_vector([0, 0, 0.5 * index]) @ rotation_from_vector(rng.normal(0, 0.25, 3))
        flange = transform(turn @ down, [*rng.normal(0, 15, 2), 400.0])
        x, y = rng.uniform(-60, 60, (2, 5000))
        z = relief_mm * (2 * np.sin(x / 23) * np.cos(y / 31) + np.sin(x / 9 + y / 17))
        seen = map_points(
            inverse(flange @ FLANGE_T_CAMERA), np.column_stack([x, y, z]) + rng.normal(0, 0.02, (5000, 3))
        )
        (folder / f"view_{index}.ply").write_bytes(ply_of(seen))
        erring = transform(flange[:3, :3], flange[:3, 3] + rng.normal(0, 0.2, 3))
        told = PoseDocument.of(erring).model_dump(mode="json")
        documents.append({"cloud": f"view_{index}.ply", "unit": "mm", "base_T_flange": told})
    content = {"schema_version": 1, "source": "test", "setup": "eye-in-hand", "views": documents}
    (folder / "scan.json").write_text(json.dumps(content))
    return folder


def rough_x(file: Path) -> Path:
    """A calibration 4 mm and a degree off."""
    off = FLANGE_T_CAMERA @ transform(rotation_from_vector([0.012, -0.01, 0.008]), [2.0, -3.0, 2.0])
    document = a_calibration("rough").model_copy(update={"flange_T_camera": PoseDocument.of(off)})
    file.write_text(document.model_dump_json())
    return file


def test_x_is_found_from_overlapping_views_of_any_part_and_registers_them(tmp_path: Path) -> None:
    folder, out, rough = part_scan(tmp_path / "scan", 6.0), tmp_path / "found.json", rough_x(tmp_path / "rough.json")
    ran = handeyed("solve", folder, "--artefact", "none", "--rough", rough, "--json", "--out", out)
    document = json.loads(ran.out)
    found, sigma_mm = document["flange_T_camera"], document["uncertainty"]["translation_mm"]
    off_mm = np.abs(np.array(found["translation_mm"]) - FLANGE_T_CAMERA[:3, 3])
    assert np.all(off_mm < 3 * np.array(sigma_mm)), (off_mm, sigma_mm)
    assert np.linalg.norm(off_mm) < 1.0, "the rough one is 4.1 mm off"
    assert ran.status == (0 if document["verdict"]["accepted"] else 3)
    assert "surfaces-agree" in [finding["code"] for finding in document["verdict"]["findings"]]
    before, after = [
        json.loads(
            handeyed("register", folder, "--calibration", file, "--out", tmp_path / "all.ply", "--json").out
        )["rms_mm"]["before"]
        for file in (rough, out)
    ]  # fmt: skip
    assert after < 0.5 * before


def test_x_is_found_without_a_rough_one(tmp_path: Path) -> None:
    folder, rough = part_scan(tmp_path / "scan", 6.0), rough_x(tmp_path / "rough.json")
    began_near = json.loads(handeyed("solve", folder, "--artefact", "none", "--rough", rough, "--json").out)
    searched = json.loads(handeyed("solve", folder, "--artefact", "none", "--json").out)

    near, found = (PoseDocument(**one["flange_T_camera"]).transform() for one in (began_near, searched))
    off_mm, off_rad = difference(near, found)
    assert off_mm < 0.3
    assert off_rad < np.radians(0.1)
    assert searched["verdict"]["accepted"] == began_near["verdict"]["accepted"]
    assert "surfaces-searched" in [finding["id"] for finding in searched["verdict"]["findings"]]


def test_three_views_of_a_plane_determine_no_x_and_say_so(tmp_path: Path) -> None:
    folder, rough = part_scan(tmp_path / "scan", 0.0, 3), rough_x(tmp_path / "rough.json")
    ran = handeyed("solve", folder, "--artefact", "none", "--rough", rough, "--json")
    document = json.loads(ran.out)
    assert (ran.status, document["flange_T_camera"]) == (3, None)
    assert document["verdict"]["findings"][0]["code"] == "surfaces-unobservable"
