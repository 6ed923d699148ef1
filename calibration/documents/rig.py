"""rig.json: several cameras and scanners on one mount, solved together (mm, degrees, w first)."""

from typing import Literal

from calibration.documents.calibration import COVARIANCE_ORDER, Six, VerdictDocument
from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.validation import Document
from calibration.problem import Setup
from calibration.solution import COVERAGE_FACTOR


class RigUncertaintyDocument(Document):
    """One standard deviation of a pose, along and about the second frame's axes, and U (k = 2) at the worst of the
    places where that sensor saw the target."""

    translation_mm: Vector
    """One standard deviation along the sensor's axes, mm."""
    rotation_deg: Vector
    """One standard deviation about the sensor's axes, degrees."""
    expanded_mm: float
    """U (k = 2) of a measured point at the worst place of the target, mm."""
    covariance: tuple[Six, Six, Six, Six, Six, Six]
    """Of pose @ exp(.), rotation (rad) then translation (mm)."""
    covariance_order: tuple[str, str, str, str, str, str] = COVARIANCE_ORDER
    """Names of its rows and columns."""
    coverage_factor: float = COVERAGE_FACTOR
    """k: U is k times the standard deviation."""


class RigSensorDocument(Document):
    """One sensor."""

    name: str
    """Name of the session's folder."""
    views: int
    """Number of views that agree."""
    mount_T_sensor: PoseDocument
    """The sensor in the flange, or in the base, from all sensors together."""
    uncertainty: RigUncertaintyDocument
    """Of mount_T_sensor."""
    alone_expanded_mm: float | None
    """U (k = 2) of the sensor's own views alone, mm; null where they do not determine its pose."""
    probability: float | None
    """That the sensor's own views alone are so far from the joint solution."""


class RelativePoseDocument(Document):
    """The pose of sensor `b` in the frame of sensor `a`."""

    a: str
    """Name of the sensor in whose frame the other is."""
    b: str
    """Name of the other sensor."""
    a_T_b: PoseDocument
    """Maps coordinates in b to coordinates in a; with a camera and a scanner `[scanner] camera_T_scanner`."""
    uncertainty: RigUncertaintyDocument
    """Of a_T_b; the robot's errors at shared stations do not enter it."""


class RigDocument(Document):
    """The whole of rig.json."""

    heading = "rigjson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    mount: Literal["flange", "base"]
    """Frame that carries the sensors."""
    sensors: tuple[RigSensorDocument, ...]
    """The sensors, in the order of the command's folders."""
    relative: tuple[RelativePoseDocument, ...]
    """The pose of each sensor in each earlier one."""
    anchor_T_target: PoseDocument
    """The target in the base, or in the flange."""
    robot_translation_mm: float
    """Scatter of the robot's poses, one standard deviation per axis, mm."""
    robot_rotation_deg: float
    """The same of its rotations, degrees."""
    stations: int
    """Number of poses of the robot at which any sensor saw the target."""
    shared_stations: int
    """Number of those at which several did."""
    tolerance_mm: float
    """Largest U (k = 2) that is accepted, mm."""
    verdict: VerdictDocument
    """Whether it may be used, and why not."""
