"""Poses of a tool, of a work object, or of several frames: the flange's are read, or it is said whose they are."""

import json
from typing import Any

import numpy as np
import pytest

from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.pose_table import PoseTable
from calibration.errors import DocumentError
from calibration.kinematics.conventions import CONVENTIONS
from calibration.problem import PosesOf
from calibration.transforms import Array, inverse, quaternion_from_rotation, transform_from_quaternion
from tests.calibration.documents.imports.written import MM, POSES, WXYZ, lines, npz, rows

TOOL_NUMBERS = [12.0, 0.0, 185.0, 0.8, 0.0, 0.0, 0.6]
TOOL: Array = transform_from_quaternion(TOOL_NUMBERS[:3], TOOL_NUMBERS[3:])
OF_TOOL: Array = POSES @ TOOL
FLANGE_ROWS = np.column_stack([MM, WXYZ]).tolist()
TOOL_ROWS = np.column_stack([OF_TOOL[:, :3, 3], quaternion_from_rotation(OF_TOOL[:, :3, :3])]).tolist()


def poses_of(table: PoseTable, unit: str = "mm") -> Array:
    (convention,) = table.conventions() if table.convention else (CONVENTIONS["quaternion-wxyz"],)
    return table.poses(convention, unit, "base_T_flange")  # type: ignore[arg-type]


def json_of(**columns: list[Any]) -> tuple[str, bytes]:
    records = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return "a.json", json.dumps(records).encode()


def nested(numbers: list[float]) -> dict[str, dict[str, float]]:
    return {
        "position": dict(zip("xyz", numbers[:3], strict=True)),
        "orientation": dict(zip("wxyz", numbers[3:], strict=True)),
    }


def csv_of(*sides: tuple[str, list[list[float]]]) -> tuple[str, bytes]:
    names = [f"{side}_{axis}" for side, _ in sides for axis in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    return "a.csv", lines(",".join(names), *rows(np.hstack([np.array(own) for _, own in sides])))


OF_BOTH = {
    "records, the tool first": json_of(tcp_pose=TOOL_ROWS, flange_pose=FLANGE_ROWS),
    "records, the flange first": json_of(flange_pose=FLANGE_ROWS, tcp_pose=TOOL_ROWS),
    "speeds beside them": json_of(q=[[0.1] * 7] * 3, tcp_pose=TOOL_ROWS, tcp_vel=[[0.0] * 6] * 3, flange=FLANGE_ROWS),
    "nested": json_of(tcp=[*map(nested, TOOL_ROWS)], flange=[*map(nested, FLANGE_ROWS)]),
    "columns": csv_of(("tcp", TOOL_ROWS), ("flange", FLANGE_ROWS)),
    "tool0": csv_of(("gripper", TOOL_ROWS), ("tool0", FLANGE_ROWS)),
    "arrays": ("a.npz", npz(tcp_poses=OF_TOOL, flange_poses=POSES)),
}


@pytest.mark.parametrize("case", OF_BOTH)
def test_of_a_tool_s_and_the_flange_s_poses_the_flange_s_are_read(case: str) -> None:
    table = read_poses(*OF_BOTH[case])
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-5)
    assert table.poses_of is None
    assert any(note.startswith("the poses of flange are taken, not those of ") for note in table.notes)


STILL = [TOOL_NUMBERS] * 3
BESIDE = {
    "a tool that stands still, first": csv_of(("tool", STILL), ("flange", FLANGE_ROWS)),
    "a base that stands still, first": csv_of(("base", [[0.0, 0, 0, 1, 0, 0, 0]] * 3), ("ee", FLANGE_ROWS)),
    "commanded poses": csv_of(("actual_flange_pose", FLANGE_ROWS), ("target_flange_pose", TOOL_ROWS)),
    "commanded joints": json_of(actual_q=[[0.1] * 6] * 3, target_q=[[0.2] * 6] * 3, flange=FLANGE_ROWS),
}


@pytest.mark.parametrize("case", BESIDE)
def test_what_stands_still_or_is_commanded_is_left_out(case: str) -> None:
    table = read_poses(*BESIDE[case])
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-5)
    assert table.poses_of is None and table.camera is None


def test_a_session_s_tool_of_no_name_is_none() -> None:
    views = [{"flange_pose": row} for row in FLANGE_ROWS]
    table = read_poses("a.json", json.dumps({"poses_of": {"tool": None, "base": "w1"}, "views": views}).encode())
    assert table.poses_of == PosesOf(base="w1")


@pytest.mark.parametrize("name", ["ee_pose", "robot_pose"])
def test_of_two_frames_without_the_flange_it_is_asked(name: str) -> None:
    with pytest.raises(DocumentError, match="no name says which are the flange's: keep only those, or call them flan"):
        read_poses(*json_of(tool_pose=TOOL_ROWS, **{name: FLANGE_ROWS}))


def test_of_a_snapshot_of_tf_the_user_names_the_frame() -> None:
    """Places and quaternions of three frames or more, two of which may be called flange and tool0."""
    frames = {"base_link": FLANGE_ROWS, "flange": FLANGE_ROWS, "tool0": FLANGE_ROWS, "tcp": TOOL_ROWS}
    of_tf = {frame: [{"translation": row[:3], "rotation": row[3:]} for row in own] for frame, own in frames.items()}
    assert [*read_poses(*json_of(**of_tf)).parts] == [*frames]


def test_the_same_poses_by_two_names_are_no_question() -> None:
    np.testing.assert_allclose(poses_of(read_poses(*json_of(hand=FLANGE_ROWS, ee=FLANGE_ROWS))), POSES, atol=1e-5)


@pytest.mark.parametrize(
    ("case", "tool"),
    [
        (json_of(tcp_pose=TOOL_ROWS), "tcp"),
        (csv_of(("actual_TCP", TOOL_ROWS)), "TCP"),
        (json_of(O_T_EE=[pose.T.ravel().tolist() for pose in OF_TOOL]), "EE"),
        (json_of(tcp_pose=TOOL_ROWS, tcp_offset=TOOL_ROWS), "tcp"),
        (json_of(tcp_pose=TOOL_ROWS, tcp_offset=[[0.012, 0, 0.185, *TOOL_NUMBERS[3:]]] * 3), "tcp"),
    ],
    ids=["tcp_pose", "RTDE", "Franka", "an offset that moves", "an offset in another unit"],
)  # fmt: skip
def test_a_tool_s_poses_say_so(case: tuple[str, bytes], tool: str) -> None:
    table = read_poses(*case)
    np.testing.assert_allclose(poses_of(table), OF_TOOL, atol=1e-5)
    assert table.poses_of == PosesOf(tool)


@pytest.mark.parametrize(
    "case", [json_of(gripper=FLANGE_ROWS), csv_of(("flange", FLANGE_ROWS)), csv_of(("", TOOL_ROWS))]
)
def test_other_names_say_nothing_of_a_tool(case: tuple[str, bytes]) -> None:
    assert read_poses(*case).poses_of is None


FRANKA = {"O_T_EE": [pose.T.ravel().tolist() for pose in OF_TOOL], "F_T_EE": [TOOL.T.ravel().tolist()] * 3}
WITH_OFFSET = {
    "tcp_offset": json_of(tcp_offset=[TOOL_NUMBERS] * 3, tcp_pose=TOOL_ROWS),
    "columns": csv_of(("tcp", TOOL_ROWS), ("tcp_offset", [TOOL_NUMBERS] * 3)),
    "libfranka": json_of(**FRANKA, NE_T_EE=FRANKA["F_T_EE"], O_T_EE_d=FRANKA["O_T_EE"]),
}


@pytest.mark.parametrize("case", WITH_OFFSET)
def test_with_its_offset_a_tool_s_poses_are_the_flange_s(case: str) -> None:
    table = read_poses(*WITH_OFFSET[case])
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-5)
    np.testing.assert_allclose(poses_of(table.take([2, 0])), POSES[[2, 0]], atol=1e-5)
    assert table.poses_of is None
    assert any("and its offset" in note for note in table.notes)


@pytest.mark.parametrize(("turn", "tool"), [((0, 0, 0), None), ((0, 0, 45), "tcp")])
def test_the_angles_of_an_offset_are_not_guessed(turn: tuple[float, float, float], tool: str | None) -> None:
    """The evidence finds the convention of the poses, and says nothing of a constant tool's."""
    angles = [[*place, 10.0, 20.0 + at, 30.0] for at, place in enumerate(MM.tolist())]
    table = read_poses(*json_of(tcp_pose=angles, tcp_offset=[[0, 0, 185, *turn]] * 3))
    assert (table.poses_of, table.offsets is None) == (tool and PosesOf(tool), tool is not None)


def test_an_offset_beside_the_flange_s_poses_is_not_used() -> None:
    table = read_poses(*json_of(flange_pose=FLANGE_ROWS, tcp_offset=[TOOL_NUMBERS] * 3))
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-5)
    assert table.notes == ("not used: tcp_offset",)


UFRAME, OFRAME = [[600, 100, 0], [0.6, 0, 0, 0.8]], [[0, 0, -20], [1, 0, 0, 0]]
WORK: Array = transform_from_quaternion(*UFRAME) @ transform_from_quaternion(*OFRAME)
LOAD = "[1.2,[0,0,80],[1,0,0,0],0,0,0]"
TOOL_DATA = f"TASK PERS tooldata tGrip:=[TRUE,[{TOOL_NUMBERS[:3]},{TOOL_NUMBERS[3:]}],{LOAD}];"
WORK_DATA = f'PERS wobjdata wFix := [FALSE, TRUE, "", {UFRAME}, {OFRAME}];'
NO_AXES = "[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]"


def module(poses: Array, moves: list[str], *data: str) -> bytes:
    """A module whose targets p1, p2, p3 are poses, with a move to each: {p} in the text."""
    numbers = [
        f"[{pose[:3, 3].tolist()},{quaternion_from_rotation(pose[:3, :3]).tolist()},{NO_AXES}]" for pose in poses
    ]
    targets = [f"CONST robtarget p{at}:={one};" for at, one in enumerate(numbers, 1)]
    return lines(
        *data, *targets, "PROC main()", *(one.format(p=f"p{at}") for at, one in enumerate(moves, 1)), "ENDPROC"
    )


BOTH = "MoveL\\Conc, Offs({p},0,0,0), v100\\V:=50, fine\\Inpos:=inpos20, TGRIP\\WObj:=wfix;"


def test_a_module_that_defines_its_tool_and_work_object_gives_the_flange_s_poses() -> None:
    table = read_poses("a.mod", module(inverse(WORK) @ OF_TOOL, [BOTH] * 3, TOOL_DATA, WORK_DATA))
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-6)
    assert table.poses_of is None
    assert "the flange's poses are those of the program and of its data TGRIP, wfix" in table.notes


def test_each_move_has_its_own_tool_and_work_object() -> None:
    written = np.array([POSES[0], OF_TOOL[1], inverse(WORK) @ POSES[2]])
    moves = [f"MoveJ {{p}},v100,z10,{frames};" for frames in ("tool0", "tGrip", "tool0\\WObj:=wFix")]
    table = read_poses("a.mod", module(written, moves, TOOL_DATA, WORK_DATA))
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-6)


@pytest.mark.parametrize(
    "move",
    [
        "TriggL {p}, v100, trFire, z10, tGrip\\WObj:=wFix;",
        "ArcL {p}, v100, smSeam, wdWeld\\Weave:=wv1, fine, tGrip \\WObj := wFix;",
        "SearchL\\SStop, di1, pFound, {p}, v100, tGrip\\WObj:=wFix;",
        "MoveJ {p}, vSlow, zCoarse, tGrip\\WObj:=wFix;",
        "MoveL\\Conc, {p}, vSlow, zCoarse, tGrip\\WObj:=wFix;",
        "TriggL {p}, v100, trFire, zCoarse, tGrip\\TLoad:=load1\\WObj:=wFix;",
        "rGoTo {p}, tGrip, nSpeed\\WObj:=wFix;",
        "rGoTo {p}, tGrip, wFix;",
        "PDispOn {p}, tGrip; MoveL {p}, v100, fine, tGrip\\WObj:=wFix;",
        "rLog {p}, tGrip; MoveL {p}, v100, fine, tGrip\\WObj:=wFix;",
        'MoveCSync p1, {p}, v100, fine, tGrip\\WObj:=wFix, "rFire";',
        "MoveAbsJ jHome, v100, fine, tool0; MoveL {p}, v100, fine, tGrip\\WObj:=wFix;",
    ],
)
def test_every_instruction_that_moves_has_a_tool(move: str) -> None:
    """MoveAbsJ has no robtarget, whose tool and work object are asked for."""
    table = read_poses("a.mod", module(inverse(WORK) @ OF_TOOL, [move] * 3, TOOL_DATA, WORK_DATA))
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-6)


@pytest.mark.parametrize(
    ("move", "said"),
    [
        ("SearchL di1, p1, {p}, v100, tGrip;", None),
        ("TriggL {p}, v100, trFire, zCoarse, tGrip;", None),
        ("MoveL\\Conc, {p}, v100, zCoarse, tGrip;", None),
        ("rGoTo {p}, tGrip, nSpeed;", None),
        ("SearchL di1, p1, {p}, v100, tElse;", PosesOf("tElse")),
        ("TriggL {p}, v100, trFire, zCoarse, tElse;", PosesOf("tElse")),
        ("MoveL\\Conc, {p}, v100, zCoarse, tElse;", PosesOf("tElse")),
        ("MoveL {p}, v100, fine, tElse{{2, 1}};", PosesOf("tElse{2,1}")),
    ],
)
def test_a_tool_counts_without_a_work_object_and_by_its_index(move: str, said: PosesOf | None) -> None:
    table = read_poses("a.mod", module(OF_TOOL, [move] * 3, TOOL_DATA))
    np.testing.assert_allclose(poses_of(table), OF_TOOL if said else POSES, atol=1e-6)
    assert table.poses_of == said


@pytest.mark.parametrize("call", ["PDispSet peOffset", "PDispOn p1, tGrip", "EOffsSet eaOffset", "EOffsOn p1"])
def test_what_shifts_all_targets_is_noted(call: str) -> None:
    moves = [f"{call};MoveL {{p}},v1,fine,tool0;"] + ["MoveL {p},v1,fine,tool0;"] * 2
    (note,) = read_poses("a.mod", module(POSES, moves)).notes
    assert note == f"the program computes poses ({call.split()[0]}): only written numbers are taken"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ([], PosesOf("tGrip", "wFix")),
        ([TOOL_DATA], PosesOf(base="wFix")),
        ([WORK_DATA], PosesOf("tGrip")),
        ([TOOL_DATA.replace("TRUE", "FALSE"), WORK_DATA], PosesOf("tGrip")),
        ([TOOL_DATA, WORK_DATA.replace("TRUE", "FALSE")], PosesOf(base="wFix")),
        ([TOOL_DATA.replace("12.0", "nLength"), WORK_DATA], PosesOf("tGrip")),
        ([TOOL_DATA, WORK_DATA, "wFix.uframe := pMeasured;"], PosesOf(base="wFix")),
        ([TOOL_DATA, TOOL_DATA.replace("12.0", "13.0"), WORK_DATA], PosesOf("tGrip")),
        ([TOOL_DATA.replace("12.0", "1E999"), WORK_DATA], PosesOf("tGrip")),
        ([TOOL_DATA, WORK_DATA.replace(str(OFRAME), "pMeasured")], PosesOf(base="wFix")),
    ],
    ids=[
        "neither", "no work object", "no tool", "a tool that stands", "a moving work object", "no number", "assigned",
        "two of one name", "not finite", "no oframe",
    ],
)  # fmt: skip
def test_what_the_module_does_not_define_is_said(data: list[str], said: PosesOf) -> None:
    of_work = inverse(WORK) if said.base else np.eye(4)
    of_tool = TOOL if said.tool else np.eye(4)
    moves = ["MoveC p1, {p}, v100, fine, tGrip\\WObj:=wFix;"] * 3
    table = read_poses("a.mod", module(inverse(WORK) @ OF_TOOL, moves, *data))
    np.testing.assert_allclose(poses_of(table), of_work @ POSES @ of_tool, atol=1e-6)
    assert table.poses_of == said


@pytest.mark.parametrize(
    ("moves", "data", "said"),
    [
        (["MoveL {p},v1,fine,tGrip;", "MoveL {p},v1,fine,tool0;"], [TOOL_DATA], "p3: one of several that are of tGrip"),
        (["MoveL {p},v1,fine,tGrip;MoveL p1,v1,fine,tool0;"] * 3, [TOOL_DATA], "p1: one of several that are of tGrip"),
        (["MoveL {p},v1,fine,tGrip;"] * 2 + ["MoveL {p},v1,fine,tool0;"], [], "p1: one of several that are of tGrip"),
        (["MoveL {p},v1,fine,tl{{1}};"] * 2 + ["MoveL {p},v1,fine,tl{{2}};"], [], "are of tl.1. in wobj0 and of tl.2."),
        ([f"MoveL {{p}},v1,fine,tool0\\WObj:=w{{{{{at}}}}};" for at in (1, 1, 2)], [], "in w.1. and of tool0 in w.2."),
    ],
    ids=["one without a move", "one with two moves", "one that is not defined", "two of an array", "two work objects"],
)  # fmt: skip
def test_targets_of_several_frames_are_refused(moves: list[str], data: list[str], said: str) -> None:
    with pytest.raises(DocumentError, match=said):
        read_poses("a.mod", module(POSES, moves, *data))


def test_the_tool_that_a_program_of_ur_sets_is_composed() -> None:
    goals = [f"movel(p[{', '.join(map(str, [x / 1000, y / 1000, z / 1000, 0.1, 0.2, 0.3]))}])" for x, y, z in MM]
    with_tool, without = (read_poses("a.script", lines(f"set_tcp(p[0, 0, {z}, 0, 0, 0])", *goals)) for z in (0.2, 0))
    apart = [table.poses(CONVENTIONS["rotation-vector"], "m", "base_T_flange") for table in (without, with_tool)]
    np.testing.assert_allclose((inverse(apart[1]) @ apart[0])[:, :3, 3], [[0, 0, 200]] * 3, atol=1e-6)
    twice = read_poses("a.script", lines("set_tcp(p[0,0,0.2,0,0,0])", *goals, "set_tcp(p[0,0,0.1,0,0,0])"))
    assert twice.poses_of == PosesOf("set_tcp p[0,0,0.2,0,0,0]")


def test_registers_of_fanuc_are_read_as_text() -> None:
    rows_of = [
        f"[1,{at}] = 'p'\n  Group: 1\n  X: {x} Y: {y} Z: {z}\n  W: 1.0 P: 2.0 R: 3.0" for at, (x, y, z) in enumerate(MM)
    ]
    np.testing.assert_allclose(read_poses("posreg.va", lines(*rows_of)).lengths, MM)


def test_egm_s_quaternion_has_w_first() -> None:
    table = read_poses("a.csv", lines("tick,X,Y,Z,u0,u1,u2,u3", *rows(np.arange(3.0)[:, None] * 40, MM, WXYZ)))
    assert table.convention == CONVENTIONS["quaternion-wxyz"]
    np.testing.assert_allclose(poses_of(table), POSES, atol=1e-5)
