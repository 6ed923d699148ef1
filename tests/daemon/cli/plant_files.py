"""Folders as plants write them: six pictures, and the same six poses in many spellings."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.transforms import inverse
from tests.daemon.cli.plant_notations import (
    BACKWARDS,
    CLOCK,
    EPOCH_S,
    EYE_IN_HAND,
    FULL_WIDTH,
    JOINTS_DEG,
    LIST,
    MICRONS,
    NUMBERS,
    PICTURES,
    POSES,
    STAMPS,
    VIEWS,
    Q,
    angles,
    csv,
    fanuc_ls,
    four_by_four,
    german,
    in_radians,
    kuka_dat,
    lines,
    quaternions,
    robtargets,
    ros_echo,
    text,
    turned_matrices,
    vectors,
    with_cell,
)
from tests.daemon.cli.sessions import TILTS_RAD, picture


@dataclass(frozen=True)
class Variant:
    """Files by name beside the pictures, which show the views in their order, and options.

    said : words of the report. refused : words of the one error, when the import is refused.
    scale : of the translations, where the data cannot show another unit and the report warns of it.
    """

    files: dict[str, bytes]
    pictures: Sequence[str] = PICTURES
    options: Sequence[str] = EYE_IN_HAND
    said: Sequence[str] = ()
    refused: Sequence[str] = ()
    scale: float = 1.0

    def write(self, folder: Path) -> Path:
        """The new folder with all files."""
        folder.mkdir()
        for name, tilt in zip(self.pictures, TILTS_RAD, strict=bool(self.pictures)):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(picture(tilt))
        for name, content in self.files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)
        return folder


def _variants() -> dict[str, Variant]:
    rows = lines(LIST, Q)
    return {**_spelled(rows), **_headed(rows), **_doubtful(rows), **_named(rows), **_beside(rows), **_filed(rows)}


def _spelled(rows: list[str]) -> dict[str, Variant]:
    """Separators, decimals, encodings, newlines, comments."""
    xyz = ("X [mm]", "Y [mm]", "Z [mm]", "rz [°]", "ry [°]", "rx [°]")
    return {
        "comma": Variant(csv(rows)),
        "semicolon": Variant(csv(lines(LIST, Q, separator=";"))),
        "semicolon, decimal comma": Variant(csv(lines(LIST, Q, separator=";", cell=german))),
        "semicolon and blank, decimal comma": Variant(csv(lines(LIST, Q, separator="; ", cell=german))),
        "tab, decimal comma": Variant(csv(lines(LIST, Q, separator="\t", cell=german), "poses.txt")),
        "blanks, decimal comma": Variant(csv(lines(LIST, Q, separator=" ", cell=german), "poses.txt")),
        "comma, quoted decimal comma": Variant(csv(lines(LIST, Q, cell=lambda n: f'"{german(n)}"'))),
        "comma, decimal comma": Variant(csv(lines(LIST, Q, cell=german)), refused=("decimal",)),
        "quoted numbers": Variant(csv(lines(LIST, [f'"{name}"' for name in Q], cell=lambda n: f'"{text(n)}"'))),
        "single quotes": Variant(csv(lines(LIST, Q, cell=lambda n: f"'{text(n)}'"))),
        "pipes": Variant(csv(lines(LIST, Q, separator="|"))),
        "thousands": Variant(csv(lines(LIST, Q, separator=";", cell=lambda n: f"{n:,.6f}"))),
        "thousands without decimals": Variant(csv(lines(quaternions(scale=1000.0), MICRONS, separator=";",
            cell=lambda n: f"{n:,.0f}" if abs(n) > 1.5 else text(n)))),
        "thousands without decimals, German": Variant(csv(lines(quaternions(scale=1000.0), MICRONS, separator=";",
            cell=lambda n: f"{n:,.0f}".replace(",", ".") if abs(n) > 1.5 else german(n)))),
        "named numbers with decimal commas": Variant(csv(
            ["; ".join(f"{key}={german(n)}" for key, n in zip("XYZABC", row, strict=True)) for row in angles()],
            "poses.txt")),
        "named numbers with commas and points": Variant(csv(
            ["; ".join(f"{key}={text(n) if key in 'ABC' else german(n)}" for key, n in zip("XYZABC", row, strict=True))
             for row in angles()], "poses.txt"), refused=("some numbers have a comma, others a point",)),
        "joints in degrees beside angles in radians": Variant(csv(lines(
            [[*JOINTS_DEG, *row] for row in in_radians(angles())],
            [*(f"j{axis}_deg" for axis in range(1, 7)), "x", "y", "z", "A", "B", "C"]))),
        "joints q1 to q6 beside angles": Variant(csv(lines([[*JOINTS_DEG, *row] for row in angles()],
            [*(f"q{axis}" for axis in range(1, 7)), "x", "y", "z", "rz", "ry", "rx"]))),
        "joints q0 to q5 behind angles": Variant(csv(lines([[*row, *JOINTS_DEG] for row in angles()],
            ["x", "y", "z", "rz", "ry", "rx", *(f"q{axis}" for axis in range(6))]))),
        "joints before poses, without names": Variant(csv(lines([[*JOINTS_DEG, *row] for row in angles()])),
            refused=("twelve numbers without a rotation matrix",)),
        "full-width digits": Variant(csv(lines(LIST, Q, cell=lambda n: text(n).translate(FULL_WIDTH)))),
        "full-width commas": Variant(csv([line.translate(FULL_WIDTH | {44: 0xFF0C}) for line in rows])),
        "full-width digits in names": Variant(csv(lines(LIST, ("image", *Q),
            before=[name.translate(FULL_WIDTH) for name in PICTURES]))),
        "Arabic digits": Variant(csv(lines(LIST, Q,
            cell=lambda n: text(n).translate({48 + at: 0x660 + at for at in range(10)})))),
        "another pose beside": Variant(csv(lines(
            [[*row, *other] for row, other in zip(LIST, BACKWARDS, strict=True)],
            [f"{whose}_{name}" for whose in ("flange", "target") for name in Q]))),
        "lengths in two units": Variant(
            csv(lines(LIST, ["x_m", "y_mm", "z_mm", *Q[3:]])), refused=("different units in x_m, y_mm, z_mm",)),
        "O, A, T that are called rx, ry, rz": Variant(
            csv(lines(angles(order="ZYZ"), ["x", "y", "z", "rx", "ry", "rz"])), said=("euler-ZYZ",)),
        "angles in two units": Variant(csv(lines(angles(), ["x", "y", "z", "rx_rad", "ry_deg", "rz_deg"])),
            refused=("different units in rx_rad, ry_deg, rz_deg",)),
        "thousands, German": Variant(csv(lines(
            LIST, Q, separator=";", cell=lambda n: f"{n:,.6f}".translate(str.maketrans(",.", ".,"))))),
        "Unicode's minus": Variant(csv(lines(LIST, Q, cell=lambda n: text(n).replace("-", "\u2212")))),
        "plus signs": Variant(csv(lines(LIST, Q, cell=lambda n: f"{n:+.6f}"))),
        "exponents": Variant(csv(lines(LIST, Q, cell=lambda n: f"{n:.9E}"))),
        "UTF-8 with BOM": Variant(csv(rows, encoding="utf-8-sig")),
        "UTF-8 with BOM, no header": Variant(csv(rows[1:], encoding="utf-8-sig")),
        "UTF-16": Variant(csv(rows, encoding="utf-16")),
        "UTF-16 of a text": Variant(csv(lines(LIST, Q, separator="\t"), "poses.txt", "\r\n", "utf-16")),
        "UTF-16 without BOM": Variant(csv(rows, encoding="utf-16-le")),
        "Latin-1": Variant(csv(lines(angles(), xyz), encoding="latin-1"), said=("euler-ZYX",)),
        "Windows newlines": Variant(csv(rows, end="\r\n")),
        "old Mac newlines": Variant(csv(rows, end="\r")),
        "empty lines": Variant(csv(rows, end="\n\n")),
        "blanks at the ends": Variant(csv(lines(LIST, Q, tail="   "))),
        "separator at the ends": Variant(csv([line + "," for line in rows])),
        "separator at the ends of rows": Variant(csv(lines(LIST, Q, tail=","))),
        "empty columns and rows of a sheet": Variant(csv([*(line + ",,," for line in rows), "," * 9, "," * 9])),
        "Ctrl-Z at the end": Variant(csv([*rows, "\x1a"], end="\r\n")),
        "sep= of a sheet": Variant(csv(["sep=;", *lines(LIST, Q, separator=";")])),
        "non-breaking blanks": Variant(csv(lines(LIST, Q, separator=";", cell=lambda n: f"\u00a0{text(n)}"))),
        "comments after rows": Variant(csv(lines(LIST, Q, tail="  # taught by AK"))),
        "comments after rows, //": Variant(csv(lines(LIST, Q, tail=" // taught, once more"))),
        "comments after rows, no header": Variant(
            csv(lines(LIST, separator=" ", tail="  # taught by AK"), "poses.txt")),
        "comments after rows, %": Variant(csv(lines(LIST, separator=" ", tail=" % 1st"), "poses.txt")),
    }  # fmt: skip


def _headed(rows: list[str]) -> dict[str, Variant]:
    """Titles, units, remarks, headers in other languages."""
    picture_names, turned = list(PICTURES), angles()

    def named(*names: str, before: list[str] | None = None) -> dict[str, bytes]:
        return csv(lines(turned, names, separator=";", cell=german, before=NUMBERS if before is None else before))

    return {
        "a title": Variant(csv(["Cell 7, poses of 22 November", *rows])),
        "key: value above": Variant(csv(["robot: IRB 2600", "operator: AK", "", *rows])),
        "a line of units": Variant(csv([rows[0], "mm,mm,mm,,,,", *rows[1:]])),
        "a line of units in brackets": Variant(csv([rows[0], "[m],[m],[m],[-],[-],[-],[-]",
                                                    *lines(quaternions(scale=1e-3))])),
        "a column of remarks": Variant(csv(lines(LIST, [*Q, "remark"], tail=",ok"))),
        "remarks in some rows": Variant(csv([f"{rows[0]},remark", *rows[1:3], f"{rows[3]},glare", *rows[4:]])),
        "the header twice": Variant(csv([*rows[:4], *rows[:1], *rows[4:]])),
        "German": Variant(named("Nr.", "X-Position [mm]", "Y-Position [mm]", "Z-Position [mm]", "Drehung Z [Grad]",
                                "Drehung Y [Grad]", "Drehung X [Grad]")),
        "German, Bild and Winkel": Variant(named("Bild", "X", "Y", "Z", "Winkel Z", "Winkel Y", "Winkel X",
                                                 before=picture_names)),
        "French": Variant(named("numéro", "x (mm)", "y (mm)", "z (mm)", "rotation z (degrés)", "rotation y (degrés)",
                                "rotation x (degrés)")),
        "Spanish": Variant(named("imagen", "posición x", "posición y", "posición z", "giro z (grados)",
                                 "giro y (grados)", "giro x (grados)", before=picture_names)),
        "Italian": Variant(named("immagine", "posizione x", "posizione y", "posizione z", "rotazione z", "rotazione y",
                                 "rotazione x", before=picture_names)),
        "Swedish": Variant(named("bild", "läge x", "läge y", "läge z", "vridning z", "vridning y", "vridning x",
                                 before=picture_names)),
        "Chinese": Variant(named("序号", "X坐标", "Y坐标", "Z坐标", "旋转Z", "旋转Y", "旋转X")),
        "Chinese, in GBK": Variant(csv(lines(LIST, ("图像", *Q), before=picture_names), encoding="gbk")),
        "Japanese": Variant(csv(lines(LIST, ("画像", *Q), before=picture_names))),
        "a language that is not known": Variant(
            csv(lines(turned, ("hely1", "hely2", "hely3", "szög1", "szög2", "szög3"))), refused=("name the numbers",)),
    }  # fmt: skip


def _doubtful(rows: list[str]) -> dict[str, Variant]:
    """Swapped, transposed, of other units, incomplete."""
    swapped = [[y, x, *rest] for x, y, *rest in LIST]
    mixed = [*LIST[:3], *quaternions(scale=1e-3)[3:]]
    zeros = [*LIST[:2], [0.0] * 7, *LIST[3:]]
    doubled = [[*row[:3], *(2 * number for number in row[3:])] for row in LIST]
    rough = [[*row[:3], *(round(number, 3) for number in row[3:])] for row in LIST]
    radians = ("x", "y", "z", "rz_rad", "ry_rad", "rx_rad")
    gradians = ("x", "y", "z", "rz_gon", "ry_gon", "rx_gon")
    columns = [list(column) for column in zip(*LIST, strict=True)]
    titled = [line for at in range(VIEWS) for line in (f"Pose {at + 1}:", *four_by_four(POSES[at : at + 1]), "")]
    inverted = np.array([inverse(pose) for pose in POSES])
    return {
        "columns in another order": Variant(csv(lines([[*row[3:], *row[:3]] for row in LIST], (*Q[3:], *Q[:3])))),
        "x and y swapped": Variant(csv(lines(swapped, Q)), refused=("none fits",)),
        "rows backwards, numbered": Variant(csv(lines(
            BACKWARDS, ("nr", *Q), before=[str(at) for at in range(12, 6, -1)]))),
        "rows backwards": Variant(csv(lines(BACKWARDS, Q)), refused=("none fits",)),
        "columns as rows": Variant(csv(lines(columns, before=Q))),
        "4 x 4": Variant(csv(four_by_four(), "poses.txt")),
        "4 x 4 with titles": Variant(csv(titled, "poses.txt")),
        "4 x 4 with commas": Variant(csv([line.replace(" ", ",") for line in four_by_four()])),
        "4 x 4 transposed": Variant(
            csv(four_by_four(np.swapaxes(POSES, 1, 2)), "poses.txt"), said=("column by column",)),
        "4 x 4 column by column": Variant(csv(lines([pose.T.ravel().tolist() for pose in POSES])),
                                          said=("column by column",)),
        "rotations transposed": Variant(csv(four_by_four(turned_matrices()), "poses.txt"), refused=("none fits",)),
        "inverted": Variant(csv(lines(quaternions(inverted), Q)), said=("flange_T_base",)),
        "metres": Variant(csv(lines(quaternions(scale=1e-3), Q)), said=("in m,",)),
        "metres that are called mm": Variant(csv(lines(quaternions(scale=1e-3), ("x_mm", "y_mm", "z_mm", *Q[3:]))),
                                             refused=("mm",)),
        "millimetres that are called m": Variant(csv(lines(LIST, ("x_m", "y_m", "z_m", *Q[3:]))),
            refused=("header: in m as stated", "m from the base")),
        "millimetres that are said to be m": Variant(csv(rows), options=(*EYE_IN_HAND, "--unit", "m"),
            refused=("--unit: in m as stated", "correct the unit")),
        "RAPID array with another target": Variant(csv(["MODULE poses", f"CONST robtarget p{{{VIEWS}}}:=[", ",\n".join(
            "home" if at == 2 else one.split(":=")[1].rstrip(";") for at, one in enumerate(robtargets()[1:-1])),
            "];", "ENDMODULE"], "poses.mod"), refused=("robtarget p", f"not read as {VIEWS} targets")),
        "half in metres": Variant(csv(lines(mixed, Q)), refused=("pose 4", "unit")),
        "centimetres": Variant(csv(lines(quaternions(scale=0.1), ("x_cm", "y_cm", "z_cm", *Q[3:])))),
        "micrometres": Variant(csv(lines(quaternions(scale=1e3), ("x [µm]", "y [µm]", "z [µm]", *Q[3:])))),
        "inches": Variant(csv(lines(quaternions(scale=1 / 25.4), ("x_in", "y_in", "z_in", *Q[3:])))),
        "centimetres, unsaid": Variant(
            csv(lines(quaternions(scale=0.1), Q)),
            refused=("translations agree as well", "multiply the places by 10, or name their unit")),
        "centimetres, unsaid, of what is stated": Variant(
            csv(lines(quaternions(scale=0.1), Q)),
            options=(*EYE_IN_HAND, "--frame", "base_T_flange", "--convention", "quaternion-wxyz"),
            said=("name the columns x_cm", "does not fit"), scale=0.1),
        "decimetres, unsaid": Variant(
            csv(lines(quaternions(scale=0.01), Q)),
            refused=("with a target 10 times as large they agree", "the units of both sides")),
        "decimetres, unsaid, of what is stated": Variant(
            csv(lines(quaternions(scale=0.01), Q)),
            options=(*EYE_IN_HAND, "--frame", "base_T_flange", "--convention", "quaternion-wxyz"),
            said=("taken as m, which puts the flange", "does not fit"), scale=10.0),
        "gradians": Variant(csv(lines(angles(1 / 0.9), gradians)), refused=("gon",)),
        "degrees that are called radians": Variant(csv(lines(angles(), radians)), said=("euler-ZYX, mm",)),
        "quaternions of norm 2": Variant(csv(lines(doubled, Q)), refused=("norm",)),
        "quaternions of three decimals": Variant(csv(lines(rough, Q))),
        "a row of zeros": Variant(csv(lines(zeros, Q)), refused=("3",)),
        "an empty cell": Variant(with_cell(""), refused=("row 3, y",)),
        "#N/A of a sheet": Variant(with_cell("#N/A"), refused=("row 3, y",)),
        "two decimal points": Variant(with_cell("1.168.17"), refused=("row 3, y",)),
        "a cell less": Variant(csv([*rows[:3], rows[3].rsplit(",", 1)[0], *rows[4:]]), refused=("row 3",)),
        "a row twice": Variant(csv([*rows[:4], *rows[3:]]), refused=("6 pictures", "7 poses")),
        "a name twice": Variant(csv(lines(LIST, ("x", "x", "z", *Q[3:]))), refused=("no pose among the names",)),
    }  # fmt: skip


def _named(rows: list[str]) -> dict[str, Variant]:
    """How pictures are called, and which belongs to which pose."""
    compact = [stamp.replace("-", "").replace("_", "T") for stamp in STAMPS]
    epoch = list(reversed(EPOCH_S))
    upper = [name.upper() for name in PICTURES]
    backwards = [str(at) for at in range(12, 6, -1)]
    return {
        "several numbers in the names": Variant(csv(rows), [f"cell7_cam2_view{at}_v3.png" for at in range(7, 13)]),
        "poses called as the pictures": Variant(
            csv(lines(BACKWARDS, ("name", *Q), before=[f"view_{one}" for one in "fedcba"])),
            [f"view_{one}.png" for one in "abcdef"]),
        "a column called pose": Variant(csv(lines(BACKWARDS, ("pose", *Q), before=backwards))),
        "several numbers, the first counts": Variant(csv(lines(BACKWARDS, ("nr", *Q), before=backwards)),
                                                     [f"cell7_view{at}_cam2.png" for at in range(7, 13)]),
        "several numbers, the last counts": Variant(csv(lines(BACKWARDS, ("nr", *Q), before=backwards)),
                                                    [f"2026-11-22_cam2_{at:04}.png" for at in range(7, 13)]),
        "time-stamped names": Variant(csv(rows), [f"IMG_{stamp}.png" for stamp in STAMPS]),
        "time-stamped names and times": Variant(
            csv(lines(BACKWARDS, ("time", *Q), before=list(reversed(CLOCK)))), [f"IMG_{each}.png" for each in STAMPS]),
        "compact stamps and times": Variant(
            csv(lines(BACKWARDS, ("time", *Q), before=list(reversed(CLOCK)))), [f"{each}.png" for each in compact]),
        "epoch seconds": Variant(csv(lines(BACKWARDS, ("time", *Q), before=epoch)), [f"{t}.png" for t in EPOCH_S]),
        "epoch seconds after a word": Variant(
            csv(lines(BACKWARDS, ("time", *Q), before=epoch)), [f"frame_{t}.png" for t in EPOCH_S]),
        "suffixes in upper case": Variant(csv(lines(LIST, ("image", *Q), before=list(PICTURES))), upper),
        "paths of Windows": Variant(csv(lines(
            LIST, ("file", *Q), before=[f"C:\\Messung\\{name}" for name in PICTURES]))),
        "names without suffix": Variant(csv(lines(LIST, ("image", *Q), before=[n[:-4] for n in PICTURES]))),
        "names of other pictures": Variant(csv(lines(LIST, ("image", *Q), before=[f"a{n}" for n in PICTURES])),
                                           refused=("no picture of the names", "aview_7.png")),
        "pictures in a folder": Variant(csv(rows), [f"img/{name}" for name in PICTURES]),
    }  # fmt: skip


def _beside(rows: list[str]) -> dict[str, Variant]:
    """Other pictures than the camera's own; those of depth are not opened."""

    def and_others(files: dict[str, bytes], names: str, content: bytes = b"depth") -> dict[str, bytes]:
        return files | {names.format(at): content for at in range(1, VIEWS + 1)}

    numbers, beside = range(1, VIEWS + 1), "6 other pictures are not used"
    single = {f"{at}/pose.txt": csv(four_by_four(POSES[at - 1 : at]))["poses.csv"] for at in numbers}
    left = [f"left/{at}.png" for at in numbers]
    return {
        "pictures of depth beside": Variant(
            and_others(csv(rows), "depth_{}.png"), [f"color_{at}.png" for at in numbers], said=(beside,)),
        "pictures of depth, in one folder": Variant(
            and_others(csv(rows), "view_{}_Depth.png"), [f"view_{at}_Color.png" for at in numbers], said=(beside,)),
        "pictures of depth, in a folder": Variant(
            and_others(csv(rows), "depth/{}.png"), [f"rgb/{at}.png" for at in numbers], said=(beside,)),
        "pictures of depth, called as the others": Variant(
            and_others(csv(rows), "{}.tiff"), [f"{at}.png" for at in numbers], said=(beside,)),
        "a folder a view, with depth": Variant(
            and_others(single, "{}/depth.png"), [f"{at}/image{at}.png" for at in numbers]),
        "a picture of the board": Variant(csv(rows) | {"board.png": b""}, said=("1 other pictures are not used",)),
        "pictures of two cameras": Variant(
            and_others(csv(rows), "right/{}.png"), left, refused=("left/*.png, right/*.png", "--images 'left/*.png'")),
        "pictures of two cameras, of which one is named": Variant(
            and_others(csv(rows), "right/{}.png"), left, (*EYE_IN_HAND, "--images", "left/*.png")),
        "pictures of two folders, which the table names": Variant(
            and_others(csv(lines(LIST, ("image", *Q), before=left)), "right/{}.png"), left),
        "pictures of two cameras, which the table names": Variant(
            and_others(csv(lines(LIST, ("image", *Q), before=[f"left_{at}.png" for at in numbers])), "right_{}.png"),
            [f"left_{at}.png" for at in numbers]),
    }  # fmt: skip


def _filed(rows: list[str]) -> dict[str, Variant]:
    """Other files than one CSV."""
    each = range(7, 13)
    records = [dict(zip(Q, row, strict=True)) for row in LIST]
    by_picture = {
        name: {"position": row[:3], "orientation": dict(zip("wxyz", row[3:], strict=True))}
        for name, row in zip(PICTURES, LIST, strict=True)
    }
    single = {f"pose_{at}.txt": csv(lines([row], separator=" ")) for at, row in zip(each, LIST, strict=True)}
    matrices = {f"pose_{at}.txt": csv(four_by_four(POSES[at - 7 : at - 6])) for at in each}
    return {
        "a file a pose": Variant({name: file["poses.csv"] for name, file in single.items()}),
        "a file a pose, 4 x 4": Variant({name: file["poses.csv"] for name, file in matrices.items()}),
        "a file a pose, with the last result": Variant({f"pose_{at}.json": json.dumps({
            "robot_pose": POSES[at - 7].ravel().tolist(), "hand_eye_calibration": np.eye(4).ravel().tolist(),
        }).encode() for at in each}),
        "KUKA E6POS": Variant({"cal.dat": kuka_dat().encode()}),
        "KUKA E6POS, one without C": Variant({"cal.dat": re.sub(r",C [^,]*,S", ",S", kuka_dat(), count=1).encode()},
            refused=("not as many of every number", "5 C")),
        "KUKA E6POS beside a tool": Variant(
            {"cal.dat": kuka_dat("DECL FRAME TOOLX={X 1.0,Y 2.0,Z 3.0,A 0,B 0,C 0}").encode()}, refused=("pose 1",)),
        "Fanuc .LS": Variant({"CAL.LS": fanuc_ls().encode()}),
        "Fanuc .LS, one not taught": Variant(
            {"CAL.LS": re.sub(r"X = +[-.\d]+", "X = ********", fanuc_ls(), count=1).encode()}, refused=("5 X",)),
        "UR's log of joints and poses": Variant(csv(lines(
            [[1_700_000_000.0 + at, *np.radians(JOINTS_DEG), *row] for at, row in enumerate(vectors())],
            ["timestamp", *(f"actual_{what}_{axis}" for what in ("q", "TCP_pose") for axis in range(6))],
            separator=" "))),
        "ros2 topic echo": Variant({"poses.yaml": ros_echo().encode()}),
        "ros2 topic echo in a text": Variant({"poses.txt": ros_echo().encode()}),
        "JSON of messages": Variant({"poses.json": json.dumps(
            [{"header": {"stamp": {"sec": at}}, "pose": {"position": dict(zip("xyz", row[:3], strict=True)),
              "orientation": dict(zip("wxyz", row[3:], strict=True))}} for at, row in enumerate(LIST)]).encode()}),
        "JSON, one record without x": Variant({"poses.json": json.dumps(
            [{k: v for k, v in one.items() if (at, k) != (2, "x")} for at, one in enumerate(records)]).encode()},
            refused=("pose 3", "a number is missing")),
        "4 x 4 in a cell": Variant(csv(["image,T", *(
            f'{name},"{json.dumps(pose.tolist())}"' for name, pose in zip(PICTURES, POSES, strict=True))])),
        "RAPID": Variant(csv(robtargets(), "poses.mod", "\r\n")),
        "RAPID with comments": Variant(csv(robtargets(" ! geführt"), "poses.mod", "\r\n", "latin-1")),
        "RAPID with an expression": Variant(csv([*robtargets()[:3], "  CONST robtarget p25:=p20;", *robtargets()[3:]],
            "poses.mod"), refused=("robtarget p25", "'p20' is not read as numbers")),
        "RAPID with a sum": Variant(csv([one.replace("p30:=[[", "p30:=[[100+") for one in robtargets()], "poses.mod"),
            refused=("robtarget p30", "is no number")),
        "RAPID that goes to computed places": Variant(csv([*robtargets()[:-1],
            "PROC main() MoveL Offs(p20,0,0,50),v100,fine,tool0; ENDPROC", "ENDMODULE"], "poses.mod"),
            said=("computes poses (Offs)",)),
        "RAPID in a text": Variant(csv(robtargets(), "poses.txt", encoding="utf-8-sig")),
        "JSON with BOM": Variant({"poses.json": json.dumps(records).encode("utf-8-sig")}),
        "JSON of texts": Variant({"poses.json": json.dumps(
            [{name: text(number) for name, number in record.items()} for record in records]).encode()}),
        "JSON by picture": Variant({"poses.json": json.dumps(by_picture).encode()}),
        "a log beside": Variant(csv(rows) | {"log.txt": b"10:15 began\n10:16 done\n", "readme.txt": b"see wiki\n"}),
        "pictures in an archive": Variant(csv(rows) | {"pictures.zip": b"PK"}, [], refused=(
            "no pictures and no clouds; pictures.zip: an archive is not read, unpack it",)),
        "a recording": Variant({"cell.bag": b"#ROSBAG V2.0"}, refused=("write its pictures and poses into files",)),
        "nothing": Variant({}, refused=("poses",)),
        "an empty file": Variant({"poses.csv": b""}, refused=("no poses in it",)),
        "a sheet": Variant({"poses.xlsx": b"PK\x03\x04" + bytes(200)}, refused=("CSV",)),
        "a sheet called .csv": Variant({"poses.csv": b"PK\x03\x04" + bytes(range(256))}, refused=("CSV",)),
        "a page called .csv": Variant({"poses.csv": b"<!doctype html><html><body>Sign in</body></html>"},
                                      refused=("poses.csv",)),
    }  # fmt: skip


VARIANTS = _variants()
