"""Pendants of other makes: position in mm and three angles in degrees, or UR's metres and rotation vector in rad.

KUKA R = Rz(A) Ry(B) Rx(C); Fanuc R = Rz(R) Ry(P) Rx(W); Yaskawa R = Rz(Rz) Ry(Ry) Rx(Rx) (rc_visard's manual, pose
formats).
"""

from calibration.documents.exports.notation import angles_xyz
from calibration.documents.exports.subject import Subject
from calibration.transforms import vector_from_rotation


def _angles(subject: Subject) -> list[str]:
    """Turns about x, y, z in degrees."""
    return subject.degrees(angles_xyz(subject.parent_T_child[:3, :3]))


def write_kuka(subject: Subject) -> str:
    """`$TOOL`, or `$BASE` of a camera that stands still."""
    x, y, z = subject.millimetres()
    c, b, a = _angles(subject)
    name = "$TOOL" if subject.on_flange else "$BASE"
    comment = subject.comment(";", f"KUKA {name}: mm, deg, R = Rz(A) Ry(B) Rx(C)")
    return f"{comment}{name}={{X {x},Y {y},Z {z},A {a},B {b},C {c}}}\n"


def write_fanuc(subject: Subject) -> str:
    """UTOOL, or UFRAME of a camera that stands still."""
    x, y, z = subject.millimetres()
    w, p, r = _angles(subject)
    name = "UTOOL" if subject.on_flange else "UFRAME"
    comment = subject.comment("!", f"FANUC {name}: mm, deg, R = Rz(R) Ry(P) Rx(W)")
    return f"{comment}X={x} Y={y} Z={z} W={w} P={p} R={r}\n"


def write_yaskawa(subject: Subject) -> str:
    """Tool coordinates, or a user frame of a camera that stands still."""
    x, y, z = subject.millimetres()
    rx, ry, rz = _angles(subject)
    name = "tool" if subject.on_flange else "user frame"
    comment = subject.comment("'", f"Yaskawa {name}: mm, deg, R = Rz(Rz) Ry(Ry) Rx(Rx)")
    return f"{comment}X={x} Y={y} Z={z} Rx={rx} Ry={ry} Rz={rz}\n"


def write_ur(subject: Subject) -> str:
    """URScript: the TCP, or the camera's pose in the base."""
    vector = subject.radians(tuple(vector_from_rotation(subject.parent_T_child[:3, :3]).tolist()))
    pose = f"p[{', '.join([*subject.metres(), *vector])}]"
    comment = subject.comment("#", "UR: metres and a rotation vector in rad")
    return comment + (f"set_tcp({pose})\n" if subject.on_flange else f"base_T_camera = {pose}\n")


def write_mech_mind(subject: Subject) -> str:
    """depthInBase of Mech-Vision's extri_param.json: x, y, z in metres and the quaternion w, x, y, z of the camera in
    the flange or base (Mech-Mind's community, topic 257). The other entries of that file belong to the camera."""
    about = "; ".join([*subject.about(), "x, y, z in metres, quaternion w, x, y, z"])
    numbers = ",\n".join(f"    {value}" for value in [*subject.metres(), *subject.quaternion_wxyz()])
    return f'{{\n  "comment": "{about}",\n  "depthInBase": [\n{numbers}\n  ]\n}}\n'
