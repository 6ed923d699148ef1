"""`python -m benchmarks [NAME...] [--out FILE]`: run the benchmarks and write what they print."""

import argparse
import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

HERE = Path(__file__).resolve().parent


def main() -> int:
    """Each module with a main() in a process of its own, so that none warms or starves the next."""
    parser = argparse.ArgumentParser(prog="benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", help="benchmarks to run; all of them when none is named")
    parser.add_argument("--out", type=Path, help="write the tables here, as Markdown")
    options = parser.parse_args()
    known = available()
    unknown = sorted(set(options.names) - set(known))
    if unknown:
        parser.error(f"no benchmark is called {', '.join(unknown)}: there are {', '.join(known)}")
    sections, failed = [], []
    for name in options.names or known:
        text, status = run(name)
        sections.append(f"## {name}\n\n`python -m benchmarks.{name}`\n\n```\n{text}\n```\n")
        failed += [name] if status else []
    if options.out:
        options.out.write_text("\n".join([heading(), *sections]), encoding="utf-8")
        print(f"written to {options.out}")
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def available() -> list[str]:
    """Every module beside this one that can be run."""
    files = (file for file in sorted(HERE.glob("*.py")) if not file.name.startswith("_"))
    return [file.stem for file in files if "\ndef main(" in file.read_text(encoding="utf-8")]


def run(name: str) -> tuple[str, int]:
    """What a benchmark prints, shown while it runs, and its exit status."""
    print(f"\n{name}", flush=True)
    command = [sys.executable, "-m", f"benchmarks.{name}"]
    lines = []
    with subprocess.Popen(command, cwd=HERE.parent, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="", flush=True)
            lines.append(line)
    return "".join(lines).strip("\n"), process.returncode


def heading() -> str:
    """What was measured, when, on what."""
    machine = f"{os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    return (
        "# Benchmarks\n\nWritten by `make bench`; each table is what the command above it prints."
        f" Measured on {datetime.now(UTC):%Y-%m-%d}, {machine}. Compare ratios, not times, between machines.\n"
    )


if __name__ == "__main__":
    sys.exit(main())
