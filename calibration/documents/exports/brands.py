"""Pendants of other makes, whose order of numbers and unit are those of BRANDS; and Mech-Mind's camera file."""

from dataclasses import dataclass

from calibration.documents.exports.subject import Subject
from calibration.kinematics.conventions import BRANDS


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
