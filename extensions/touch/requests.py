"""Bodies of POST /touch and POST /touch/approach."""

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from calibration.documents.pose import Vector, is_direction
from calibration.documents.requirement import Tolerance
from calibration.documents.tip import TipDocument
from calibration.documents.touches import Sigma, TouchDocument
from calibration.documents.validation import Document
from daemon.config.settings import DeviceName
from daemon.model.requests import examples, require_printable

MAX_TOUCH_STEP_MM, MAX_TOUCH_SPEED_MM_S = 5.0, 10.0
"""Limits of one step towards a point that is to be touched: the tip may meet it."""


def _require_printable_names(touches: tuple[TouchDocument, ...]) -> tuple[TouchDocument, ...]:
    for touch in touches:
        require_printable(touch.name or "")
    return touches


class TouchRequest(Document):
    """A touch test: the `tip`, as of `handeyed tip`, and where it touched points that the camera has seen.

    `verification`: run whose points of the target the touches name by `id`. One touch may leave `base_T_flange` out: it
    is read from the standing arm. `adds_to`: id of a touch test to which these touches are added, with its tip.
    `tolerance_mm`: largest miss; by default that of the test before, or the settings'.
    `placing_sigma_mm`: of bringing the tip to a point, without the robot's error. `camera`: name of one of [cameras]
    that saw the points, by default that of the verification, or of the test before, else [camera].
    """

    model_config = examples(
        {
            "tip": {"flange_tip_mm": [0.0, 0.0, 180.2], "covariance": [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0],
                    [0.0, 0.0, 0.01]], "placing_sigma_mm": 0.1},
            "verification": "20261121-090000-3f9a1c", "touches": [{"id": 0}], "tolerance_mm": 0.5,
        },
        {"adds_to": "20261121-093000-5b2c7d", "touches": [{"id": 10, "miss_mm": [0.0, 0.0, -0.3]}]},
    )  # fmt: skip

    tip: TipDocument | None = None
    verification: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    adds_to: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    touches: Annotated[
        tuple[TouchDocument, ...], Field(min_length=1, max_length=100), AfterValidator(_require_printable_names)
    ]
    placing_sigma_mm: Sigma | None = None
    tolerance_mm: Tolerance | None = None
    camera: DeviceName | None = None


class ApproachRequest(Document):
    """The arm brings the tip before a point that the camera has seen, or one step nearer. Each request is one consent.

    The flange keeps its orientation, and the tip moves on straight lines. Without `step_mm`: to `stand_off_mm` before
    the point, first back along the approach where the tip is nearer than that. With `step_mm`: so far towards the
    point, and never beyond where it was seen. `along`: direction of the approach in the base, else the flange's z axis;
    it is at most 60 degrees from the line of sight of each view that saw the point. Nothing moves when the tip stands
    beyond the point, or flange, camera or a point of [robot] carried_mm would come nearer to it than the tip.
    `touch`: the point, by `id` or `camera_mm`; `tip`, `verification`, `adds_to` and `camera` as of a touch test, the
    verification at most 8 hours old and of the active calibration. `short_tip`: the tip is within 5 mm of the
    flange's centre. `speed_mm_s`: by default 50 to the stand-off and 5 in a step; at most [robot] speed_mm_s, and 10 in
    a step.
    """

    model_config = examples(
        {"adds_to": "20261121-093000-5b2c7d", "touch": {"id": 10}},
        {"adds_to": "20261121-093000-5b2c7d", "touch": {"id": 10}, "step_mm": 2.0},
    )

    tip: TipDocument | None = None
    verification: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    adds_to: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    touch: TouchDocument
    stand_off_mm: Annotated[float, Field(ge=5, le=100)] = 20.0
    step_mm: Annotated[float, Field(gt=0, le=MAX_TOUCH_STEP_MM)] | None = None
    along: Vector | None = None
    short_tip: bool = False
    speed_mm_s: Annotated[float, Field(ge=1, le=250)] | None = None
    camera: DeviceName | None = None

    @model_validator(mode="after")
    def _check_approach(self) -> "ApproachRequest":
        if self.touch.base_T_flange is not None or any(self.touch.miss_mm):
            raise ValueError("the touch names the point only: leave base_T_flange and miss_mm out")
        if self.along is not None and not is_direction(self.along):
            raise ValueError("along has no direction")
        if self.step_mm is not None and (self.speed_mm_s or 0.0) > MAX_TOUCH_SPEED_MM_S:
            raise ValueError(f"speed_mm_s of a step is at most {MAX_TOUCH_SPEED_MM_S:g}")
        return self
