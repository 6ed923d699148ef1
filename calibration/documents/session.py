"""session.json: robot poses and images or detections of a calibration run, in the folder with its images."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from calibration.camera import BROWN, COEFFICIENT_COUNTS, CameraModel, LensModel
from calibration.documents.arm_conditions import ArmTemperature, LoadDocument
from calibration.documents.external_axis import ExternalAxes, ExternalAxisDocument
from calibration.documents.knowledge import KnowledgeDocument, NoiseBeliefDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from calibration.kinematics.external_axis import ExternalAxis
from calibration.kinematics.load import Load
from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief
from calibration.kinematics.stance import Stance
from calibration.problem import AxisOffset, PosesOf, Setup
from calibration.targets import Target, TrackedFrame
from calibration.transforms import Array

Pixels = Annotated[int, Field(ge=16, le=65536)]


class CameraDocument(Document):
    """OpenCV's coefficients, in its order: 4, 5 (k1, k2, p1, p2, k3), 8, 12 or 14; k1 to k4 of a fisheye."""

    matrix: tuple[Vector, Vector, Vector]
    """fx, 0, cx / 0, fy, cy / 0, 0, 1 in px; (0, 0) is the middle of the first pixel."""
    distortion: Annotated[list[float], Field(min_length=4, max_length=14)]
    """OpenCV's coefficients: 4, 5, 8, 12 or 14 (k1, k2, p1, p2, k3, ...); k1 to k4 of a fisheye. No unit."""
    image_size: tuple[Pixels, Pixels]
    """Width and height in px."""
    lens: LensModel = "pinhole"
    """pinhole or fisheye."""

    @model_validator(mode="after")
    def _coefficients_of_lens(self) -> "CameraDocument":
        counts = COEFFICIENT_COUNTS[self.lens]
        if len(self.distortion) not in counts:
            known = ", ".join(map(str, counts))
            raise ValueError(f"distortion has {len(self.distortion)} coefficients; a {self.lens} lens has {known}")
        return self

    def camera(self) -> CameraModel:
        """Four coefficients of a pinhole camera are k1, k2, p1, p2."""
        distortion = np.array(self.distortion)
        if self.lens == "pinhole" and len(distortion) < BROWN:
            distortion = np.append(distortion, 0.0)
        return CameraModel(np.array(self.matrix), distortion, self.image_size, self.lens)

    @classmethod
    def of(cls, camera: CameraModel) -> "CameraDocument":
        return cls.model_validate(
            {
                "matrix": camera.matrix.tolist(),
                "distortion": camera.distortion.tolist(),
                "image_size": list(camera.image_size),
                "lens": camera.lens_model,
            }
        )


OBSERVATIONS = ("image", "corners_px", "cloud", "points_mm", "camera_T_target", "camera_point_mm")
"""What a view may hold: a picture, or what another program has found in it or measured."""

IN_SPACE = ("cloud", "points_mm", "camera_T_target", "camera_point_mm")
"""Those of them that need no intrinsics."""


FILES = ("image", "cloud")
"""Those of them that are files beside session.json."""


Quarter = Annotated[int, Field(ge=-8, le=8)]
"""Number of the quarter turn in which an axis stands."""


class ViewDocument(Document):
    """One station: an image, or the detection or measurement already made."""

    base_T_flange: PoseDocument
    """The flange (tool0) in the base (wobj0): maps coordinates of the flange to the base, mm."""
    camera_temperature_c: Annotated[float, Field(ge=-100, le=200)] | None = None
    """Temperature of the camera where it was recorded, degrees Celsius."""
    arm_temperature_c: ArmTemperature | None = None
    """Temperature of the arm's links at the pose, degrees Celsius; null where it is not known."""
    joints_deg: Annotated[tuple[float, ...], Field(min_length=1, max_length=12)] | None = None
    """Joint angles where they were recorded, degrees."""
    external_axes: ExternalAxes | None = None
    """The controller's axes beside the arm at the pose, mm or degrees; null for one it does not have."""
    confdata: tuple[Quarter, Quarter, Quarter, Annotated[int, Field(ge=0, le=7)]] | None = None
    """cf1, cf4, cf6, cfx of the pose, as in a robtarget, where joints were not recorded."""
    image: str | None = None
    """Name of a picture beside the document, in which the target is detected."""
    corners_px: list[tuple[int, float, float]] | None = None
    """[id, u, v] of target points in px; the id counts the points row by row from 0."""
    cloud: str | None = None
    """Name of an organised cloud beside the document, with an intensity and a point for every pixel."""
    unit: Literal["m", "mm"] | None = None
    """Of the cloud's lengths: m or mm; never guessed."""
    points_mm: list[tuple[int, float, float, float]] | None = None
    """[id, x, y, z] of target points in the camera's frame, mm."""
    camera_T_target: PoseDocument | None = None
    """The target's pose in the camera's frame, mm."""
    camera_point_mm: tuple[float, float, float] | None = None
    """The point at the pose's place, a tip's or a ball's, in a standing camera's frame, mm."""
    covariance: list[list[float]] | None = None
    """6 x 6 of camera_T_target: rotation vector rad, translation mm, in the camera's axes."""

    @model_validator(mode="after")
    def _one_observation(self) -> "ViewDocument":
        if sum(getattr(self, name) is not None for name in OBSERVATIONS) != 1:
            raise ValueError(f"a view has one of {', '.join(map(repr, OBSERVATIONS))}")
        return self

    @model_validator(mode="after")
    def _cloud_has_unit(self) -> "ViewDocument":
        if (self.cloud is None) != (self.unit is None):
            raise ValueError("a 'cloud' has a 'unit', m or mm")
        return self

    @model_validator(mode="after")
    def _covariance_is_one(self) -> "ViewDocument":
        if self.covariance is None:
            return self
        if self.camera_T_target is None:
            raise ValueError("'covariance' is that of 'camera_T_target', which is not there")
        rows = self.covariance
        if [len(row) for row in rows] != [6] * 6:
            raise ValueError("'covariance' has six rows of six numbers")
        matrix = np.array(rows)
        scale = np.sqrt(np.maximum(np.diagonal(matrix), 0.0))
        if not np.all(scale > 0) or np.abs((matrix - matrix.T) / np.outer(scale, scale)).max() > MAX_ASYMMETRY:
            raise ValueError("'covariance' is not symmetric with positive variances")
        if np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] < -MAX_ASYMMETRY:
            raise ValueError("'covariance' has a negative variance in some direction")
        return self

    @property
    def stance(self) -> Stance:
        """Where the arm stood."""
        return Stance.of_degrees(self.base_T_flange.transform(), self.joints_deg, self.external_axes, self.confdata)

    @property
    def observation(self) -> str:
        """Which of OBSERVATIONS the view holds."""
        return next(name for name in OBSERVATIONS if getattr(self, name) is not None)


MAX_ASYMMETRY = 1e-6
"""Largest relative difference of a covariance from its transpose; more is no rounding."""


class KnownDistanceDocument(Document):
    """A known distance from the target's middle here to its middle in another session."""

    to: Annotated[str, Field(min_length=1, max_length=255)]
    """Name of the other session's folder."""
    distance_mm: Annotated[float, Field(gt=0, le=100_000)]
    """Between the two middles, mm."""
    sigma_mm: Annotated[float, Field(gt=0, le=1000)]
    """One standard deviation of it, mm."""


class SessionDocument(Document):
    """The whole of session.json.

    axis_offset : for an arm that turns its flange about one axis only (a palletiser, a SCARA); for images.
    external_axis : roughly; its reading is in `external_axes` of every view, and it is found with X; for images.
    """

    heading = "sessionjson"

    schema_version: Literal[1]
    """Version of the format."""
    source: str = ""
    """Where it came from, for people."""
    poses_from_controller: bool = False
    """Whether a driver read the poses from the controller, so that they are not inverted."""
    poses_of: PosesOf | None = None
    """The tool and work object of which the poses are; null for the flange's in the base."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    target: TargetDocument | None = None
    """The board; may be left out where every view holds camera_T_target."""
    camera: CameraDocument | None = None
    """Intrinsics; null to have them estimated; may be left out where views need none."""
    image_size: tuple[Pixels, Pixels] | None = None
    """Width and height in px."""
    axis_offset: AxisOffset | None = None
    """A coordinate measured along the only axis of rotation of an arm that cannot tilt; else null."""
    external_axis: ExternalAxisDocument | None = None
    """A track or turntable that the controller leaves out of its poses; else null."""
    load: LoadDocument | None = None
    """What the flange carries; null where it is not known."""
    known: KnowledgeDocument = KnowledgeDocument()
    """What is known of target, camera and arm before the views; none of it counts as exact."""
    robot_noise: NoiseBeliefDocument | None = None
    """What was believed of the robot's noise beforehand; null for arms as usual."""
    distances: tuple[KnownDistanceDocument, ...] = ()
    """Known ones from the target's middle here to its middle in other sessions, for solve --arm."""
    views: list[ViewDocument]
    """At least three, in the order in which they were taken."""

    def described_target(self) -> Target:
        """The target; a TrackedFrame where none is described."""
        return TrackedFrame() if self.target is None else self.target

    @property
    def noise_belief(self) -> NoiseBelief:
        """`robot_noise` as the solver takes it."""
        return USUAL_BELIEF if self.robot_noise is None else self.robot_noise.belief()

    @property
    def rough_axis(self) -> ExternalAxis | None:
        """`external_axis` as the solver takes it."""
        return None if self.external_axis is None else self.external_axis.axis()

    @property
    def carried(self) -> Load | None:
        """`load` as the solver takes it."""
        return None if self.load is None else self.load.load()

    def axis_reading(self, index: int) -> float | None:
        """Reading, mm or rad, of the external axis in that view; None without one."""
        return None if self.external_axis is None else self.external_axis.reading(self.views[index].external_axes)

    @property
    def point_pairs(self) -> tuple[Array, Array] | None:
        """Points (n, 3) in base and in the camera, mm, of views that hold `camera_point_mm`; None of other views."""
        seen = [view.camera_point_mm for view in self.views if view.camera_point_mm is not None]
        places = [view.base_T_flange.translation_mm for view in self.views]
        return (np.array(places, float), np.array(seen)) if seen and len(seen) == len(places) else None

    @property
    def in_space(self) -> bool:
        """Whether the views hold measurements of the target in space."""
        return any(view.observation in IN_SPACE for view in self.views)
