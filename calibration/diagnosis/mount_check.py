"""Is the camera where it was expected? A tool instead of the flange in a whole session contradicts nothing else."""

from dataclasses import dataclass

import numpy as np

from calibration.sentences.sentence import Sentence
from calibration.solution import Finding
from calibration.transforms import Array, difference

MOUNT_MM, MOUNT_RAD = 25.0, float(np.radians(3.0))
"""Default tolerance of an expected mount, as from a drawing or a ruler."""


@dataclass(frozen=True, eq=False)
class ExpectedMount:
    """The expected X (4, 4) and its tolerances."""

    mount_T_camera: Array
    within_mm: float = MOUNT_MM
    within_rad: float = MOUNT_RAD


def mount_findings(mount_T_camera: Array, expected: ExpectedMount) -> tuple[Finding, ...]:
    """At most one finding: X is not as expected. Poses of a tool instead of the flange are consistent otherwise."""
    off_mm, off_rad = difference(expected.mount_T_camera, mount_T_camera)
    if off_mm <= expected.within_mm and off_rad <= expected.within_rad:
        return ()
    return (
        Finding(
            "mount-not-as-expected",
            "warning",
            Sentence("mount-not-as-expected", off_mm=off_mm, off_deg=np.degrees(off_rad)),
            Sentence("check-tool"),
        ),
    )
