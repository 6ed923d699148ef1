"""The result of a touch test: where a tip touched what the camera has seen, and the misses (mm)."""

from typing import Literal

from calibration.documents.pose import PoseDocument, Vector
from calibration.documents.validation import Document

Conformance = Literal["within", "beyond", "undecided"]


class TouchedPointDocument(Document):
    """One point in the base, seen and touched."""

    name: str
    """What the point is called."""
    seen_mm: Vector
    """The point in the base as the camera saw it, mm."""
    touched_mm: Vector
    """The tip in the base when it touched the point, mm."""
    miss_mm: Vector
    """touched_mm less seen_mm, mm."""
    length_mm: float
    """Length of the miss, mm."""
    expanded_mm: float
    """U (k = 2) of the miss by tip, robot and placing, mm."""
    claimed_mm: float
    """The same with the uncertainty of X, and of the arm where its errors were taken up, mm."""
    outlying: bool
    """Whether this miss alone is larger than all of that explains."""
    base_T_flange: PoseDocument
    """The flange in the base when the tip touched the point."""


class TouchTestDocument(Document):
    """The misses of a touch test."""

    heading = "touch-test"

    schema_version: Literal[1] = 1
    """Version of the format."""
    calibration_id: str
    """Of the calibration that was used."""
    flange_tip_mm: Vector
    """The tip in the flange's frame, mm."""
    points: tuple[TouchedPointDocument, ...]
    """The points that were touched."""
    largest_mm: float
    """Length of the largest miss, mm."""
    mean_mm: Vector
    """Mean of the misses along the base's axes, mm."""
    probability: float
    """That errors as stated make misses as large as these."""
    agree: bool
    """Whether the probability is at least 0.01."""
    tolerance_mm: float | None
    """Largest miss that is accepted, mm; null without one."""
    conformance: Conformance | None
    """To the tolerance by ISO 14253-1: within, beyond or undecided; null without one."""
    accepted: bool
    """Within the tolerance; without one, whether the misses agree with what is stated."""
    summary: str
    """The result in a sentence."""
