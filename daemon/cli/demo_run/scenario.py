"""The demo's scenario, as an MES would run it: calibrate, scan a part, fetch the merged cloud; its score and report."""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_text import accuracy_text
from calibration.documents.numbers import significant
from daemon.cli.errors import CommandError
from daemon.cli.rest_client import connect
from daemon.config.toml_text import toml_text
from daemon.runtime.module_names import module_name
from handeyed.client import DEFAULT_URL, Client, ServerEvent

TOLERANCE_MM = 1.0
"""Largest U (k = 2) of a measured point in the demo's cell."""


def settings_text(announcement: dict[str, Any], port: int) -> str:
    """The settings of a daemon at `port` for the mock cell with this ready file."""
    robot, cell = announcement["robot"], announcement["cell"]
    sections: dict[str, dict[str, Any]] = {
        "robot": {
            "address": f"tcp://{robot['host']}:{robot['port']}",
            "limit_s": 20.0,  # the mock controller is one of many programs on this PC
            "model": cell["arm"],
            "speed_mm_s": 250.0,
            "box_mm": cell["box_mm"],
        },
        "camera": {
            "address": announcement["camera"],
            "setup": cell["setup"],
            "limit_s": 60.0,  # its pictures are rendered beside everything else on this PC
            "intrinsics": cell["camera"],
        },
        "scanner": {"address": announcement["scanner"], "unit": "mm", "poses": cell["scan_poses"]},
        "target": cell["target"],
        "calibration": {
            "policy": "auto",
            "tolerance_mm": TOLERANCE_MM,
            **{name: guess for name, guess in cell.items() if name.endswith("_guess")},
        },
        "server": {"port": port},
        "storage": {"folder": "store", "reserve_mb": 50.0},
        "report": {"cell": "Mock cell"},
    }
    return toml_text(sections)


NAME, WHAT = 12, 36
"""Widths of the two left columns."""


class ProgressLine:
    """The output of one step: a line, rewritten on a terminal, written once elsewhere."""

    def __init__(self, name: str, what: str, live: bool, aside: bool) -> None:
        self._left = f"  {name:<{NAME}}{what:<{WHAT}}"
        self._live, self._aside = live, aside
        self._began_s = time.monotonic()
        self.over = False

    def update(self, doing: str) -> None:
        """Rewrite the line with the current activity; on a terminal only."""
        if self._live:
            typer.echo(f"\r\033[K{self._left}{doing}", nl=False, err=self._aside)

    def finish(self, result: str) -> None:
        """Complete the line with the time taken and the result."""
        self.over = True
        took = f"{time.monotonic() - self._began_s:5.1f} s"
        typer.echo(("\r\033[K" if self._live else "") + f"{self._left}{took}   {result}", err=self._aside)


class ProgressPrinter:
    """Prints to standard output, or with `aside` to standard error."""

    def __init__(self, aside: bool = False) -> None:
        self._aside = aside
        self._live = (sys.stderr if aside else sys.stdout).isatty()

    def line(self, text: str = "") -> None:
        typer.echo(text, err=self._aside)

    @contextmanager
    def progress_line(self, name: str, what: str) -> Iterator[ProgressLine]:
        """The progress line of a step; when the block raises, the line stays as it is."""
        step = ProgressLine(name, what, self._live, self._aside)
        step.update("...")
        try:
            yield step
        except BaseException:
            if self._live and not step.over:
                typer.echo(err=self._aside)
            raise


VIEW_FILE = "view.ply"
"""The last view in the scanner's frame; the arm still stands where it was taken."""


@dataclass(frozen=True)
class DemoResult:
    """The results, their files, the truth and the score."""

    calibration: CalibrationDocument
    calibration_file: Path
    cloud_file: Path
    scan_id: str
    truth: dict[str, Any]
    score: dict[str, Any]


def run_scenario(url: str, folder: Path, seed: int, printer: ProgressPrinter) -> DemoResult:
    """Run the scenario with the daemon at `url`; files go into `folder`. Raises ClientError, CommandError."""
    with connect(url) as daemon:
        calibration = _calibrate(daemon, printer)
        calibration_file = folder / "calibration.json"
        calibration_file.write_text(calibration.model_dump_json(indent=1) + "\n")
        scan_id, cloud_file = _scan(daemon, folder / "door.ply", printer)
        last_view = daemon.get(f"/scans/{scan_id}")["views"][-1]["file"]
    shutil.copy(folder / "store" / "scans" / scan_id / last_view, folder / VIEW_FILE)
    truth = run_mock(["truth", "--seed", str(seed)])
    files = ["--calibration", str(calibration_file), "--cloud", str(cloud_file)]
    score = run_mock(["score", "--seed", str(seed), *files])
    return DemoResult(calibration, calibration_file, cloud_file, scan_id, truth, score)


def _calibrate(daemon: Client, printer: ProgressPrinter) -> CalibrationDocument:
    """Run until U meets the tolerance of the settings: the daemon says itself how many poses that takes."""
    with printer.progress_line("calibrate", f"planned, until U <= {TOLERANCE_MM:g} mm") as step:
        document = daemon.result(daemon.follow("/calibrate", {}, _show_progress(step, " at most")))
        if not document.verdict.accepted:
            errors = [finding for finding in document.verdict.findings if finding.severity == "error"]
            raise CommandError("calibrate", f"not accepted: {errors[0].message}", errors[0].fix)
        step.finish(f"{len(document.views)} pictures, accepted and active")
    return document


def _scan(daemon: Client, file: Path, printer: ProgressPrinter) -> tuple[str, Path]:
    with printer.progress_line("scan", "a car door, wider than one view") as step:
        run = daemon.follow("/scans", {"name": "door", "capture": True}, _show_progress(step))
        result = daemon.require_finished(run)
        scan_id = result["scan_id"]
        step.update("merging")
        size = daemon.download(f"/scans/{scan_id}/cloud", file)
        step.finish(f"{result['views']} views, {size / 1e6:.0f} MB merged")
    return scan_id, file


def _show_progress(line: ProgressLine, or_fewer: str = "") -> Callable[[ServerEvent], None]:
    def show(event: ServerEvent) -> None:
        of = event["stations"]
        predicted = f", {event['predicted']}" if event.get("predicted") else ""
        line.update(f"station {min(event['station'] + 1, of)} of {of}{or_fewer}: {event['state']}{predicted}")

    return show


def run_mock(arguments: list[str]) -> dict[str, Any]:
    """The JSON that `python -m mock_robot` prints. Raises CommandError. The truth is never imported here."""
    began_s = time.monotonic()
    command = [sys.executable, "-P", "-m", module_name("mock_robot"), *arguments]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode:
        last = (process.stderr.strip().splitlines() or ["it said nothing"])[-1]
        took_s = time.monotonic() - began_s
        raise CommandError(f"mock_robot {arguments[0]}", f"{last} (after {took_s:.0f} s)", "report this")
    answer: dict[str, Any] = json.loads(process.stdout)
    return answer


def report(found: DemoResult) -> str:
    """A table of the result beside the truth."""
    x, truth = found.calibration.flange_T_camera, found.truth["flange_T_camera"]
    assert x is not None  # an accepted eye-in-hand calibration has one
    off, cloud = found.score["calibration"], found.score["cloud"]
    rows = (
        ("", "found", "truth", "off by"),
        (
            "camera on the flange",
            _vector(x.translation_mm),
            _vector(truth["translation_mm"]),
            f"{off['translation_mm']:.3f} mm, {off['rotation_deg']:.4f} deg",
        ),
        (
            "a measured point",
            f"± {significant(found.calibration.accuracy.expanded_mm)} mm (U, k = 2)",
            "",
            f"{off['point_rms_mm']:.2f} mm RMS",
        ),
        (
            "the door's surface",
            f"{cloud['points']:,} points",
            f"{cloud['covered']:.0%} of it covered",
            f"{cloud['rms_mm']:.2f} mm RMS",
        ),
    )
    table = "\n".join(f"  {name:<22}{a:<29}{b:<29}{c}".rstrip() for name, a, b, c in rows)
    return (
        f"\nThe daemon's result beside the truth, which it does not have:\n\n{table}\n\n"
        f"{accuracy_text(found.calibration.accuracy)}\n"
        f"The merged cloud: {found.cloud_file} (base frame, mm; any viewer opens it)"
    )


def report_json(found: DemoResult) -> str:
    """The same as JSON: calibration, truth, score and files."""
    return json.dumps(
        {
            "calibration": found.calibration.model_dump(mode="json"),
            "truth": found.truth,
            "score": found.score,
            "files": {"calibration": str(found.calibration_file), "cloud": str(found.cloud_file)},
        }
    )


def curl_lines(url: str, view: Path) -> str:
    """Three curl commands for a daemon at `url`."""
    ply = f"-H 'Content-Type: application/x-ply' --data-binary @{view}"
    return "\n".join(
        [
            f"  curl {ply} -o in_base.ply '{url}/register?pose=now'",
            f"  curl -X POST -H 'Accept: text/plain' '{url}/calibrate?wait=60'",
            f"  curl -o frame.png {url}/camera/frame.png",
        ]
    )


def next_steps(kept_url: str | None, view: Path) -> str:
    """The demo's last lines: how to keep the cell, and three commands to try."""
    first = (
        f"The cell keeps running until Ctrl-C. Its page: {kept_url}/page/\n"
        if kept_url
        else "`handeyed demo --keep` keeps the cell running."
    )
    return f"\n{first} In another terminal, in this folder:\n\n{curl_lines(kept_url or DEFAULT_URL, view)}\n"


def _vector(values: Iterable[Any]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in values) + ") mm"
