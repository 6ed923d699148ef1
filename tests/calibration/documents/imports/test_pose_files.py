"""Three poses in every way of writing them are read as the same three poses."""

import json

import numpy as np
import pytest

from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.pose_table import find_conventions
from calibration.errors import DocumentError
from calibration.problem import PosesOf
from tests.calibration.documents.imports.written import FILES, MM, POSES, VECTORS, WXYZ, euler, lines, matrices, rows


@pytest.mark.parametrize("case", FILES)
def test_the_poses_are_read(case: str) -> None:
    name, content, given = FILES[case]
    table = read_poses(name, content)
    conventions = table.conventions()
    if given:
        conventions = tuple(one for one in find_conventions(given)[0] if one.kind == table.kind)
    (unit,) = table.units()
    assert len(conventions) == 1
    np.testing.assert_allclose(table.poses(conventions[0], unit, "base_T_flange"), POSES, atol=2e-5)


def test_what_a_file_leaves_open_stays_open() -> None:
    table = read_poses("a.csv", lines(*rows(MM, euler("ZYX"))))
    assert {one.name for one in table.conventions()} >= {"euler-ZYX", "euler-xyz", "euler-XYZ", "rotation-vector-deg"}
    assert {one.name for one in read_poses("a.csv", lines(*rows(MM, WXYZ))).conventions()} == {
        "quaternion-wxyz", "quaternion-xyzw",
    }  # fmt: skip
    assert table.frames() == ("base_T_flange", "flange_T_base")


def test_metres_are_known_by_their_size() -> None:
    assert read_poses("a.json", json.dumps(matrices(metres=True).tolist()).encode()).units() == ("m",)
    assert read_poses("a.json", json.dumps(matrices().tolist()).encode()).units() == ("mm",)


def test_six_numbers_that_have_names_are_not_taken_for_joints() -> None:
    row = "0.1,0.2,0.3,0.4,0.5,0.6"
    assert read_poses("a.csv", lines(row, row)).may_be_joints()
    assert not read_poses("a.csv", lines("x,y,z,rotation_1,rotation_2,rotation_3", row, row)).may_be_joints()


def test_names_and_pictures_of_the_rows_are_kept() -> None:
    named = [f"img_{at}.png,{row},0.1" for at, row in enumerate(rows(MM, WXYZ))]
    table = read_poses("a.csv", lines("image,x,y,z,qw,qx,qy,qz,joint 1", *named))
    assert table.images == ("img_0.png", "img_1.png", "img_2.png")
    assert table.notes == ("not used: joint 1",)


def test_halcon_s_representations() -> None:
    said = "# 3D POSE PARAMETERS\n{}\nr {} {} {}\nt {} {} {}\n"
    for code, angles in ((0, euler("XYZ")), (2, euler("xyz"))):
        table = read_poses("a.dat", said.format(f"f {code}", *angles[0], *(MM[0] / 1000)).encode())
        (convention,) = table.conventions()
        np.testing.assert_allclose(table.poses(convention, "m", "base_T_flange")[0], POSES[0], atol=1e-6)


REFUSED = {
    "wrong format": ("a.csv", lines("x,y,z,a1,a2,a3", *rows(MM, WXYZ[:, 1:])), "no pose among the names"),
    "five numbers": ("a.csv", lines(*["1,2,3,4,5"] * 48), "5 numbers a row without names"),
    "ragged": ("a.csv", lines("1,2,3,4,5,6", "1,2,3,4,5"), "row 2: 5 numbers, where row 1 has 6"),
    "text in a cell": ("a.csv", lines("x,y,z,qw,qx,qy,qz", "1,2,three,1,0,0,0"), "row 1, z: 'three' is no number"),
    "NaN": ("a.csv", lines("x,y,z,qw,qx,qy,qz", "1,2,nan,1,0,0,0"), "pose 1: a number is missing or not finite"),
    "no rotation": ("a.txt", lines(*["1 0 0 5 0 1 0 6 0 0 1 7 0 0 1 1"] * 3), "the last row"),
    "joint targets": ("a.mod", lines("CONST jointtarget j:=[[1,2,3,4,5,6],[9E9,9E9]];"), "joint targets"),
    "empty": ("a.csv", b"", "no poses in it"),
    "binary": ("a.txt", bytes(range(256)), "not text"),
    "JSON cut off": ("a.json", b'[{"x": 1,', "not JSON"),
    "YAML tag": ("a.yaml", b"!!python/object/apply:os.system [ls]", "not YAML"),
    "YAML alias": ("a.yaml", b"a: &a [1, 2]\nb: [*a, *a, *a]", "aliases"),
    "pickle": ("a.npy", b"\x93NUMPY\x01\x00" + b"v\x00" + b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
               .ljust(118), "no numbers"),
    "no zip": ("a.npz", b"PK\x03\x04" + b"0" * 50, "no .npz file"),
    "camera of HALCON": ("a.dat", b"ParGroup: Cam: Par;\n 'Focus': 0.008;\n", "intrinsics, no pose"),
    "suffix": ("a.doc", b"1,2,3", "no poses are read from .doc"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_one_error(case: str) -> None:
    name, content, what = REFUSED[case]
    with pytest.raises(DocumentError) as raised:
        read_poses(name, content)
    (problem,) = raised.value.problems
    assert what in f"{problem.place}: {problem.what}"
    assert "docs/formats.md#" in problem.fix


ROBTARGET = "[[{x}, 20.5, 640], [0.1, 0.7, 0.7, 0.1], [0, -1, 0, 0], [9E9, 9E+09, 9E9, 9E9, 9E9, 9E9]]"
JSON_ROBTARGET = (
    '{{"trans": [{x}, 20.5, 640], "rot": [0.1, 0.7, 0.7, 0.1], "robconf": [0, 0, 0, 0], '
    '"extax": [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]}}'
)


@pytest.mark.parametrize(
    ("name", "row"), [("a.txt", ROBTARGET), ("a.jsonl", JSON_ROBTARGET), ("a.txt", JSON_ROBTARGET)]
)
def test_axes_that_are_not_there_are_no_pose(name: str, row: str) -> None:
    table = read_poses(name, lines(*(row.format(x=800 + at) for at in range(3))))
    assert table.lengths.tolist() == [[800 + at, 20.5, 640] for at in range(3)]
    assert table.numbers.tolist() == [[0.1, 0.7, 0.7, 0.1]] * 3


FANUC = (
    "P[{at}]{{\n GP1:\n UF : {base}, UT : {tool}, CONFIG : 'N U T, 0, 0, 0',\n X = 812.4 mm, Y = -3{at}.1 mm,"
    " Z = 640.0 mm,\n W = 1.0 deg, P = 2.0 deg, R = 3.0 deg\n}};"
)
KUKA = (
    "DECL E6POS XP{at}={{X 812.4,Y -3{at}.1,Z 640.0,A 1.0,B 2.0,C 3.0,S 2,T 10}}\n"
    "DECL FDAT F{at}={{TOOL_NO {tool},BASE_NO {base}}}"
)


@pytest.mark.parametrize(
    ("name", "row", "said"),
    [("a.ls", FANUC, PosesOf("UT 2", "UF 1")), ("a.dat", KUKA, PosesOf("TOOL_NO 2", "BASE_NO 1"))],
)
def test_a_tool_and_a_base_of_the_poses_are_said(name: str, row: str, said: PosesOf) -> None:
    """As of RAPID: X and the places are then of another frame than the flange's and the base's."""
    of_flange, of_tool = (
        read_poses(name, lines(*(row.format(at=at, base=base, tool=tool) for at in range(4))))
        for base, tool in ((0, 0), (1, 2))
    )
    assert of_flange.poses_of is None
    assert of_tool.poses_of == said


@pytest.mark.parametrize(
    ("frames", "said"),
    [
        ("$BASE=BASE_DATA[0]\n$TOOL = TOOL_DATA[0]", None),
        ("$BASE=$NULLFRAME", None),
        ("$BASE=BASE_DATA[10]", PosesOf(base="BASE BASE_DATA[10]")),
        ("$TOOL=TOOL_DATA[3]", PosesOf("TOOL TOOL_DATA[3]")),
        ("UF : F, UT : 0", PosesOf(base="UF F")),
        ("UF : F, UT : F", PosesOf("UT F", "UF F")),
    ],
)
def test_the_null_frame_is_no_base_and_the_one_in_use_may_be(frames: str, said: PosesOf | None) -> None:
    poses = read_poses("a.src", lines(frames, *(KUKA.format(at=at, base=0, tool=0) for at in range(4))))
    assert poses.poses_of == said


def test_columns_by_the_letters_of_their_frames_are_of_two_sides_beside_others() -> None:
    seen = np.concatenate([MM / 1000 + 0.2, np.roll(WXYZ, -1, axis=1)], axis=1)
    header = "stamp_sec,B_tcp_x,B_tcp_y,B_tcp_z,B_tcp_rx,B_tcp_ry,B_tcp_rz," + ",".join(
        [*(f"C_p_O_{axis}" for axis in "xyz"), *(f"C_q_O_{axis}" for axis in "xyzw")]
    )
    stamps = np.arange(3.0)[:, None] + 1.7e9
    table = read_poses("a.csv", lines(header, *rows(stamps, MM / 1000, VECTORS, seen)))
    assert table.camera is not None
    np.testing.assert_allclose((table.lengths, table.numbers), (MM / 1000, VECTORS), atol=1e-8)
    np.testing.assert_allclose(table.camera.lengths, seen[:, :3], atol=1e-8)
    np.testing.assert_allclose(table.camera.numbers, WXYZ, atol=1e-8)


def test_a_quaternion_of_another_norm_is_refused_with_the_columns_that_it_was_read_from() -> None:
    with pytest.raises(DocumentError, match=r"norm 2, not 1 \(of columns x, y, z, qw, qx, qy, qz\)"):
        read_poses("a.csv", lines("x,y,z,qw,qx,qy,qz", *rows(MM, 2 * WXYZ)))
