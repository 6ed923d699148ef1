"""Every format by name: its file's name, media type and sentence; and plain numbers as CSV and as a matrix."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Generic, TypeVar

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.exports import brands, pose_list, rapid, ros, scene3d
from calibration.documents.exports.pose_list import PoseList
from calibration.documents.exports.subject import ExportOptions, Subject, subject_of
from calibration.documents.validation import nearest_fix
from calibration.errors import ExportRefused
from calibration.transforms import quaternion_from_rotation

Content = TypeVar("Content", Subject, PoseList)

TEXT, YAML, XML = "text/plain", "application/yaml", "application/xml"


COLUMNS = ("parent", "child", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "calibration")


def write_csv(subject: Subject) -> str:
    """A header and one row (RFC 4180), in the shortest digits that restore the numbers; qw >= 0."""
    numbers = [
        *subject.parent_T_child[:3, 3].tolist(),
        *quaternion_from_rotation(subject.parent_T_child[:3, :3]).tolist(),
    ]
    row = [subject.parent, subject.child, *(repr(value + 0.0) for value in numbers), subject.calibration_id]
    return "\r\n".join([",".join(COLUMNS), ",".join(row), ""])


def write_matrix(subject: Subject) -> str:
    """Four rows of four numbers, `parent_T_child` in mm, for numpy.loadtxt, MATLAB's readmatrix and R's read.table."""
    rows = "".join(" ".join(f"{value + 0.0: .15e}" for value in row) + "\n" for row in subject.parent_T_child.tolist())
    return subject.comment("#", f"{subject.parent} <- {subject.child}, mm, rows") + rows


@dataclass(frozen=True)
class ExportFormat(Generic[Content]):
    """`file`: the name to save it as; `write`: its content, text as UTF-8."""

    name: str
    file: str
    media_type: str
    about: str
    write: Callable[[Content], str | bytes]

    def encoded(self, content: Content) -> bytes:
        """The file."""
        written = self.write(content)
        return written if isinstance(written, bytes) else written.encode()


_FORMATS = (
    ExportFormat("ros2-launch", "handeyed.launch.py", "text/x-python",
                 "ROS 2 launch file with a static_transform_publisher", ros.write_launch),
    ExportFormat("ros-tf", "tf_static.yaml", YAML, "tf2_msgs/TFMessage for /tf_static", ros.write_tf),
    ExportFormat("urdf", "handeyed.urdf.xacro", XML, "xacro macro of the camera's links", ros.write_urdf),
    ExportFormat("easy-handeye2", "handeyed.calib", YAML, "calibration of easy_handeye2", ros.write_easy_handeye2),
    ExportFormat("moveit", "handeyed.launch", XML, "launch file as moveit_calibration saves it", ros.write_moveit),
    ExportFormat("rapid", "handeyed_data.mod", TEXT, "ABB RAPID: pose, work object, procedure for tframe",
                 rapid.write_rapid),
    ExportFormat("opencv", "handeyed_opencv.yaml", YAML, "OpenCV FileStorage: X, camera matrix, distortion",
                 brands.write_opencv),
    ExportFormat("halcon", "cam_in_tool_pose.dat", TEXT, "HALCON: the camera in the tool or base",
                 brands.write_halcon),
    ExportFormat("halcon-inverse", "tool_in_cam_pose.dat", TEXT, "HALCON: the tool or base in the camera",
                 brands.write_halcon_inverse),
    ExportFormat("zivid", "handEyeTransform.yaml", YAML, "Zivid Matrix4x4", brands.write_zivid),
    ExportFormat("mech-mind", "extri_param.json", "application/json", "Mech-Mind: depthInBase of extri_param.json",
                 brands.write_mech_mind),
    ExportFormat("kuka", "kuka.txt", TEXT, "KUKA $TOOL or $BASE: X Y Z A B C", brands.PENDANTS["kuka"].write),
    ExportFormat("fanuc", "fanuc.txt", TEXT, "FANUC UTOOL or UFRAME: X Y Z W P R", brands.PENDANTS["fanuc"].write),
    ExportFormat("ur", "ur.script", TEXT, "Universal Robots: set_tcp(p[...])", brands.PENDANTS["ur"].write),
    ExportFormat("yaskawa", "yaskawa.txt", TEXT, "Yaskawa tool or user frame: X Y Z Rx Ry Rz",
                 brands.PENDANTS["yaskawa"].write),
    ExportFormat("csv", "pose.csv", "text/csv", "one row of CSV", write_csv),
    ExportFormat("matrix", "matrix_4x4_mm.txt", TEXT, "4 x 4 matrix, mm", write_matrix),
    ExportFormat("gltf", "handeyed.glb", "model/gltf-binary", "glTF 2.0 scene", scene3d.write_gltf),
    ExportFormat("usd", "handeyed.usda", "model/vnd.usda", "OpenUSD stage", scene3d.write_usd),
)  # fmt: skip

FORMATS: Mapping[str, ExportFormat[Subject]] = MappingProxyType({each.name: each for each in _FORMATS})
"""Formats of X by name, in the order they are listed."""

_POSE_FORMATS = (
    ExportFormat("poses-toml", "poses.toml", "application/toml", "poses for the settings", pose_list.write_poses_toml),
    ExportFormat("rapid-robtarget", "handeyed_poses.mod", TEXT, "RAPID robtargets", pose_list.write_robtargets),
    ExportFormat("rapid-jointtarget", "handeyed_joints.mod", TEXT, "RAPID jointtargets", pose_list.write_jointtargets),
)

POSE_FORMATS: Mapping[str, ExportFormat[PoseList]] = MappingProxyType({each.name: each for each in _POSE_FORMATS})
"""Formats of a list of poses by name."""


def export(calibration: CalibrationDocument, name: str, options: ExportOptions | None = None) -> bytes:
    """X of `calibration` in the format `name`. Raises ExportRefused for an unknown name or without X."""
    return find_format(name).encoded(subject_of(calibration, options or ExportOptions()))


def find_format(name: str) -> ExportFormat[Subject]:
    """The format of that name. Raises ExportRefused with the nearest ones."""
    if name not in FORMATS:
        fix = nearest_fix(name, FORMATS) or f"use one of {', '.join(FORMATS)}"
        raise ExportRefused(f"{name[:40]!r} is no format of a calibration", fix)
    return FORMATS[name]


def export_poses(poses: PoseList, name: str) -> bytes:
    """`poses` in the format `name` of POSE_FORMATS. Raises ExportRefused."""
    if name not in POSE_FORMATS:
        raise ExportRefused(f"{name[:40]!r} is no format of poses", f"use one of {', '.join(POSE_FORMATS)}")
    return POSE_FORMATS[name].encoded(poses)
