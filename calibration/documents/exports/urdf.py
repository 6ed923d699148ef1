"""URDF: a xacro macro with the camera's links. Metres, rad, turns about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll)."""

from calibration.documents.exports.subject import OPTICAL_FRAME, Subject

QUARTER_TURN = "1.570796326794897"


def write_urdf(subject: Subject) -> str:
    """A macro that joins `child` to `parent`; with a body frame the optical frame hangs on it."""
    about = "; ".join([*subject.about(), "metres, rad, rpy about fixed axes"])
    links = _link("${parent}", subject.child, " ".join(subject.metres()), " ".join(subject.turn("euler-xyz-rad")))
    if subject.is_body_frame:
        links += _link(f"${{prefix}}{subject.child}", OPTICAL_FRAME, "0 0 0", f"-{QUARTER_TURN} 0 -{QUARTER_TURN}")
    return (
        '<?xml version="1.0"?>\n'
        f"<!-- {about} -->\n"
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
        f'  <xacro:macro name="handeyed_camera" params="parent:={subject.parent} prefix:=\'\'">\n'
        f"{links}"
        "  </xacro:macro>\n"
        "</robot>\n"
    )


def _link(parent: str, name: str, position: str, angles: str) -> str:
    joint = name.removesuffix("_frame").replace("/", "_")
    return (
        f'    <link name="${{prefix}}{name}"/>\n'
        f'    <joint name="${{prefix}}{joint}_joint" type="fixed">\n'
        f'      <parent link="{parent}"/>\n'
        f'      <child link="${{prefix}}{name}"/>\n'
        f'      <origin xyz="{position}" rpy="{angles}"/>\n'
        "    </joint>\n"
    )
