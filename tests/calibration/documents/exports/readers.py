"""Readers of exported files that others wrote, or formulas of others: each gives X (4, 4) in mm."""

import csv
import io
import json
import re
from collections.abc import Callable
from typing import Any
from xml.dom.minidom import parseString
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.transforms import Array, transform
from tests.mock_robot.rapid.snippets import Snippet

Reader = Callable[[bytes], Array]
NUMBER = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"


def placed(metres: object, xyzw: object) -> Array:
    """From metres and a quaternion x, y, z, w, whose sign is checked."""
    quaternion = np.array(xyzw, float)
    assert quaternion[3] >= 0
    return transform(Rotation.from_quat(quaternion).as_matrix(), 1000 * np.array(metres, float))


def _by_name(values: dict[str, float], names: str) -> list[float]:
    return [values[name] for name in names]


def _yaml(content: bytes) -> dict:  # type: ignore[type-arg]
    read: dict = pytest.importorskip("yaml").safe_load(content)  # type: ignore[type-arg]
    return read


def ros_tf(content: bytes) -> Array:
    read = _yaml(content)["transforms"][0]["transform"]
    return placed(_by_name(read["translation"], "xyz"), _by_name(read["rotation"], "xyzw"))


def easy_handeye2(content: bytes) -> Array:
    read = _yaml(content)["transform"]
    return placed(_by_name(read["translation"], "xyz"), _by_name(read["rotation"], "xyzw"))


def ros2_launch(content: bytes) -> Array:
    """By running the file with a launch_ros that hands its arguments over."""
    nodes: list[dict[str, list[str]]] = []
    text = re.sub(r"^from launch\S* import \S+\n", "", content.decode().replace("_ros.actions", "_ros"), flags=re.M)
    names: dict[str, object] = {"Node": lambda **given: nodes.append(given), "LaunchDescription": lambda each: each}
    exec(compile(text, "handeyed.launch.py", "exec"), names)
    names["generate_launch_description"]()  # type: ignore[operator]
    given = nodes[0]["arguments"]
    values = dict(zip(given[::2], given[1::2], strict=True))
    assert (values["--frame-id"], values["--child-frame-id"]) == ("tool0", "camera_optical_frame")
    return placed([values[f"--{axis}"] for axis in "xyz"], [values[f"--q{axis}"] for axis in "xyzw"])


def moveit(content: bytes) -> Array:
    node = ElementTree.fromstring(content).find("node")
    assert node is not None
    values = node.attrib["args"].split()
    return placed(values[:3], values[3:7])


def urdf_joints(content: bytes) -> list[Any]:
    """The joints of the macro, by xacro, then urdfdom_py."""
    xacro, parser = pytest.importorskip("xacro"), pytest.importorskip("urdf_parser_py.urdf")
    calling = content.replace(b"</robot>", b'<link name="tool0"/><xacro:handeyed_camera/></robot>')
    document = parseString(calling.replace(b"<robot ", b'<robot name="cell" '))
    xacro.process_doc(document)
    joints: list[Any] = parser.URDF.from_xml_string(document.toxml()).joints
    return joints


def joint_place(joint: Any) -> Array:
    """parent_T_child of a joint."""
    rotation = Rotation.from_euler("xyz", joint.origin.rpy).as_matrix()
    return transform(rotation, 1000 * np.array(joint.origin.xyz))


def urdf(content: bytes) -> Array:
    (joint,) = urdf_joints(content)
    assert (joint.parent, joint.child) == ("tool0", "camera_optical_frame")
    return joint_place(joint)


def rapid(content: bytes) -> Array:
    """By the mock's interpreter: the value that he_set_tool gives a tool's frame."""
    tool = "PERS tooldata he_tool := [TRUE, [[1, 2, 3], [1, 0, 0, 0]], [7, [8, 9, 10], [1, 0, 0, 0], 11, 12, 13]];"
    text = content.decode("ascii").replace("MODULE handeyed_data", f"MODULE handeyed_data {tool}", 1)
    text = text.replace("ENDMODULE", "PROC main() he_set_tool he_tool; ENDPROC ENDMODULE")
    _, (position, wxyz), (mass, *_rest) = Snippet(text).runs()["he_tool"]
    assert mass == 7
    return placed(np.array(position) / 1000, [*wxyz[1:], wxyz[0]])


def opencv(content: bytes) -> Array:
    file = cv2.FileStorage(content.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    matrix = file.getNode("flange_T_camera").mat()
    assert file.getNode("camera_matrix").mat().shape == (3, 3)
    assert file.getNode("image_width").real() > 0
    file.release()
    return np.array(matrix)


def _dat(content: bytes) -> Array:
    """HALCON's type 0: R = Rx Ry Rz, degrees, metres."""
    rows = dict(line.split(maxsplit=1) for line in content.decode().splitlines() if line[:2] in ("f ", "r ", "t "))
    assert rows["f"] == "0"
    angles = [float(angle) for angle in rows["r"].split()]
    assert all(0 <= angle <= 360 for angle in angles)
    rotation = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
    return transform(rotation, [1000 * float(value) for value in rows["t"].split()])


def halcon_inverse(content: bytes) -> Array:
    inverted: Array = np.linalg.inv(_dat(content))
    return inverted


def zivid(content: bytes) -> Array:
    return np.array(_yaml(content)["FloatMatrix"]["Data"], float)


def mech_mind(content: bytes) -> Array:
    x, y, z, w, *xyz = json.loads(content)["depthInBase"]
    return placed([x, y, z], [*xyz, w])


def _six(pattern: str) -> Callable[[bytes], list[float]]:
    def read(content: bytes) -> list[float]:
        found = re.search(pattern.replace("#", f"({NUMBER})"), content.decode())
        assert found, content
        return [float(number) for number in found.groups()]

    return read


def _by_robodk(name: str, values: list[float]) -> Array:
    """The pose of a brand's six numbers by RoboDK's formulas."""
    convert = getattr(pytest.importorskip("robodk.robomath"), name)
    return np.array(convert(values).rows, float)


def kuka(content: bytes) -> Array:
    return _by_robodk("KUKA_2_Pose", _six(r"\$TOOL=\{X #,Y #,Z #,A #,B #,C #\}")(content))


def fanuc(content: bytes) -> Array:
    return _by_robodk("Fanuc_2_Pose", _six("X=# Y=# Z=# W=# P=# R=#")(content))


def yaskawa(content: bytes) -> Array:
    return _by_robodk("Motoman_2_Pose", _six("X=# Y=# Z=# Rx=# Ry=# Rz=#")(content))


def ur(content: bytes) -> Array:
    pose = _by_robodk("UR_2_Pose", _six(r"set_tcp\(p\[#, #, #, #, #, #\]\)")(content))
    pose[:3, 3] *= 1000
    return pose


def csv_row(content: bytes) -> Array:
    (row,) = csv.DictReader(io.StringIO(content.decode(), newline=""))
    metres = np.array([float(row[name]) for name in ("x_mm", "y_mm", "z_mm")]) / 1000
    return placed(metres, [float(row[name]) for name in ("qx", "qy", "qz", "qw")])


def matrix(content: bytes) -> Array:
    return np.loadtxt(io.BytesIO(content))


def gltf(content: bytes) -> Array:
    scene = pytest.importorskip("pygltflib").GLTF2.load_from_bytes(content)
    node = next(node for node in scene.nodes if node.name == "camera_optical_frame")
    return placed(node.translation, node.rotation)


def usd(content: bytes) -> Array:
    """By OpenUSD: the frame's place in its parent. Its matrices act on rows."""
    sdf, usd_module = pytest.importorskip("pxr.Sdf"), pytest.importorskip("pxr.Usd")
    geometry = pytest.importorskip("pxr.UsdGeom")
    layer = sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(content.decode())
    stage = usd_module.Stage.Open(layer)
    assert geometry.GetStageMetersPerUnit(stage) == 0.001
    prim = stage.GetPrimAtPath("/tool0/camera_optical_frame")
    return np.array(geometry.Xformable(prim).GetLocalTransformation()).T


READERS: dict[str, Reader] = {
    "ros2-launch": ros2_launch,
    "ros-tf": ros_tf,
    "urdf": urdf,
    "easy-handeye2": easy_handeye2,
    "moveit": moveit,
    "rapid": rapid,
    "opencv": opencv,
    "halcon": _dat,
    "halcon-inverse": halcon_inverse,
    "zivid": zivid,
    "mech-mind": mech_mind,
    "kuka": kuka,
    "fanuc": fanuc,
    "ur": ur,
    "yaskawa": yaskawa,
    "csv": csv_row,
    "matrix": matrix,
    "gltf": gltf,
    "usd": usd,
}
