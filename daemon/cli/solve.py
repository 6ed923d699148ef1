"""`handeyed solve DIR...`: calibrate from session folders; with --artefact from clouds instead of pictures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from daemon.cli.errors import ExitStatus, UnreadableInput
from daemon.cli.output import Json, SolvedFolders, new_calibration, print_error, progress_bar, write_document, writing

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument
    from calibration.documents.knowledge import KnowledgeDocument
    from calibration.documents.requirement import PointsFile
    from calibration.documents.session import CameraDocument, SessionDocument
    from calibration.problem import Problem, Setup
    from calibration.solution import NamedPoint, Solution
    from calibration.transforms import Array
    from calibration.verdict import VerdictLimits
    from daemon.sessions.session_reader import SessionFolder

    Requirement = tuple[VerdictLimits, tuple[NamedPoint, ...]]


RESULT_FILE = "calibration.json"

FOR_IMAGES = "it is for images only", "leave it out; this session holds poses or points"

CLOSED_FORM_NAMES = "three-pose, tsai, park, horaud, daniilidis, shah, kronecker"
"""Of `calibration.closed_forms`, which is not imported for a help text."""


def solve(
    ctx: typer.Context,
    folders: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders with a session.json each.")],
    method: Annotated[
        str, typer.Option(help=f"auto (maximum likelihood), or a closed form: {CLOSED_FORM_NAMES}.")
    ] = "auto",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Also write calibration.json here; with several folders: a folder for NAME/calibration.json.",
        ),
    ] = None,
    artefact: Annotated[
        str | None,
        typer.Option(help="Calibrate from clouds (folders with scan.json): sphere, or none for overlapping surfaces."),
    ] = None,
    radius_mm: Annotated[float | None, typer.Option(help="Radius of --artefact sphere.")] = None,
    rough: Annotated[
        Path | None, typer.Option(help="calibration.json with a rough X, for --artefact none; else it is searched.")
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Intrinsics to use: JSON with matrix, distortion (4, 5, 8, 12 or 14), image_size and"
            ' "lens": "fisheye" (4); a session.json or calibration.json; YAML or XML of ROS, OpenCV, Kalibr.',
        ),
    ] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE",
            help="What is known beforehand, as in \\[calibration.known]: camera=this-session, arm=absolute-accuracy,"
            " target.source=certified, or target.source=measured with target.length_mm=200 and"
            " target.instrument=calliper; once for each. In place of what session.json states of it.",
        ),
    ] = None,
    views: Annotated[bool, typer.Option("--views", help="Also print a table of pictures, the worst first.")] = False,
    pictures: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Also write each image with its points and residuals, and residuals.html; with several folders: into"
            " DIR/NAME.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(metavar="MM", help="Accept up to this U (k = 2) at the worst point.")
    ] = None,
    at: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="JSON with box_mm or points: where the uncertainty counts; else the working volume."
        ),
    ] = None,
    arm: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Also identify the errors of this arm (`handeyed arms`) from the joints of all folders together, each"
            " with the target at another place; --out then gets arm.json, too.",
        ),
    ] = None,
    together: Annotated[
        bool,
        typer.Option(
            "--together",
            help="Also solve the folders as cameras and scanners on one mount that look at one target at one place:"
            " their poses relative to each other; --out then gets rig.json, too.",
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Calibrate from session folders: session.json and its images; with --artefact from scans.

    Exit status: 0 every calibration accepted, 3 solved or refused but not accepted, 2 unreadable input.
    """
    from calibration.errors import DocumentError
    from calibration.solve import METHODS
    from daemon.cli.import_session import read_camera
    from registration.errors import RegistrationError

    if method not in METHODS:
        raise UnreadableInput("--method", f"none is called {method!r}", f"one of {', '.join(METHODS)}")
    check_options(artefact, radius_mm, rough, method)
    for name, given in (("--pictures", pictures), ("--camera", camera), ("--known", known)):
        if artefact is not None and given is not None:
            raise UnreadableInput(name, "clouds have no images", "leave it out")
    intrinsics = None if camera is None else read_camera(camera).document(None)
    stated, required = known_of(known or []), requirement_of(tolerance, at)
    together_asked = "" if together else None
    asked = {name: value for name, value in (("--arm", arm), ("--together", together_asked)) if value is not None}
    for option in asked:
        if option not in ctx.obj:
            raise UnreadableInput(option, "no extension is installed that solves it", "leave it out")
    status, solved = ExitStatus.OK, []
    for folder in folders:
        try:
            if artefact is None:
                document, shown = solve_session(folder, method, required, intrinsics, stated)
            else:
                document, shown = solve_scan(folder, radius_mm, rough, required), None
        except (DocumentError, RegistrationError) as error:
            print_error(str(error))
            status = ExitStatus.UNREADABLE
            continue
        if not document.verdict.accepted and status is ExitStatus.OK:
            status = ExitStatus.NOT_ACCEPTED
        _print(folder, document, json, views)
        name = folder.resolve().name
        if out is not None:
            write_document(out if len(folders) == 1 else out / name / RESULT_FILE, document)
        if shown is not None:
            solved.append(shown)
        if pictures is not None and shown is not None and shown[1].in_space:
            raise UnreadableInput("--pictures", *FOR_IMAGES)
        if pictures is not None and shown is not None:
            _write_pictures(pictures if len(folders) == 1 else pictures / name, document, *shown)
    if (arm is not None or together) and any(solution.external_axis for _, _, solution in solved):
        what = "an arm's errors, and sensors together, are not found while an external axis moves"
        raise UnreadableInput("--arm" if arm else "--together", what, "leave it out")
    folder_out = out.parent if out is not None and len(folders) == 1 else out
    for option, value in asked.items():
        found = SolvedFolders(value, folders, solved, required[0], at, folder_out, json)
        if not ctx.obj[option](found) and status is ExitStatus.OK:
            status = ExitStatus.NOT_ACCEPTED
    raise typer.Exit(status)


def known_of(pairs: list[str]) -> "KnowledgeDocument":
    """What --known states. Raises CommandError, DocumentError."""
    from calibration.documents.knowledge import KnowledgeDocument
    from calibration.documents.validation import validate_document

    data: dict[str, Any] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        section, _, name = key.rpartition(".")
        if not (key and equals and value):
            what, fix = f"{pair!r} is no KEY=VALUE", "such as camera=this-session"
            raise UnreadableInput("--known", what, fix)
        inner = data.setdefault(section, {}) if section else data
        inner[name] = float(value) if value.replace(".", "", 1).isdigit() else value
    return validate_document(KnowledgeDocument, data, "--known")


def requirement_of(tolerance_mm: float | None, at: Path | None) -> "Requirement":
    """The limits and the points of --tolerance and --at. Raises CommandError, DocumentError."""
    from calibration.documents.requirement import MAX_TOLERANCE_MM, VerdictSettings

    if tolerance_mm is not None and not 0 < tolerance_mm <= MAX_TOLERANCE_MM:
        raise UnreadableInput("--tolerance", f"{tolerance_mm} mm is no tolerance", "give U in mm")
    points = () if at is None else points_file(at).named_points()
    return VerdictSettings().limits(tolerance_mm), points


def points_file(at: Path) -> "PointsFile":
    """That of --at. Raises DocumentError."""
    from calibration.documents.requirement import PointsFile
    from daemon.runtime.bounded_read import read_as

    return read_as(PointsFile, at)


def solve_session(
    folder: Path,
    method: str,
    required: "Requirement",
    camera: "CameraDocument | None",
    known: "KnowledgeDocument | None" = None,
) -> "tuple[CalibrationDocument, tuple[SessionFolder, Problem, Solution] | None]":
    """The calibration and what it is of; None of pairs of points. Raises CommandError, DocumentError."""
    from dataclasses import replace

    import cv2

    from calibration.documents.planning_settings import NoiseExpectedDocument
    from calibration.likelihood.mapped_points import at_points
    from calibration.planning.what_if import PlanComparison
    from calibration.solve import poses_at_zero, solve_hand_eye
    from calibration.targets import orientation_advice
    from calibration.verdict import judge
    from daemon.sessions.session_reader import find_repeated_poses, load_problem, open_session

    session = open_session(folder)
    if session.document.point_pairs is not None:
        return _solve_points(session.document, str(session.file), required), None
    changes: dict[str, Any] = {} if known is None else {"known": session.document.known.replaced_by(known)}
    if camera is not None:
        changes["camera"] = camera
    session = replace(session, document=session.document.model_copy(update=changes))
    cv2.setNumThreads(1)  # pictures are read in threads; those of OpenCV would take processor time to wait for work
    with progress_bar(folder.resolve().name) as progress:
        problem = load_problem(session, progress)
    if problem.in_space and method != "auto":
        raise UnreadableInput("--method", *FOR_IMAGES)
    lines = [*map(str, find_repeated_poses(session.document))]
    if (advice := orientation_advice(problem.target)) is not None:
        lines.append(f"target: it looks the same turned by 180 deg: {advice}")
    for line in (*lines, *missing_target_lines(problem)):
        print_error(f"{session.file}: {line}")
    limits, points = required
    first = solve_hand_eye(problem, method=method)
    problem = poses_at_zero(problem, first)
    solution = at_points(problem, first, points)
    verdict = judge(problem, solution, limits)
    if (better := PlanComparison.for_session(problem, solution, NoiseExpectedDocument().noise(), points)) is not None:
        verdict = replace(verdict, findings=(*verdict.findings, *better.findings(problem, solution)))
    return new_calibration(solution, verdict, problem.target), (session, problem, solution)


def _solve_points(document: "SessionDocument", origin: str, required: "Requirement") -> "CalibrationDocument":
    """The calibration of pairs of points. Raises DocumentError where they do not determine it."""
    import numpy as np

    from calibration.errors import DocumentError, UndeterminedError
    from calibration.likelihood.mapped_points import with_points
    from calibration.pose_pairs.point_pairs import judge_point_pairs, solve_point_pairs

    pairs, (limits, points) = document.point_pairs, required
    assert pairs is not None
    try:
        solution = with_points(solve_point_pairs(document.setup, *pairs), points, np.eye(4)[None])
    except UndeterminedError as why:
        raise DocumentError.one(origin, "views", why.what, why.fix) from None
    return new_calibration(solution, judge_point_pairs(solution, limits))


def missing_target_lines(problem: "Problem") -> list[str]:
    """One line for each reason why the target was not found: `views[3, 7]: what: what to do`."""
    by_reason: dict[str, tuple[str, list[int]]] = {}
    for view in problem.views:
        if view.missing is not None:
            code, sentence = view.missing
            by_reason.setdefault(code, (sentence, []))[1].append(view.index)
    return [f"views[{format_ranges(indices)}]: {sentence}" for sentence, indices in by_reason.values()]


def format_ranges(indices: list[int]) -> str:
    """Ascending numbers as ranges, such as "0-59, 108"."""
    starts = [at for at, index in enumerate(indices) if at == 0 or index != indices[at - 1] + 1]
    runs = [
        (indices[start], indices[stop - 1]) for start, stop in zip(starts, [*starts[1:], len(indices)], strict=True)
    ]
    return ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in runs)


def _print(folder: Path, document: "CalibrationDocument", json: bool, views: bool) -> None:
    from calibration.documents.calibration_text import summary
    from calibration.documents.view_table import view_table

    if json:
        typer.echo(document.model_dump_json())
        return
    typer.echo(summary(str(folder), document) + "\n")
    if views:
        typer.echo(view_table(document) + "\n")


def _write_pictures(
    folder: Path, document: "CalibrationDocument", session: "SessionFolder", problem: "Problem", solution: "Solution"
) -> None:
    from calibration.documents.view_table import worst_first
    from daemon.sessions.session_files import read_grey
    from daemon.tools.session_pictures.write import write_pictures

    order, title = [view.index for view in worst_first(document.views)], session.path.resolve().name
    with writing(folder, "choose another --pictures"):
        page = write_pictures(folder, title, problem, solution, order, lambda name: read_grey(session.path / name))
    print_error(f"{page}: residuals of {len(order)} pictures")


ARTEFACTS = ("sphere", "none")


def check_options(artefact: str | None, radius_mm: float | None, rough: Path | None, method: str) -> None:
    """Check that the options are consistent. Raises CommandError."""
    refusals = [
        (artefact is not None and artefact not in ARTEFACTS, "--artefact", f"none is called {artefact!r}",
         f"one of {', '.join(ARTEFACTS)}"),
        (artefact == "sphere" and radius_mm is None, "--radius-mm", "the sphere's radius is not given",
         "measure it, or take it from its certificate: --radius-mm 48.37"),
        (radius_mm is not None and not 0 < radius_mm < 1e5, "--radius-mm", f"{radius_mm} mm is no radius",
         "give the sphere's radius in mm"),
        (radius_mm is not None and artefact != "sphere", "--radius-mm", "only a sphere has a radius",
         "add --artefact sphere, or leave it out"),
        (rough is not None and artefact != "none", "--rough", "only --artefact none begins with a rough X",
         "add --artefact none, or leave it out"),
        (artefact is not None and method != "auto", "--method", "it is for images only", "leave it out"),
    ]  # fmt: skip
    for refused, place, what, fix in refusals:
        if refused:
            raise UnreadableInput(place, what, fix)


def solve_scan(
    folder: Path, radius_mm: float | None, rough: Path | None, required: "tuple[VerdictLimits, tuple[NamedPoint, ...]]"
) -> "CalibrationDocument":
    """Calibrate from a sphere when its radius is given, else from overlapping surfaces, with a rough X or none.

    `required`: the limits of the verdict, and the points where the uncertainty counts.
    Raises DocumentError, RegistrationError.
    """
    import numpy as np

    from calibration.likelihood.mapped_points import with_points
    from registration.calibrate.outcome import judge_scan
    from registration.calibrate.sphere import solve_sphere_scan
    from registration.calibrate.surfaces import solve_surface_scan
    from registration.scan import setup_of
    from registration.scan_folder import read_scan

    views, (limits, points) = read_scan(folder), required
    if radius_mm is not None:
        solution = solve_sphere_scan(views, radius_mm)
    else:
        solution = solve_surface_scan(views, None if rough is None else _rough_x(rough, setup_of(views)))
    solution = with_points(solution, points, np.array([view.anchor_T_mount for view in views]))
    return new_calibration(solution, judge_scan(solution, limits))


def _rough_x(file: Path, setup: "Setup") -> "Array":
    """X of a calibration of the same set-up. Raises DocumentError, ScanError."""
    from daemon.cli.compare import read_calibration
    from registration.errors import ScanError
    from registration.scan import scanner_mount_of

    document = read_calibration(file)
    if setup == "eye-in-hand":
        return scanner_mount_of(document).flange_T_camera
    if document.base_T_camera is None:
        raise ScanError(f"calibration {document.id} has no base_T_camera", "use an eye-to-hand calibration")
    return document.base_T_camera.transform()
