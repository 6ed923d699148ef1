"""What the MES would do: calibrate, scan a part from several sides, fetch the merged cloud. Then ask for the truth."""

import json
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calibration.documents.calibration import CalibrationDocument
from daemon.cli.demo_run.progress import Teller
from daemon.cli.errors import CommandError
from daemon.cli.rest_client import DaemonClient, Event

VIEW_FILE = "view.ply"
"""The last view as the scanner gave it: the arm still stands where it was taken."""

POSES = 3
"""As the seed: three positions."""


@dataclass(frozen=True)
class Found:
    """What came out, and the files it lies in."""

    calibration: CalibrationDocument
    calibration_file: Path
    cloud_file: Path
    scan_id: str
    truth: dict[str, Any]
    score: dict[str, Any]


def play(url: str, folder: Path, seed: int, teller: Teller) -> Found:
    """The main job, through the daemon at `url`; files go into `folder`. Raises CommandError."""
    with DaemonClient(url) as daemon:
        calibration = _calibrate(daemon, teller)
        calibration_file = folder / "calibration.json"
        calibration_file.write_text(calibration.model_dump_json(indent=1) + "\n")
        scan_id, cloud_file = _scan(daemon, folder / "door.ply", teller)
        last_view = daemon.get(f"/scans/{scan_id}")["views"][-1]["file"]
    shutil.copy(folder / "store" / "scans" / scan_id / last_view, folder / VIEW_FILE)
    truth = mock_says(["truth", "--seed", str(seed)])
    files = ["--calibration", str(calibration_file), "--cloud", str(cloud_file)]
    score = mock_says(["score", "--seed", str(seed), *files])
    return Found(calibration, calibration_file, cloud_file, scan_id, truth, score)


def _calibrate(daemon: DaemonClient, teller: Teller) -> CalibrationDocument:
    with teller.step("calibrate", f"{POSES} poses, planned") as step:
        run = _finished(daemon.run("/calibrate", {"count": POSES}, _progress(step)))
        document = CalibrationDocument.model_validate(daemon.get(f"/calibrations/{run['result']['calibration_id']}"))
        if not document.verdict.accepted:
            errors = [finding for finding in document.verdict.findings if finding.severity == "error"]
            raise CommandError("calibrate", f"not accepted: {errors[0].message}", errors[0].fix)
        step.done("accepted and in force")
    return document


def _scan(daemon: DaemonClient, file: Path, teller: Teller) -> tuple[str, Path]:
    with teller.step("scan", "a car door, wider than one view") as step:
        run = _finished(daemon.run("/scans", {"name": "door", "capture": True}, _progress(step)))
        scan_id = run["result"]["scan_id"]
        step.now("merging")
        size = daemon.download(f"/scans/{scan_id}/cloud", file)
        step.done(f"{run['result']['views']} views, {size / 1e6:.0f} MB merged")
    return scan_id, file


def _progress(step: Any) -> Any:
    def told(event: Event) -> None:
        step.now(f"station {min(event['station'] + 1, event['stations'])} of {event['stations']}: {event['state']}")

    return told


def _finished(run: Any) -> Any:
    if run["state"] != "finished":
        cause = run["cause"] or {"what": f"the run was {run['state']}", "fix": "try again"}
        raise CommandError(f"{run['kind']} run {run['id']}", cause["what"], cause["fix"])
    return run


def mock_says(arguments: list[str]) -> dict[str, Any]:
    """What the mock's own program prints: the truth is never imported here."""
    began_s = time.monotonic()
    command = [sys.executable, "-m", "mock_robot", *arguments]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode:
        last = (process.stderr.strip().splitlines() or ["it said nothing"])[-1]
        took_s = time.monotonic() - began_s
        raise CommandError(f"mock_robot {arguments[0]}", f"{last} (after {took_s:.0f} s)", "report this")
    answer: dict[str, Any] = json.loads(process.stdout)
    return answer
