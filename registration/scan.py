"""Registers a scan: several clouds of one part, each with its flange pose, become one cloud in the base frame.

The basic formula is P_base = base_T_flange @ flange_T_camera @ P_camera for each view (paper, Eq. 10, with X^-1 where
it prints X). Refinement puts a small motion before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.kinematics.robot_accuracy import ABSOLUTE_NOISE, MIN_POSE_NOISE, RobotNoise
from calibration.kinematics.stance import Stance
from calibration.problem import Setup, anchor_T_mount_of
from calibration.transforms import Array
from registration.errors import ScanError
from registration.fusion.concatenation import OnProgress, report_part, size_of
from registration.fusion.overlap import Agreement, agreement
from registration.fusion.pose_adjustment import MAX_ITERATIONS, Refinement, refine_poses
from registration.io.reading import open_cloud
from registration.points.layout import Layout
from registration.points.range_check import POSSIBLE_MM, RangeCheck, RangeMm
from registration.points.rigid_motion import RigidMotion, scale_to_mm
from registration.points.surface import MAX_RANGE_MM, POINT_LIMIT, PointSample, Surface


@dataclass(frozen=True, eq=False)
class ScanView:
    """A cloud file with its unit and where the arm stood. The part stands, or is on the flange.

    `range_mm`: nearest and farthest from the scanner at which its points can be.
    """

    path: Path
    unit: str
    stance: Stance
    setup: Setup = "eye-in-hand"
    range_mm: RangeMm = POSSIBLE_MM

    @property
    def base_T_flange(self) -> Array:
        """(4, 4)"""
        return self.stance.base_T_flange

    @property
    def anchor_T_mount(self) -> Array:
        """The camera's mount (4, 4) in the frame in which the part does not move."""
        return anchor_T_mount_of(self.setup, self.base_T_flange)


@dataclass(frozen=True, eq=False)
class ScannerMount:
    """X and, where it was estimated, the robot's noise, as a registration needs them from a calibration."""

    calibration_id: str
    flange_T_camera: Array
    noise: RobotNoise = field(default=ABSOLUTE_NOISE)


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A view with its pose in base after registration, how many points it has, and how many are not finite."""

    view: ScanView
    base_T_camera: Array
    points: int
    non_finite: int


@dataclass(frozen=True, eq=False)
class Registration:
    """Poses of all views, and their agreement before and (when refined) after."""

    views: tuple[PlacedView, ...]
    before: Agreement
    after: Agreement | None
    refinement: Refinement | None


def setup_of(views: Sequence[ScanView]) -> Setup:
    """The set-up of a scan's views; eye-in-hand of none."""
    return views[0].setup if views else "eye-in-hand"


def scanner_mount_of(document: CalibrationDocument) -> ScannerMount:
    """The scanner's mount from calibration.json. Raises ScanError when it has no flange_T_camera."""
    if document.flange_T_camera is None:
        reason = "its motions could not determine X" if document.setup == "eye-in-hand" else "its camera stands still"
        raise ScanError(
            f"calibration {document.id} has no flange_T_camera ({reason})", "use an eye-in-hand calibration"
        )
    translation_mm, rotation_deg = document.noise.robot_translation_mm, document.noise.robot_rotation_deg
    noise = RobotNoise(
        ABSOLUTE_NOISE.translation_mm if translation_mm is None else max(translation_mm, MIN_POSE_NOISE.translation_mm),
        ABSOLUTE_NOISE.rotation_rad
        if rotation_deg is None
        else max(np.deg2rad(rotation_deg), MIN_POSE_NOISE.rotation_rad),
    )
    return ScannerMount(document.id, document.flange_T_camera.transform(), noise)


@dataclass(frozen=True, eq=False)
class ViewSample:
    """What was read of a view: its surface, its columns, how many points it has, and how many are not finite.

    `doubt`: why its unit cannot be.
    """

    surface: Surface
    layout: Layout
    points: int
    non_finite: int
    doubt: str | None = None


def sample_views(
    views: Sequence[ScanView], on_progress: OnProgress = lambda share: None, *, limit: int = POINT_LIMIT
) -> list[ViewSample]:
    """Read a sample of every view, of at most `limit` points. Raises CloudError's leaves, UnitUnknown, ScanError.

    `on_progress` is called with the share of the files' bytes that is read. A file that does not say how many points it
    has counts when it is read.
    """
    if not views:
        raise ScanError("there are no views", "add at least one")
    samples: list[ViewSample] = []
    sizes = [size_of(view.path) for view in views]
    for index, view in enumerate(views):
        before, size, whole = sum(sizes[:index]), sizes[index], max(sum(sizes), 1)
        samples.append(_sample(view, limit, partial(report_part, on_progress, before / whole, size / whole)))
        on_progress((before + size) / whole)
    return samples


def _sample(view: ScanView, limit: int, on_read: OnProgress) -> ViewSample:
    """`on_read` is called with the share of the points that is read."""
    sample, check = PointSample(scale_to_mm(view.unit), limit), RangeCheck(view.unit, view.range_mm)
    points = non_finite = 0
    with open_cloud(view.path) as cloud:
        for block in cloud.blocks():
            points += len(block)
            check.look(block, cloud.layout)
            measured = block[cloud.layout.has_point(block)]
            non_finite += len(block) - len(measured)
            if cloud.count:
                on_read(min(points / cloud.count, 1.0))
            sample.add(measured, cloud.layout)
    kept = sample.points()
    if not len(kept) and points > non_finite:
        what = f"{view.path.name}: no point lies within {MAX_RANGE_MM / 1e6:g} km of the scanner"
        raise ScanError(what, "check the cloud and its unit")
    return ViewSample(Surface.of(kept), cloud.layout, points, non_finite, check.doubt)


def register_views(
    views: Sequence[ScanView],
    samples: Sequence[ViewSample],
    hand: ScannerMount,
    *,
    refine: bool = False,
    on_progress: OnProgress = lambda share: None,
) -> Registration:
    """Poses of the views by the basic formula, or refined. Raises MotionError, ScanError.

    `on_progress` is called with the share that is done: each iteration of a refinement, of as many as it may take, and
    the agreement before and after it count the same.
    """
    if any(view.setup == "eye-to-hand" for view in views):
        raise ScanError(
            "the camera stands in the cell and the part moves with the flange: its views have no common place in base",
            "calibrate from them with handeyed solve --artefact; register views of a camera on the flange",
        )
    poses = [view.base_T_flange @ hand.flange_T_camera for view in views]
    for view, pose in zip(views, poses, strict=True):
        RigidMotion.of(pose, view.unit)
    surfaces = [sample.surface for sample in samples]
    before = agreement(surfaces, poses)
    refinement, after = None, None
    if refine:
        refinement = refine_poses(
            surfaces,
            poses,
            [view.base_T_flange for view in views],
            hand.noise,
            lambda iteration: on_progress(iteration / (2 + MAX_ITERATIONS)),
        )
        poses = [found.motion @ pose for found, pose in zip(refinement.corrections, poses, strict=True)]
        after = agreement(surfaces, poses)
    placed = tuple(
        PlacedView(view, pose, sample.points, sample.non_finite)
        for view, pose, sample in zip(views, poses, samples, strict=True)
    )
    return Registration(placed, before, after, refinement)
