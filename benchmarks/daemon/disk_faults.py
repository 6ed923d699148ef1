"""Fails the n-th fsync, write, rename or openat, for every n, while everything is saved.

`python -m benchmarks.daemon.disk_faults`

A process saves a run, an image, a calibration, what is applied, a scan, a view, events, an audit row, keys, sessions,
requests, webhooks and documents in sequence, and reports which were acknowledged. strace makes the n-th call of one
kind fail with EIO or ENOSPC once the process has opened its store. Then another process checks, with a working disk:
everything acknowledged is there completely, everything else completely or not at all, and the audit log is intact.
`fsync` includes SQLite's fdatasync.
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
from multiprocessing.connection import Connection
from pathlib import Path

KINDS = {
    "fsync": "fsync,fdatasync",
    "write": "write,pwrite64",
    "rename": "rename,renameat,renameat2",
    "openat": "openat",
}
ERRORS = ("EIO", "ENOSPC")


def save_everything(folder: str, pipe: Connection) -> None:
    """Save one record of each kind; send those acknowledged at the end."""
    asyncio.run(_save(Path(folder), pipe))


async def _save(folder: Path, pipe: Connection) -> None:
    from daemon.errors import NotFound, StorageError
    from daemon.store.store import Store
    from tests.daemon.save_paths import save_steps

    steps = save_steps(Store(folder))
    (folder / "warm").write_bytes(b"")
    pipe.send(None)
    pipe.recv()  # strace is attached now
    done, refused = [], {}
    for name, step in steps.items():
        try:
            await step()
            done.append(name)
        except (StorageError, NotFound) as error:  # not found: what an earlier, refused step would have saved
            refused[name] = error.code
    for _ in range(5):  # the pipe is written to as well, but is not under test
        with suppress(OSError):
            pipe.send((done, refused))
            break
    pipe.recv()


def check_store(folder: str, done: list[str], pipe: Connection) -> None:
    """Check the store with a working disk."""
    from tests.daemon.save_paths import find_losses

    pipe.send(asyncio.run(find_losses(Path(folder), done)))


class Disk:
    """Applies one fault after the other."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["tests.daemon.save_paths"])
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
