"""`handeyed solve` of organised clouds: a board found in the intensity, measured in the points."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from calibration.documents.calibration import TRANSFORM_NAMES, CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.problem import Setup
from calibration.transforms import Array, difference, inverse, rotation_from_vector, transform
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import (
    BASE_T_TARGET,
    CAMERA,
    FLANGE_T_CAMERA,
    TILTS_RAD,
    camera_T_target,
    picture,
    session,
)

X = {"eye-in-hand": FLANGE_T_CAMERA, "eye-to-hand": inverse(BASE_T_TARGET)}
"""mount_T_camera: in eye-to-hand the camera stands where the target stood, and the target is on the flange."""

Write = Callable[[Path, Array, NDArray[np.uint8]], None]


def seen(tilt_rad: tuple[float, float, float], rng: np.random.Generator) -> tuple[Array, NDArray[np.uint8]]:
    """Points (480, 640, 3) and intensity: the board's plane with noise, a hole, and points in the void behind it."""
    image = np.asarray(cv2.imdecode(np.frombuffer(picture(tilt_rad), np.uint8), cv2.IMREAD_GRAYSCALE), np.uint8)
    pose = camera_T_target(tilt_rad)
    v, u = np.mgrid[:480, :640]
    rays = np.concatenate([CAMERA.normalise(np.column_stack([u.ravel(), v.ravel()])), np.ones((u.size, 1))], axis=1)
    normal, origin = pose[:3, 2], pose[:3, 3]
    points = rays * ((normal @ origin) / (rays @ normal))[:, None]
    points += 0.02 * rng.standard_normal(points.shape) + 0.15 * rng.standard_normal((len(points), 1)) * rays
    points[rng.random(len(points)) < 0.02] += [0.0, 0.0, 80.0]
    points[rng.random(len(points)) < 0.05] = np.nan
    return points.reshape(480, 640, 3), image


def as_pcd(file: Path, points: Array, image: NDArray[np.uint8]) -> None:
    rows = np.zeros(image.size, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
    rows["x"], rows["y"], rows["z"] = (points / 1000).reshape(-1, 3).T
    rows["intensity"] = image.ravel() * 3.5
    height, width = image.shape
    header = (
        "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {image.size}\nDATA binary\n"
    )
    file.write_bytes(header.encode() + rows.tobytes())


def as_ply(file: Path, points: Array, image: NDArray[np.uint8], *, sized: bool = True) -> None:
    colours = [(name, "u1") for name in ("red", "green", "blue")]
    rows = np.zeros(image.size, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *colours])
    rows["x"], rows["y"], rows["z"] = points.reshape(-1, 3).T
    for name, _ in colours:
        rows[name] = image.ravel()
    height, width = image.shape
    size = f"obj_info num_cols {width}\nobj_info num_rows {height}\n" if sized else ""
    lines = "".join(f"property float {name}\n" for name in "xyz")
    lines += "".join(f"property uchar {name}\n" for name, _ in colours)
    header = f"ply\nformat binary_little_endian 1.0\n{size}element vertex {image.size}\n{lines}end_header\n"
    file.write_bytes(header.encode() + rows.tobytes())


def as_ply_without_size(file: Path, points: Array, image: NDArray[np.uint8]) -> None:
    as_ply(file, points, image, sized=False)


def as_npz(file: Path, points: Array, image: NDArray[np.uint8]) -> None:
    with file.open("wb") as content:
        np.savez(content, points=np.nan_to_num(points, nan=0.0), intensity=image.astype(np.uint16) * 16)


FORMATS: dict[str, tuple[Write, str, str]] = {
    "pcd": (as_pcd, ".pcd", "m"),
    "ply": (as_ply, ".ply", "mm"),
    "npz": (as_npz, ".npz", "mm"),
}


def folder_of(folder: Path, write: Write, suffix: str, unit: str, setup: Setup = "eye-in-hand") -> Path:
    folder.mkdir()
    rng = np.random.default_rng(8)
    on_flange = transform(rotation_from_vector([0.2, 0.1, -0.4]), [20.0, 30.0, 80.0])
    views: list[dict[str, Any]] = []
    for index, tilt in enumerate(TILTS_RAD):
        pose = camera_T_target(tilt)
        if setup == "eye-in-hand":
            base_T_flange = BASE_T_TARGET @ inverse(pose) @ inverse(FLANGE_T_CAMERA)
        else:
            base_T_flange = X[setup] @ pose @ inverse(on_flange)
        name = f"view_{index:03}{suffix}"
        write(folder / name, *seen(tilt, rng))
        flange = PoseDocument.of(base_T_flange).model_dump(mode="json")
        views.append({"cloud": name, "unit": unit, "base_T_flange": flange})
    document = {**session(views), "setup": setup}
    del document["camera"]
    (folder / "session.json").write_text(json.dumps(document))
    return folder


@pytest.mark.parametrize("setup", ["eye-in-hand", pytest.param("eye-to-hand", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("write", "suffix", "unit"), FORMATS.values(), ids=FORMATS)
def test_a_board_in_organised_clouds_gives_x(
    write: Write, suffix: str, unit: str, setup: Setup, tmp_path: Path
) -> None:
    ran = handeyed("solve", folder_of(tmp_path / "a", write, suffix, unit, setup), "--json")

    assert (ran.status, ran.err) == (0, ""), ran.out
    document = CalibrationDocument.model_validate_json(ran.out)
    off_mm, off_rad = difference(X[setup], getattr(document, TRANSFORM_NAMES[setup][0]).transform())
    assert off_mm < 0.5
    assert off_rad < 1e-3
    assert document.uncertainty is not None
    assert off_mm < 5 * document.uncertainty.point_mm
    noise = next(finding.message for finding in document.verdict.findings if finding.code == "points-noise")
    assert noise.startswith("measured points scatter by 0.0")


def test_a_ply_without_its_size_needs_it_from_the_session(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", as_ply_without_size, ".ply", "mm")
    refused = handeyed("solve", folder)
    assert refused.status == 2
    assert "width and height are not in the file: give image_size" in refused.err

    document = json.loads((folder / "session.json").read_text())
    (folder / "session.json").write_text(json.dumps({**document, "image_size": [640, 480]}))
    assert handeyed("solve", folder).status == 0


def test_a_cloud_without_the_board_is_named_and_left_out(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", as_npz, ".npz", "mm")
    points, image = seen(TILTS_RAD[2], np.random.default_rng(1))
    as_npz(folder / "view_002.npz", points, np.full_like(image, 90))
    ran = handeyed("solve", folder, "--json")

    assert "views[2]: the image has 0 grey levels" in ran.err
    document = CalibrationDocument.model_validate_json(ran.out)
    assert [view.index for view in document.views if view.status == "rejected"] == [2]


def test_a_board_without_points_is_named(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", as_npz, ".npz", "mm")
    points, image = seen(TILTS_RAD[2], np.random.default_rng(1))
    as_npz(folder / "view_002.npz", np.zeros_like(points), image)
    assert "have a cloud around them" in handeyed("solve", folder).err


LZMA_HEAD = b"\x09\x04\x05\x00\x5d"
"""Begins a member's LZMA stream; its last byte holds the parameters."""


def packed(array: bytes, compression: int = zipfile.ZIP_STORED) -> bytes:
    """An archive with one array."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", compression) as archive:
        archive.writestr("points.npy", array)
    return content.getvalue()


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"nothing", "this is no NPZ of arrays"),
        (b"", "this is no NPZ of arrays"),
        (packed(b"\x93NUMPY\x01\x00\x02\x00{\n"), "this is no NPZ of arrays"),
        (packed(bytes(200), zipfile.ZIP_LZMA).replace(LZMA_HEAD, LZMA_HEAD[:-1] + b"\xff"), "this is no NPZ of arrays"),
        (None, "No such file"),
    ],
)
def test_a_damaged_cloud_is_refused_by_its_name(content: bytes | None, what: str, tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", as_npz, ".npz", "mm")
    (folder / "view_001.npz").unlink()
    if content is not None:
        (folder / "view_001.npz").write_bytes(content)
    ran = handeyed("solve", folder)
    assert ran.status == 2
    assert "view_001.npz" in ran.err
    assert what in ran.err


@pytest.mark.parametrize("name", ["../view.npz", "/tmp/view.npz"])
def test_a_cloud_outside_the_folder_is_refused(name: str, tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "a", as_npz, ".npz", "mm")
    document = json.loads((folder / "session.json").read_text())
    document["views"][1]["cloud"] = name
    (folder / "session.json").write_text(json.dumps(document))
    assert "views[1].cloud" in handeyed("solve", folder).err
