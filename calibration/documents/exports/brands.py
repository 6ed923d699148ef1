"""Other makes: pendants, whose order of numbers and unit are those of BRANDS; Mech-Mind's camera file, OpenCV's
FileStorage, HALCON's poses in both directions, Zivid's matrix."""

from dataclasses import dataclass

import numpy as np

from calibration.documents.exports.subject import Subject, fixed
from calibration.kinematics.conventions import BRANDS
from calibration.transforms import Array, inverse


@dataclass(frozen=True)
class Pendant:
    """How a brand's pendant or program writes one frame.

    comment : what begins a comment; frames : words of the frame of a camera on the flange, and of one that stands
    still. pose : {0} to {5} are the numbers in the brand's order, {frame[0]} and so on those words.
    """

    brand: str
    comment: str
    frames: tuple[tuple[str, ...], tuple[str, ...]]
    pose: str

    def write(self, subject: Subject) -> str:
        """A tool, or the frame of a camera that stands still."""
        brand, frame = BRANDS[self.brand], self.frames[0 if subject.on_flange else 1]
        lengths = subject.metres() if brand.unit == "m" else subject.millimetres()
        about = f"{self.brand.upper()} {frame[0].strip('( =')}: {brand.unit}; {brand.words}"
        pose = self.pose.format(*lengths, *subject.turn(brand.angles), frame=frame)
        return f"{subject.comment(self.comment, about)}{pose}\n"


PENDANTS = {
    one.brand: one
    for one in (
        Pendant("kuka", ";", (("$TOOL",), ("$BASE",)), "{frame[0]}={{X {0},Y {1},Z {2},A {3},B {4},C {5}}}"),
        Pendant("fanuc", "!", (("UTOOL",), ("UFRAME",)), "X={0} Y={1} Z={2} W={3} P={4} R={5}"),
        Pendant("yaskawa", "'", (("tool",), ("user frame",)), "X={0} Y={1} Z={2} Rx={3} Ry={4} Rz={5}"),
        Pendant("ur", "#", (("set_tcp(", ")"), ("base_T_camera = ", "")),
                "{frame[0]}p[{0}, {1}, {2}, {3}, {4}, {5}]{frame[1]}"),
    )
}  # fmt: skip


def write_mech_mind(subject: Subject) -> str:
    """depthInBase of Mech-Vision's extri_param.json: x, y, z in metres and the quaternion w, x, y, z of the camera in
    the flange or base (Mech-Mind's community, topic 257). The other entries of that file belong to the camera."""
    about = "; ".join([*subject.about(), "x, y, z in metres, quaternion w, x, y, z"])
    numbers = ",\n".join(f"    {value}" for value in [*subject.metres(), *subject.turn("quaternion-wxyz")])
    return f'{{\n  "comment": "{about}",\n  "depthInBase": [\n{numbers}\n  ]\n}}\n'


def write_opencv(subject: Subject) -> str:
    """X in mm, the camera matrix and the distortion, for cv::FileStorage, with every digit."""
    camera = subject.calibration.camera
    text = "%YAML:1.0\n---\n" + subject.comment("#", f"{subject.x_name} in mm")
    text += _opencv_matrix(subject.x_name, subject.parent_T_child)
    if camera is not None:
        text += _opencv_matrix("camera_matrix", np.array(camera.matrix))
        text += _opencv_matrix("distortion_coefficients", np.array([camera.distortion]))
        width, height = camera.image_size
        text += f'image_width: {width}\nimage_height: {height}\nlens: "{camera.lens}"\n'
    return text + f'calibration_id: "{subject.calibration_id}"\n'


def _opencv_matrix(name: str, matrix: Array) -> str:
    rows, columns = matrix.shape
    numbers = ",\n       ".join(", ".join(f"{value!r}" for value in row) for row in matrix.tolist())
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {numbers} ]\n"


def write_halcon(subject: Subject) -> str:
    """The camera's pose in the tool or base."""
    return _halcon(subject, subject.parent_T_child, f"pose of the camera in {_place(subject)}")


def write_halcon_inverse(subject: Subject) -> str:
    """The pose of the tool or base in the camera: what calibrate_hand_eye itself returns."""
    return _halcon(subject, inverse(subject.parent_T_child), f"pose of {_place(subject)} in the camera")


def _place(subject: Subject) -> str:
    return "the tool (flange)" if subject.on_flange else "the base"


def _halcon(subject: Subject, a_T_b: Array, about: str) -> str:
    """A pose of type 0 ('Rp+T', 'gba', 'point'): R = Rx Ry Rz, angles 0 to 360 (MVTec, create_pose, write_pose)."""
    angles = subject.turn("euler-XYZ", a_T_b[:3, :3])
    positive = [fixed(float(angle) % 360.0, subject.decimals + 1) for angle in angles]
    position = [fixed(value / 1000, subject.decimals + 3) for value in a_T_b[:3, 3]]
    return subject.comment("#", about) + (
        "# 3D POSE PARAMETERS: rotation and translation\n\n"
        "# Used representation type:\nf 0\n\n"
        f"# Rotation angles [deg] or Rodriguez vector:\nr {' '.join(positive)}\n\n"
        f"# Translation vector (x y z [m]):\nt {' '.join(position)}\n"
    )


def write_zivid(subject: Subject) -> str:
    """A Matrix4x4 of Zivid: mm, rows."""
    rows = ",\n".join(
        f"    [{', '.join(fixed(value, subject.decimals + 5) for value in row)}]"
        for row in subject.parent_T_child.tolist()
    )
    return subject.comment("#", "mm") + f"FloatMatrix:\n  Data: [\n{rows}]\n"
