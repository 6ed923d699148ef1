"""The result of a touch test: where a tip touched what the camera has seen, and the misses (mm)."""

from typing import Literal

from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.validation import Document

Conformance = Literal["within", "beyond", "undecided"]


class TouchedPointDocument(Document):
    """One point in the base, and `miss_mm`: touched less seen.

    `expanded_mm`: U (k = 2) of the miss by tip, robot and placing; `claimed_mm`: with X's, and the arm's where its
    errors were taken up. `outlying`: this miss alone
    is larger than all of that explains. `base_T_flange`: in which the tip touched it.
    """

    name: str
    seen_mm: Vector
    touched_mm: Vector
    miss_mm: Vector
    length_mm: float
    expanded_mm: float
    claimed_mm: float
    outlying: bool
    base_T_flange: PoseDocument


class TouchTestDocument(Document):
    """The misses of a touch test. `largest_mm`: of them; `mean_mm`: their mean.

    `probability`: that errors as stated make misses as large as these; `agree`: whether that is at least 0.01.
    `conformance`: to `tolerance_mm` by ISO 14253-1, null without one. `accepted`: the points are within the tolerance;
    without one, the misses agree with what is stated.
    """

    heading = "touch-test"

    schema_version: Literal[1] = 1
    calibration_id: str
    flange_tip_mm: Vector
    points: tuple[TouchedPointDocument, ...]
    largest_mm: float
    mean_mm: Vector
    probability: float
    agree: bool
    tolerance_mm: float | None
    conformance: Conformance | None
    accepted: bool
    summary: str
