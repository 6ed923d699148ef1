"""Processor time of starting each command: `python -m benchmarks.daemon.startup --starts 9`.

Each command runs as a process of its own; user and system time of the process are summed, and the median of the starts
is printed beside its bar. Elapsed time is left out: it measures what else the machine does.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

COMMANDS = (("--help",), ("version",), ("target", "chessboard"), ("target", "charuco"), ("target", "circles"))
BAR_S = 0.4


def processor_s(arguments: tuple[str, ...], folder: str) -> float:
    """User and system time of one `handeyed ARGUMENTS`, in a folder that may be written."""
    command = [sys.executable, "-m", "daemon.cli", *arguments]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, env=environment_with_bytecode())
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def environment_with_bytecode() -> dict[str, str]:
    """The environment of a process that keeps what it compiled, as an installed package does; one thread for BLAS."""
    root = str(Path(__file__).resolve().parents[2])
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": root, "OPENBLAS_NUM_THREADS": "1"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=9)
    starts = parser.parse_args().starts
    late = 0
    with tempfile.TemporaryDirectory() as folder:
        for arguments in COMMANDS:
            processor_s(arguments, folder)  # compiled files are written once
            taken_s = statistics.median(processor_s(arguments, folder) for _ in range(starts))
            late += taken_s > BAR_S
            print(f"handeyed {' '.join(arguments):20} {taken_s:5.2f} s (bar {BAR_S} s)")
    print("handeyed serve: python -m benchmarks.daemon.restart")
    return int(late > 0)


if __name__ == "__main__":
    sys.exit(main())
