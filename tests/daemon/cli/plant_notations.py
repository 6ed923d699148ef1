"""The same six poses as plants write them: notations of numbers, rows and whole files."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.transforms import Array
from tests.daemon.cli.sessions import TILTS_RAD, base_T_flange

TARGET = "charuco:7x5:30:22:DICT_5X5_100"
POSES: Array = np.array([base_T_flange(tilt) for tilt in TILTS_RAD])
VIEWS = len(POSES)
PICTURES = tuple(f"view_{at}.png" for at in range(7, 13))  # natural order is not that of the alphabet
EYE_IN_HAND = ("--setup", "eye-in-hand")

Rows = list[list[float]]


def quaternions(poses: Array = POSES, scale: float = 1.0) -> Rows:
    """x, y, z (mm times `scale`), qw, qx, qy, qz."""
    xyzw = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    rows: Rows = np.concatenate([poses[:, :3, 3] * scale, np.roll(xyzw, 1, axis=1)], axis=1).tolist()
    return rows


def angles(scale: float = 1.0, order: str = "ZYX") -> Rows:
    """x, y, z (mm) and angles in degrees times `scale`, in the order of the rotations."""
    turned = Rotation.from_matrix(POSES[:, :3, :3]).as_euler(order, degrees=True) * scale
    rows: Rows = np.concatenate([POSES[:, :3, 3], turned], axis=1).tolist()
    return rows


def in_radians(rows: Rows) -> Rows:
    return [[*row[:3], *np.radians(row[3:]).tolist()] for row in rows]


def text(number: float) -> str:
    return f"{number:.6f}"


def lines(
    rows: Rows,
    names: Sequence[str] | None = None,
    *,
    separator: str = ",",
    cell: Callable[[float], str] = text,
    before: Sequence[str] = (),
    tail: str = "",
) -> list[str]:
    """The rows as texts. `before`: a cell before each row's numbers; `tail`: after each row."""
    cells = [[*before[at : at + 1], *map(cell, row)] for at, row in enumerate(rows)]
    head = [] if names is None else [separator.join(names)]
    return [*head, *(separator.join(row) + tail for row in cells)]


def csv(given: list[str], name: str = "poses.csv", end: str = "\n", encoding: str = "utf-8") -> dict[str, bytes]:
    return {name: (end.join(given) + end).encode(encoding)}


def german(number: float) -> str:
    return text(number).replace(".", ",")


Q = ("x", "y", "z", "qw", "qx", "qy", "qz")
MICRONS = ("x_um", "y_um", "z_um", *Q[3:])
JOINTS_DEG = [10.0, -20.0, 30.0, 40.0, 50.0, -60.0]
NUMBERS = [str(at) for at in range(1, VIEWS + 1)]
BACKWARDS = list(reversed(quaternions()))
STAMPS = [f"2026-11-22_10-15-{second:02}" for second in (2, 9, 17, 24, 38, 51)]
CLOCK = [f"{stamp[:10]}T{stamp[11:].replace('-', ':')}Z" for stamp in STAMPS]
EPOCH_S = [f"{1_763_800_000 + 37 * at:.3f}" for at in range(VIEWS)]
FULL_WIDTH = {ord(one): ord(one) + 0xFEE0 for one in "0123456789.-"}
LIST = quaternions()
ONE = text(LIST[2][1])
"""A cell of row 3."""


def with_cell(other: str) -> dict[str, bytes]:
    return csv([line.replace(ONE, other) for line in lines(LIST, Q)])


def four_by_four(poses: Array = POSES) -> list[str]:
    return [" ".join(map(text, row)) for pose in poses for row in pose]


def robtargets(comment: str = "") -> list[str]:
    return [
        "MODULE poses",
        *(
            f"  CONST robtarget p{at}0:=[[{x:.3f},{y:.3f},{z:.3f}],[{','.join(map(text, q))}],[0,-1,0,0],"
            f"[9E9,9E9,9E9,9E9,9E9,9E9]];{comment}"
            for at, (x, y, z, *q) in enumerate(LIST, 1)
        ),
        "ENDMODULE",
    ]


def vectors() -> Rows:
    """x, y, z (m) and a rotation vector (rad), as UR writes them."""
    turned = Rotation.from_matrix(POSES[:, :3, :3]).as_rotvec()
    rows: Rows = np.concatenate([POSES[:, :3, 3] / 1000, turned], axis=1).tolist()
    return rows


def kuka_dat(more: str = "") -> str:
    """A data list of KRL, with what is taught beside the poses."""
    points = [
        f"DECL E6POS XP{at}={{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.5f},B {b:.5f},C {c:.5f},S 2,T 35,E1 0.0,E2 0.0}}\n"
        f'DECL FDAT FP{at}={{TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}}'
        for at, (x, y, z, a, b, c) in enumerate(angles(), 1)
    ]
    return "\n".join(
        ["DEFDAT CAL PUBLIC", "DECL E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}", more, *points, "ENDDAT"]
    )


def fanuc_ls() -> str:
    """A program of TP as it is listed."""
    points = [
        f"P[{at}]{{\n   GP1:\n\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX = {x:9.3f}  mm,\tY = {y:9.3f}  mm,"
        f"\tZ = {z:9.3f}  mm,\n\tW = {w:9.5f} deg,\tP = {p:9.5f} deg,\tR = {r:9.5f} deg\n}};"
        for at, (x, y, z, r, p, w) in enumerate(angles(), 1)
    ]
    return "\n".join(["/PROG CAL", "/MN", "   1:J P[1] 100% FINE ;", "/POS", *points, "/END"])


def ros_echo() -> str:
    """What `ros2 topic echo` prints of PoseStamped."""
    messages = [
        f"header:\n  stamp:\n    sec: {at}\n    nanosec: 5\n  frame_id: base\npose:\n"
        f"  position:\n    x: {x / 1000}\n    y: {y / 1000}\n    z: {z / 1000}\n"
        f"  orientation:\n    x: {qx}\n    y: {qy}\n    z: {qz}\n    w: {qw}\n"
        for at, (x, y, z, qw, qx, qy, qz) in enumerate(LIST)
    ]
    return "---\n".join(messages)


def turned_matrices() -> Array:
    """Matrices whose rotation is transposed and whose translation is not."""
    wrong = POSES.copy()
    wrong[:, :3, :3] = np.swapaxes(POSES[:, :3, :3], 1, 2)
    return wrong
