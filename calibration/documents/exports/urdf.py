"""URDF: a xacro macro with the camera's links. Metres, rad, turns about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll)."""

from collections.abc import Sequence

from calibration.documents.exports.subject import OPTICAL_FRAME, Subject

OPTICAL_TURN = ("-1.570796326794897", "0", "-1.570796326794897")


def write_urdf(subject: Subject) -> str:
    """A macro that joins `child` to `parent`; with a body frame the optical frame hangs on it."""
    about = "; ".join([*subject.about(), "metres, rad, rpy about fixed axes"])
    links = _link(subject, "${parent}", subject.child, subject.metres(), subject.turn("euler-xyz-rad"))
    if subject.is_body_frame:
        links += _link(subject, f"${{prefix}}{subject.child}", OPTICAL_FRAME, "000", OPTICAL_TURN)
    return subject.filled("urdf.xml.txt", about=about, links=links)


def _link(subject: Subject, above: str, name: str, position: Sequence[str], angles: Sequence[str]) -> str:
    placed = {"position": " ".join(position), "angles": " ".join(angles)}
    joint = name.removesuffix("_frame").replace("/", "_")
    return subject.filled("urdf_link.xml.txt", name=name, joint=joint, above=above, **placed)
