"""An arm of one's own from a URDF or a Denavit-Hartenberg table."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.documents.imports.leaves import array_of
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.text_tables import rows_of
from calibration.documents.imports.trees import read_xml
from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_row import SLOWEST
from calibration.kinematics.joint_chain import JointChain, arm_of_chain
from calibration.transforms import Array, transform

HEADING = "an-arm-of-ones-own"
MAX_JOINTS = 1000
_TURNING = ("revolute", "continuous")
_FULL_TURN = (-2 * np.pi, 2 * np.pi)

CLASSICAL = ["a_mm", "alpha_deg", "d_mm", "theta_deg", "lower_deg", "upper_deg"]
"""Denavit and Hartenberg's: turn theta and slide d along z, then slide a and turn alpha about the new x."""
MODIFIED = ["a_before_mm", "alpha_before_deg", *CLASSICAL[2:]]
"""Craig's: slide a and turn alpha about x of the link before, then turn theta and slide d along z."""


def read_arm_description(content: bytes, origin: str, *, name: str, tip: str | None = None) -> Arm:
    """The arm of a URDF or of a CSV with a Denavit-Hartenberg row for each axis. Raises DocumentError.

    `tip`: link of a URDF that is the flange; by default tool0, then the last link of the longest chain.
    """
    if origin.lower().endswith((".urdf", ".xml", ".xacro")):
        chain, limits, speeds = _of_urdf(content, origin, tip)
    else:
        chain, limits = _of_table(content, origin)
        speeds = _slowest()
    try:
        return arm_of_chain(chain, name, limits, speeds)
    except GeometryError as error:
        raise refusal(origin, "axes", str(error), "correct the description, or choose another tip", HEADING) from None


@dataclass(frozen=True)
class _Joint:
    name: str
    parent: str
    child: str
    kind: str
    parent_T_joint: Array
    axis: Array
    limits_rad: tuple[float, float]
    speed_rad_s: float

    @property
    def turns(self) -> bool:
        return self.kind in _TURNING


def _of_urdf(content: bytes, origin: str, tip: str | None) -> tuple[JointChain, Array, tuple[float, ...]]:
    joints = _joints_of(content, origin)
    by_child = {joint.child: joint for joint in joints}
    chain = _chain_to(by_child, _tip_of(by_child, origin, tip), origin)
    turning = [place for place, joint in enumerate(chain) if joint.turns]
    if len(turning) != 6:
        what = f"{len(turning)} turning joints from {chain[0].parent if chain else '?'} to the tip, not 6"
        raise refusal(origin, "joint", what, "name the flange's link with --tip", HEADING)
    for joint in chain:
        if not joint.turns and joint.kind != "fixed":
            what = f"it is {joint.kind}: a track or a lift is no part of the arm"
            raise refusal(origin, f"joint {joint.name}", what, "give the arm alone", HEADING)
        if joint.turns and joint.limits_rad[0] >= joint.limits_rad[1]:
            raise refusal(origin, f"joint {joint.name}", "no lower and upper limit", "write <limit> in rad", HEADING)
    frames, frame = [], np.eye(4)
    for joint in chain:
        frame = frame @ joint.parent_T_joint
        if joint.turns:
            frames.append(frame)
            frame = np.eye(4)
    six = [chain[place] for place in turning]
    return (
        JointChain(np.array(frames), np.array([joint.axis for joint in six]), frame),
        np.array([joint.limits_rad for joint in six]),
        tuple(joint.speed_rad_s for joint in six),
    )


def _joints_of(content: bytes, origin: str) -> list[_Joint]:
    text = decode(content, origin)
    if "xacro:" in text:
        raise refusal(origin, "file", "macros are not read", "expand it first: xacro FILE > arm.urdf", HEADING)
    root = read_xml(text, origin, HEADING)
    found = [element for element in root.findall("joint") if element.find("parent") is not None]
    if not found or len(found) > MAX_JOINTS:
        raise refusal(origin, "joint", f"{len(found)} joints", "give the URDF of one arm", HEADING)
    return [_joint(element, origin) for element in found]


def _joint(element: ElementTree.Element, origin: str) -> _Joint:
    name, kind = element.get("name", "?"), element.get("type", "")
    try:
        placed, axis = element.find("origin"), element.find("axis")
        xyz = _numbers(placed.get("xyz", "0 0 0") if placed is not None else "0 0 0")
        rpy = _numbers(placed.get("rpy", "0 0 0") if placed is not None else "0 0 0")
        direction = _numbers(axis.get("xyz", "1 0 0") if axis is not None else "1 0 0")
        length = float(np.linalg.norm(direction))
        limit = element.find("limit")
        low, high, speed = (
            (float(limit.get(key, default)) for key, default in (("lower", "0"), ("upper", "0"), ("velocity", "0")))
            if limit is not None
            else (0.0, 0.0, 0.0)
        )
        if length == 0 or not np.all(np.isfinite([low, high, speed])):
            raise ValueError("an axis of length 0 or a limit that is no number")
    except ValueError as error:
        raise refusal(origin, f"joint {name}", str(error), "correct the joint", HEADING) from None
    parent, child = element.find("parent"), element.find("child")
    return _Joint(
        name,
        parent.get("link", "") if parent is not None else "",
        child.get("link", "") if child is not None else "",
        kind,
        transform(Rotation.from_euler("xyz", rpy).as_matrix(), 1000 * xyz),
        direction / length,
        _FULL_TURN if kind == "continuous" else (low, high),
        speed if speed > 0 else _slowest()[0],
    )


def _numbers(text: str) -> Array:
    values = np.array([float(part) for part in text.split()])
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise ValueError(f"{text!r} is not three numbers")
    return values


def _tip_of(by_child: dict[str, _Joint], origin: str, tip: str | None) -> str:
    if tip is not None:
        if tip not in by_child:
            raise refusal(origin, "tip", f"no joint ends at {tip!r}", f"one of {', '.join(by_child)}", HEADING)
        return tip
    if "tool0" in by_child:
        return "tool0"
    return max(by_child, key=lambda link: len(_chain_to(by_child, link, origin)))


def _chain_to(by_child: dict[str, _Joint], tip: str, origin: str) -> list[_Joint]:
    """The joints from the root to a link. Raises DocumentError for links that hang on each other in a circle."""
    chain, link = list[_Joint](), tip
    while link in by_child:
        chain.append(by_child[link])
        link = by_child[link].parent
        if len(chain) > len(by_child):
            raise refusal(origin, "joint", f"link {tip} hangs on itself", "correct parent and child", HEADING)
    return chain[::-1]


def _of_table(content: bytes, origin: str) -> tuple[JointChain, Array]:
    rows = rows_of(decode(content, origin).splitlines())
    wanted = next((names for names in (MODIFIED, CLASSICAL) if {*names} <= {*(rows.names or ())}), None)
    if wanted is None:
        what = f"no columns {', '.join(CLASSICAL)} (or {', '.join(MODIFIED[:2])})"
        raise refusal(origin, "header", what, "one row for each axis", HEADING)
    records = [dict(zip(rows.names or (), cells, strict=False)) for cells in rows.cells]
    table = array_of([[record.get(name) for name in wanted] for record in records])
    if table is None or table.shape[0] != 6 or not np.all(np.isfinite(table)):
        raise refusal(origin, "rows", f"{len(records)} rows, where six axes have six", "numbers only", HEADING)
    modified = wanted is MODIFIED
    a, d = table[:, 0], table[:, 2]
    alpha, theta, low, high = np.radians(table[:, [1, 3, 4, 5]]).T
    if np.any(low >= high):
        raise refusal(origin, "lower_deg", "a lower limit that is not below the upper", "correct it", HEADING)
    across = [
        transform(Rotation.from_euler("x", turn).as_matrix(), (by, 0, 0)) for turn, by in zip(alpha, a, strict=True)
    ]
    along = [
        transform(Rotation.from_euler("z", turn).as_matrix(), (0, 0, by)) for turn, by in zip(theta, d, strict=True)
    ]
    z = np.tile([0.0, 0.0, 1.0], (6, 1))
    limits = np.column_stack([low, high])
    if modified:  # the joint turns before theta and d, which are about and along the same z
        return JointChain(np.array([x @ z_ for x, z_ in zip(across, along, strict=True)]), z, np.eye(4)), limits
    frames = [along[0], *(x @ z_ for x, z_ in zip(across, along[1:], strict=False))]
    return JointChain(np.array(frames), z, across[5]), limits


def _slowest() -> tuple[float, ...]:
    return tuple(float(np.radians(float(speed))) for speed in SLOWEST.split())
