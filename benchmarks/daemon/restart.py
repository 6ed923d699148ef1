"""Time from kill -9 until the cell is ready again: `python -m benchmarks.daemon.restart --starts 20`.

A mock cell and the daemon as processes. The daemon is killed in the middle of a run; a new process is started on the
same store and polled until GET /ready says that it could calibrate and register. Measured from the start of the
process, including imports, in elapsed time and in processor time, which depends less on other load.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from benchmarks.daemon.startup import environment_with_bytecode
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text

READY_BAR_S = 5.0
AT_WORK_BAR_S = 1.2
LIMIT_S = 60.0
POLL_S = 0.005
TRIES = 5


@contextmanager
def start_daemon(folder: Path) -> Iterator[tuple[httpx.Client, float, float]]:
    """Start a daemon; yields a client, the seconds until ready, and the processor time of them; kills it at the end."""
    ready = folder / "daemon.json"
    ready.unlink(missing_ok=True)
    command = [sys.executable, "-m", "daemon.cli", "serve", str(folder / "handeyed.toml"), "--ready-file", str(ready)]
    began_s = time.monotonic()
    with (folder / "daemon.log").open("ab") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment_with_bytecode())
    try:
        while not ready.exists():
            if process.poll() is not None or time.monotonic() - began_s > LIMIT_S:
                raise SystemExit(f"the daemon did not start: {(folder / 'daemon.log').read_text()[-500:]}")
            time.sleep(POLL_S)
        url = json.loads(ready.read_text())["url"]
        with httpx.Client(base_url=url, timeout=120, trust_env=False, verify=False) as client:
            while not _can_work(client.get("/ready").json()):
                if time.monotonic() - began_s > LIMIT_S:
                    raise SystemExit(f"the cell did not become ready: {client.get('/ready').text}")
                time.sleep(POLL_S)
            yield client, time.monotonic() - began_s, _at_work_s(process.pid)
    finally:
        process.kill()
        process.wait()


def _at_work_s(pid: int) -> float:
    """Processor time of all its threads so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _can_work(ready: dict[str, Any]) -> bool:
    return bool(ready["calibrate"]["ready"] and ready["register"]["ready"])


def run_in_progress(client: httpx.Client) -> str:
    """A run in progress that has moved the arm; started again when the machine was too busy for a device."""
    for _ in range(TRIES):
        run = client.post("/calibrate").raise_for_status().json()
        while run["station"] < 1 and not run["over"]:
            run = client.get(f"/runs/{run['id']}").json()
        if not run["over"]:
            return str(run["id"])
    raise SystemExit(f"the run ended before it could be interrupted: {run['cause']}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="handeyed-restart-") as name:
        folder, took_s, work_s = Path(name), [], []
        mock = ["mock_robot", "run", "--with-parent", "--seed", "7", "--time-scale", "20"]
        with start_child("mock-cell", mock, folder) as robot:
            (folder / "handeyed.toml").write_text(settings_text(robot.announcement, 0))
            left = ""
            with _first(folder) as client:
                client.post("/calibrate?wait=120").raise_for_status()
                left = run_in_progress(client)
            for _ in range(options.starts):
                with start_daemon(folder) as (client, seconds, at_work):
                    took_s.append(seconds)
                    work_s.append(at_work)
                    run = client.get(f"/runs/{left}").json()
                    assert run["state"] == "failed" and "start the run again" in run["cause"]["fix"], run
                    left = run_in_progress(client)
    middle, slowest = statistics.median(took_s), max(took_s)
    print(f"ready again after kill -9 in mid-run, {len(took_s)} starts of a new process:")
    print(f"median {middle:.2f} s, slowest {slowest:.2f} s (bar {READY_BAR_S:g} s)")
    at_work_s = statistics.median(work_s)
    print(f"processor time of it {at_work_s:.2f} s (bar {AT_WORK_BAR_S:g} s)")
    print(f"load {os.getloadavg()[0]:.0f} on {os.cpu_count()} cores")
    return 0 if slowest < READY_BAR_S and at_work_s < AT_WORK_BAR_S else 1


@contextmanager
def _first(folder: Path) -> Iterator[httpx.Client]:
    """A daemon that makes the first calibration, since register is not ready before."""
    with start_child("daemon", ["daemon.cli", "serve", str(folder / "handeyed.toml")], folder) as daemon:
        with httpx.Client(base_url=daemon.announcement["url"], timeout=120, trust_env=False, verify=False) as client:
            yield client
        daemon.process.kill()


if __name__ == "__main__":
    sys.exit(main())
