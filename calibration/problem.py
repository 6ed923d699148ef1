"""Input of the hand-eye solver.

Both set-ups are one problem. The camera is fixed in its *mount*, the target in its *anchor*:

    eye-in-hand    mount = flange    anchor = base      anchor_T_mount = base_T_flange
    eye-to-hand    mount = base      anchor = flange    anchor_T_mount = flange_T_base

    anchor_T_target = anchor_T_mount @ mount_T_camera @ camera_T_target        for every view

so a solver uses `anchor_T_mount` only, and X is `mount_T_camera`. (The X of Song et al. is its inverse.)
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from calibration.camera import CameraModel
from calibration.kinematics.external_axis import ExternalAxis
from calibration.kinematics.load import Load
from calibration.kinematics.robot_accuracy import USUAL_BELIEF, NoiseBelief
from calibration.kinematics.stance import Stance
from calibration.knowledge import NOTHING_STATED, Knowledge
from calibration.sentences.described import Described
from calibration.targets import IN_DOCUMENTS, Target
from calibration.transforms import Array, inverse

Setup = Literal["eye-in-hand", "eye-to-hand"]

MOUNTS: dict[Setup, Literal["flange", "base"]] = {"eye-in-hand": "flange", "eye-to-hand": "base"}
ANCHORS: dict[Setup, Literal["base", "flange"]] = {"eye-in-hand": "base", "eye-to-hand": "flange"}
"""Names of the two frames in each set-up, as fields of documents have them."""


def anchor_T_mount_of(setup: Setup, base_T_flange: Array) -> Array:
    """anchor_T_mount (..., 4, 4) of robot poses base_T_flange (..., 4, 4)."""
    return base_T_flange if setup == "eye-in-hand" else inverse(base_T_flange)


def base_T_flange_of(setup: Setup, anchor_T_mount: Array) -> Array:
    """The robot poses (..., 4, 4) that put the mount there: the inverse of `anchor_T_mount_of`."""
    return anchor_T_mount if setup == "eye-in-hand" else inverse(anchor_T_mount)


@dataclass(frozen=True, eq=False)
class Detection:
    """Target points seen in one image: `ids` (n,) index into `target.points_mm`, `corners_px` (n, 2)."""

    ids: NDArray[np.intp]
    corners_px: Array


@dataclass(frozen=True, eq=False)
class MeasuredPose:
    """The target's pose (4, 4) in the camera, as a tracker, a 3D camera or another program gives it.

    covariance : (6, 6) of [rotation vector rad, translation of the target's origin mm] along the camera's axes, None
        where it is not known.
    """

    camera_T_target: Array
    covariance: Array | None = None


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Target points measured in space: `ids` (n,) index into `target.points_mm`, `points_mm` (n, 3) in the camera."""

    ids: NDArray[np.intp]
    points_mm: Array


Measurement = MeasuredPose | MeasuredPoints


@dataclass(frozen=True)
class AxisOffset(Described):
    """The number that turns about one axis leave open, measured otherwise (docs/decisions/0043).

    A coordinate along that axis, with one standard deviation: of the camera's centre in the mount's frame, or of the
    target's origin in the anchor's. It counts positive where the largest component of the axis does: for an axis along
    z it is the z of that point.
    """

    __pydantic_config__: ClassVar[ConfigDict] = IN_DOCUMENTS

    of: Literal["camera", "target"]
    """camera: its centre, in the frame of its mount; target: its origin, in the other frame."""
    coordinate_mm: Annotated[float, Field(ge=-10_000, le=10_000)]
    """The coordinate along that axis: its z for an axis along z, mm."""
    sigma_mm: Annotated[float, Field(gt=0, le=1000)]
    """One standard deviation of coordinate_mm, mm."""


@dataclass(frozen=True)
class PosesOf(Described):
    """Frames of the robot's poses where they are not the flange's in the base; "" for these two themselves."""

    __pydantic_config__: ClassVar[ConfigDict] = IN_DOCUMENTS

    tool: Annotated[str, Field(max_length=200)] = ""
    """Name of the tool in place of the flange."""
    base: Annotated[str, Field(max_length=200)] = ""
    """Name of the work object or the program's base in place of the robot's base."""


@dataclass(frozen=True, eq=False)
class View:
    """One station: where the arm stood and the target's detection there; `index`: its row in the session.

    `detection` is None when the target was not found; `missing` is then the reason: a code and a sentence.
    `measured`: the target measured in space instead of detected in an image.
    `camera_temperature_c`: of the camera when it took the picture, where it reports one.
    `arm_temperature_c`: of the arm's links then, where it is known.
    """

    index: int
    stance: Stance
    detection: Detection | None
    image: str | None = None
    missing: tuple[str, str] | None = None
    measured: Measurement | None = None
    camera_temperature_c: float | None = None
    arm_temperature_c: float | None = None

    @property
    def base_T_flange(self) -> Array:
        """(4, 4)"""
        return self.stance.base_T_flange

    def standing(self, **changes: Any) -> "View":
        """The view with these fields of its stance."""
        return replace(self, stance=replace(self.stance, **changes))


@dataclass(frozen=True, eq=False)
class Problem:
    """A calibration session. `camera` None: the intrinsics are estimated with the rest, from `image_size`.

    `in_space`: the views hold measurements of the target in space and no detections; intrinsics are not needed then.
    `poses_from_controller`: a driver read them, so that they are base_T_flange for certain.
    `axis_offset`: for an arm that turns its flange about one axis only; not used where the motions determine X.
    `load`: on the flange, where it is known.
    `knowledge`: what is stated of target, camera and arm. `robot_noise`: what is believed of the arm's noise.
    `poses_of`: a tool or a work object of which the poses are; X is then the camera's pose in it.
    `external_axis`: a track or turntable, roughly; every view has its reading then, and poses are as reported there.
    """

    setup: Setup
    target: Target
    camera: CameraModel | None
    image_size: tuple[int, int]
    views: tuple[View, ...]
    in_space: bool = False
    poses_from_controller: bool = False
    axis_offset: AxisOffset | None = None
    external_axis: ExternalAxis | None = None
    load: Load | None = None
    knowledge: Knowledge = NOTHING_STATED
    robot_noise: NoiseBelief = USUAL_BELIEF
    poses_of: PosesOf | None = None

    @property
    def rows(self) -> int:
        """Number of the session's rows, with those before the last view that are not among the views."""
        return 1 + max((view.index for view in self.views), default=-1)

    def anchor_T_mount(self, view: View) -> Array:
        """(4, 4) of one view."""
        return anchor_T_mount_of(self.setup, view.base_T_flange)

    def with_axis_at_zero(self, axis: ExternalAxis) -> "Problem":
        """The problem as if the axis had stood at its zero in every view, and there were none."""
        views = tuple(
            view.standing(
                base_T_flange=axis.at_zero(view.base_T_flange, axis.reading(view.stance.external_axes) or 0.0),
                external_axes=None,
            )
            for view in self.views
        )
        return replace(self, views=views, external_axis=None)
