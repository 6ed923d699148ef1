"""What `handeyed import` is asked for one folder, and what it understood."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calibration.documents.imports.intrinsics import Intrinsics
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets import CLOUDS, Chosen, ImportedSet
from calibration.documents.pose import PoseDocument
from calibration.documents.readings import Decision, Reading
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetDocument
from calibration.kinematics.conventions import Convention, Frame, LengthUnit
from calibration.problem import Setup
from calibration.transforms import Array


@dataclass(frozen=True)
class ImportRequest:
    """The folder and what the user states; None is left to the files and to the evidence.

    conventions : allowed ones, several of a brand; part : a camera or scene of several; arm : of joints.
    axes : of the places, such as ("x", "-y", "z"). camera_unit, camera_conventions : of the camera's poses.
    pictures : an empty folder for those that lie within other files, as long as the session is not written.
    """

    folder: Path
    chosen: Chosen = field(default_factory=Chosen)
    part: str | None = None
    conventions: tuple[Convention, ...] | None = None
    unit: LengthUnit | None = None
    frame: Frame | None = None
    setup: Setup | None = None
    target: TargetDocument | None = None
    camera: Intrinsics | None = None
    cloud_unit: LengthUnit | None = None
    arm: str | None = None
    axes: tuple[str, ...] | None = None
    camera_unit: LengthUnit | None = None
    camera_conventions: tuple[Convention, ...] | None = None
    pictures: Path | None = None


@dataclass(frozen=True, eq=False)
class Understood:
    """What a folder holds, as it was understood.

    base_T_flange : (n, 4, 4) by `reading`; camera_T_target likewise, where the set has it instead of images.
    images : (n,) absolute paths; `decision` says why that reading.
    camera_points_mm : (n, 3) of pairs of points; `base_T_flange` has the robot's as places.
    """

    request: ImportRequest
    imported: ImportedSet
    reading: Reading
    decision: Decision
    base_T_flange: Array
    camera_T_target: Array | None
    images: tuple[Path, ...]
    target: TargetDocument | None
    camera: CameraDocument | None
    notes: tuple[str, ...]
    camera_points_mm: Array | None = None

    @property
    def is_scan(self) -> bool:
        """Whether the clouds are those of a part, without a target."""
        return bool(self.images) and self.target is None


def are_clouds(images: Sequence[Path]) -> bool:
    return bool(images) and all(image.suffix.lower() in CLOUDS for image in images)


def views_of(
    camera_T_target: Array | None, images: Sequence[Path], unit: LengthUnit | None, request: ImportRequest
) -> list[dict[str, Any]]:
    """What each view of session.json has of the camera: its pose of the target, a cloud or a picture. DocumentError."""
    if camera_T_target is not None:
        return [{"camera_T_target": PoseDocument.of(pose).model_dump(mode="json")} for pose in camera_T_target]
    if are_clouds(images):
        if unit is None:  # it is never guessed
            fix = "give --cloud-unit m or mm"
            raise refusal(request.folder.name, "clouds", "their unit is not stated", fix, "clouds")
        return [{"cloud": str(image), "unit": unit} for image in images]
    return [{"image": str(image)} for image in images]
