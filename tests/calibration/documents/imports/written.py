"""Three poses of a flange, written as robots and programs write them: files of our own making."""

import io
import json
import pickle
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.transforms import (
    Array,
    quaternion_from_rotation,
    rotation_from_vector,
    transform,
    vector_from_rotation,
)

POSES: Array = np.array(
    [
        transform(rotation_from_vector([2.9, 0.2, 0.4]), [812.4, -35.1, 640.0]),
        transform(rotation_from_vector([2.7, -0.3, 0.8]), [700.25, 120.5, 611.75]),
        transform(rotation_from_vector([3.0, 0.5, -0.6]), [903.0, 44.0, 580.5]),
    ]
)
"""base_T_flange (3, 4, 4) in mm."""

MM: Array = POSES[:, :3, 3]
ROTATIONS: Array = POSES[:, :3, :3]
WXYZ: Array = quaternion_from_rotation(ROTATIONS)
VECTORS: Array = vector_from_rotation(ROTATIONS)


def euler(order: str) -> Array:
    """(3, 3) degrees by scipy: upper case intrinsic, lower case extrinsic."""
    angles: Array = Rotation.from_matrix(ROTATIONS).as_euler(order, degrees=True)
    return angles


def rows(*columns: Array, separator: str = ",", decimal: str = ".") -> list[str]:
    """One line for each pose."""
    return [separator.join(f"{v:.9f}".replace(".", decimal) for v in row) for row in np.concatenate(columns, axis=1)]


def lines(*texts: str) -> bytes:
    return ("\n".join(texts) + "\n").encode()


def npy(array: Array) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def npz(*unnamed: Array, **arrays: Array) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, *unnamed, **arrays)
    return stream.getvalue()


def sheet(rows: list[list[Any]], *, shared: bool = True) -> bytes:
    """An .xlsx file with texts in a list of their own, as Excel writes it, or in their cells."""
    texts: list[str] = []

    def cell(name: str, value: Any) -> str:
        if isinstance(value, str) and shared:
            texts.append(value)
            return f'<c r="{name}" t="s"><v>{len(texts) - 1}</v></c>'
        if isinstance(value, str):
            return f'<c r="{name}" t="inlineStr"><is><t>{escape(value)}</t></is></c>'
        return f'<c r="{name}"><f>1+1</f><v>{value!r}</v></c>'

    lines = ""
    for at, row in enumerate(rows, 1):
        cells = (cell(f"{column}{at}", one) for column, one in zip("ABCDEFGH", row, strict=False) if one is not None)
        lines += f'<row r="{at}">{"".join(cells)}</row>'
    space = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", f"<worksheet {space}><sheetData>{lines}</sheetData></worksheet>")
        archive.writestr("xl/worksheets/sheet2.xml", f"<worksheet {space}/>")
        if shared:
            said = "".join(f"<si><t>{escape(text)}</t><rPh><t>reading</t></rPh></si>" for text in texts)
            archive.writestr("xl/sharedStrings.xml", f"<sst {space}>{said}</sst>")
    return stream.getvalue()


@dataclass(frozen=True)
class Held:
    """Files in memory."""

    files: Mapping[str, bytes]
    origin: str = "set"

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(sorted(self.files))

    def read(self, name: str) -> bytes:
        return self.files[name]


def matrices(metres: bool = False) -> Array:
    scaled = POSES.copy()
    scaled[:, :3, 3] *= 0.001 if metres else 1.0
    return scaled


def ros_poses() -> list[dict[str, dict[str, float]]]:
    """geometry_msgs/Pose as plain data."""
    return [
        {
            "position": dict(zip("xyz", (mm / 1000).tolist(), strict=True)),
            "orientation": dict(zip("wxyz", wxyz.tolist(), strict=True)),
        }
        for mm, wxyz in zip(MM, WXYZ, strict=True)
    ]


def rapid() -> bytes:
    targets = [
        f"  CONST robtarget p{at}:=[[{mm}],[{turn}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
        for at, (mm, turn) in enumerate(zip(rows(MM), rows(WXYZ), strict=True), 1)
    ]
    tool = "  PERS tooldata tCam:=[TRUE,[[1,2,3],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"
    return lines("MODULE Poses", tool, "  ! [[9,9,9],[1,0,0,0]]", *targets, "ENDMODULE")


def keyed(form: str, angles: Array) -> bytes:
    """Each pose in a form such as "{{X {}, Y {}, Z {}, A {}, B {}, C {}}}"."""
    return lines(*(form.format(*mm, *turn) for mm, turn in zip(MM, angles, strict=True)))


FILES: dict[str, tuple[str, bytes, str]] = {
    "header, quaternion": ("a.csv", lines("x,y,z,qw,qx,qy,qz", *rows(MM, WXYZ)), ""),
    "ABB's names": ("a.csv", lines("Name;X mm;Y mm;Z mm;q1;q2;q3;q4",
                    *(f"p{at};{row}" for at, row in enumerate(rows(MM, WXYZ, separator=";")))), "abb"),
    "decimal commas": ("a.csv", lines("X;Y;Z;QW;QX;QY;QZ", *rows(MM, WXYZ, separator=";", decimal=",")), ""),
    "tabs, axes named": ("a.tsv", lines("x [mm]\ty [mm]\tz [mm]\trx [deg]\try [deg]\trz [deg]",
                         *rows(MM, euler("xyz"), separator="\t")), "abb"),
    "blanks, no header": ("a.txt", lines("# x y z qx qy qz w",
                          *rows(MM, np.roll(WXYZ, -1, axis=1), separator=" ")), ""),
    "tabs, and blanks in one row": ("a.txt", lines(*rows(MM, WXYZ, separator="\t")[:2],
                                    *rows(MM, WXYZ, separator=" ")[2:]), "abb"),
    "six numbers": ("a.txt", lines(*rows(MM, euler("ZYX"), separator=" ")), "kuka"),
    "named KUKA angles": ("a.csv", lines("X,Y,Z,A,B,C", *rows(MM, euler("ZYX"))), "kuka"),
    "roll, pitch, yaw": ("a.csv", lines("x,y,z,roll,pitch,yaw", *rows(MM, np.radians(euler("xyz")))), "ros"),
    "rotation vector": ("a.csv", lines("tx,ty,tz,rvec_x,rvec_y,rvec_z", *rows(MM, VECTORS)), ""),
    "sixteen numbers": ("a.txt", lines(*rows(POSES.reshape(3, 16), separator=" ")), ""),
    "twelve numbers": ("a.txt", lines(*rows(POSES[:, :3].reshape(3, 12), separator=" ")), ""),
    "matrix in names": ("a.csv", lines(",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)) + ",x,y,z",
                        *rows(ROTATIONS.reshape(3, 9), MM)), ""),
    "4 x 4 blocks": ("a.txt", lines(*("\n".join(" ".join(map(str, row)) for row in pose) for pose in POSES)), ""),
    "counted blocks": ("a.txt", lines("3", *("\n".join(" ".join(map(str, r)) for r in pose) for pose in POSES)), ""),
    "Franka's columns": ("a.txt", lines(*rows(np.swapaxes(POSES, 1, 2).reshape(3, 16), separator=" ")), ""),
    "Python's brackets": ("a.txt", lines(*(f"T{at} = np.array({pose.tolist()})" for at, pose in enumerate(POSES))), ""),
    "numpy as it prints": ("a.txt", lines(*(f"[{pose!s}]" for pose in POSES)), ""),
    "MATLAB": ("a.txt", lines(*(f"T{at} = [" + "; ".join(" ".join(map(str, row)) for row in pose) + "];"
                                for at, pose in enumerate(POSES))), ""),
    "a label and brackets": ("a.txt", lines(*(f"pose: [{row}]" for row in rows(MM, VECTORS))), "rotation-vector"),
    "a picture and brackets": ("a.txt", lines(*(f"img_{at}.png [{row}]" for at, row in enumerate(rows(MM, VECTORS)))),
                               "rotation-vector"),
    "axis before the word": ("a.csv", lines("x_pos,y_pos,z_pos,w_rot,x_rot,y_rot,z_rot", *rows(MM, WXYZ)), ""),
    "angles first": ("a.csv", lines(*rows(euler("ZYX"), MM)), "kuka"),
    "quaternion first": ("a.csv", lines(*rows(WXYZ, MM)), "abb"),
    "nested rotation": ("a.json", json.dumps([{"rotation": pose[:3, :3].tolist(), "translation": pose[:3, 3].tolist()}
                                              for pose in POSES]).encode(), ""),
    "JSON of ROS": ("a.json", json.dumps(ros_poses()).encode(), ""),
    "JSON by name": ("a.json", json.dumps({f"v{at}": pose for at, pose in enumerate(ros_poses())}).encode(), ""),
    "JSON matrices": ("a.json", json.dumps({"poses": POSES.tolist()}).encode(), ""),
    "JSON matrix a record": ("a.json", json.dumps([{"id": at, "T": pose.tolist()} for at, pose in enumerate(POSES)])
                             .encode(), ""),
    "JSON lists": ("a.json", json.dumps([{"translation_mm": mm.tolist(), "quaternion_wxyz": turn.tolist()}
                   for mm, turn in zip(MM, WXYZ, strict=True)]).encode(), ""),
    "JSON lines": ("a.jsonl", lines(*(json.dumps(pose) for pose in ros_poses())), ""),
    "YAML": ("a.yaml", lines(*(f"- {json.dumps(pose)}" for pose in ros_poses())), ""),
    "NPY": ("a.npy", npy(POSES), ""),
    "a pickle": ("a.pkl", pickle.dumps({"poses": list(POSES)}, 2), ""),
    "a sheet": ("a.xlsx", sheet([[*"xyz", "rvec_x", "rvec_y", "rvec_z"],
                                 *np.concatenate([MM, VECTORS], axis=1).tolist()]), ""),
    "NPZ": ("a.npz", npz(R=ROTATIONS, t=MM), ""),
    "RAPID": ("a.mod", rapid(), ""),
    "KUKA": ("a.src", keyed("DECL E6POS P={{X {}, Y {}, Z {}, A {}, B {}, C {}, S 2, T 35}}", euler("ZYX")), "kuka"),
    "Fanuc": ("a.ls", keyed("P[1]{{\n X = {:.4f} mm, Y = {:.4f} mm, Z = {:.4f} mm,\n W = {:.6f} deg,"
                            " P = {:.6f} deg, R = {:.6f} deg\n}};", euler("xyz")), "fanuc"),
    "Fanuc, whole, with a second group": ("a.ls", lines("DEFAULT_GROUP = 1,1,*,*,*;", "/MN", " 1:J P[1] 100% FINE ;",
        "/POS") + keyed("P[1]{{\n GP1:\n X = {:.4f} mm, Y = {:.4f} mm, Z = {:.4f} mm,\n W = {:.6f} deg, P = {:.6f} deg,"
                        " R = {:.6f} deg\n GP2:\n UF : 0, UT : 0,\n J1= 6.5 deg\n}};", euler("xyz")), "fanuc"),
    "UR": ("a.script", lines(*(f"p{at} = p[{row}]" for at, row in enumerate(rows(MM / 1000, VECTORS)))), ""),
    "a program's log": ("a.log", lines(*(f"10:00:0{at},125 Pose {at}: X={x:.6f} Y={y:.6f} Z={z:.6f} Q=[{turn}]"
                        for at, ((x, y, z), turn) in enumerate(zip(MM, rows(WXYZ), strict=True)))), "abb"),
    "lists in a log": ("a.log", lines(*(f"pose {at}: position: [{mm}] rvec: [{turn}]"
                       for at, (mm, turn) in enumerate(zip(rows(MM), rows(VECTORS), strict=True)))), ""),
    "Open3D's trajectory": ("a.log", lines(*(f"{at} {at} 3\n" + "\n".join(" ".join(map(str, row)) for row in pose)
                            for at, pose in enumerate(POSES))), ""),
    "Stanford's conf": ("a.conf", lines("camera 0 0 0 0 0 0 1", *(f"bmesh scan_{at}.ply {row}" for at, row in enumerate(
                        rows(MM, np.roll(WXYZ, -1, axis=1), separator=" ")))), ""),
    "TUM": ("a.txt", lines(*rows(np.array([[1e9], [1e9 + 1], [1e9 + 2]]), MM / 1000, np.roll(WXYZ, -1, axis=1),
            separator=" ")), "quaternion-xyzw"),
}  # fmt: skip
"""Name of the case: name of the file, its content, and the convention to give where the file leaves it open."""
