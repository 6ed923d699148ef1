"""`handeyed report FOLDER|FILE|ID`: the calibration report as HTML or PDF."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from daemon.cli.output import write_whole

if TYPE_CHECKING:
    from calibration.documents.calibration import CalibrationDocument
    from daemon.reports.context import ReportContext

MAX_REPORT_S = 60.0
ReportLanguage = Literal["en", "de", "es", "zh"]
WHAT = 'A session folder, a calibration.json, or an id of the daemon ("current": the active one).'


def report(
    what: Annotated[str, typer.Argument(metavar="FOLDER|FILE|ID", help=WHAT)],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Write here: .html, or .pdf with the extra `report`.")
    ] = Path("report.html"),
    settings: Annotated[Path | None, typer.Option(help="Settings with names and serials, in its table report.")] = None,
    url: Annotated[str, typer.Option(help="The daemon's address, for an id.")] = "http://127.0.0.1:8372",
    language: Annotated[ReportLanguage, typer.Option(help="The language of its words.")] = "en",
) -> None:
    """Write the calibration report: result with U (k = 2), pictures, budget, quick check, traceability.

    A session folder is solved, unless its calibration.json lies in it. What is not known is a blank.

    Exit status: 0 written, 1 failed, 2 unreadable input.
    """
    path = Path(what)
    if path.is_dir() or path.is_file() or path.suffix == ".json":
        content = _from_files(path, out.suffix == ".pdf", settings, language)
    else:
        content = _from_daemon(url, what, out.suffix == ".pdf", language)
    write_whole(out, content)
    typer.echo(str(out))


def _from_files(path: Path, pdf: bool, settings: Path | None, language: ReportLanguage) -> bytes:
    from dataclasses import replace
    from hashlib import sha256

    from daemon.cli.compare import read_calibration
    from daemon.reports.context import ReportContext
    from daemon.reports.pdf import Attached, write_pdf
    from daemon.reports.reports import calibration_report

    document, context = _session(path) if path.is_dir() else (read_calibration(path), ReportContext())
    content = document.model_dump_json().encode()
    context = replace(context, language=language, document_sha256=sha256(content).hexdigest())
    if settings is not None:
        from daemon.config.settings import load_settings  # its devices are on Linux only

        loaded = load_settings(settings)
        context = replace(
            context, names=loaded.report, robot_model=loaded.robot.model_name, target=context.target or loaded.target
        )
    html = calibration_report(document, context)
    return write_pdf(html, Attached("calibration.json", content, "the calibration")) if pdf else html.encode()


def _session(folder: Path) -> "tuple[CalibrationDocument, ReportContext]":
    """The calibration of a session, solved unless it is there, with its worst views."""
    from calibration.targets import TrackedFrame
    from daemon.cli.compare import read_calibration
    from daemon.cli.solve import RESULT_FILE, requirement_of, solve_session
    from daemon.reports.context import ReportContext, session_sha256
    from daemon.reports.pictures import view_pictures
    from daemon.sessions.session_files import find_grey
    from daemon.sessions.session_reader import open_session

    session = open_session(folder)
    target = session.document.described_target()
    known = session.path / RESULT_FILE
    solution = None
    if known.is_file():
        document = read_calibration(known)
    else:
        document, solved = solve_session(folder, "auto", requirement_of(None, None), None)
        solution = None if solved is None else solved[2]
    pictures = (
        ()
        if isinstance(target, TrackedFrame)
        else view_pictures(document.views, target, lambda name: find_grey(session.path / name), solution)
    )
    return document, ReportContext(
        target=session.document.target, session_sha256=session_sha256(session.path), pictures=pictures
    )


def _from_daemon(url: str, calibration_id: str, pdf: bool, language: ReportLanguage) -> bytes:
    from urllib.parse import quote

    from daemon.cli.rest_client import connect

    with connect(url, MAX_REPORT_S) as daemon:
        form = "pdf" if pdf else "html"
        return daemon.read(f"/calibrations/{quote(calibration_id, safe='')}/report?format={form}&language={language}")
