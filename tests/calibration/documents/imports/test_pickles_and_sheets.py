"""Pickles, of which nothing is run, spreadsheets, and pictures that lie beside the poses in one file."""

import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.sets import Chosen, read_set
from calibration.errors import DocumentError
from calibration.transforms import Array
from tests.calibration.documents.imports.written import MM, POSES, VECTORS, WXYZ, Held, matrices, npz, sheet

PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)
PICTURES: Array = np.arange(3 * 48 * 64, dtype=np.uint8).reshape(3, 48, 64)

HELD: dict[str, Any] = {
    "a mapping of matrices": {"robot_pos": list(POSES), "camera_pos": list(POSES)},
    "records of lists, numbers and texts": [
        {"image": f"{at}.png", "position": tuple(place), "quaternion_wxyz": q.tolist(), "exposure_ms": np.float64(3.5)}
        for at, (place, q) in enumerate(zip(MM.tolist(), WXYZ, strict=True))
    ],
    "an array by columns, of big-endian numbers": np.asfortranarray(np.concatenate([MM, WXYZ], axis=1)).astype(">f8"),
    "both sides as two lists": (list(POSES), list(POSES)),
}


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("case", HELD)
def test_arrays_lists_and_mappings_are_read_from_a_pickle(case: str, protocol: int) -> None:
    table = read_poses("poses.pkl", pickle.dumps(HELD[case], protocol))
    np.testing.assert_allclose(table.lengths, MM, atol=1e-6)
    assert (table.camera is not None) == ("robot_pos" in case or "sides" in case or "matrices" in case)


def test_a_pickle_of_python_2_whose_bytes_are_texts_is_read() -> None:
    packed = POSES.astype("<f8").tobytes()
    begin = (
        b"\x80\x02cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R(K\x01K\x03K\x04K\x04\x87"
    )
    dtype = b"cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x89"
    content = begin + dtype + b"T" + len(packed).to_bytes(4, "little") + packed + b"tb."
    np.testing.assert_allclose(read_poses("poses.pkl", content).lengths, MM, atol=1e-6)


class Calls:
    """What a pickle calls when it is loaded as Python does it."""

    def __init__(self, call: Any, *args: Any) -> None:
        self.call, self.args = call, args

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return self.call, self.args


class Stateful:
    def __init__(self, state: Any) -> None:
        self.state = state

    def __reduce__(self) -> tuple[Any, tuple[Any, ...], Any]:
        return np.dtype, ("f8",), self.state


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_pickle_that_runs_a_command_does_not_run_it(protocol: int, tmp_path: Path) -> None:
    mark = tmp_path / "was_run"
    attacks = [
        Calls(os.system, f"touch {mark}"),
        Calls(eval, f"open({str(mark)!r}, 'w')"),
        Calls(np.save, str(mark), 1),
    ]
    for attack in attacks:
        content = pickle.dumps({"poses": POSES, "more": attack}, protocol)
        with pytest.raises(DocumentError, match=r"(system|eval|save) is not read: it may run any program"):
            read_poses("poses.pkl", content)
    pickle.loads(pickle.dumps(attacks[1])).close()
    assert mark.exists(), "as Python loads it, it runs"


NOT_READ: dict[str, tuple[bytes, str]] = {
    "a class of its own": (pickle.dumps(Path("a")), r"pathlib\.\w*Path is not read"),
    "a name that leads on": (b"\x80\x04\x8c\x05numpy\x8c\x0ccore.loadtxt\x93.", r"numpy\.core\.loadtxt is not read"),
    "an array of objects": (pickle.dumps(np.array([{"a": 1}, None])), "an array of"),
    "a dtype with fields": (pickle.dumps(Stateful((3, "<", None, ("x",), {"x": 1}, -1, -1, 0))), "no pose"),
    "an array that says more than it holds": (
        pickle.dumps(POSES, 2).replace(b"K\x03K\x04K\x04", b"K\x7fK\x04K\x04"), "cannot reshape"),
    "a number of 10,000 bytes": (pickle.dumps({"x": 1 << 80_000, "y": 2, "z": 3}), "too large"),
    "a list that holds itself": (b"(lp0\ng0\na.", "recursion"),
    "lists within lists without end": (b"]" + b"\x85" * 10 + b"\x86".join([b"2"] * 40) + b"\x86.", "more than 256 MB"),
    "bytes that are not there": (b"\x80\x05\x96" + (1 << 40).to_bytes(8, "little") + b".", "no pickle|exhausted"),
    "an object by an id": (b"\x80\x04K\x01Q.", "persistent"),
    "half a number": (b"\x80\x04J\x01.", "requires a buffer"),
    "nothing": (b"", "no pickle of numbers"),
    "half of it": (pickle.dumps(POSES)[:200], "no pickle of numbers"),
}  # fmt: skip


@pytest.mark.parametrize("case", NOT_READ)
def test_what_else_a_pickle_holds_is_refused(case: str) -> None:
    content, said = NOT_READ[case]
    with pytest.raises(DocumentError, match=said):
        read_poses("poses.pkl", content)


@pytest.mark.parametrize("shared", [True, False])
def test_the_first_sheet_of_a_spreadsheet_is_read_as_a_csv(shared: bool) -> None:
    poses = np.concatenate([MM, VECTORS], axis=1).tolist()
    rows = [["Robot poses <cell 4>"], [], ["image", None, "x [mm]", "y [mm]", "z [mm]", "rvec_x", "rvec_y", "rvec_z"]]
    rows += [[f"{at}.png", None, *row] for at, row in enumerate(poses)]
    table = read_poses("poses.xlsx", sheet(rows, shared=shared))
    np.testing.assert_allclose(table.lengths, MM, atol=1e-9)
    np.testing.assert_allclose(table.numbers, VECTORS, atol=1e-9)
    assert table.images == ("0.png", "1.png", "2.png")


def test_a_spreadsheet_with_points_of_camera_and_world_is_read_by_their_letters() -> None:
    seen = MM @ POSES[0, :3, :3] + 10
    rows = [["C_X", "C_Y", "C_Z", "W_X", "W_Y", "W_Z"], *np.concatenate([seen, MM], axis=1).tolist()]
    table = read_poses("points.xlsx", sheet(rows))
    assert table.camera is not None
    np.testing.assert_allclose((table.lengths, table.camera.lengths), (MM, seen), atol=1e-9)


def test_a_spreadsheet_that_is_none_or_unpacks_to_too_much_is_refused() -> None:
    for content, said in (
        (b"PK\x03\x04" + bytes(99), "no .xlsx file"),
        (npz(np.zeros(3)), "no .xlsx file"),
        (sheet([["x" * 33_000_000]]), "more than 32 MB"),
        (sheet([]), "no poses in it"),
    ):
        with pytest.raises(DocumentError, match=said):
            read_poses("poses.xlsx", content)


def test_pictures_lie_in_one_file_with_the_poses_of_all_views() -> None:
    depth = np.zeros_like(PICTURES)
    files = Held({"views.npz": npz(poses=matrices(), color=PICTURES, depth_image=depth, mask=depth[0])})
    imported = read_set(files, None, Chosen())
    np.testing.assert_array_equal(imported.poses.pictures, PICTURES)
    assert imported.images == ("view_000.png", "view_001.png", "view_002.png")


def test_each_view_has_a_file_with_its_pose_and_its_picture() -> None:
    colours = np.stack([PICTURES] * 3, axis=-1)
    files = {
        f"shot_{at}.npz": npz(*one) for at, one in enumerate(zip(MM, np.roll(WXYZ, -1, axis=1), colours, strict=True))
    }
    imported = read_set(Held(files), None, Chosen())
    np.testing.assert_array_equal(imported.poses.pictures, colours)
    np.testing.assert_allclose(imported.poses.lengths, MM)


def test_pictures_of_a_pickle_are_those_of_its_poses() -> None:
    content = pickle.dumps({"poses": POSES, "frames": PICTURES})
    np.testing.assert_array_equal(read_set(Held({"a.pkl": content}), None, Chosen()).poses.pictures, PICTURES)


def test_pictures_that_are_named_come_before_those_within_the_file() -> None:
    files = {"views.npz": npz(poses=matrices(), color=PICTURES), **{f"{at}.png": b"" for at in range(3)}}
    imported = read_set(Held(files), None, Chosen(images="*.png"))
    assert (imported.images, imported.poses.pictures) == (("0.png", "1.png", "2.png"), ())


def test_two_series_of_pictures_within_a_file_are_not_guessed() -> None:
    files = Held({"views.npz": npz(poses=matrices(), left=PICTURES, right=PICTURES)})
    with pytest.raises(DocumentError, match="no pictures"):
        read_set(files, None, Chosen())
