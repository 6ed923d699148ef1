"""ROS: a static transform as a launch file, as a TFMessage, for easy_handeye2, for moveit_calibration, and as URDF.

Metres; the quaternion as x, y, z, w; in URDF turns in rad about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll). Options of
static_transform_publisher as in ros2/geometry2; the .calib file as easy_handeye2's HandeyeCalibration.msg; the launch
file as moveit_calibration's control widget saves it.
"""

from collections.abc import Sequence

from calibration.documents.exports.subject import OPTICAL_FRAME, Subject

UNITS = "metres; quaternion x, y, z, w with w >= 0"


def _named(subject: Subject) -> tuple[dict[str, str], dict[str, str]]:
    """Translation x, y, z in metres and rotation x, y, z, w by name."""
    quaternion = subject.turn("quaternion-xyzw")
    return dict(zip("xyz", subject.metres(), strict=True)), dict(zip("xyzw", quaternion, strict=True))


def write_launch(subject: Subject) -> str:
    """A launch file in Python for ROS 2."""
    translation, rotation = _named(subject)
    values = {
        **{f"--{axis}": value for axis, value in translation.items()},
        **{f"--q{axis}": value for axis, value in rotation.items()},
        "--frame-id": subject.parent,
        "--child-frame-id": subject.child,
    }
    arguments = "".join(f'                "{option}", "{value}",\n' for option, value in values.items())
    return subject.comment("#", UNITS) + subject.filled("launch.py.txt", arguments=arguments)


def write_tf(subject: Subject) -> str:
    """A tf2_msgs/TFMessage in YAML."""
    translation, rotation = (_flow(values) for values in _named(subject))
    publish = (
        "ros2 topic pub --once --qos-durability transient_local"
        ' /tf_static tf2_msgs/msg/TFMessage "$(cat tf_static.yaml)"'
    )
    return subject.comment("#", UNITS, publish) + subject.filled(
        "tf_static.yaml.txt", translation=translation, rotation=rotation
    )


def write_easy_handeye2(subject: Subject) -> str:
    """A .calib of easy_handeye2, for ~/.ros2/easy_handeye2/calibrations/NAME.calib."""
    translation, rotation = (_flow(values) for values in _named(subject))
    kind, base, effector = ("eye_in_hand", "base", subject.parent)
    if not subject.on_flange:
        kind, base, effector = ("eye_on_base", subject.parent, "tool0")
    frames = {"kind": kind, "base": base, "effector": effector}
    about = subject.comment("#", UNITS, "save it as ~/.ros2/easy_handeye2/calibrations/handeyed.calib")
    return about + subject.filled("easy_handeye2.yaml.txt", **frames, translation=translation, rotation=rotation)


def write_moveit(subject: Subject) -> str:
    """The launch file of moveit_calibration, a ROS 1 static transform."""
    translation, rotation = _named(subject)
    return subject.filled(
        "moveit.xml.txt",
        about="; ".join([*subject.about(), UNITS]),
        position=" ".join(translation.values()),
        quaternion=" ".join(rotation.values()),
        angles=" ".join(subject.turn("euler-xyz-rad")),
    )


def _flow(values: dict[str, str]) -> str:
    return "{" + ", ".join(f"{name}: {value}" for name, value in values.items()) + "}"


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
