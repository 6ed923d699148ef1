"""Fails the n-th fsync, write, rename or openat, for every n, while everything is saved.

`python -m benchmarks.daemon.disk_faults`

A process saves a run, an image, a calibration, what is applied, a scan, a view, events and an audit row in sequence,
and reports which were acknowledged. strace makes the n-th call of one kind fail with EIO or ENOSPC once the process has
opened its store. Then another process checks, with a working disk: everything acknowledged is there completely,
everything else completely or not at all, and the audit log is intact. `fsync` includes SQLite's fdatasync.
"""

import argparse
import asyncio
import multiprocessing
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

KINDS = {
    "fsync": "fsync,fdatasync",
    "write": "write,pwrite64",
    "rename": "rename,renameat,renameat2",
    "openat": "openat",
}
ERRORS = ("EIO", "ENOSPC")
AT = "2026-11-21T09:00:00.000Z"
PICTURE = b"\x89PNG" + bytes(20_000)


def save_everything(folder: str, pipe: Connection) -> None:
    """Save one record of each kind; send those acknowledged at the end."""
    asyncio.run(_save(Path(folder), pipe))


async def _save(folder: Path, pipe: Connection) -> None:
    import numpy as np

    from calibration.documents.pose import PoseDocument
    from daemon.errors import StorageError
    from daemon.model.records import AppliedCalibration, CalibrationRecord, ScanRecord
    from daemon.model.run_states import RunState
    from daemon.runtime.event_bus import BusEvent
    from daemon.store.actor import AuditContext
    from daemon.store.store import Store
    from tests.daemon.calibrations import a_calibration
    from tests.daemon.fakes import ply_of
    from tests.daemon.records import a_run

    store = Store(folder)
    run, scan = a_run("r"), ScanRecord("s", AT, "door")
    calibration = CalibrationRecord("c", "r", AT, True, a_calibration("c"))
    upload = store.scan_folder("s") / ".upload"
    pose = PoseDocument.of(np.eye(4))
    cloud = ply_of(np.ones((500, 3)))

    async def view() -> None:
        upload.parent.mkdir(parents=True, exist_ok=True)
        try:
            upload.write_bytes(cloud)
        except OSError as error:
            raise StorageError(str(error), "") from None
        await store.add_scan_view("s", upload, ".ply", "mm", pose, AT)

    steps = {
        "run": lambda: store.save_run(run),
        "picture": lambda: store.write_file(store.run_folder("r") / "view_000.png", [PICTURE]),
        "session": lambda: store.write_file(store.run_folder("r") / "session.json", [b'{"views": 1}']),
        "session again": lambda: store.write_file(store.run_folder("r") / "session.json", [b'{"views": 2}']),
        "calibration": lambda: store.save_calibration(calibration),
        "applied": lambda: store.apply(AppliedCalibration("c", AT, "Ann")),
        "run over": lambda: store.save_run(replace(run, state=RunState.FINISHED)),
        "scan": lambda: store.save_scan(scan),
        "view": view,
        "event": lambda: store.stored_events.keep([BusEvent(7, "run", {})]),
        "audit": lambda: store.audit.append(AuditContext(), AT, "x", "y"),
        "anchor": store.audit.anchor,
    }
    (folder / "warm").write_bytes(b"")
    pipe.send(None)
    pipe.recv()  # strace is attached now
    done, refused = [], {}
    for name, step in steps.items():
        try:
            await step()
            done.append(name)
        except StorageError as error:
            refused[name] = error.code
    for _ in range(5):  # the pipe is written to as well, but is not under test
        with suppress(OSError):
            pipe.send((done, refused))
            break
    pipe.recv()


def check_store(folder: str, done: list[str], pipe: Connection) -> None:
    """Check the store with a working disk."""
    pipe.send(asyncio.run(_check(Path(folder), done)))


async def _check(folder: Path, done: list[str]) -> list[str]:
    from daemon.errors import NoCalibration, NotFound
    from daemon.model.run_states import RunState
    from daemon.store.audit_log import check_audit_log
    from daemon.store.database import DATABASE_NAME
    from daemon.store.store import Store

    store = Store(folder)
    wrong: list[str] = []

    def expect(name: str, there: bool, what: str = "is not there") -> None:
        if name in done and not there:
            wrong.append(f"{name} was acknowledged and {what}")

    try:
        run = await store.run("r")
        expect("run over", run.state is RunState.FINISHED, f"the run is {run.state}")
    except NotFound:
        expect("run", False)
    picture, session = store.run_folder("r") / "view_000.png", store.run_folder("r") / "session.json"
    expect("picture", picture.exists())
    if picture.exists() and picture.read_bytes() != PICTURE:
        wrong.append("the picture is torn")
    text = session.read_text() if session.exists() else ""
    allowed = {'{"views": 2}'} if "session again" in done else {'{"views": 1}', '{"views": 2}'}
    if text not in (allowed if {"session", "session again"} & {*done} else {"", *allowed}):
        wrong.append(f"session.json says {text!r} after {done}")
    try:
        await store.calibration("c")
    except NotFound:
        expect("calibration", False)
    try:
        await store.current()
    except NoCalibration:
        expect("applied", False)
    try:
        await store.scan("s")
        views = await store.scan_views("s")
        expect("view", len(views) == 1)
        for view in views:
            if (store.scan_folder("s") / view.file).stat().st_size < 6000:
                wrong.append("the view is torn")
    except NotFound:
        expect("scan", False)
    expect("event", any(event.number == 7 for event in await store.stored_events.last()))
    await store.close()
    return wrong + check_audit_log(folder / DATABASE_NAME, [])[1]


class Disk:
    """Applies one fault after the other."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(
            ["tests.daemon.calibrations", "tests.daemon.fakes", "tests.daemon.records"]
        )
        self.refused: Counter[str] = Counter()

    def fault(self, kind: str, error: str, nth: int) -> tuple[bool, list[str]]:
        """Whether there was an n-th call, and the errors found afterwards."""
        store = self._folder / "store"
        shutil.rmtree(store, ignore_errors=True)
        ours, theirs = self._context.Pipe()
        child = self._context.Process(target=save_everything, args=(str(store), theirs), daemon=True)
        child.start()
        theirs.close()
        ours.recv()
        trace = self._folder / "trace"
        calls = KINDS[kind]
        command = ["strace", "-f", "-q", "-o", str(trace), "-e", f"trace={calls}",
                   "-e", f"inject={calls}:error={error}:when={nth}", "-p", str(child.pid)]  # fmt: skip
        tracer = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        _wait_for_tracer(child.pid or 0, tracer)
        ours.send("go")
        try:
            done, refused = ours.recv()
        except EOFError:
            done, refused = [], None
        child.kill()
        child.join()
        tracer.wait()
        assert tracer.stderr is not None
        tracer.stderr.close()
        injected = "INJECTED" in trace.read_text()
        wrong = self._look(store, done)
        if refused is None:
            wrong.append("the process died")
        else:
            self.refused.update(refused.values())
        return injected, wrong

    def _look(self, store: Path, done: list[str]) -> list[str]:
        ours, theirs = self._context.Pipe()
        child = self._context.Process(target=check_store, args=(str(store), done, theirs), daemon=True)
        child.start()
        theirs.close()
        try:
            found: list[str] = ours.recv()
        except EOFError:
            found = ["the store cannot be opened any more"]
        child.join()
        return found


def _wait_for_tracer(pid: int, tracer: "subprocess.Popen[str]") -> None:
    """Wait until every thread is traced."""
    ends_s = time.monotonic() + 20
    while True:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        if all("TracerPid:\t0" not in (task / "status").read_text() for task in tasks):
            return
        if tracer.poll() is not None or time.monotonic() > ends_s:
            raise SystemExit(f"strace could not attach: {tracer.stderr and tracer.stderr.read()}")
        time.sleep(0.01)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="only every so manieth call")
    parser.add_argument("--kind", choices=[*KINDS], action="append", help="only this kind; repeat it")
    options = parser.parse_args()
    if shutil.which("strace") is None:
        print("strace is not installed: apt install strace")
        return 1
    folder = Path(tempfile.mkdtemp(prefix="handeyed-disk-"))
    disk, failed = Disk(folder), 0
    try:
        for kind in options.kind or KINDS:
            for error in ERRORS:
                cases, nth, wrong = _every_call(disk, kind, error, options.every)
                failed += len(wrong)
                said = "; ".join(wrong) or "old or new, never between"
                print(f"{kind:<8}{error:<8}{cases:5} faults, calls 1 to {nth}: {said}", flush=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print("reported as: " + ", ".join(f"{code} {count} times" for code, count in sorted(disk.refused.items())))
    return 1 if failed else 0


def _every_call(disk: Disk, kind: str, error: str, every: int) -> tuple[int, int, list[str]]:
    """Until no such call is made any more."""
    cases, nth, wrong = 0, 1, []
    while True:
        injected, found = disk.fault(kind, error, nth)
        wrong += [f"call {nth}: {what}" for what in found]
        if not injected:
            return cases, nth - every, wrong
        cases, nth = cases + 1, nth + every


if __name__ == "__main__":
    sys.exit(main())
