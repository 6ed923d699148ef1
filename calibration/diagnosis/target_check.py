"""Test whether the images show another target than described, for refused sessions."""

from collections.abc import Iterator

import numpy as np

from calibration.camera import CameraModel
from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.problem import Problem
from calibration.solution import Finding

FOREIGN_ID = "corner-id-unknown"
MISPLACED_PX = 5.0
"""RMS residual of a view above which it shows another target; wrong intrinsics and bent boards leave less."""


def target_findings(problem: Problem, camera: CameraModel | None) -> Iterator[Finding]:
    """At most one finding: in most views the detected points are not those of this target."""
    seen, refused = observe(problem)
    looked_at = sum(view.detection is not None for view in problem.views)
    foreign = sum(why.code == FOREIGN_ID for why in refused.values())
    misplaced = 0
    if camera is not None and len(seen):
        misplaced = int(np.count_nonzero(candidate_poses(seen, camera)[1].min(axis=1) > MISPLACED_PX))
    if not 2 * (foreign + misplaced) > looked_at:
        return
    last = len(problem.target.points_mm) - 1
    parts = (
        f"points that it does not have (it has 0 to {last}) in {foreign}" if foreign else "",
        f"points that do not lie as its points do in {misplaced}" if misplaced else "",
    )
    yield Finding(
        "target-not-as-described",
        "error",
        f"the target is another one than was described: {' and '.join(filter(None, parts))} of {looked_at} views",
        "compare the target's description with the target: kind, columns, rows, dictionary and layout",
    )
