"""What a hand-eye solver answers. Judging it is `calibration.verdict`'s work."""

from dataclasses import dataclass, field
from typing import Literal

from calibration.camera import CameraModel
from calibration.problem import Setup
from calibration.transforms import Array

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True)
class Finding:
    """Something a person should know: a stable `code`, a sentence, and what to do."""

    code: str
    severity: Severity
    message: str
    fix: str


@dataclass(frozen=True, eq=False)
class ViewResult:
    """How one view fits. `robot_correction`: (3,) mm and rotation vector (3,) rad."""

    index: int
    image: str | None
    status: Literal["used", "corrected", "rejected"]
    reason: str | None
    reprojection_px: float | None
    base_error_mm: float | None
    robot_correction: tuple[Array, Array] | None


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """One standard deviation of X and of a mapped point (`point_mm`).

    `translation_mm` (3,): of X's translation along the mount's axes; `rotation_rad` (3,): about the camera's axes.

    `covariance` (6, 6) of [rotation rad, translation mm], of mount_T_camera @ exp(.), in the camera frame.
    """

    translation_mm: Array
    rotation_rad: Array
    point_mm: float
    covariance: Array


@dataclass(frozen=True)
class Noise:
    """Standard deviations estimated from the data, per axis; None where they cannot be."""

    image_px: float | None
    robot_rotation_rad: float | None
    robot_translation_mm: float | None


@dataclass(frozen=True)
class Observability:
    """How well the motions determine X. `axis_spread`: 0 all rotation axes parallel .. 1 evenly spread."""

    views_used: int
    max_rotation_rad: float
    axis_spread: float
    weakest_direction: str


@dataclass(frozen=True)
class HoldOut:
    """Leave-one-view-out errors, RMS."""

    base_error_mm: float
    reprojection_px: float


@dataclass(frozen=True, eq=False)
class Solution:
    """`mount_T_camera` is None when the motions cannot determine it: never a wrong one. See `calibration.problem`."""

    setup: Setup
    method: str
    mount_T_camera: Array | None
    anchor_T_target: Array | None
    camera: CameraModel | None
    camera_source: Literal["given", "estimated"]
    uncertainty: Uncertainty | None
    noise: Noise
    views: tuple[ViewResult, ...]
    observability: Observability
    hold_out: HoldOut | None
    findings: tuple[Finding, ...] = field(default=())


@dataclass(frozen=True)
class Verdict:
    """Whether a solution may be used, and everything found on the way."""

    accepted: bool
    findings: tuple[Finding, ...]
