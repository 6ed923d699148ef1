"""Random and damaged byte streams over HTTP connections: `python -m benchmarks.daemon.http_fuzz --streams 100000`.

Two daemons in processes of their own, one of them over TLS. Reported are the answers by status, the longest turn of
each event loop in processor time, and the memory after a tenth of the streams and at the end.
"""

import argparse
import asyncio
import contextlib
import os
import shutil
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from benchmarks.daemon.http import process
from daemon.runtime.memory_trim import PERIOD_S

ALLOWED = (502, 503, 504, 507)
"""Documented answers above 499: a device that does not answer, not ready, too many connections, disk full."""

TRIMMED_S = 2 * PERIOD_S + 2.0
"""After so long without connections the daemon has given freed memory back."""

MAX_STALL_MS = 100.0
MAX_GROWTH_MB = 10.0
BATCH = 1000


def daemon_process(folder: str, secured: bool, ready: Any) -> None:
    """The daemon with its real server and fake devices; puts (port, a viewer's key)."""
    import uvloop

    uvloop.run(_daemon(Path(folder), secured, ready))


async def _daemon(folder: Path, secured: bool, ready: Any) -> None:
    from daemon.access.roles import Role
    from tests.daemon.access_keys import TEST
    from tests.daemon.cell_under_test import serving, settings_for
    from tests.daemon.http.tls_files import certificate

    server = certificate(folder / "tls") if secured else {}
    async with serving(settings_for(folder / "store", server=server)) as bench:
        key, _ = await bench.application.key_service.add("viewer", Role.VIEWER, TEST)
        bench.server.prepare()
        await asyncio.sleep(0.5)  # what that took is not to be counted
        bench.application.loop_monitor.reset()
        ready.put((urlsplit(bench.url).port, key))
        while True:
            await asyncio.sleep(10)
            stall = bench.application.loop_monitor.longest()
            (folder / "stall").write_text(f"{1000 * stall.processor_s:.1f} {1000 * stall.wall_s:.1f}")


def resident_mb(pid: int) -> float:
    """Resident memory of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> int:
    from tests.daemon.http.http_fuzz import Answers, Target, send_streams
    from tests.daemon.http.tls_files import trusting

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streams", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="end after so long, at a whole thousand")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="handeyed-http-fuzz-"))
    answers, stalls_ms, ended_mb = Answers(), [0.0, 0.0], [0.0, 0.0]
    early_mb: list[float] = []
    began_s = time.monotonic()
    try:
        with contextlib.ExitStack() as daemons:
            folders = [folder / "plain", folder / "tls"]
            started = [
                daemons.enter_context(process(daemon_process, str(each), each.name == "tls")) for each in folders
            ]
            pids = [pid for _, pid in started]
            targets = [Target(*started[0][0]), Target(*started[1][0], tls=trusting(folders[1] / "tls"))]  # type: ignore[misc]
            for first in range(0, options.streams, BATCH):
                numbers = range(options.seed + first, options.seed + min(first + BATCH, options.streams))
                asyncio.run(send_streams(targets, numbers, options.seed + first, answers))
                stalls_ms = [max(worst, stall_ms(each)) for worst, each in zip(stalls_ms, folders, strict=True)]
                last = first + BATCH >= options.streams or time.monotonic() - began_s > options.seconds
                if last or (not early_mb and first + BATCH >= options.streams / 10):
                    time.sleep(TRIMMED_S)
                    ended_mb = [resident_mb(pid) for pid in pids]
                    early_mb = early_mb or ended_mb
                if last:
                    break
            for target, scheme in zip(targets, ("http", "https"), strict=True):
                health = f"{scheme}://127.0.0.1:{target.port}/health"
                assert urllib.request.urlopen(health, timeout=60, context=target.tls).status == 200
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{answers.streams} streams in {time.monotonic() - began_s:.0f} s; answers by status:")
    print("  " + ", ".join(f"{status}: {count}" for status, count in sorted(answers.by_status.items())))
    for name, stall, early, ended in zip(("plain", "TLS"), stalls_ms, early_mb, ended_mb, strict=True):
        print(f"{name:<6} longest turn {stall:.1f} ms of processor time (bar {MAX_STALL_MS:g}), "
              f"memory {early:.1f} MB after a tenth, {ended:.1f} MB at the end (bar +{MAX_GROWTH_MB:g})")  # fmt: skip
    wrong = {status: answer for status, answer in answers.failures.items() if status not in ALLOWED}
    for status, answer in wrong.items():
        print(f"an answer {status}: {answer!r}")
    grown = any(ended > early + MAX_GROWTH_MB for early, ended in zip(early_mb, ended_mb, strict=True))
    return int(bool(wrong) or grown or max(stalls_ms) > MAX_STALL_MS)


def stall_ms(folder: Path) -> float:
    """The longest turn that the daemon has written down last, in milliseconds of processor time."""
    try:
        return float((folder / "stall").read_text().split()[0])
    except (OSError, IndexError):
        return 0.0


if __name__ == "__main__":
    sys.exit(main())
