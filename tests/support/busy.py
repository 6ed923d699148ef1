"""Runs a command while every core is kept busy: `python -m tests.support.busy COMMAND [ARGUMENT...]`."""

import multiprocessing
import os
import subprocess
import sys


def spin() -> None:
    """Use one core for ever."""
    while True:
        pass


def main() -> int:
    """The exit status of the command."""
    if not sys.argv[1:]:
        sys.exit(__doc__)
    spinning = [multiprocessing.Process(target=spin, daemon=True) for _ in range(os.cpu_count() or 1)]
    for process in spinning:
        process.start()
    try:
        return subprocess.run(sys.argv[1:], check=False).returncode
    finally:
        for process in spinning:
            process.kill()


if __name__ == "__main__":
    sys.exit(main())
