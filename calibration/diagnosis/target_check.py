"""Test whether the images show another target than described, for refused sessions."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from calibration.intrinsics.zhang_init import plane_views
from calibration.observations.observations import observe
from calibration.problem import Detection, Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding
from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Grid, Target, TrackedFrame

FOREIGN_ID = "corner-id-unknown"
MAX_TRIED_VIEWS = 5
"""Views, evenly spaced, in which other columns and rows are tried."""

MAX_COLUMNS = 60
"""Most columns that are tried."""


def target_findings(problem: Problem) -> Iterator[Finding]:
    """At most one finding: in most views the detected points are not those of this target."""
    seen, refused = observe(problem)
    looked_at = sum(view.detection is not None for view in problem.views)
    foreign = sum(why.code == FOREIGN_ID for why in refused.values())
    misplaced = sum(plane is None for plane in plane_views(seen, problem.image_size))
    if not 2 * (foreign + misplaced) > looked_at:
        return
    last = len(problem.target.points_mm) - 1
    parts = (
        Sentence("foreign-points", last=last, views=foreign) if foreign else None,
        Sentence("misplaced-points", views=misplaced) if misplaced else None,
    )
    what, shown = [part for part in parts if part], _fitting_description(problem)
    yield Finding(
        "target-not-as-described",
        "error",
        Sentence("target-not-as-described", what=what, views=looked_at)
        if shown is None
        else Sentence("target-shown", what=what, views=looked_at, shown=shown[0]),
        Sentence("compare-target-kind") if shown is None else shown[1],
    )


def _fitting_description(problem: Problem) -> tuple[Sentence, Sentence] | None:
    """What fits the points, and the setting to change; None when no number of columns does, or several do."""
    described = problem.target
    if isinstance(described, TrackedFrame | ArucoMarker):
        return None
    detections = [view.detection for view in problem.views if view.detection is not None]
    few = [detections[row] for row in np.unique(np.linspace(0, len(detections) - 1, MAX_TRIED_VIEWS).astype(np.intp))]
    least = min((int(seen.ids.min()) for seen in detections if len(seen.ids)), default=0)
    last = max((int(seen.ids.max()) for seen in detections if len(seen.ids)), default=-1)
    from_zero = [Detection(seen.ids - 1, seen.corners_px) for seen in few]
    if least > 0 and _shows(problem, described, from_zero) and last <= len(described.points_mm):
        return Sentence("ids-from-one"), Sentence("count-from-zero")
    fitting = [
        target
        for columns in range(2, MAX_COLUMNS + 1)
        if (target := _with_columns(described, columns, last)) is not None and _shows(problem, target, few)
    ]
    if len(fitting) != 1:
        return None
    (target,) = fitting
    if target.columns == described.rows and target.rows <= described.columns:
        rows, what = described.columns, Sentence("columns-and-rows-exchanged")
    else:
        rows, what = target.rows, Sentence("columns-and-rows", columns=target.columns, rows=target.rows)
    return what, Sentence("set-columns-and-rows", columns=target.columns, rows=rows)


def _with_columns(target: Grid, columns: int, last: int) -> Grid | None:
    """The target with so many columns and as few rows, but not fewer than described, as have the point `last`."""
    wide = columns - 1 if isinstance(target, Charuco) else columns
    if wide < 1:
        return None
    last = last // 4 if isinstance(target, AprilTagGrid | ArucoGrid) else last
    rows = last // wide + (2 if isinstance(target, Charuco) else 1)
    return replace(target, columns=columns, rows=max(rows, 2))


def _shows(problem: Problem, target: Target, detections: list[Detection]) -> bool:
    """Whether the points of all these images lie as this target's do."""
    pairs = zip(problem.views, detections, strict=False)
    views = tuple(replace(view, detection=seen) for view, seen in pairs)
    seen, _ = observe(replace(problem, target=target, views=views))
    return len(seen) == len(detections) and all(plane is not None for plane in plane_views(seen, problem.image_size))
