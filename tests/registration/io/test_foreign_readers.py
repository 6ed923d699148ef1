"""Clouds written by us as foreign readers see them: every pair of formats, for points, colours and further columns."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from registration.errors import CloudFormatError
from registration.fusion.concatenation import PlacedCloud, merge_clouds
from registration.io.convert import move_file
from registration.io.formats.pcd import format_header
from registration.io.organised import read_organised
from registration.points.layout import COLOURS, Layout, Records
from registration.points.rigid_motion import RigidMotion
from tests.registration.clouds import BASE_T_CAMERA, moved
from tests.registration.io.cloud_files import read, write
from tests.support.cases import cases

Table = dict[str, NDArray[Any]]


def library(name: str) -> Any:
    return pytest.importorskip(name, reason=f"{name} is not installed: its format is not tested")


def by_plyfile(path: Path) -> Table:
    vertices = library("plyfile").PlyData.read(str(path))["vertex"].data
    return {name: vertices[name] for name in vertices.dtype.names}


def by_the_format(path: Path) -> Table:
    """A PCD of single numbers as its specification says, with PCL's packed colours."""
    head, _, body = path.read_bytes().partition(b"DATA binary\n")
    words = {line.split()[0]: line.split()[1:] for line in head.decode().splitlines()}
    kinds = [f"<{kind.lower()}{size}" for kind, size in zip(words["TYPE"], words["SIZE"], strict=True)]
    records = np.frombuffer(body, list(zip(words["FIELDS"], kinds, strict=True)))
    table = {name: records[name] for name in words["FIELDS"]}
    if "rgb" not in table:
        return {name.replace("normal_", "n"): column for name, column in table.items()}
    bits = table.pop("rgb").view(np.uint32)
    colours = {name: (bits >> shift & 255).astype(np.uint8) for name, shift in zip(COLOURS, (16, 8, 0), strict=True)}
    return {name.replace("normal_", "n"): column for name, column in table.items()} | colours


def by_laspy(path: Path) -> Table:
    cloud = library("laspy").read(str(path))
    return {name: np.asarray(cloud[name]) for name in ("x", "y", "z", *cloud.point_format.dimension_names)}


def by_pye57(path: Path) -> Table:
    file = library("pye57").E57(str(path))
    held = file.get_header(0).point_fields
    scan = file.read_scan(0, ignore_missing_fields=True, intensity="intensity" in held, colors="colorRed" in held)
    file.close()
    names = {f"cartesian{axis}": axis.lower() for axis in "XYZ"}
    names |= {f"color{colour.title()}": colour for colour in COLOURS}
    return {names.get(name, name): column * (1e3 if "cartesian" in name else 1) for name, column in scan.items()}


def by_numpy(path: Path) -> Table:
    records = np.load(path)
    if records.dtype.names is None:  # points only
        return dict(zip("xyz", records.T, strict=True))
    return {name: records[name] for name in records.dtype.names}


def by_genfromtxt(path: Path) -> Table:
    records = np.genfromtxt(path, names=True, delimiter="," if path.suffix == ".csv" else None)
    return {name: records[name] for name in records.dtype.names}


READERS: dict[str, Callable[[Path], Table]] = {
    ".ply": by_plyfile,
    ".pcd": by_the_format,
    ".las": by_laspy,
    ".laz": by_laspy,
    ".e57": by_pye57,
    ".npy": by_numpy,
    ".xyz": by_genfromtxt,
    ".csv": by_genfromtxt,
}
LAS = (".las", ".laz")
EIGHT_BITS = (".ply", ".pcd", ".e57")


def records(colours: str, far_mm: float, count: int = 500) -> tuple[Layout, Records]:
    """Points around `far_mm`, some not finite, with normals, colours of the type, intensity and a column more."""
    random = np.random.default_rng(41)
    names = [*((name, "<f8") for name in ("x", "y", "z")), *((name, "<f4") for name in ("nx", "ny", "nz"))]
    kinds = [*names, *((name, colours) for name in COLOURS), ("intensity", "<u2"), ("gps_time", "<f8"), ("fit", "<f4")]
    made = np.zeros(count, kinds)
    for name in ("x", "y", "z"):
        made[name] = far_mm + random.uniform(-500, 500, count)
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for axis, name in enumerate(("nx", "ny", "nz")):
        made[name] = normals[:, axis]
    most = np.iinfo(np.dtype(colours)).max
    for name in COLOURS:
        made[name] = random.integers(0, most, count, endpoint=True)
    made["intensity"], made["gps_time"], made["fit"] = (
        np.arange(count) * 100,
        np.arange(count) / 7,
        np.arange(count) / 3,
    )
    return Layout.of(made.dtype), made


@pytest.mark.parametrize("target", READERS)
@pytest.mark.parametrize("source", READERS)
@pytest.mark.parametrize(("colours", "far_mm"), [("u1", 0.0), ("<u2", 0.0), ("<u2", 7654.321)])
def test_a_foreign_reader_finds_what_was_written(
    tmp_path: Path, source: str, target: str, colours: str, far_mm: float
) -> None:
    layout, made = records(colours, far_mm)
    if source in (".ply", ".npy", ".xyz", ".csv"):
        made["x"][7] = np.nan
    if source in (".xyz", ".csv"):
        colours, layout = "u1", records("u1", far_mm)[0]
        made = made if made.dtype == layout.dtype else _with_eight_bits(made, layout)
    if source in EIGHT_BITS and colours != "u1":
        made, layout = _with_eight_bits(made, records("u1", far_mm)[0]), records("u1", far_mm)[0]
    write(tmp_path / f"in{source}", layout, made)
    merged = merge_clouds([PlacedCloud(tmp_path / f"in{source}", *_placed(source))], tmp_path / f"out{target}")

    sound = made[np.isfinite(made["x"])]
    table = READERS[target](tmp_path / f"out{target}")
    found = np.stack([np.asarray(table[name], float) for name in ("x", "y", "z")], axis=1)
    np.testing.assert_allclose(found, moved(sound), rtol=0, atol=0.01)
    kept = set(table) | {name.removesuffix("_as_read") for name in table}
    assert set(merged.columns_lost) | kept >= set(_held_by(source)), "a column is neither kept nor named as lost"
    assert not set(merged.columns_lost) & set(table)
    if {"nx", "ny", "nz"} <= set(table):
        turned = np.stack([sound[name] for name in ("nx", "ny", "nz")], axis=1) @ BASE_T_CAMERA[:3, :3].T
        np.testing.assert_allclose(np.stack([table[n] for n in ("nx", "ny", "nz")], axis=1), turned, atol=1e-6)
    for name in ("intensity", "gps_time", "fit"):
        if name in table and name in _held_by(source):
            column = table.get(f"{name}_as_read", table[name])
            np.testing.assert_allclose(column, sound[name], rtol=1e-6, err_msg=name)
    for name in COLOURS:
        share = sound[name] / np.iinfo(sound[name].dtype).max
        most = 65535 if target in LAS or np.max(table[name]) > 255 else 255
        assert target not in EIGHT_BITS or table[name].dtype == np.uint8, "Open3D and others take bytes only"
        np.testing.assert_allclose(table[name] / most, share, atol=0.51 / 255, err_msg=name)


def _with_eight_bits(made: Records, layout: Layout) -> Records:
    out = np.zeros(len(made), layout.dtype)
    for name in layout.dtype.names or ():
        out[name] = np.rint(made[name] / 257) if name in COLOURS and made.dtype[name] == np.uint16 else made[name]
    return out


def _placed(source: str) -> tuple[str, Any]:
    return "m" if source == ".e57" else "mm", BASE_T_CAMERA


def _held_by(source: str) -> tuple[str, ...]:
    held = ("x", "y", "z", *COLOURS, "intensity")
    return held if source == ".e57" else (*held, "nx", "ny", "nz", "gps_time", "fit")


@pytest.mark.parametrize("kinds", [(".las", ".las"), (".laz", ".las"), (".las", ".laz"), (".laz", ".laz")])
@pytest.mark.parametrize("version", [("1.2", 2), ("1.2", 3), ("1.4", 7)])
def test_las_of_another_writer_is_merged_into_las(
    tmp_path: Path, kinds: tuple[str, str], version: tuple[str, int]
) -> None:
    laspy = library("laspy")
    theirs = laspy.create(file_version=version[0], point_format=version[1])
    theirs.header.scales = [0.001] * 3
    theirs.x, theirs.y, theirs.z = (np.arange(1, 301) / share for share in (3, 5, 7))
    theirs.classification, theirs.red = np.arange(300) % 32, np.arange(300) * 200
    theirs.return_number, theirs.intensity = np.full(300, 3), np.arange(300)
    file = tmp_path / f"in{kinds[0]}"
    theirs.write(str(file))
    merged = merge_clouds([PlacedCloud(file, "mm", np.eye(4))] * 2, tmp_path / f"out{kinds[1]}")
    ours = laspy.read(str(tmp_path / f"out{kinds[1]}"))
    assert merged.points == 600 and merged.columns_lost == ()
    for name in theirs.point_format.dimension_names:
        if name not in ("X", "Y", "Z"):
            np.testing.assert_array_equal(np.asarray(ours[name])[:300], np.asarray(theirs[name]), err_msg=name)


@pytest.mark.parametrize(
    ("text", "colours"),
    [
        ("1.5 2 3 0 0 0\n4 5 6 200 100 50\n", [[0, 200], [0, 100], [0, 50]]),
        ("1.5,2,3,9,8,7\n4,5,6,255,100,50\n", [[9, 255], [8, 100], [7, 50]]),
        ("1.5 2 3 0 0 1\n4 5 6 0 1 0\n", None),
        ("1.5 2 3 0.5 0.5 0.7\n4 5 6 0 1 0\n", None),
        ("1.5 2 3 9 8 7\n4 5 6 256 1 0\n", None),
    ],
    ids=["colours", "commas", "normals", "fractions", "beyond a byte"],
)
def test_six_columns_without_names_are_colours_where_they_are_bytes(
    tmp_path: Path, text: str, colours: list[list[int]] | None
) -> None:
    (tmp_path / "in.xyz").write_text(text)
    merge_clouds([PlacedCloud(tmp_path / "in.xyz", "mm", np.eye(4))], tmp_path / "out.ply")
    table = by_plyfile(tmp_path / "out.ply")
    assert ("red" in table) == (colours is not None)
    if colours is not None:
        assert [table[name].tolist() for name in COLOURS] == colours


@pytest.mark.parametrize(
    ("held", "limits", "colours"),
    [
        ((0, 255), (0, 255), [0, 51, 255]),
        ((0, 65535), (0, 65535), [0, 13107, 65535]),
        ((0, 65535), None, [0, 13107, 65535]),
        ((0, 1023), (100, 1000), [100, 280, 1000]),
        (None, (0.0, 1.0), [0.0, 0.2, 1.0]),
        (None, None, [0.0, 51.0, 255.0]),
    ],
    ids=["bytes", "16 bits", "16 bits without limits", "limits of its own", "shares", "floats without limits"],
)
def test_colours_of_an_e57_are_read_against_its_limits(
    tmp_path: Path, held: tuple[int, int] | None, limits: tuple[float, float] | None, colours: list[float]
) -> None:
    pye57 = library("pye57")
    lib, file = pye57.libe57, pye57.E57(str(tmp_path / "in.e57"), mode="w")
    image, scan = file.image_file, pye57.libe57.StructureNode(file.image_file)
    scan.set("guid", lib.StringNode(image, "{0}"))
    prototype, buffers, columns = lib.StructureNode(image), lib.VectorSourceDestBuffer(), []
    for name in (*(f"cartesian{axis}" for axis in "XYZ"), *(f"color{colour.title()}" for colour in COLOURS)):
        whole = held is not None and name.startswith("color")
        prototype.set(name, lib.IntegerNode(image, 0, *held) if whole else lib.FloatNode(image, 0.0))
        columns.append(np.array(colours if name.startswith("color") else [1.0, 2.0, 3.0], np.float64))
        buffers.append(lib.SourceDestBuffer(image, name, columns[-1], 3, True, True))
    points = lib.CompressedVectorNode(image, prototype, lib.VectorNode(image, True))
    scan.set("points", points)
    if limits is not None:
        node = lib.StructureNode(image)
        for colour in COLOURS:
            node.set(f"color{colour.title()}Minimum", lib.FloatNode(image, float(limits[0])))
            node.set(f"color{colour.title()}Maximum", lib.FloatNode(image, float(limits[1])))
        scan.set("colorLimits", node)
    file.data3d.append(scan)
    writer = points.writer(buffers)
    writer.write(3)
    writer.close()
    file.close()
    merge_clouds([PlacedCloud(tmp_path / "in.e57", "m", np.eye(4))], tmp_path / "out.las")
    assert by_laspy(tmp_path / "out.las")["red"].tolist() == [0, 51 * 257, 65535]


def test_an_e57_declares_the_limits_of_what_it_holds(tmp_path: Path) -> None:
    """By which its readers scale: an intensity of 16 bits is not cut at 1 or 255."""
    layout, made = records("u1", 0.0)
    write(tmp_path / "in.ply", layout, made)
    merge_clouds([PlacedCloud(tmp_path / "in.ply", "mm", np.eye(4))], tmp_path / "out.e57")
    file = library("pye57").E57(str(tmp_path / "out.e57"))
    node = file.get_header(0).node
    found = [node["intensityLimits"][f"intensity{end}"].value() for end in ("Minimum", "Maximum")]
    assert found == [0.0, float(made["intensity"].max())] and found[1] > 255
    assert [node["colorLimits"][f"colorGreen{end}"].value() for end in ("Minimum", "Maximum")] == [0.0, 255.0]
    file.close()


@pytest.mark.parametrize("target", READERS)
@pytest.mark.parametrize("shape", [(500,), (20, 25)], ids=["in a row", "organised"])
def test_arrays_of_an_npz_are_kept_or_named(tmp_path: Path, target: str, shape: tuple[int, ...]) -> None:
    _, made = records("u1", 0.0)
    made["x"][7] = np.nan
    stacked = {
        key: np.stack([made[name] for name in names], axis=1).reshape(*shape, 3)
        for key, names in {"points": ("x", "y", "z"), "normals": ("nx", "ny", "nz"), "rgb": COLOURS}.items()
    }
    np.savez(tmp_path / "in.npz", **stacked, intensity=made["intensity"].reshape(shape), exposure=np.float64(3))
    merged = merge_clouds([PlacedCloud(tmp_path / "in.npz", "mm", BASE_T_CAMERA)], tmp_path / f"out{target}")
    table, sound = READERS[target](tmp_path / f"out{target}"), made[np.isfinite(made["x"])]
    found = np.stack([np.asarray(table[name], float) for name in ("x", "y", "z")], axis=1)
    np.testing.assert_allclose(found, moved(sound), rtol=0, atol=0.01)
    held = {"x", "y", "z", "nx", "ny", "nz", *COLOURS, "intensity"}
    assert held <= set(table) | set(merged.columns_lost), "a column is neither kept nor named as lost"
    np.testing.assert_array_equal(table["intensity"], sound["intensity"])
    for name in COLOURS:
        most = 257 if target in LAS else 1
        np.testing.assert_array_equal(table[name], sound[name].astype(int) * most, err_msg=name)


def test_a_damaged_npz_is_refused(tmp_path: Path) -> None:
    (tmp_path / "in.npz").write_bytes(b"PK\x03\x04" + bytes(60))
    with pytest.raises(CloudFormatError, match="this is no NPZ of arrays"):
        merge_clouds([PlacedCloud(tmp_path / "in.npz", "mm", np.eye(4))], tmp_path / "out.ply")
    np.savez(tmp_path / "in.npz", depth=np.ones((3, 3)))
    with pytest.raises(CloudFormatError, match=r"no array 'points' of .* among depth"):
        merge_clouds([PlacedCloud(tmp_path / "in.npz", "mm", np.eye(4))], tmp_path / "out.ply")


EXTRAS = {"gps_time": "<f8", "fit": "<f4", "label": "<i4", "classification": "u1", "flag": "i1"}
FARTHEST_MM = {".pcd": 19_000.0, ".las": 10_000.0, ".laz": 10_000.0}
"""Beyond this a format is refused, since it would lose digits."""


@st.composite
def any_clouds(draw: st.DrawFn, source: str, target: str) -> Records:
    """Records that the source can hold: any columns, any of them missing, NaN, and far from the origin."""
    colours = st.sampled_from([None, "u1"] if source in (*EIGHT_BITS, ".xyz", ".csv") else [None, "u1", "<u2"])
    kinds = [(name, draw(st.sampled_from(["<f4", "<f8"]))) for name in ("x", "y", "z")]
    kinds += [(name, "<f4") for name in ("nx", "ny", "nz")] if draw(st.booleans()) else []
    kinds += [(name, kind) for name in COLOURS] if (kind := draw(colours)) else []
    kinds += [("intensity", kind)] if (kind := draw(st.sampled_from([None, "u1", "<u2", "<f4"]))) else []
    kinds += [(name, EXTRAS[name]) for name in draw(st.lists(st.sampled_from(sorted(EXTRAS)), unique=True))]
    reach = min(FARTHEST_MM.get(source, 1e7), FARTHEST_MM.get(target, 1e7))
    far_mm = draw(st.sampled_from([mm for mm in (0.0, 5432.1, 654_321.123) if mm < reach]))
    random = np.random.default_rng(draw(st.integers(0, 1000)))
    made = np.zeros(draw(st.integers(2, 40)), kinds)
    for name in made.dtype.names or ():
        kind = made.dtype[name]
        whole = kind.kind in "ui"
        made[name] = random.integers(0, np.iinfo(kind).max, len(made)) if whole else random.uniform(0, 1, len(made))
    for name in ("x", "y", "z"):
        made[name] = far_mm + random.uniform(-500, 500, len(made))
    if source not in (*LAS, ".e57") and draw(st.booleans()):
        made["y"][0] = np.nan
    return made


def values_as_read(path: Path) -> dict[str, Any]:
    """The columns that the source's file holds, by their common names."""
    found = read(path, common=True)
    return {name: found[name] for name in found.dtype.names or ()}


@pytest.mark.parametrize("target", READERS)
@pytest.mark.parametrize("source", READERS)
@given(data=st.data())
@settings(max_examples=cases(5), deadline=None)
def test_any_cloud_comes_out_with_all_its_columns_or_their_names(
    tmp_path_factory: pytest.TempPathFactory, source: str, target: str, data: st.DataObject
) -> None:
    for name in ("laspy", "pye57"):
        library(name)
    folder, made = tmp_path_factory.mktemp("pair"), data.draw(any_clouds(source, target))
    write(folder / f"in{source}", Layout.of(made.dtype), made)
    before = values_as_read(folder / f"in{source}")
    sound = np.isfinite(np.stack([before[name] for name in ("x", "y", "z")])).all(axis=0)
    merged = merge_clouds([PlacedCloud(folder / f"in{source}", *_placed(source))], folder / f"out{target}")
    assert (merged.points, merged.non_finite) == (np.count_nonzero(sound), np.count_nonzero(~sound))
    table = READERS[target](folder / f"out{target}")
    before_mm = np.stack([before[name] for name in ("x", "y", "z")], axis=1)[sound].astype(float)
    before_mm *= 1e3 if source == ".e57" else 1
    expected = before_mm @ BASE_T_CAMERA[:3, :3].T + BASE_T_CAMERA[:3, 3]
    found = np.stack([np.atleast_1d(np.asarray(table[name], float)) for name in ("x", "y", "z")], axis=1)
    single = source == ".pcd" or target == ".pcd" or any(before[name].dtype.itemsize == 4 for name in ("x", "y", "z"))
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.003 + 2e-7 * single * np.abs(expected).max(initial=0))
    for name in before.keys() - {"x", "y", "z", "nx", "ny", "nz", *COLOURS}:
        renamed = f"{name}_as_read" in table and f"{name}_as_read" not in before
        held = f"{name}_as_read" if renamed else name if name in table else None
        assert (held is None) == (name in merged.columns_lost), f"{name} is neither kept nor named as lost, or both"
        if held is not None:
            np.testing.assert_allclose(np.atleast_1d(table[held]), before[name][sound], rtol=1e-6, err_msg=name)
    for name in before.keys() & set(COLOURS):
        most = 257 if target in LAS and before[name].dtype != np.uint16 else 1
        most = 1 / 257 if target in EIGHT_BITS and before[name].dtype == np.uint16 else most
        np.testing.assert_allclose(
            np.atleast_1d(table[name]), before[name][sound] * float(most), atol=0.51, err_msg=name
        )


@pytest.mark.parametrize("target", [".ply", ".pcd"])
@pytest.mark.parametrize("source", READERS)
def test_open3d_finds_points_colours_and_normals(tmp_path: Path, source: str, target: str) -> None:
    """Colours from 0 to 1; its normals are those of the file."""
    open3d = library("open3d")
    layout, made = records("u1", 0.0)
    write(tmp_path / f"in{source}", layout, made)
    merge_clouds([PlacedCloud(tmp_path / f"in{source}", *_placed(source))], tmp_path / f"out{target}")
    cloud = open3d.io.read_point_cloud(str(tmp_path / f"out{target}"))
    np.testing.assert_allclose(np.asarray(cloud.points), moved(made), rtol=0, atol=0.01)
    colours = np.stack([made[name] for name in COLOURS], axis=1) / 255
    np.testing.assert_allclose(np.asarray(cloud.colors), colours, atol=0.51 / 255)
    if "nx" in _held_by(source):
        turned = np.stack([made[name] for name in ("nx", "ny", "nz")], axis=1) @ BASE_T_CAMERA[:3, :3].T
        np.testing.assert_allclose(np.asarray(cloud.normals), turned, atol=1e-5)


@pytest.mark.parametrize("source", READERS)
def test_trimesh_finds_points_and_colours(tmp_path: Path, source: str) -> None:
    trimesh = library("trimesh")
    layout, made = records("u1", 0.0)
    write(tmp_path / f"in{source}", layout, made)
    merge_clouds([PlacedCloud(tmp_path / f"in{source}", *_placed(source))], tmp_path / "out.ply")
    cloud = trimesh.load(tmp_path / "out.ply")
    np.testing.assert_allclose(np.asarray(cloud.vertices), moved(made), rtol=0, atol=0.01)
    assert np.array_equal(np.asarray(cloud.colors)[:, :3], np.stack([made[name] for name in COLOURS], axis=1))


def test_an_organised_pcd_stays_one_where_it_is_moved_and_gives_its_points_where_it_is_merged(tmp_path: Path) -> None:
    made = np.zeros(20 * 25, [(name, "<f4") for name in ("x", "y", "z", "intensity")])
    for name in made.dtype.names or ():
        made[name] = np.random.default_rng(3).uniform(100, 900, len(made))
    made["z"][40:60] = np.nan
    header = format_header(Layout.of(made.dtype), len(made), rows=20)
    (tmp_path / "in.pcd").write_bytes(header + made.tobytes())
    move_file(tmp_path / "in.pcd", tmp_path / "out.pcd", RigidMotion.of(BASE_T_CAMERA, "mm"))
    cloud = read_organised(tmp_path / "out.pcd", "mm")
    assert cloud.points_mm.shape == (20, 25, 3)
    assert np.array_equal(np.isnan(cloud.points_mm[..., 0].ravel()), np.isnan(made["z"]))
    np.testing.assert_allclose(cloud.points_mm.reshape(-1, 3), moved(made), atol=1e-3)
    for target, reader in READERS.items():
        merge_clouds([PlacedCloud(tmp_path / "in.pcd", "mm", BASE_T_CAMERA)], tmp_path / f"merged{target}")
        table = reader(tmp_path / f"merged{target}")
        found = np.stack([np.asarray(table[name], float) for name in ("x", "y", "z")], axis=1)
        np.testing.assert_allclose(found, moved(made[np.isfinite(made["z"])]), atol=0.01)
