"""plan.json: in and out of `handeyed plan FILE --json` and `handeyed assess FILE --json`."""

from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from calibration.documents.knowledge import KnowledgeDocument
from calibration.documents.planning_settings import LimitsDocument, NoiseExpectedDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.requirement import PointsDocument
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from calibration.likelihood.predicted_uncertainty import Scene, predict
from calibration.planning.line_of_sight import LineOfSight, line_of_sight
from calibration.planning.plan import plan_poses
from calibration.planning.viewpoint_selection import Reachable
from calibration.problem import ANCHORS, MOUNTS, Setup
from calibration.solution import Uncertainty
from calibration.transforms import Array


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
        return line_of_sight(scene.setup, scene.target, scene.mount_T_camera, scene.anchor_T_target)

    def choose_poses(self, reachable: Reachable | None = None) -> "PlannedDocument":
        """The poses that determine X best, and how well they will. `reachable`: which of them the arm can take.

        Raises PlanningError.
        """
        plan = plan_poses(self.scene(), self.limits.limits(), self.poses, reachable=reachable)
        poses = [
            PlannedPoseDocument(base_T_flange=PoseDocument.of(pose), target_in_view=float(share))
            for pose, share in zip(plan.base_T_flange, plan.target_in_view, strict=True)
        ]
        return PlannedDocument(poses=poses, predicted=_describe(plan.predicted))

    def assess(self, base_T_flange: Array) -> "PredictedDocument":
        """How well poses (n, 4, 4) will determine X."""
        return _describe(predict(self.scene(), base_T_flange))


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


def _describe(prediction: Uncertainty) -> PredictedDocument:
    if not np.isfinite(prediction.point_mm):
        return PredictedDocument(point_mm=None, translation_mm=None, rotation_deg=None)
    x, y, z = prediction.translation_mm.tolist()
    a, b, c = np.rad2deg(prediction.rotation_rad).tolist()
    worst = prediction.worst_point
    return PredictedDocument(
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


class AssessedDocument(Document):
    """What `assess` answers."""

    heading = "assessed"

    predicted: PredictedDocument
    """What the given poses will tell of X."""
