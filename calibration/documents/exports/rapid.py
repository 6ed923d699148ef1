"""ABB RAPID: poses, a procedure that sets the frame of a tool, and work objects. mm; q1..q4 = w, x, y, z; num is a
single float.

Of a tooldata only tframe is set: mass, centre of gravity and inertia are the tool's; wrong ones move the arm wrongly.
"""

from calibration.documents.exports.subject import Subject, single
from calibration.transforms import Array, quaternion_from_rotation

NO_OFFSET = "[[0, 0, 0], [1, 0, 0, 0]]"


def pose_text(a_T_b: Array) -> str:
    """`[[x, y, z], [q1, q2, q3, q4]]` of a transform (4, 4) in mm."""
    position = ", ".join(single(value) for value in a_T_b[:3, 3])
    orientation = ", ".join(single(value) for value in quaternion_from_rotation(a_T_b[:3, :3]))
    return f"[[{position}], [{orientation}]]"


def write_rapid(subject: Subject) -> str:
    """A module with X and the target's pose."""
    x, target = pose_text(subject.parent_T_child), subject.parent_T_target
    body = [*(f"! {line}" for line in [*subject.about(), "mm; quaternion q1..q4 = w, x, y, z with w >= 0"])]
    body.append(f"PERS pose he_{subject.x_name} := {x};")
    if target is not None:
        body.append("! The target, as it was seen.")
        body.append(f"PERS pose he_{subject.target_name} := {pose_text(target)};")
    if not subject.on_flange:
        body += _work_object("he_camera", x, "The camera as a work object: what it measures is in this frame.")
    elif target is not None:
        body += _work_object("he_target", pose_text(target), "The target as a work object.")
    return module_text("handeyed_data", "".join(f"  {line}\n" for line in body) + _procedure(subject))


def module_text(name: str, body: str) -> str:
    """A module's file, with the line ends of a controller."""
    return f"MODULE {name}\n{body}ENDMODULE\n".replace("\n", "\r\n")


def _work_object(name: str, frame: str, about: str) -> list[str]:
    """A work object in the world frame, which is the base's unless the base was moved."""
    return [f"! {about}", f'PERS wobjdata {name} := [FALSE, TRUE, "", {frame}, {NO_OFFSET}];']


def _procedure(subject: Subject) -> str:
    if not subject.on_flange:
        return ""
    return (
        "\n  ! Only the frame is set: mass, centre of gravity and inertia of the tool stay as they are.\n"
        "  PROC he_set_tool(PERS tooldata camera_tool)\n"
        f"    camera_tool.tframe := he_{subject.x_name};\n"
        "  ENDPROC\n"
    )
