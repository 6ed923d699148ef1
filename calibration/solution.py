"""Output of the hand-eye solver. `calibration.verdict` decides whether it may be used."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import with_config

from calibration.camera import CameraModel
from calibration.kinematics.arm_errors import Group
from calibration.kinematics.external_axis import ExternalAxis
from calibration.kinematics.robot_accuracy import NoiseBelief
from calibration.problem import AxisOffset, Problem, Setup, View
from calibration.sentences.described import Described
from calibration.targets import IN_DOCUMENTS
from calibration.transforms import Array

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True)
class Finding:
    """A message for people: a stable `code`, what was found, and how to fix it.

    `effect_mm`: by how much a measured point moves when the cause is taken into account, None where that is not known.
    `sizes`: what the verdict compares with its limits, by their names in `calibration.verdict.VerdictLimits`; while
    none is beyond its limit the severity is `within` at most. `least`: what a small effect may lower the severity to.
    """

    code: str
    severity: Severity
    message: str
    fix: str
    effect_mm: float | None = None
    sizes: tuple[tuple[str, float], ...] = ()
    within: Severity = "warning"
    least: Severity = "info"


@dataclass(frozen=True, eq=False)
class PointResiduals:
    """The m detected points of one view beside the places where the solution predicts them.

    pixels, residuals_px : (m, 2) measured, and predicted minus measured: at the corrected pose of the robot for a view
        that is used, at the reported one for a rejected view.
    distances_mm : (m,) from the camera, along its axis.
    used : (m,) False for outlying points.
    """

    pixels: Array
    residuals_px: Array
    distances_mm: Array
    used: NDArray[np.bool_]

    @property
    def lengths_px(self) -> Array:
        """Lengths (m,) of the residuals."""
        return np.asarray(np.hypot(*self.residuals_px.T))


@dataclass(frozen=True, eq=False)
class ViewResult:
    """The fit of one view.

    reason, why : why it is not used or was corrected, a code and a sentence.
    robot_correction : estimated error of its pose, (3,) mm and rotation vector (3,) rad.
    points : None when there is no estimate, or the view does not enter it.
    joints_rad : (n,) the arm's axes, where they were recorded.
    camera_temperature_c : of the camera, where it was recorded.
    """

    index: int
    image: str | None
    status: Literal["used", "corrected", "rejected"]
    reason: str | None = None
    reprojection_px: float | None = None
    base_error_mm: float | None = None
    robot_correction: tuple[Array, Array] | None = None
    points: PointResiduals | None = None
    why: str | None = None
    joints_rad: Array | None = None
    camera_temperature_c: float | None = None


COVERAGE_FACTOR = 2.0
"""k of an expanded uncertainty U = k sigma (JCGM 100, 6.2)."""

PointFrame = Literal["base", "camera"]


@dataclass(frozen=True)
class NamedPoint:
    """A point that matters to the user, at (x, y, z) mm of a frame."""

    name: str
    frame: PointFrame
    position_mm: tuple[float, float, float]


@dataclass(frozen=True)
class PointUncertainty(NamedPoint):
    """Such a point, and the standard deviation of it mapped through X, over three axes.

    `camera_mm`: where it is in the camera's frame; of several views' places the most uncertain one.
    """

    camera_mm: tuple[float, float, float]
    sigma_mm: float

    @property
    def expanded_mm(self) -> float:
        """U, k = 2."""
        return COVERAGE_FACTOR * self.sigma_mm


class _Uncertain(Protocol):
    @property
    def sigma_mm(self) -> float: ...


AnyPoint = TypeVar("AnyPoint", bound=_Uncertain)


def worst_of(points: Iterable[AnyPoint]) -> AnyPoint:
    """The most uncertain of these points, one at least: its U (k = 2) is the one that is stated everywhere."""
    return max(points, key=lambda point: inf if isnan(point.sigma_mm) else point.sigma_mm)


@dataclass(frozen=True, eq=False)
class ArmScale:
    """Lengths by the arm over true ones: the logarithm's mean and variance, and its covariance (6,) with X."""

    log: float
    variance: float
    with_x: Array


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """One standard deviation of X and of a measured point (`point_mm`).

    translation_mm : (3,) of X's translation along the mount's axes.
    rotation_rad : (3,) about the camera's axes.
    point_mm : RMS over the working volume.
    covariance : (6, 6) of [rotation rad, translation mm] of mount_T_camera @ exp(.), in the camera frame.
    points : the points that matter, one at least.
    arm_scale : of the arm's millimetre, in which X is; None where it is not estimated.
    """

    translation_mm: Array
    rotation_rad: Array
    point_mm: float
    covariance: Array
    points: tuple[PointUncertainty, ...]
    arm_scale: ArmScale | None = None

    def scaled(self, factor: float) -> "Uncertainty":
        """All standard deviations times `factor`."""
        scale = self.arm_scale
        return Uncertainty(
            translation_mm=factor * self.translation_mm,
            rotation_rad=factor * self.rotation_rad,
            point_mm=factor * self.point_mm,
            covariance=factor**2 * self.covariance,
            points=tuple(replace(point, sigma_mm=factor * point.sigma_mm) for point in self.points),
            arm_scale=None if scale is None else replace(scale, with_x=factor * scale.with_x),
        )

    @property
    def worst_point(self) -> PointUncertainty:
        """The most uncertain of the points that matter."""
        return worst_of(self.points)

    @property
    def expanded_mm(self) -> float | None:
        """U (k = 2) there, mm; None where X is not determined."""
        worst_mm = self.worst_point.expanded_mm
        return worst_mm if isfinite(worst_mm) else None


GroupedBy = Literal["image", "pose", "view"]


@with_config(IN_DOCUMENTS)
@dataclass(frozen=True)
class LeaveOutDocument(Described):
    """Uncertainty of a measured point by leaving out groups of neighbouring views; it assumes no noise model.

    Neighbours have the target's place in the image in common, the pose, or nothing: single views.
    """

    point_mm: float
    """One standard deviation of a measured point, mm, RMS over the working volume."""
    ratio: float
    """Observed over expected square of the errors. No unit."""
    redundancy: float
    """Degrees of freedom of the ratio."""
    share: float
    """Posterior probability of errors beyond the model, 0 to 1."""
    grouped_by: GroupedBy
    """The grouping that disagrees most: image, pose or view."""
    groups: int
    """Number of groups."""

    @property
    def inflation(self) -> float:
        """Factor of X's covariance: 1 under the model, `ratio` where errors beyond it are certain."""
        return 1 + self.share * max(self.ratio - 1, 0.0)


@dataclass(frozen=True)
class Noise:
    """Standard deviations per axis, estimated from the data; None where the data do not determine one.

    `belief`: in the robot's noise after the session, None where there is no estimate.
    """

    image_px: float | None = None
    robot_rotation_rad: float | None = None
    robot_translation_mm: float | None = None
    belief: NoiseBelief | None = None


@dataclass(frozen=True)
class Observability:
    """How well the motions determine X. `axis_spread`: 0 when all rotation axes are parallel, 1 when evenly spread."""

    views_used: int
    max_rotation_rad: float
    axis_spread: float
    weakest_direction: str


@with_config(IN_DOCUMENTS)
@dataclass(frozen=True)
class HoldOutDocument(Described):
    """Leave one view out; the document holds null below 4 views, and no pixels without images."""

    base_error_mm: float
    """RMS distance in the base, mm."""
    reprojection_px: float | None
    """RMS distance of points from where they are predicted, px."""


@with_config(IN_DOCUMENTS)
@dataclass(frozen=True)
class ClockOffsetDocument(Described):
    """The robot's clock minus the sensor's, with one standard deviation."""

    offset_s: float
    """The robot's clock minus the sensor's at one moment, s."""
    sigma_s: float
    """One standard deviation of offset_s, s."""


@with_config(IN_DOCUMENTS)
@dataclass(frozen=True)
class ArmLadderDocument(Described):
    """The models up to a group: their probability, log-evidence against no error, and hold-out by joint regions."""

    up_to: Group | None
    """The last group of the model; null for an arm as drawn."""
    probability: float
    """Of the model among those with errors."""
    log_evidence: float
    """Natural logarithm of the evidence against an arm as drawn."""
    hold_out_mm: float
    """Prediction error of views left out by region of joint space, RMS, mm."""


@dataclass(frozen=True, eq=False)
class ExternalAxisEstimate:
    """The axis found with X; poses, target and X of the solution are those with the axis at its zero.

    covariance : (12, 12) of X @ exp(.) and [direction, point_mm] of the axis, which vary across the direction only.
    readings : lowest and highest of the views, mm or rad.
    sigma_mm : largest standard deviation, over three axes, of a point of the working volume registered at a view's
        reading and pose: of X and the axis together.
    off_rad : angle between the direction given and the one found.
    """

    axis: ExternalAxis
    covariance: Array
    readings: tuple[float, float]
    sigma_mm: float
    off_rad: float

    @property
    def expanded_mm(self) -> float:
        """U, k = 2."""
        return COVERAGE_FACTOR * self.sigma_mm


@dataclass(frozen=True, eq=False)
class Solution:
    """The result of a solve; frames as in `calibration.problem`. `mount_T_camera` is None when it is not determined.
    What is not given is not known, or does not belong to the method.

    `target_scale`: size of the target over the described one, as estimated with X.
    """

    setup: Setup
    method: str
    views: tuple[ViewResult, ...]
    observability: Observability
    mount_T_camera: Array | None = None
    anchor_T_target: Array | None = None
    camera: CameraModel | None = None
    camera_source: Literal["given", "estimated"] = "given"
    uncertainty: Uncertainty | None = None
    noise: Noise = Noise()
    hold_out: HoldOutDocument | None = None
    findings: tuple[Finding, ...] = ()
    leave_out: LeaveOutDocument | None = None
    clock_offset: ClockOffsetDocument | None = None
    axis_offset: AxisOffset | None = None
    external_axis: ExternalAxisEstimate | None = None
    target_scale: float = 1.0


def used_views(problem: Problem, solution: Solution) -> tuple[View, ...]:
    """The problem's views that the solution does not reject."""
    used = {view.index for view in solution.views if view.status != "rejected"}
    return tuple(view for view in problem.views if view.index in used)
