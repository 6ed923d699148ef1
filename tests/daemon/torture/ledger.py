"""What a daemon has acknowledged, and whether the one after it still knows: kept outside, by the client."""

import hashlib
import json
import uuid
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from tests.daemon.clouds import PLY


class Lost(Exception):
    """What was promised is not there, or something is there that was not."""


@dataclass
class Request:
    """A POST that must be carried out exactly once."""

    kind: str
    path: str
    body: dict[str, Any] | bytes
    key: str = field(default_factory=lambda: str(uuid.uuid4()))

    def send(self, client: httpx.Client) -> dict[str, Any]:
        """Its answer. Raises Lost for a refusal, httpx.HTTPError when there is none."""
        headers = {"idempotency-key": self.key}
        if isinstance(self.body, bytes):
            answer = client.post(self.path, content=self.body, headers={**headers, **PLY})
        else:
            answer = client.post(self.path, json=self.body, headers=headers)
        if not answer.is_success:
            raise Lost(f"{self.kind} {self.path}: HTTP {answer.status_code} {answer.text[:300]}")
        document: dict[str, Any] = answer.json()
        return document


@dataclass
class Ledger:
    """What one store's daemons have acknowledged."""

    sent: Counter[str] = field(default_factory=Counter)
    runs: dict[str, dict[str, Any]] = field(default_factory=dict)
    scans: list[str] = field(default_factory=list)
    views: dict[tuple[str, int], str] = field(default_factory=dict)
    calibrations: dict[str, str] = field(default_factory=dict)
    applied: list[str] = field(default_factory=list)

    def acknowledged(self, request: Request, answer: dict[str, Any], client: httpx.Client) -> None:
        match request.kind:
            case "run":
                self.runs[answer["id"]] = answer
                if answer["state"] == "finished":
                    calibration_id = answer["result"]["calibration_id"]
                    self.calibrations[calibration_id] = client.get(f"/calibrations/{calibration_id}").text
            case "scan":
                self.scans.append(answer["id"])
            case "view":
                assert isinstance(request.body, bytes)
                scan_id = request.path.split("/")[2]
                self.views[scan_id, answer["view"]] = hashlib.sha256(request.body).hexdigest()
            case "apply":
                self.applied.append(answer["calibration_id"])

    def check(self, client: httpx.Client, folder: Path, pending: Request | None) -> None:
        """`pending`: a request that got no answer. Raises Lost."""
        runs = {run["id"]: run for run in _all(client, "/runs?limit=500", "runs")}
        scans = {scan["id"]: scan for scan in _all(client, "/scans?limit=500", "scans")}
        applied = [row["calibration_id"] for row in _page(client, "/calibrations?limit=500")["applied"]][::-1]
        self._check_runs(runs, client, folder)
        self._check_scans(scans, folder)
        self._count("run", len(runs), pending)
        self._count("scan", len(scans), pending)
        self._count("view", sum(len(scan["views"]) for scan in scans.values()), pending)
        self._count("apply", len(applied), pending)
        if applied[: len(self.applied)] != self.applied:
            raise Lost(f"{self.applied} were applied, and the history says {applied}")

    def _check_runs(self, runs: dict[str, dict[str, Any]], client: httpx.Client, folder: Path) -> None:
        for run_id, run in self.runs.items():
            if runs.get(run_id) != run:
                raise Lost(f"run {run_id} was answered as {run}, and is {runs.get(run_id)}")
        for run in runs.values():
            if not run["over"] or (run["state"] == "failed" and "start the run again" not in run["cause"]["fix"]):
                raise Lost(f"an interrupted run does not say how to go on: {run}")
            _check_session(folder / "runs" / run["id"])
        for calibration_id, text in self.calibrations.items():
            if client.get(f"/calibrations/{calibration_id}").text != text:
                raise Lost(f"calibration {calibration_id} is another one now")

    def _check_scans(self, scans: dict[str, dict[str, Any]], folder: Path) -> None:
        for scan_id in self.scans:
            if scan_id not in scans:
                raise Lost(f"scan {scan_id} is gone")
        for (scan_id, view), digest in self.views.items():
            file = folder / "scans" / scan_id / scans[scan_id]["views"][view]["file"]
            if hashlib.sha256(file.read_bytes()).hexdigest() != digest:
                raise Lost(f"view {view} of scan {scan_id} is not what was sent")
        for scan in scans.values():
            _check_scan(folder / "scans" / scan["id"], scan)

    def _count(self, kind: str, there: int, pending: Request | None) -> None:
        """One for each request that was ever sent; the one without an answer may have one or none."""
        unsure = int(pending is not None and pending.kind == kind)
        if not self.sent[kind] - unsure <= there <= self.sent[kind]:
            raise Lost(f"{self.sent[kind]} requests for a {kind}, {there} there")


def _all(client: httpx.Client, link: str | None, noun: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    while link:
        page = _page(client, link)
        found, link = found + page[noun], page["next"]
    return found


def _page(client: httpx.Client, link: str) -> dict[str, Any]:
    page: dict[str, Any] = client.get(link).raise_for_status().json()
    return page


def _check_session(folder: Path) -> None:
    """Every picture that session.json names is whole."""
    file = folder / "session.json"
    if not file.exists():
        return
    for view in json.loads(file.read_text())["views"]:
        content = (folder / view["image"]).read_bytes()
        if not (content.startswith(b"\x89PNG") and content.endswith(b"IEND\xaeB`\x82")):
            raise Lost(f"{folder / view['image']} is half a picture")


def _check_scan(folder: Path, scan: dict[str, Any]) -> None:
    if scan["views"]:
        listed = [view["cloud"] for view in json.loads((folder / "scan.json").read_text())["views"]]
        if listed != [view["file"] for view in scan["views"]]:
            raise Lost(f"scan.json of {scan['id']} says {listed}")
