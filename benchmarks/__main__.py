"""`python -m benchmarks [NAME...] [--full] [--out FILE]`: run the benchmarks and record their output.

Each has a quick tier, `QUICK`, so that all of them together take half an hour; `--full` runs them at their default size
or larger, which takes hours. A benchmark that fails or exceeds its limit is named at the end and in its section.
"""

import argparse
import os
import platform
import re
import signal
import subprocess
import sys
import threading
from datetime import UTC, datetime
from pathlib import Path

HERE = Path(__file__).resolve().parent

QUICK: dict[str, tuple[str, ...]] = {
    "arm": ("--arms", "1"),
    "daemon.abort": ("--aborts", "4", "--viewers", "300"),
    "daemon.camera_stream": ("--requests", "200"),
    "daemon.damaged_files": ("--files", "300"),
    "daemon.described_wrongly": ("--seeds", "1"),
    "daemon.disk_faults": ("--every", "40"),
    "daemon.drift": ("--cells", "30"),
    "daemon.egm": ("--seconds", "5"),
    "daemon.half_open": ("--connections", "200", "--requests", "100"),
    "daemon.held_move": ("--holds", "3"),
    "daemon.http": ("--rounds", "8"),
    "daemon.http_fuzz": ("--streams", "1000"),
    "daemon.link": ("--schedules", "10", "--reads", "10", "--reconnects", "50"),
    "daemon.merge_beside": ("--points", "1e6", "--runs", "1"),
    "daemon.opcua": ("--seconds", "8"),
    "daemon.page": ("--runs", "1", "--idle", "10"),
    "daemon.page_cloud": ("--points", "1e6", "--views", "4", "--area", "2"),
    "daemon.page_hours": ("--hours", "1"),
    "daemon.power_cut": ("--every", "40", "--states", "4"),
    "daemon.readers": ("--readers", "100", "--rounds", "3"),
    "daemon.restart": ("--starts", "5"),
    "daemon.schemathesis": ("--cases", "300"),
    "daemon.soak": ("--minutes", "1"),
    "daemon.torture": ("--rounds", "20"),
    "detection": ("--views", "4"),
    "detection.recognition": ("--pictures", "40", "--stride", "20"),
    "diagnosis": ("--sessions", "4", "--real", "2", "--clean", "50", "--factors", "1", "1.5"),
    "diagnosis.damaged": ("--sessions", "100"),
    "diagnosis.postures": ("--sessions", "2"),
    "diagnosis.warming": ("--sessions", "4"),
    "hand_eye": ("--cells", "500"),
    "hand_eye.belief": ("--seeds", "6"),
    "hand_eye.expected": (),
    "hand_eye.further_camera": ("--cells", "6"),
    "hand_eye.honesty": ("--sessions", "520"),
    "hand_eye.peers": ("--cells", "20"),
    "hand_eye.vision_calibration": ("--cells", "4"),
    "registration.archive": ("--scans", "8"),
    "registration.archive_faults": ("--scans", "20", "--points", "500"),
    "registration.finished_scans": ("--scans", "200"),
    "registration.large_part": ("--views", "8", "--points", "1e5"),
    "registration.profiled_door": ("--cells", "1"),
    "run_time": ("--runs", "1"),
}
FULL: dict[str, tuple[str, ...]] = {
    "daemon.modbus": ("--frames", "1000000"),
    "daemon.soak": ("--minutes", "120"),
    "daemon.torture": ("--rounds", "1000"),
    "diagnosis.damaged": ("--sessions", "20000"),
    "hand_eye": ("--cells", "1000"),
    "hand_eye.kinhec": ("--tier", "small"),
    "hand_eye.peers": ("--cells", "200"),
    "hand_eye.vision_calibration": ("--cells", "50"),
}
BY_NAME_ONLY = frozenset({"hand_eye.peers"})
"""Needs an OpenCV with calibrateHandEye: `make bench` runs it in the other environment."""

STARTED_BY_OTHERS = frozenset({"daemon.floods"})
"""Programs here that benchmarks start with arguments of their own."""

QUICK_LIMIT_S, FULL_LIMIT_S = 900.0, 3 * 3600.0


def main() -> int:
    """Run each module with a main() in a process of its own, so that they do not affect each other."""
    parser = argparse.ArgumentParser(prog="benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", help="benchmarks to run; all of them when none is named")
    parser.add_argument("--full", action="store_true", help="the long tiers")
    parser.add_argument("--limit", type=float, help="seconds that one benchmark may take")
    parser.add_argument("--out", type=Path, help="write the tables here, as Markdown; sections of others are kept")
    options = parser.parse_args()
    known = available()
    unknown = sorted(set(options.names) - set(known))
    if unknown:
        parser.error(f"no benchmark is called {', '.join(unknown)}: there are {', '.join(known)}")
    limit_s = options.limit or (FULL_LIMIT_S if options.full else QUICK_LIMIT_S)
    failed = []
    for name in options.names or [name for name in known if name not in BY_NAME_ONLY]:
        arguments = (FULL if options.full else QUICK).get(name, ())
        text, trouble = run(name, arguments, limit_s)
        if options.out:
            put(options.out, name, section(name, arguments, text, trouble))
        failed += [f"{name} ({trouble})"] if trouble else []
    if options.out:
        print(f"written to {options.out}")
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def available() -> list[str]:
    """Dotted names of the modules and packages in this folder that run as programs, sorted."""
    files = [file for file in HERE.rglob("*.py") if file != HERE / "__main__.py"]
    runnable = [file for file in files if '__name__ == "__main__"' in file.read_text(encoding="utf-8")]
    names = {".".join(file.relative_to(HERE).with_suffix("").parts).removesuffix(".__main__") for file in runnable}
    return sorted(names - STARTED_BY_OTHERS)


def run(name: str, arguments: tuple[str, ...], limit_s: float) -> tuple[str, str]:
    """Run a benchmark, showing its output; returns the output, and what went wrong or ""."""
    print(f"\n{command_of(name, arguments)}", flush=True)
    lines = []
    command = [sys.executable, "-m", f"benchmarks.{name}", *arguments]
    # a process group of its own, so that its children end with it
    with subprocess.Popen(
        command, cwd=HERE.parent, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        stopped = threading.Event()
        watchdog = threading.Timer(limit_s, lambda: (stopped.set(), os.killpg(process.pid, signal.SIGTERM)))
        watchdog.start()
        try:
            for line in process.stdout:
                print(line, end="", flush=True)
                lines.append(line)
        except KeyboardInterrupt:
            os.killpg(process.pid, signal.SIGTERM)
            raise
        finally:
            watchdog.cancel()
    trouble = f"stopped after {limit_s:.0f} s" if stopped.is_set() else ""
    if process.returncode and not trouble:
        trouble = f"exit status {process.returncode}"
    return "".join(lines).strip("\n"), trouble


def command_of(name: str, arguments: tuple[str, ...]) -> str:
    """Command line of a benchmark."""
    return " ".join(["python -m", f"benchmarks.{name}", *arguments])


def section(name: str, arguments: tuple[str, ...], text: str, trouble: str) -> str:
    """Section of the document: heading, command, date and machine, output."""
    when = (
        f"{datetime.now(UTC):%Y-%m-%d}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    )
    failure = f"\n\nFailed: {trouble}." if trouble else ""
    return f"## {name}\n\n`{command_of(name, arguments)}` ({when}){failure}\n\n```\n{text}\n```\n"


def put(file: Path, name: str, new: str) -> None:
    """Replace the section of that name, or append it. Text around the old table is kept."""
    old = file.read_text(encoding="utf-8") if file.exists() else HEADING
    head, *sections = re.split(r"^(?=## )", old, flags=re.MULTILINE)
    kept = [one.rstrip("\n") + "\n" for one in sections]
    places = [index for index, one in enumerate(kept) if one.startswith(f"## {name}\n")]
    if places:
        kept[places[0]] = with_words(kept[places[0]], new)
    else:
        kept.append(new)
    file.write_text("\n".join([head.rstrip("\n") + "\n", *kept]), encoding="utf-8")


def with_words(old: str, new: str) -> str:
    """A new section with the text of the old one: paragraphs before its table and everything after it,

    which may include tables of longer runs with their own commands.
    """
    parts, written = (re.split(FENCED, one, maxsplit=1, flags=re.MULTILINE) for one in (old, new))
    if len(parts) < len(written):
        return new
    before = [one.strip("\n") for one in parts[0].split("\n\n")[2:]]
    words = [one for one in before if one and not one.startswith("Failed: ")]
    after = [one for one in (parts[2].strip("\n"),) if one]
    return "\n\n".join([written[0].rstrip("\n"), *words, written[1], *after]) + "\n"


FENCED = r"(^```\n(?s:.*?)^```$)"
"""A table: the output of a benchmark."""

HEADING = """# Benchmarks

Written by `make bench`; each table is what the command above it prints. Compare ratios, not times, between machines.
"""


if __name__ == "__main__":
    sys.exit(main())
