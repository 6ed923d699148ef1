"""`handeyed export FILE|ID --as FORMAT`: X or poses as a file of another system."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote, urlencode

import typer

from daemon.cli.errors import UnreadableInput
from daemon.cli.output import write_whole

if TYPE_CHECKING:
    from calibration.documents.exports.formats import ExportFormat
    from calibration.documents.exports.subject import ExportOptions

LIST = "list"
WHAT = 'calibration.json or its folder, planned.json, session.json, or an id of the daemon ("current": the active one).'
CHILD = "Name of the camera's frame; one that ends with camera_link is its body frame (REP 103)."


def export(
    what: Annotated[str, typer.Argument(metavar="FILE|FOLDER|ID", help=WHAT)],
    form: Annotated[str, typer.Option("--as", metavar="FORMAT", help="The format; without it they are listed.")] = LIST,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write here, not to standard output.")] = None,
    parent: Annotated[str | None, typer.Option(help="Name of the flange's or base's frame.")] = None,
    child: Annotated[str, typer.Option(help=CHILD)] = "camera_optical_frame",
    decimals: Annotated[int, typer.Option(min=0, max=9, help="Decimals of lengths in mm.")] = 4,
    robot: Annotated[str | None, typer.Option(help="The arm of poses, as 'IRB 1600-6/1.45'.")] = None,
    url: Annotated[str, typer.Option(help="The daemon's address, for an id.")] = "http://127.0.0.1:8372",
) -> None:
    """Write a calibration for ROS, RAPID, OpenCV, HALCON and others, or planned poses for the settings and for RAPID.

    Exit status: 0 written, 1 there is nothing to export, 2 unreadable input or no such format.
    """
    from calibration.documents.exports.formats import FORMATS, POSE_FORMATS
    from calibration.documents.exports.subject import ExportOptions
    from calibration.errors import ExportRefused

    if form == LIST and out is not None:
        raise UnreadableInput(what, "no format is named", "name one, as --as rapid")
    if form == LIST:
        known: list[ExportFormat[Any]] = [*FORMATS.values(), *POSE_FORMATS.values()]
        typer.echo("\n".join(f"{each.name:<18}{each.file:<24}{each.about}" for each in known))
        return
    try:
        path = Path(what) / "calibration.json" if Path(what).is_dir() else Path(what)
        if path.is_file() or path.suffix == ".json" or len(path.parts) > 1:
            content = _from_file(path, form, ExportOptions(parent, child, decimals), robot)
        else:
            content = _from_daemon(url, what, form, ExportOptions(parent, child, decimals))
    except ExportRefused as error:
        raise UnreadableInput(what, error.what, error.fix) from None
    if out is not None:
        write_whole(out, content)
    else:
        sys.stdout.buffer.write(content)


def _from_file(file: Path, form: str, options: "ExportOptions", robot: str | None) -> bytes:
    """From calibration.json, or the poses of a plan's answer or of a session."""
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.exports.formats import POSE_FORMATS, export, export_poses
    from calibration.documents.validation import parse_document
    from daemon.runtime.bounded_read import read_document

    content = read_document(file)
    if form in POSE_FORMATS:
        return export_poses(_poses(file, content, robot), form)
    return export(parse_document(CalibrationDocument, content, str(file)), form, options)


def _poses(file: Path, content: bytes, robot: str | None) -> Any:
    """Poses of the flange in what `handeyed plan --json` printed, or in session.json."""
    import json

    import numpy as np

    from calibration.documents.exports.pose_list import pose_list
    from calibration.documents.plan import PlannedDocument
    from calibration.documents.session import SessionDocument
    from calibration.documents.validation import parse_document
    from calibration.errors import ExportRefused
    from calibration.kinematics.abb_arms import find_arm

    try:
        keys = set(json.loads(content))
    except (ValueError, RecursionError, TypeError):
        keys = set()
    if "views" in keys:
        session = parse_document(SessionDocument, content, str(file))
        stations = [view.base_T_flange for view in session.views]
        if (of := session.poses_of) is not None and (of.tool or of.base):
            raise ExportRefused("poses of a tool or work object, not of tool0 in wobj0", "export the flange's poses")
    else:
        stations = [planned.base_T_flange for planned in parse_document(PlannedDocument, content, str(file)).poses]
    poses = np.array([station.transform() for station in stations]).reshape(-1, 4, 4)
    return pose_list(file.name, poses, find_arm(robot) if robot else None)


def _from_daemon(url: str, calibration_id: str, form: str, options: "ExportOptions") -> bytes:
    from daemon.cli.rest_client import connect

    query = {"child": options.child, "decimals": options.decimals}
    if options.parent is not None:
        query["parent"] = options.parent
    with connect(url) as daemon:
        path = f"/calibrations/{quote(calibration_id, safe='')}/exports/{quote(form, safe='')}"
        return daemon.read(f"{path}?{urlencode(query)}")
