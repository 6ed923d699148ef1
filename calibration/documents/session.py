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
from calibration.problem import AxisOffset, Setup
from calibration.targets import Target, TrackedFrame
from calibration.transforms import Array

Pixels = Annotated[int, Field(ge=16, le=65536)]


class CameraDocument(Document):
    """OpenCV's coefficients, in its order: 4, 5 (k1, k2, p1, p2, k3), 8, 12 or 14; k1 to k4 of a fisheye."""

    matrix: tuple[Vector, Vector, Vector]
    distortion: Annotated[list[float], Field(min_length=4, max_length=14)]
    image_size: tuple[Pixels, Pixels]
    lens: LensModel = "pinhole"

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


OBSERVATIONS = ("image", "corners_px", "cloud", "points_mm", "camera_T_target")
"""What a view may hold: a picture, or what another program has found in it or measured."""

IN_SPACE = ("cloud", "points_mm", "camera_T_target")
"""Those of them that need no intrinsics."""


FILES = ("image", "cloud")
"""Those of them that are files beside session.json."""


Quarter = Annotated[int, Field(ge=-8, le=8)]
"""Number of the quarter turn in which an axis stands."""


class ViewDocument(Document):
    """One station: an image, or the detection or measurement already made.

    joints_deg : the arm's axes, where they were recorded; they are copied into calibration.json.
    external_axes : the controller's axes beside the arm at the pose, mm or degrees; null for one that it does not have.
    camera_temperature_c : of the camera when it took the picture, where it reports one.
    arm_temperature_c : of the arm's links at the pose, where it is known, for an arm whose errors are identified.
    confdata : the posture of the pose where joints were not recorded, as in a robtarget: cf1, cf4, cf6, cfx.
    image : name of a file beside session.json.
    corners_px : [id, u, v] of the target's points in the image.
    cloud : name of an organised cloud beside session.json, with an intensity and a point for every pixel.
    unit : of the cloud's lengths; it is never guessed.
    points_mm : [id, x, y, z] of the target's points in the camera's frame.
    camera_T_target : the target's pose in the camera, mm.
    covariance : (6, 6) of camera_T_target, of [rotation vector rad, translation of the target's origin mm] along the
        camera's axes.
    """

    base_T_flange: PoseDocument
    camera_temperature_c: Annotated[float, Field(ge=-100, le=200)] | None = None
    arm_temperature_c: ArmTemperature | None = None
    joints_deg: Annotated[tuple[float, ...], Field(min_length=1, max_length=12)] | None = None
    external_axes: ExternalAxes | None = None
    confdata: tuple[Quarter, Quarter, Quarter, Annotated[int, Field(ge=0, le=7)]] | None = None
    image: str | None = None
    corners_px: list[tuple[int, float, float]] | None = None
    cloud: str | None = None
    unit: Literal["m", "mm"] | None = None
    points_mm: list[tuple[int, float, float, float]] | None = None
    camera_T_target: PoseDocument | None = None
    covariance: list[list[float]] | None = None

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
    def joints_rad(self) -> Array | None:
        """(n,) the arm's axes, None where they were not recorded."""
        return None if self.joints_deg is None else np.radians(self.joints_deg)

    @property
    def observation(self) -> str:
        """Which of OBSERVATIONS the view holds."""
        return next(name for name in OBSERVATIONS if getattr(self, name) is not None)


MAX_ASYMMETRY = 1e-6
"""Largest relative difference of a covariance from its transpose; more is no rounding."""


class AxisOffsetDocument(Document):
    """The number that turns about one axis leave open: a coordinate along that axis, with one standard deviation.

    of : the camera's centre in the frame of its mount (flange, or base beside the robot), or the target's origin in
        the other one. For an axis along z it is the z of that point.
    """

    of: Literal["camera", "target"]
    coordinate_mm: Annotated[float, Field(ge=-10_000, le=10_000)]
    sigma_mm: Annotated[float, Field(gt=0, le=1000)]

    def offset(self) -> AxisOffset:
        return AxisOffset(self.of, self.coordinate_mm, self.sigma_mm)


class KnownDistanceDocument(Document):
    """A known distance, with one standard deviation, from the target's middle here to its middle in another session.

    to : name of the other session's folder.
    """

    to: Annotated[str, Field(min_length=1, max_length=255)]
    distance_mm: Annotated[float, Field(gt=0, le=100_000)]
    sigma_mm: Annotated[float, Field(gt=0, le=1000)]


class SessionDocument(Document):
    """The whole of session.json.

    target : may be left out where every view holds `camera_T_target`, of a tracker without a printed target.
    camera : null where the intrinsics are estimated; may be left out where they are not needed.
    axis_offset : for an arm that turns its flange about one axis only (a palletiser, a SCARA); for images.
    external_axis : a track or turntable that the controller leaves out of its poses, roughly; its reading is in
        `external_axes` of every view, and it is found with X; for images.
    load : what the flange carried, for the sag of an arm whose errors are identified.
    known : what is known beforehand of target, camera and arm.
    robot_noise : what was believed of it beforehand; of arms as usual where it is left out.
    distances : known ones to the target's places in other sessions of the arm, for `solve --arm`.
    poses_from_controller : whether a driver read the poses from the controller, so that they are not inverted.
    """

    heading = "sessionjson"

    schema_version: Literal[1]
    source: str = ""
    poses_from_controller: bool = False
    setup: Setup
    target: TargetDocument | None = None
    camera: CameraDocument | None = None
    image_size: tuple[Pixels, Pixels] | None = None
    axis_offset: AxisOffsetDocument | None = None
    external_axis: ExternalAxisDocument | None = None
    load: LoadDocument | None = None
    known: KnowledgeDocument = KnowledgeDocument()
    robot_noise: NoiseBeliefDocument | None = None
    distances: tuple[KnownDistanceDocument, ...] = ()
    views: list[ViewDocument]

    def described_target(self) -> Target:
        """The target; a TrackedFrame where none is described."""
        return TrackedFrame() if self.target is None else self.target.target()

    @property
    def noise_belief(self) -> NoiseBelief:
        """`robot_noise` as the solver takes it."""
        return USUAL_BELIEF if self.robot_noise is None else self.robot_noise.belief()

    @property
    def given_offset(self) -> AxisOffset | None:
        """`axis_offset` as the solver takes it."""
        return None if self.axis_offset is None else self.axis_offset.offset()

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
    def in_space(self) -> bool:
        """Whether the views hold measurements of the target in space."""
        return any(view.observation in IN_SPACE for view in self.views)
