"""kill -9, again and again, at random and at every failpoint: `python -m benchmarks.torture --rounds 1000`.

Each round starts a daemon on what the last one left, checks that everything that was ever acknowledged is there and
nothing is half there, sends the request that got no answer once more, works on, and is killed. The devices are the
tests' fakes; server, store and files are what runs in a plant. kill -9 leaves what the system has in its buffers: what
a power cut would take as well is what `python -m benchmarks.disk_faults` is about.
"""

import argparse
import asyncio
import contextlib
import hashlib
import json
import multiprocessing
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import httpx
import numpy as np

READY_BAR_S = 5.0
ROUNDS_A_STORE = 25
PLY = {"content-type": "application/x-ply"}
POSE = "800,-100,900,0,1,0,0"


@dataclass
class KillAt:
    """Ends this process the n-th time a place is reached; `seen` counts what was reached."""

    place: str
    nth: int
    seen: Counter[str] = field(default_factory=Counter)

    def reached(self, place: str) -> None:
        self.seen[place] += 1
        if place == self.place and self.seen[place] == self.nth:
            os.kill(os.getpid(), signal.SIGKILL)


def daemon_process(folder: str, place: str, nth: int, told: Connection) -> None:
    """The daemon, with a crash in its future."""
    asyncio.run(_daemon(Path(folder), KillAt(place, nth), told))


async def _daemon(folder: Path, at: KillAt, told: Connection) -> None:
    from daemon.store.store import Store
    from tests.daemon.cells import Parts, serving, settings_for
    from tests.daemon.fakes import FakeCamera

    parts, moves = Parts(), folder.with_name("moves")

    async def move(number: int) -> None:
        at.reached("before move")
        with moves.open("a") as file:
            file.write(f"{number}\n")

    class Camera(FakeCamera):
        async def grab(self, newer_than_s: float) -> Any:
            at.reached("before capture")
            frame = await super().grab(newer_than_s)
            at.reached("after capture")
            return frame

    async def moved(number: int) -> None:
        await move(number)
        at.reached("after move")

    parts.robot.before_move = moved
    parts.camera = Camera(parts.robot)
    poses = settings_for(folder).calibration.poses[:3]
    settings = settings_for(folder, calibration={"poses": [pose.model_dump() for pose in poses]})
    async with serving(settings, parts, Store(folder, at=at)) as bench:
        told.send(bench.url)
        await asyncio.Event().wait()


@dataclass
class Request:
    """A POST that must be carried out exactly once."""

    kind: str
    path: str
    body: dict[str, Any] | bytes
    key: str = field(default_factory=lambda: str(uuid.uuid4()))

    def send(self, client: httpx.Client) -> dict[str, Any]:
        headers = {"idempotency-key": self.key}
        if isinstance(self.body, bytes):
            answer = client.post(self.path, content=self.body, headers={**headers, **PLY})
        else:
            answer = client.post(self.path, json=self.body, headers=headers)
        if not answer.is_success:
            raise Lost(f"{self.kind} {self.path}: HTTP {answer.status_code} {answer.text[:300]}")
        document: dict[str, Any] = answer.json()
        return document


class Lost(Exception):
    """What was promised is not there, or something is there that was not."""


@dataclass
class Ledger:
    """What the daemon has acknowledged."""

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
        """Raises Lost."""
        runs = {run["id"]: run for run in _all(client, "/runs?limit=500", "runs")}
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
        scans = {scan["id"]: scan for scan in _all(client, "/scans?limit=500", "scans")}
        for scan_id in self.scans:
            if scan_id not in scans:
                raise Lost(f"scan {scan_id} is gone")
        for (scan_id, view), digest in self.views.items():
            file = folder / "scans" / scan_id / scans[scan_id]["views"][view]["file"]
            if hashlib.sha256(file.read_bytes()).hexdigest() != digest:
                raise Lost(f"view {view} of scan {scan_id} is not what was sent")
        for scan in scans.values():
            _check_scan(folder / "scans" / scan["id"], scan)
        applied = [row["calibration_id"] for row in _page(client, "/calibrations?limit=500")["applied"]][::-1]
        self._count("run", len(runs), pending)
        self._count("scan", len(scans), pending)
        self._count("view", sum(len(scan["views"]) for scan in scans.values()), pending)
        self._count("apply", len(applied), pending)
        if applied[: len(self.applied)] != self.applied:
            raise Lost(f"{self.applied} were applied, and the history says {applied}")

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
        told = [view["cloud"] for view in json.loads((folder / "scan.json").read_text())["views"]]
        if told != [view["file"] for view in scan["views"]]:
            raise Lost(f"scan.json of {scan['id']} says {told}")


class Torture:
    """One store, many daemons."""

    def __init__(self, folder: Path, chance: random.Random) -> None:
        self._folder, self._chance = folder, chance
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["tests.daemon.cells", "tests.daemon.fakes", "scipy.optimize", "httpx"])
        warm = self._context.Process(target=int)  # the fork server's own imports are no start of a daemon
        warm.start()
        warm.join()
        self.ready_s: list[float] = []
        self.killed: Counter[str] = Counter()
        self._begin()

    def _begin(self) -> None:
        shutil.rmtree(self._folder / "store", ignore_errors=True)
        (self._folder / "moves").write_text("")
        self._ledger, self._pending = Ledger(), None

    def round(self, number: int) -> None:
        """Start, check, go on, be killed. Raises Lost."""
        from daemon.store.failpoints import PLACES

        if number % ROUNDS_A_STORE == 0:
            self._begin()
        place, nth = "", 0
        if self._chance.random() < 0.7:
            place = PLACES[number % len(PLACES)]
            nth = self._chance.randint(1, 6 if "move" in place or "capture" in place else 30)
        ours, theirs = self._context.Pipe()
        moves = (self._folder / "moves").read_text()
        began_s = time.monotonic()
        child = self._context.Process(
            target=daemon_process, args=(str(self._folder / "store"), place, nth, theirs), daemon=True
        )
        child.start()
        theirs.close()
        try:
            url = ours.recv()
        except EOFError:  # killed while it was starting: the next one goes on
            child.join()
            self.killed[f"{place}, while starting"] += 1
            return
        self.ready_s.append(time.monotonic() - began_s)
        timer = None
        if not place:
            timer = threading.Timer(self._chance.uniform(0, 1.2), child.kill)
            timer.start()
        try:
            with httpx.Client(base_url=url, timeout=60) as client:
                self._work(client, moves)
            child.kill()
            self.killed["at the end"] += 1
        except httpx.HTTPError:
            self.killed[place or "at random"] += 1
        finally:
            if timer is not None:
                timer.cancel()
            child.kill()
            child.join()

    def _work(self, client: httpx.Client, moves: str) -> None:
        self._ledger.check(client, self._folder / "store", self._pending)
        if (self._folder / "moves").read_text() != moves:
            raise Lost("the arm moved, and nobody had asked")
        if self._pending is not None:
            self._send(client, self._pending)
        scan = self._send(client, Request("scan", "/scans", {"name": "part"}))
        for _ in range(2):
            self._send(client, Request("view", f"/scans/{scan['id']}/views?pose={POSE}", _cloud(self._chance)))
        run = self._send(client, Request("run", "/calibrate?wait=60", {"count": 3}))
        if run["state"] == "finished":
            self._send(client, Request("apply", f"/calibrations/{run['id']}/apply", {"despite_verdict": True}))

    def _send(self, client: httpx.Client, request: Request) -> dict[str, Any]:
        if request is not self._pending:
            self._ledger.sent[request.kind] += 1
        self._pending = request
        answer = request.send(client)
        self._ledger.acknowledged(request, answer, client)
        self._pending = None
        return answer


def cold_start_s(folder: Path) -> float:
    """From nothing to the first answer, as systemd would start it: a new process with all its imports."""
    from tests.daemon.test_scans_killed import SETTINGS

    config, ready = folder / "handeyed.toml", folder / "ready.json"
    config.write_text(SETTINGS)
    ready.unlink(missing_ok=True)
    began_s = time.monotonic()
    command = [sys.executable, "-m", "daemon.cli", "serve", str(config), "--ready-file", str(ready)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        while not ready.exists() and process.poll() is None:
            time.sleep(0.01)
        took_s = time.monotonic() - began_s
        process.kill()
    return took_s


def _cloud(chance: random.Random) -> bytes:
    from tests.daemon.fakes import ply_of

    return ply_of(np.random.default_rng(chance.randrange(2**32)).normal(0, 100, (2000, 3)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="handeyed-torture-"))
    torture = Torture(folder, random.Random(options.seed))
    began_s = time.monotonic()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    number = done = 0
    try:
        for number in range(options.rounds):
            torture.round(number)
            done = number + 1
    except KeyboardInterrupt:
        print("stopped before its end")
    except Lost as lost:
        print(f"round {number}: {lost}\nthe store is left in {folder}")
        return 1
    took_s = time.monotonic() - began_s
    cold_s = [cold_start_s(folder) for _ in range(5)]
    with contextlib.suppress(OSError):
        shutil.rmtree(folder)
    print(f"{done} rounds in {took_s:.0f} s: nothing lost, nothing half done, the arm never moved by itself")
    for place, count in sorted(torture.killed.items()):
        print(f"  killed {place:<44}{count:6}")
    for name, times in (("forked", torture.ready_s), ("as a new process", cold_s)):
        middle, slowest = statistics.median(times), max(times)
        print(f"ready again, {name}: median {middle:.2f} s, slowest {slowest:.2f} s (bar {READY_BAR_S:g} s)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
