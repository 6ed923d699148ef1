"""plan.json: in and out of `handeyed plan FILE --json` and `handeyed assess FILE --json`."""

from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from calibration.documents.knowledge import KnowledgeDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import PointsDocument
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from calibration.kinematics.robot_accuracy import (
    PRIOR_FACTOR,
    PRIOR_NOISE,
    STATED_FACTOR,
    USUAL_BELIEF,
    NoiseBelief,
    RobotNoise,
)
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.planning.line_of_sight import LineOfSight
from calibration.planning.plan import Plan
from calibration.planning.viewpoints import ViewpointLimits
from calibration.problem import ANCHORS, MOUNTS, Setup
from calibration.solution import Uncertainty


class NoiseExpectedDocument(Document):
    """What is expected of the noise; of the robot's, good to a factor of two. Left out, the robot's is that of an
    industrial robot as usual, or what the cell has learnt of its own; the camera's is that of a good one."""

    image_px: PositiveFloat = 0.05
    """Noise of a detected point, px, one standard deviation per axis."""
    robot_rotation_deg: PositiveFloat | None = None
    """Noise of the robot's rotation, degrees, one standard deviation per axis."""
    robot_translation_mm: PositiveFloat | None = None
    """Noise of the robot's translation, mm, one standard deviation per axis."""

    @property
    def is_stated(self) -> bool:
        """Whether the robot's noise is stated."""
        return self.robot_rotation_deg is not None or self.robot_translation_mm is not None

    def belief(self) -> NoiseBelief:
        """In the robot's noise, as far as it is stated."""
        if not self.is_stated:
            return USUAL_BELIEF
        rotation_deg, translation_mm = self.robot_rotation_deg, self.robot_translation_mm
        median = RobotNoise(
            PRIOR_NOISE.translation_mm if translation_mm is None else translation_mm,
            PRIOR_NOISE.rotation_rad if rotation_deg is None else float(np.deg2rad(rotation_deg)),
        )
        stated = (PRIOR_FACTOR if rotation_deg is None else STATED_FACTOR,
                  PRIOR_FACTOR if translation_mm is None else STATED_FACTOR)  # fmt: skip
        return NoiseBelief(median, stated, "stated")

    def noise(self, belief: NoiseBelief | None = None) -> ExpectedNoise:
        """At the median of what is believed; by default of `self.belief()`."""
        median = (belief or self.belief()).median
        return ExpectedNoise(self.image_px, median.rotation_rad, median.translation_mm)


class LimitsDocument(Document):
    """Where the planner may look from; see `calibration.planning.viewpoints.ViewpointLimits`."""

    tilt_deg: Annotated[float, Field(gt=0, le=75)] = 45.0
    """Largest angle between the line of sight and the target's normal, degrees."""
    roll_deg: Annotated[float, Field(ge=0, le=180)] = 180.0
    """Largest turn about the line of sight, degrees."""
    distance_mm: tuple[PositiveFloat, PositiveFloat] = (450.0, 750.0)
    """Least and greatest distance of the camera from the target, mm."""
    box_mm: tuple[Vector, Vector] | None = None
    """Two opposite corners [[xmin, ymin, zmin], [xmax, ymax, zmax]] in the base, mm."""

    @model_validator(mode="after")
    def _check_order(self) -> "LimitsDocument":
        if self.distance_mm[0] > self.distance_mm[1]:
            raise ValueError("distance_mm is [nearest, furthest]")
        if self.box_mm is not None and any(low >= high for low, high in zip(*self.box_mm, strict=True)):
            raise ValueError("box_mm is [[xmin, ymin, zmin], [xmax, ymax, zmax]]")
        return self

    def limits(self) -> ViewpointLimits:
        box = None if self.box_mm is None else np.array(self.box_mm)
        return ViewpointLimits(
            float(np.deg2rad(self.tilt_deg)), float(np.deg2rad(self.roll_deg)), self.distance_mm, box
        )


class PlanDocument(Document):
    """The input: scene, limits, number of poses; or poses to assess."""

    heading = "planjson"

    schema_version: Literal[1]
    """Version of the format."""
    target: TargetDocument
    """The board."""
    camera: CameraDocument
    """Intrinsics."""
    setup: Setup = "eye-in-hand"
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    flange_T_camera_guess: PoseDocument | None = None
    """Rough pose of the camera on the flange, mm."""
    base_T_target_guess: PoseDocument | None = None
    """Rough pose of the target in the base, mm."""
    base_T_camera_guess: PoseDocument | None = None
    """Where the camera stands in the base, roughly, mm; of an eye-to-hand plan."""
    flange_T_target_guess: PoseDocument | None = None
    """Where the target is on the flange, roughly, mm; of an eye-to-hand plan."""
    noise: NoiseExpectedDocument = NoiseExpectedDocument()
    """Expected noise, one standard deviation per axis."""
    known: KnowledgeDocument = KnowledgeDocument()
    """What is known of target, camera and arm before the views; none of it counts as exact."""
    limits: LimitsDocument = LimitsDocument()
    """Where the planner may look from."""
    poses: Annotated[int, Field(ge=3, le=60)] = 3
    """How many poses to plan."""
    robot: str | None = None
    """Name of an arm (`handeyed arms`) whose reach counts; null for none."""
    part: PointsDocument = PointsDocument()
    """The points that matter; the working volume without."""
    views: list[PoseDocument] | None = None
    """Poses base_T_flange to be assessed, mm."""

    @model_validator(mode="after")
    def _check_guesses(self) -> "PlanDocument":
        """Exactly the two guesses of the set-up."""
        for setup in get_args(Setup):
            for name in (f"{MOUNTS[setup]}_T_camera_guess", f"{ANCHORS[setup]}_T_target_guess"):
                if (getattr(self, name) is not None) != (setup == self.setup):
                    needed = "is missing" if setup == self.setup else f"belongs to {setup}"
                    raise ValueError(f"{name} {needed}: the set-up is {self.setup}")
        scene = self.scene()
        if np.allclose([scene.mount_T_camera, scene.anchor_T_target], np.eye(4), rtol=0, atol=1e-9):
            raise ValueError("both guesses are the identity, which no cell is: measure them with a ruler")
        return self

    def scene(self) -> Scene:
        in_hand = self.setup == "eye-in-hand"
        camera = self.flange_T_camera_guess if in_hand else self.base_T_camera_guess
        target = self.base_T_target_guess if in_hand else self.flange_T_target_guess
        assert camera is not None  # _check_guesses
        assert target is not None
        return Scene(
            self.setup,
            self.target,
            self.camera.camera(),
            camera.transform(),
            target.transform(),
            self.noise.noise(),
            points=self.part.named_points(),
            knowledge=self.known.knowledge(),
        )

    def sight(self) -> LineOfSight | None:
        """Of a camera beside the robot, by the guesses."""
        scene = self.scene()
        return LineOfSight.of(scene.setup, scene.target, scene.mount_T_camera, scene.anchor_T_target)


class PredictedDocument(Document):
    """One standard deviation of X, and U; null where the poses do not determine it."""

    point_mm: float | None
    """One standard deviation of a measured point, mm, RMS over the points that matter."""
    expanded_mm: float | None = None
    """U (k = 2) at the worst of the points that matter, mm; null where undetermined."""
    worst_point: str | None = None
    """The name of that point."""
    translation_mm: Vector | None
    """One standard deviation of X's translation along its axes, mm."""
    rotation_deg: Vector | None
    """One standard deviation of X's rotation about its axes, degrees."""

    @classmethod
    def of(cls, prediction: Uncertainty) -> "PredictedDocument":
        if not np.isfinite(prediction.point_mm):
            return cls(point_mm=None, translation_mm=None, rotation_deg=None)
        x, y, z = prediction.translation_mm.tolist()
        a, b, c = np.rad2deg(prediction.rotation_rad).tolist()
        worst = prediction.worst_point
        return cls(
            point_mm=prediction.point_mm, expanded_mm=worst.expanded_mm, worst_point=worst.name,
            translation_mm=(x, y, z), rotation_deg=(a, b, c),
        )  # fmt: skip


class PlannedPoseDocument(Document):
    """A pose to take, and the share of the target's points that should be in the image there."""

    base_T_flange: PoseDocument
    """The flange (tool0) in the base (wobj0): maps coordinates of the flange to the base, mm."""
    target_in_view: float
    """Share of the target's points that should be in the image, 0 to 1."""


class PlannedDocument(Document):
    """The answer."""

    heading = "plannedjson"

    poses: list[PlannedPoseDocument]
    """The poses to take, in their order."""
    predicted: PredictedDocument
    """What these poses will tell of X."""

    @classmethod
    def of(cls, plan: Plan) -> "PlannedDocument":
        poses = [
            PlannedPoseDocument(base_T_flange=PoseDocument.of(pose), target_in_view=float(share))
            for pose, share in zip(plan.base_T_flange, plan.target_in_view, strict=True)
        ]
        return cls(poses=poses, predicted=PredictedDocument.of(plan.predicted))


class AssessedDocument(Document):
    """What `assess` answers."""

    heading = "assessed"

    predicted: PredictedDocument
    """What the given poses will tell of X."""
