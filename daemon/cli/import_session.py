"""`handeyed import FOLDER... --out DIR`: sessions of other programs become session folders."""

import json as json_text
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import Json, progress_bar

if TYPE_CHECKING:
    from calibration.documents.imports.intrinsics import Intrinsics
    from calibration.documents.target import TargetDocument
    from calibration.kinematics.conventions import Convention, LengthUnit

AXES = frozenset(f"{sign}{axis}" for sign in ("", "-") for axis in "xyz")
FOLDERS_HELP = "Folders with poses and pictures, or a set of another program."
TARGET_HELP = "chessboard:9x6:23.6, charuco:5x7:36.195:18.256:DICT_6X6_250, circles-asymmetric:7x11:20, ... or a file."
CONVENTION_HELP = "Of orientations: a brand (abb, kuka, ur, ...) or a name such as euler-ZYX; else every one is tried."


def import_session(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help=FOLDERS_HELP)],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="New folder; with several FOLDERs one in it for each.")
    ],
    images: Annotated[str | None, typer.Option(metavar="GLOB", help="Pictures or clouds of the session.")] = None,
    poses: Annotated[str | None, typer.Option(metavar="GLOB", help="File or files with the robot's poses.")] = None,
    camera_poses: Annotated[
        str | None, typer.Option(metavar="GLOB", help="Poses of the target in the camera, instead of pictures.")
    ] = None,
    part: Annotated[str | None, typer.Option(help="Camera, scene or robot's frame where there are several.")] = None,
    convention: Annotated[str | None, typer.Option(metavar="NAME", help=CONVENTION_HELP)] = None,
    unit: Annotated[Literal["m", "mm"] | None, typer.Option(help="Of the poses; else by their size.")] = None,
    frame: Annotated[
        Literal["base_T_flange", "flange_T_base"] | None, typer.Option(help="What the poses are; else both are tried.")
    ] = None,
    setup: Annotated[
        Literal["eye-in-hand", "eye-to-hand"] | None, typer.Option(help="Where the camera is; else both are tried.")
    ] = None,
    target: Annotated[str | None, typer.Option(metavar="TARGET", help=TARGET_HELP)] = None,
    camera: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Intrinsics of ROS, OpenCV, Kalibr, ViSP or handeyed; else estimated."),
    ] = None,
    cloud_unit: Annotated[Literal["m", "mm"] | None, typer.Option(help="Of clouds.")] = None,
    arm: Annotated[str | None, typer.Option(metavar="NAME", help="Of joints, as 'IRB 1600-6/1.45'.")] = None,
    axes: Annotated[str | None, typer.Option(metavar="AXES", help="Of the poses' places, such as x,-y,z.")] = None,
    camera_unit: Annotated[
        Literal["m", "mm"] | None, typer.Option(help="Of --camera-poses; else by their size.")
    ] = None,
    camera_convention: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of orientations of --camera-poses; else every one is tried.")
    ] = None,
    json: Json = False,
) -> None:
    """Make session folders of pictures and poses that another program, or a person, has written.

    Exit status: 0 written, 2 unreadable, or the data do not decide what the message asks for.
    """
    from calibration.documents.imports.sets import Chosen
    from daemon.sessions.session_import.request import ImportRequest
    from daemon.sessions.session_import.understand import understand
    from daemon.sessions.session_import.write import report, write_session

    conventions, unit_of_brand = (None, None) if convention is None else _conventions(convention)
    of_camera, camera_unit_of_brand = (None, None) if camera_convention is None else _conventions(camera_convention)
    chosen = Chosen(images, poses, camera_poses)
    intrinsics = None if camera is None else read_camera(camera)
    described = None if target is None else _target(target)
    for folder in folders:
        with TemporaryDirectory() as pictures:
            request = ImportRequest(
                folder, chosen, part, conventions, unit or unit_of_brand, frame, setup, described, intrinsics,
                cloud_unit, arm, None if axes is None else _axes(axes), camera_unit or camera_unit_of_brand, of_camera,
                Path(pictures),
            )  # fmt: skip
            with progress_bar(folder.resolve().name) as progress:
                understood = understand(request, progress)
            file = write_session(understood, out if len(folders) == 1 else out / folder.resolve().name)
        if json:
            reading = understood.reading
            answer = {
                "file": str(file), "kind": understood.imported.kind, "views": len(understood.base_T_flange),
                "convention": reading.convention.name, "unit": reading.unit, "frame": reading.frame,
                "setup": reading.setup, "evidence": understood.decision.words, "notes": list(understood.notes),
            }  # fmt: skip
            typer.echo(json_text.dumps(answer))
        else:
            typer.echo(report(understood, file))


def _axes(text: str) -> tuple[str, ...]:
    """The axes of --axes, each of x, y, z once, with a sign or without."""
    axes = tuple(axis.strip().lstrip("+") for axis in text.split(","))
    if sorted(axis[-1:] for axis in axes) != ["x", "y", "z"] or any(axis not in AXES for axis in axes):
        what, fix = f"{text!r} is no order of axes", "give x, y and z, each with a sign or without, as x,-y,z"
        raise UnreadableInput("--axes", what, fix)
    return axes


def _conventions(name: str) -> "tuple[tuple[Convention, ...], LengthUnit | None]":
    from calibration.documents.imports.pose_table import find_conventions
    from calibration.errors import GeometryError

    try:
        return find_conventions(name)
    except GeometryError as error:
        fix = "give a brand or a name of docs/formats.md#conventions"
        raise UnreadableInput("--convention", str(error), fix) from None


def read_camera(file: Path) -> "Intrinsics":
    """The intrinsics in a file of handeyed, ROS, OpenCV, Kalibr or ViSP. Raises DocumentError."""
    from calibration.documents.imports.intrinsics import read_intrinsics
    from daemon.runtime.bounded_read import read_document

    return read_intrinsics(str(file), read_document(file))


def _target(text: str) -> "TargetDocument":
    from calibration.documents.imports.trees import read_json, read_yaml
    from calibration.documents.target_text import target_of_data, target_of_text
    from daemon.runtime.bounded_read import read_document

    file = Path(text)
    if ":" in text and not file.exists():
        return target_of_text(text)
    content = read_document(file)
    data = read_json(content, text) if file.suffix.lower() == ".json" else read_yaml(content, text)
    inner = data.get("target", data) if isinstance(data, dict) else data
    return target_of_data(inner, text)
