"""Recognition of targets: `python -m benchmarks.detection.recognition [--pictures N] [--data FOLDER]`.

Bars: 95 % of each recognised, none wrong without a doubt said; otherwise the exit status is 1.
Counts rendered pictures of every kind, and the photographs of a folder of sessions, whose target is recognised; those
with a wrong name, with and without a doubt said.
"""

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np

from tests.simulated.recognisable import MIN_SHARE, outcome, photographs, recognisable_pictures


def main() -> None:
    """Print one line a kind and a total, rendered and photographed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=200)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--stride", type=int, default=1, help="every n-th photograph only")
    options = parser.parse_args()
    rendered = ((target.kind, target, image) for target, image in recognisable_pictures(options.pictures))
    taken = list(photographs(options.data))[:: options.stride] if options.data.is_dir() else []
    print("| pictures | right | of | nothing | wrong, doubted | wrong | not in view | ms |")
    print("|---|---|---|---|---|---|---|---|")
    missed = False
    for title, rows in (("rendered", rendered), ("photographs", iter(taken))):
        counts: dict[str, Counter[str]] = {}
        milliseconds = []
        for name, target, image in rows:
            start = time.perf_counter()
            said = outcome(image, target)
            milliseconds.append(1e3 * (time.perf_counter() - start))
            counts.setdefault(name, Counter())[said] += 1
        counts[f"all {title}"] = sum(counts.values(), Counter())
        for name, count in counts.items():
            kinds = " | ".join(str(count[kind]) for kind in ("nothing", "wrong, doubted", "wrong"))
            of, hidden = count.total() - count["not in view"], count["not in view"]
            missed |= (name.startswith("all ") and count["right"] < MIN_SHARE * of) or count["wrong"] > 0
            print(f"| {name} | {count['right']} | {of} | {kinds} | {hidden} | {np.median(milliseconds or [0]):.0f} |")
    raise SystemExit(missed)


if __name__ == "__main__":
    main()
