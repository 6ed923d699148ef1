"""Profiles and paths from files: our own forms, a Gocator's export, and what is refused."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from registration.errors import PathError, ProfileError, RegistrationError
from registration.profiles.files import read_path, read_profiles
from tests.support.profile_files import write_npz

ROWS = "time,x_mm,z_mm\n0.5,1,10\n0.5,2,11\n0.6,1.5,12\n"
POSES = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,1,2,3,1,0,0,0\n0.1,2,2,3,0.8,0.6,0,0\n"
UNIFORM = (
    "Info\nCSV Version,Sensor Count\n2,1\nEnd\n\nProfile\nFrame Count,Column Count,X Offset,Y Offset,Z Offset\n"
    "2,3,0,0,0\n\nFrame,Source,Time,Encoder,Z Encoder,Inputs,Exposure,Y,Axis,-1.0,0.0,1.0\n"
    "0,0,10240,0,0,0,80,0,Z,5.0,,7.0\n0,0,10240,0,0,0,80,0,I,10,20,30\n1,0,20480,0,0,0,80,0,Z,5.5,6.5,7.5\nEnd\n"
)
RAW = (
    "Info\r\nCSV Version\r\n2\r\nEnd\r\nRawProfile\r\nFrame Count,Column Count,X Offset,Y Offset,Z Offset\r\n"
    "1,2,0,0,0\r\nFrame,Source,Time,Encoder,Z Encoder,Inputs,Exposure,Y,Axis,0,1\r\n"
    "0,0,1024,0,0,0,80,0,X,-1.5,2.5\r\n0,0,1024,0,0,0,80,0,Z,5.0,6.0\r\nEnd\r\n"
)


def written(folder: Path, name: str, text: str | bytes) -> Path:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_arrays_and_rows_are_the_same_profiles(tmp_path: Path) -> None:
    rows = read_profiles(written(tmp_path, "a.csv", ROWS))
    np.testing.assert_array_equal(rows.times_s, [0.5, 0.6])
    np.testing.assert_array_equal(rows.x_mm, [[1, 2], [1.5, np.nan]])
    np.testing.assert_array_equal(rows.z_mm, [[10, 11], [12, np.nan]])
    write_npz(tmp_path / "a.npz", rows)
    arrays = read_profiles(tmp_path / "a.npz")
    np.testing.assert_array_equal(arrays.z_mm, rows.z_mm)
    np.testing.assert_array_equal(read_profiles(tmp_path / "a.npz", "ms").times_s, rows.times_s * 1e-3)


def test_a_gocator_export_with_uniform_spacing(tmp_path: Path) -> None:
    block = read_profiles(written(tmp_path, "a.csv", UNIFORM), "us/1.024")
    np.testing.assert_allclose(block.times_s, [0.01, 0.02])
    np.testing.assert_array_equal(block.x_mm, [[-1, 0, 1]] * 2)
    np.testing.assert_array_equal(block.z_mm, [[5, np.nan, 7], [5.5, 6.5, 7.5]])


def test_a_gocator_export_of_point_clouds(tmp_path: Path) -> None:
    block = read_profiles(written(tmp_path, "a.csv", RAW), "us/1.024")
    np.testing.assert_allclose(block.times_s, [0.001])
    np.testing.assert_array_equal(block.x_mm, [[-1.5, 2.5]])
    np.testing.assert_array_equal(block.z_mm, [[5, 6]])


def test_a_path_is_read(tmp_path: Path) -> None:
    path = read_path(written(tmp_path, "path.csv", POSES))
    np.testing.assert_array_equal(path.times_s, [0, 0.1])
    np.testing.assert_allclose(path.base_T_flange[1, :3, 3], [2, 2, 3])


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", "x,z\n1,2\n", "first line"),
        ("a.csv", "time,x_mm,z_mm\n", "no rows"),
        ("a.csv", "time,x_mm,z_mm\n1,2\n", "rows have 2 numbers"),
        ("a.csv", "time,x_mm,z_mm\n1,2,three\n", "three"),
        ("a.csv", "time,x_mm,z_mm\n2,1,1\n1,1,1\n", "before the one"),
        ("a.csv", "Info\n2\nEnd\n", "no section"),
        ("a.csv", UNIFORM.replace("Axis", "Axle"), "no row with the names"),
        ("a.csv", UNIFORM.replace(",Z,", ",I,"), "axis Z"),
        ("a.npz", b"PK", "no .npz file"),
    ],
)
def test_what_is_no_file_of_profiles_is_refused_by_name(tmp_path: Path, name: str, content: str, said: str) -> None:
    with pytest.raises(ProfileError, match=said) as caught:
        read_profiles(written(tmp_path, name, content))
    assert caught.value.what.startswith("a.")


def packed(time: bytes, compression: int = zipfile.ZIP_STORED) -> bytes:
    """A .npz whose array of times is `time`."""
    numbers, archive = io.BytesIO(), io.BytesIO()
    np.save(numbers, np.ones((3, 4)))
    with zipfile.ZipFile(archive, "w", compression) as file:
        for name, content in (("time", time), ("x_mm", numbers.getvalue()), ("z_mm", numbers.getvalue())):
            file.writestr(f"{name}.npy", content)
    return archive.getvalue()


def headed(header: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + (len(header) + 1).to_bytes(2, "little") + header.encode() + b"\n"


@pytest.mark.parametrize(
    "content",
    [
        packed(headed("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000,), }")),
        packed(headed("{'descr': ('<f8', 'fortran_order': False, 'shape': (10,), ")),
        packed(headed("{'descr': (), 'fortran_order': False, 'shape': (1,), }")),
        packed(packed(b"")),
        packed(bytes(200), zipfile.ZIP_LZMA).replace(b"\x09\x04\x05\x00\x5d", b"\x09\x04\x05\x00\xff", 1),
    ],
    ids=["size", "open bracket", "no type", "an archive in an archive", "compressed"],
)
def test_a_damaged_array_is_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(ProfileError, match=r"a\.npz: no \.npz file"):
        read_profiles(written(tmp_path, "a.npz", content))


def test_a_gocator_export_of_another_order_or_of_too_many_values_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="has 1 values"):
        read_profiles(written(tmp_path, "a.csv", "Info\nEnd\nProfile\nAxis,Time,1\nZ\nEnd\n"))
    rows = "".join(f"{k},{k},Z,1\n" for k in range(1, 500))
    wide = "Info\nEnd\nProfile\nFrame,Time,Axis\n0,0,Z" + ",1" * 300_000 + "\n" + rows
    with pytest.raises(ProfileError, match="are too many"):
        read_profiles(written(tmp_path, "a.csv", wide))


@pytest.mark.parametrize("bad", ["0.8,0.6,0,0", "0.1,2,2"])
def test_what_is_no_path_is_refused_by_name(tmp_path: Path, bad: str) -> None:
    for replacement in ("0.8,0.7,0,0", "nan,0,0,0"):
        with pytest.raises(PathError, match=r"path\.csv"):
            read_path(written(tmp_path, "path.csv", POSES.replace(bad, replacement)))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(start=st.sampled_from([ROWS, UNIFORM, RAW, POSES]), at=st.integers(0, 300), junk=st.binary(max_size=12))
def test_damaged_files_are_read_or_refused(tmp_path: Path, start: str, at: int, junk: bytes) -> None:
    content = start.encode()[:at] + junk + start.encode()[at + len(junk) :]
    for name, read in (("a.csv", read_profiles), ("a.npz", read_profiles), ("a.csv", read_path)):
        try:
            read(written(tmp_path, name, content))
        except RegistrationError as error:
            assert error.what and error.fix
