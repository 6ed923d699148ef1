"""Scenes for viewers of three dimensions: glTF 2.0 as .glb, and OpenUSD as text.

glTF: y up, metres, quaternion x, y, z, w; a camera looks along -z (Khronos glTF 2.0). USD: as its stage says, here z up
and mm; a camera looks along -z with y up. So both hang a camera turned by half a turn about x below the optical frame.
"""

import json
import math
import struct
from typing import Any

import numpy as np

from calibration.documents.exports.subject import LINK_T_OPTICAL, OPTICAL_FRAME, Subject
from calibration.transforms import Array, quaternion_from_rotation

HALF_SQRT2 = math.sqrt(0.5)
AXIS_M = 0.1
NEAR_MM, FAR_MM = 50.0, 3000.0
FLOAT, LINES, ARRAY_BUFFER = 5126, 1, 34962
GLB, JSON_CHUNK, BIN_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942


def write_gltf(subject: Subject) -> bytes:
    """A binary glTF: parent, camera frame and camera, each frame with axes of 100 mm in red, green and blue."""
    axes = np.zeros((6, 3), np.float32)
    axes[[1, 3, 5], [0, 1, 2]] = AXIS_M
    colours = np.repeat(np.eye(3, dtype=np.float32), 2, axis=0)
    content = axes.tobytes() + colours.tobytes()
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "handeyed", "extras": {"about": [*subject.about(), "metres, y up"]}},
        "scene": 0,
        "scenes": [{"name": subject.calibration_id, "nodes": [0]}],
        "nodes": _nodes(subject),
        "meshes": [{"name": "axes", "primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": LINES}]}],
        "accessors": [
            {"bufferView": 0, "componentType": FLOAT, "count": 6, "type": "VEC3",
             "min": [0.0] * 3, "max": [float(np.float32(AXIS_M))] * 3},
            {"bufferView": 1, "componentType": FLOAT, "count": 6, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 72 * view, "byteLength": 72, "target": ARRAY_BUFFER} for view in (0, 1)
        ],
        "buffers": [{"byteLength": len(content)}],
    }  # fmt: skip
    if camera := _perspective(subject):
        document["cameras"] = [camera]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), JSON_CHUNK) + text + struct.pack("<II", len(content), BIN_CHUNK) + content
    return struct.pack("<III", GLB, 2, 12 + len(chunks)) + chunks


def _nodes(subject: Subject) -> list[dict[str, Any]]:
    """Scene in z up, parent, camera frame, camera; a body frame has the optical frame between it and the camera."""
    nodes: list[dict[str, Any]] = [
        {"name": "z up", "rotation": [-HALF_SQRT2, 0, 0, HALF_SQRT2], "children": [1]},
        {"name": subject.parent, "mesh": 0, "children": [2]},
        {"name": subject.child, "mesh": 0, **_placed(subject.parent_T_child), "children": [3]},
    ]
    if subject.is_body_frame:
        nodes.append({"name": OPTICAL_FRAME, **_placed(LINK_T_OPTICAL), "children": [4]})
    looking = {"camera": 0} if subject.calibration.camera else {}
    return [*nodes, {"name": "camera", "rotation": [1, 0, 0, 0], **looking}]


def _placed(a_T_b: Array) -> dict[str, Any]:
    w, x, y, z = quaternion_from_rotation(a_T_b[:3, :3]).tolist()
    return {"translation": (a_T_b[:3, 3] / 1000).tolist(), "rotation": [x, y, z, w]}


def _perspective(subject: Subject) -> dict[str, Any] | None:
    camera = subject.calibration.camera
    if camera is None:
        return None
    (width, height), fx, fy = camera.image_size, camera.matrix[0][0], camera.matrix[1][1]
    view = {"yfov": 2 * math.atan(height / 2 / fy), "aspectRatio": width / fx * fy / height}
    return {"type": "perspective", "perspective": {**view, "znear": NEAR_MM / 1000, "zfar": FAR_MM / 1000}}


def write_usd(subject: Subject) -> str:
    """An OpenUSD stage as text: parent, camera frame, camera; mm, z up."""
    camera = _usd_camera(subject)
    if subject.is_body_frame:
        camera = _prim(OPTICAL_FRAME, _usd_place(LINK_T_OPTICAL), camera)
    child = _prim(_prim_name(subject.child), _usd_place(subject.parent_T_child), camera)
    about = "; ".join(subject.about())
    head = f'#usda 1.0\n(\n    doc = "{about}"\n    defaultPrim = "{_prim_name(subject.parent)}"\n'
    return f'{head}    metersPerUnit = 0.001\n    upAxis = "Z"\n)\n\n' + _prim(_prim_name(subject.parent), "", child)


def _prim_name(frame: str) -> str:
    return frame.replace("/", "_")


def _prim(name: str, place: str, inside: str, kind: str = "Xform") -> str:
    body = "".join(f"    {line}\n" for line in (place + inside).splitlines())
    return f'def {kind} "{name}"\n{{\n{body}}}\n'


def _usd_place(a_T_b: Array) -> str:
    position = ", ".join(repr(value + 0.0) for value in a_T_b[:3, 3].tolist())
    turn = ", ".join(repr(value + 0.0) for value in quaternion_from_rotation(a_T_b[:3, :3]).tolist())
    return (
        f"double3 xformOp:translate = ({position})\n"
        f"quatd xformOp:orient = ({turn})\n"
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]\n'
    )


def _usd_camera(subject: Subject) -> str:
    """A camera with a focal length of 10 (tenths of a unit) and the aperture that gives the view."""
    turn = 'quatd xformOp:orient = (0, 1, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:orient"]\n'
    camera = subject.calibration.camera
    view = ""
    if camera is not None:
        (width, height), fx, fy = camera.image_size, camera.matrix[0][0], camera.matrix[1][1]
        view = (
            'token projection = "perspective"\n'
            "float focalLength = 10\n"
            f"float horizontalAperture = {10 * width / fx:.9g}\n"
            f"float verticalAperture = {10 * height / fy:.9g}\n"
            f"float2 clippingRange = ({NEAR_MM:g}, {FAR_MM:g})\n"
        )
    return _prim("camera", turn, view, "Camera")
