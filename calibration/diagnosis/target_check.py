"""Test whether the images show another target than described, for refused sessions."""

from collections.abc import Iterator

import numpy as np

from calibration.camera import CameraModel
from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
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
        Sentence("foreign-points", last=last, views=foreign) if foreign else None,
        Sentence("misplaced-points", views=misplaced) if misplaced else None,
    )
    yield Finding(
        "target-not-as-described",
        "error",
        Sentence("target-not-as-described", what=[part for part in parts if part], views=looked_at),
        Sentence("compare-target-kind"),
    )
