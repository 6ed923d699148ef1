"""Recognition of targets: `python -m benchmarks.detection.recognition [--pictures N] [--data FOLDER]`.

Bars: 95 % of each recognised, none wrong without a doubt said; otherwise the exit status is 1.
Counts rendered pictures of every kind, and the photographs of a folder of sessions, whose target is recognised; those
with a wrong name, with and without a doubt said.
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.detect import detect
from calibration.detection.recognition import recognise
from calibration.documents.target import TargetDocument
from calibration.errors import DetectionError
from calibration.targets import Target
from tests.simulated.recognisable import is_same_print, recognisable_pictures

MIN_SHARE = 0.95


def photographs(folder: Path) -> Iterator[tuple[str, Target, NDArray[Any]]]:
    """Name, target and image of every photograph of sessions with a target."""
    from pydantic import TypeAdapter

    for file in sorted(folder.rglob("session.json")):
        session = json.loads(file.read_text())
        try:
            target = TypeAdapter(TargetDocument).validate_python(session["target"]).target()
        except (KeyError, ValueError):
            continue
        for view in session["views"]:
            image = cv2.imread(str(file.parent / view["image"]), cv2.IMREAD_GRAYSCALE) if view.get("image") else None
            if image is not None:
                yield str(file.parent.relative_to(folder)), target, image


def outcome(image: NDArray[Any], target: Target) -> str:
    """`right`, `nothing`, `wrong` or `wrong, doubted`; `not in view` where its description finds nothing, either."""
    try:
        found = recognise(image)
    except DetectionError:
        found = None
    if found is None:
        try:
            detect(image, target)
        except DetectionError:
            return "not in view"
        return "nothing"
    if is_same_print(found.target, target):
        return "right"
    return "wrong, doubted" if found.doubts else "wrong"


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
