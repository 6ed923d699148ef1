"""A Dask scheduler and workers as processes of their own, which can be killed."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.support.waiting import eventually_blocking


@contextmanager
def cluster(workers: int) -> Iterator[tuple[str, "subprocess.Popen[bytes]", list["subprocess.Popen[bytes]"]]]:
    """A Dask scheduler and workers as processes of their own: its address, and all of them."""
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder, "scheduler.json")
        quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        dask = [sys.executable, "-m", "dask"]
        scheduler = subprocess.Popen(
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(told)],
            **quiet,
        )
        eventually_blocking(lambda: bool(_address(told)))
        address = _address(told)
        one = [*dask, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", folder]
        processes = [subprocess.Popen(one, **quiet) for _ in range(workers)]
        try:
            yield address, scheduler, processes
        finally:
            for process in (scheduler, *processes):
                process.kill()
                process.wait()


def _address(told: Path) -> str:
    """The scheduler's address; "" until its file is whole."""
    try:
        return str(json.loads(told.read_text())["address"])
    except (OSError, ValueError):
        return ""
