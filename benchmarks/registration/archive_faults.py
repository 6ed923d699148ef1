"""An archive whose workers, scheduler and storage fail: is it finished, with the same bytes, and is it resumed?
`python -m benchmarks.registration.archive_faults`.

Scans of three views are registered in this process first; every other way must write the same bytes. A process is
killed (SIGKILL) when a quarter of the scans is finished. What a killed scheduler leaves, a second command finishes.
"""

import argparse
import hashlib
import logging
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.registration.archive import an_archive
from daemon.tools.batch_registration.archive_run import FINISHED_NAME, FinishedScans, open_executor, run_here
from daemon.tools.batch_registration.remote_folder import RemoteFolder
from daemon.tools.batch_registration.tasks import MANIFEST_NAME, OutcomeDocument, RegistrationTask
from tests.daemon.calibrations import a_calibration
from tests.daemon.tools.dask_cluster import cluster

LATENCY_S = 0.02
"""Of each call of the slow share."""

LIMIT_S = 900.0
POLL_S = 0.1


class Trial:
    """The archive, its results, and the bytes that every way has to write."""

    def __init__(self, folder: Path, scans: int, points: int) -> None:
        self.folder, self.count = folder, scans
        self.scans = an_archive(folder / "in", scans, points)
        self.calibration = folder / "calibration.json"
        self.calibration.write_text(a_calibration("benchmark").model_dump_json())
        self.expected: dict[str, str] = {}

    def tasks(self, out: str, source: str | None = None) -> list[RegistrationTask]:
        return [
            RegistrationTask(source or str(self.folder / "in"), out, scan, self.calibration.read_text())
            for scan in self.scans
        ]

    def command(self, out: Path, *more: str) -> list[str]:
        given = ["register-archive", str(self.folder / "in"), "--calibration", str(self.calibration), "--out", str(out)]
        return [sys.executable, "-m", "daemon.cli", *given, "--json", *more]

    def hashes(self, out: Path) -> dict[str, str]:
        files = (file for file in sorted(out.rglob("*")) if file.is_file() and file.name != FINISHED_NAME)
        return {
            str(file.relative_to(out)): hashlib.sha256(file.read_bytes()).hexdigest()
            for file in files
            if file.suffix != ".part"
        }

    def finished(self, out: Path) -> int:
        return len(list(out.rglob(MANIFEST_NAME)))

    def row(self, words: str, began_s: float, states: dict[str, int], found: dict[str, str]) -> None:
        """One line of the table."""
        counts = ", ".join(f"{count} {state}" for state, count in states.items() if count)
        same = "same" if found == self.expected else f"DIFFERENT ({len(found)} of {len(self.expected)} files)"
        print(f"{words:<44}{time.monotonic() - began_s:8.1f} s  {counts:<40}{same} bytes", flush=True)


def states_of(outcomes: list[OutcomeDocument]) -> dict[str, int]:
    """How many scans are registered, unchanged and failed."""
    return {state: sum(one.state == state for one in outcomes) for state in ("registered", "unchanged", "failed")}


def read_states(lines: str) -> dict[str, int]:
    """The same of what `register-archive --json` prints."""
    return states_of([OutcomeDocument.model_validate_json(line) for line in lines.splitlines() if line.strip()])


def _wait(done: Callable[[], bool], process: "subprocess.Popen[str] | None" = None) -> None:
    ends_s = time.monotonic() + LIMIT_S
    while not done() and time.monotonic() < ends_s and (process is None or process.poll() is None):
        time.sleep(POLL_S)


def killed(trial: Trial, which: str) -> None:
    """A worker or the scheduler is killed; the command's end, and a second command where scans are left."""
    out, began_s = trial.folder / which, time.monotonic()
    with cluster(2) as (address, scheduler, workers):
        command = trial.command(out, "--scheduler", address)
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
            _wait(lambda: trial.finished(out) >= trial.count // 4, running)
            (scheduler if which == "scheduler" else workers[0]).kill()
            try:
                lines, errors = running.communicate(timeout=LIMIT_S)
            except subprocess.TimeoutExpired:
                running.kill()
                lines, errors = running.communicate()
                errors = f"no end within {LIMIT_S:g} s"
    trial.row(f"{which} killed: exit {running.returncode}", began_s, read_states(lines), trial.hashes(out))
    if errors:
        print(f"  {len(errors.splitlines())} lines of errors, the last: {errors.strip().splitlines()[-1][:150]}")
    if trial.finished(out) < trial.count:
        began_s = time.monotonic()
        again = subprocess.run(trial.command(out, "--scheduler", "here"), capture_output=True, text=True, check=False)
        trial.row(
            f"  the same command again: exit {again.returncode}", began_s, read_states(again.stdout), trial.hashes(out)
        )


def slow_share(trial: Trial) -> None:
    """Both folders on a share of which every call takes LATENCY_S."""
    import fsspec
    from fsspec.implementations.dirfs import DirFileSystem
    from fsspec.implementations.local import LocalFileSystem

    class SlowFileSystem(DirFileSystem):  # type: ignore[misc]
        protocol = "slow"

        def __init__(self, **options: Any) -> None:
            super().__init__(path=str(trial.folder), fs=LocalFileSystem(auto_mkdir=True), **options)

        def __getattribute__(self, name: str) -> Any:
            if name in ("cat_file", "get_file", "put_file", "pipe_file", "info", "rm_file", "makedirs"):
                time.sleep(LATENCY_S)
            return super().__getattribute__(name)

    fsspec.register_implementation("slow", SlowFileSystem)
    began_s = time.monotonic()
    outcomes = list(run_here(trial.tasks("slow://slow", "slow://in")))
    words = f"share with {LATENCY_S * 1e3:g} ms a call"
    trial.row(words, began_s, states_of(outcomes), trial.hashes(trial.folder / "slow"))


def object_store(trial: Trial) -> None:
    """Both folders in a bucket of an S3 server (moto)."""
    import fsspec
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    os.environ |= {"AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "cell",
                   "AWS_SECRET_ACCESS_KEY": "secret", "AWS_DEFAULT_REGION": "us-east-1"}  # fmt: skip
    s3: Any = fsspec.filesystem("s3", skip_instance_cache=True)
    s3.mkdir("parts")
    s3.put(str(trial.folder / "in"), "parts/in", recursive=True)
    for words in ("S3", "  the same again"):
        began_s = time.monotonic()
        target, source = RemoteFolder("s3://parts/out"), RemoteFolder("s3://parts/in")
        finished = FinishedScans(target, source.list_marks())
        outcomes = list(finished.run(trial.tasks(target.url, source.url), run_here))
        took_s = time.monotonic() - began_s
        found = {name: hashlib.sha256(s3.cat_file(f"parts/out/{name}")).hexdigest() for name in trial.expected}
        trial.row(words, time.monotonic() - took_s, states_of(outcomes), found)
    server.stop()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=200)
    parser.add_argument("--points", type=int, default=2000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="handeyed-bench-") as temporary:
        trial = Trial(Path(temporary), options.scans, options.points)
        began_s = time.monotonic()
        outcomes = list(run_here(trial.tasks(str(trial.folder / "here"))))
        trial.expected = trial.hashes(trial.folder / "here")
        trial.row("this process", began_s, states_of(outcomes), trial.expected)
        for workers in (1, 2):
            out, began_s = trial.folder / f"workers{workers}", time.monotonic()
            with open_executor("local", workers) as run:
                outcomes = list(run(trial.tasks(str(out))))
            trial.row(f"{workers} worker{'s' * (workers > 1)}", began_s, states_of(outcomes), trial.hashes(out))
        killed(trial, "worker")
        killed(trial, "scheduler")
        slow_share(trial)
        object_store(trial)
    return 0


if __name__ == "__main__":
    sys.exit(main())
