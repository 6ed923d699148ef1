"""`python -m benchmarks.daemon.described_wrongly [--seeds N] [--rows ...]`

The whole daemon at its default, with the mock cell on real sockets, policy "auto" and a stated tolerance of 1 mm, while
the settings describe the print, the lens or the arm's lengths wrongly. What is active then is compared with the
mock's truth: the largest error of the working volume's points beside the stated U. Fails when anything active is off
by more than its U and 0.2 mm.
"""

import argparse
import asyncio
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.transforms import map_points
from mock_robot.truth.truth import CellTruth
from mock_robot.truth.truth_sheet import cell_sheet
from tests.stories.plant import Plant, plant
from tests.support.waiting import LIMIT_S

NEGLIGIBLE_MM = 0.2
AUTO = {"policy": "auto", "tolerance_mm": 1.0}


@dataclass(frozen=True)
class Row:
    """The truth over what is described: of the target's size, the focal length and the arm's lengths.

    An arm that is longer than its controller reports measures everything shorter, the truth of X and target too: in its
    millimetres the print alone has another size.
    """

    size: float = 1.0
    focal: float = 1.0
    arm: float = 1.0


ROWS = {
    "as described": Row(),
    **{f"print {100 * size:g} %": Row(size=size) for size in (0.95, 0.97, 0.98, 0.99, 0.995, 1.003)},
    **{f"focus {100 * (focal - 1):+.1f} %": Row(focal=focal) for focal in (1.005, 1.01, 1.03)},
    **{f"arm {100 * arm:g} %": Row(arm=arm) for arm in (0.996, 1.004)},
}


@dataclass(frozen=True)
class Outcome:
    """Of one run: whether its result is active; error, U and views; codes of what is not information."""

    applied: bool
    error_mm: float
    expanded_mm: float
    views: int
    said: tuple[str, ...]

    @property
    def wrong(self) -> bool:
        """Active, and off by more than it says."""
        return self.applied and self.error_mm > max(self.expanded_mm, NEGLIGIBLE_MM)


def described(sheet: dict[str, Any], row: Row) -> dict[str, dict[str, Any]]:
    """Sections of the settings in which the truth is `row` times what they say."""
    target, matrix = dict(sheet["target"]), np.array(sheet["camera"]["matrix"])
    for length in ("pitch_mm", "square_mm", "marker_mm"):
        if length in target:
            target[length] *= row.arm / row.size
    matrix[[0, 1], [0, 1]] /= row.focal
    return {"target": target, "camera": {"intrinsics": {**sheet["camera"], "matrix": matrix.tolist()}}}


async def outcome_of(row: Row, seed: int) -> Outcome:
    """Calibrate once, and compare what is active with the truth."""
    with tempfile.TemporaryDirectory() as folder:
        changes = described(cell_sheet(CellTruth.from_seed(seed)), row)
        async with plant(Path(folder), seed=seed, planned=True, calibration=AUTO, **changes) as story:
            run = (await story.operator.client.post("/calibrate", params={"wait": LIMIT_S})).json()
            return _outcome(story, run, (await story.operator.client.get(f"/calibrations/{run['id']}")).json())


def _outcome(story: Plant, run: dict[str, Any], document: dict[str, Any]) -> Outcome:
    found, findings = document.get("flange_T_camera"), document.get("verdict", {}).get("findings", [])
    said = tuple(finding["code"] for finding in findings if finding["severity"] != "info")
    if found is None:
        return Outcome(False, np.inf, np.inf, 0, said or (str(run["cause"]),))
    points = np.array([point["camera_mm"] for point in document["uncertainty"]["points"]])
    off = map_points(PoseDocument.model_validate(found).transform(), points) - map_points(
        story.truth.flange_T_camera, points
    )
    error_mm = float(np.linalg.norm(off, axis=1).max())
    views = document["observability"]["views_used"]
    return Outcome(bool(run["result"]["applied"]), error_mm, document["accuracy"]["expanded_mm"], views, said)


def lines_of(name: str, outcomes: list[Outcome]) -> Iterator[str]:
    """A line for each seed."""
    for seed, one in enumerate(outcomes, 1):
        said = ", ".join(one.said) or "nothing"
        state = "active" if one.applied else "waits for a person"
        yield (
            f"{name:14s} {seed:4d}  {state:18s} {one.views:5d} {one.error_mm:8.3f} {one.expanded_mm:8.3f}"
            f"  {'BEYOND U' if one.wrong else '':8s} {said}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--rows", nargs="*", default=list(ROWS))
    given = parser.parse_args()
    print(f"{'':14s} seed  {'':18s} views  error mm     U mm")
    wrong = 0
    for name in given.rows:
        outcomes = [asyncio.run(outcome_of(ROWS[name], seed)) for seed in range(1, given.seeds + 1)]
        wrong += sum(one.wrong for one in outcomes)
        print(*lines_of(name, outcomes), sep="\n", flush=True)
    if wrong:
        raise SystemExit(f"{wrong} active ones are off by more than their U")


if __name__ == "__main__":
    main()
