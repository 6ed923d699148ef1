"""What `handeyed import` and `solve` make of damaged files with poses: `python -m benchmarks.daemon.damaged_files`.

The files are those of HANDEYED_DATA/cases, each with its known X, damaged by seeds
(tests/calibration/documents/imports/file_damage.py). Counted are refusals, results that are right, and accepted ones
that are wrong, which are printed with their seed, as is every exception that no user should see. Where the lengths of
both sides were changed alike, or one axis of both reversed with the rotations that go with it, X is as wrong as they
are and no file shows it; these are counted apart.
"""

import argparse
import shutil
import tempfile
import time
import traceback
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from tests.calibration.documents.imports.file_damage import FACTORS, damage
from tests.daemon.cli.public_cases import CASES, Case, data_folder
from tests.daemon.cli.running import handeyed

WRONG_MM, WRONG_DEG = 1.0, 0.15
"""Of an accepted X; the tolerance is 1 mm."""

SAME_RATIO = 0.02
"""Of X's length to a factor of the damage: then all lengths of both sides were changed, which no file shows."""

Outcome = tuple[int, str, str, str]
"""Seed, outcome, damage and details."""


def try_one(seed: int, folder: Path) -> Outcome:
    """The outcome of one damaged case in a folder of its own, which holds the undamaged files of every case."""
    random = np.random.default_rng(seed)
    case: Case = CASES[seed % len(CASES)]
    own, out = folder / case.name, folder / "session"
    if not own.exists():
        shutil.copytree(data_folder() / "cases" / case.name, own)
    shutil.rmtree(out, ignore_errors=True)
    name = case.files[random.integers(len(case.files))]
    original = (own / name).read_bytes()
    done, content = damage(original, random)
    (own / name).unlink()
    (own / name).write_bytes(content)
    try:
        outcome, details = _outcome(case, own, out)
    except Exception:  # noqa: BLE001  (whatever it is, it is what is looked for)
        outcome, details = "EXCEPTION", traceback.format_exc(limit=-3)
    finally:
        (own / name).write_bytes(original)
    return seed, "unchanged" if content == original else outcome, f"{case.name}, {done}", details


def _outcome(case: Case, own: Path, out: Path) -> tuple[str, str]:
    ran = handeyed("import", own, *case.options(own), "--out", out)
    if ran.status != 0:
        return "refused by import", ran.err
    if not (out / "session.json").exists():
        return "imported without a target", ran.out
    solved = handeyed("solve", out, "--json")
    if solved.status != 0:
        return "refused by solve", solved.err
    off_mm, off_deg = case.error_of(solved.out)
    if off_deg <= WRONG_DEG and any(
        abs(case.ratio_of(solved.out) / factor - 1) < SAME_RATIO for factor in (-1.0, *FACTORS)
    ):
        return "all lengths changed alike", ""
    if case.is_mirrored(solved.out):
        return "both sides mirrored alike", ""
    if off_mm > WRONG_MM or off_deg > WRONG_DEG:
        return "WRONG", f"{off_mm:.2f} mm, {off_deg:.3f} deg; {ran.out}"
    return "right", ""


def try_some(seeds: list[int]) -> list[Outcome]:
    """Outcomes of some seeds, in a process of its own."""
    from daemon.sessions import session_reader

    warnings.simplefilter("error")
    session_reader.detect_in_file = cache(session_reader.detect_in_file)  # type: ignore[attr-defined]
    with tempfile.TemporaryDirectory() as folder:
        return [try_one(seed, Path(folder)) for seed in seeds]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=3_800_000, help="of the first file; each next one has the next")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--chunk", type=int, default=500)
    options = parser.parse_args()
    if not (data_folder() / "cases").is_dir():
        print(f"there is no folder {data_folder() / 'cases'}: set HANDEYED_DATA")
        return
    seeds = list(range(options.seed, options.seed + options.files))
    chunks = [seeds[at : at + options.chunk] for at in range(0, len(seeds), options.chunk)]
    counts: Counter[str] = Counter()
    began = time.monotonic()
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        for job in as_completed([pool.submit(try_some, chunk) for chunk in chunks]):
            for seed, outcome, what, details in job.result():
                counts[outcome] += 1
                if outcome.isupper():
                    print(f"{outcome} {seed} ({what}): {details}", flush=True)
            passed_s = time.monotonic() - began
            print(f"{sum(counts.values()):,} files in {passed_s:.0f} s: {dict(counts)}", flush=True)


if __name__ == "__main__":
    main()
