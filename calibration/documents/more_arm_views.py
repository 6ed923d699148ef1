"""What more views would leave of the error of a registered point: a part of arm.json (mm, degrees)."""

from pydantic import Field

from calibration.documents.pose import Vector
from calibration.documents.validation import Document

BOX_STEPS = 4
"""Places along one edge of the box."""

Joints = tuple[float, float, float, float, float, float]


class PointAfterViewsDocument(Document):
    """RMS error of a registered point after so many more views."""

    more: int = Field(ge=1)
    """Number of the further views that are taken, from the first."""
    point_mm: float = Field(ge=0)
    """Error of a registered point after them, RMS, mm."""


class FurtherArmViewDocument(Document):
    """Joints from which the target is seen at its place in the base."""

    joints_deg: Joints
    """Axes 1 to 6, degrees."""
    target_mm: Vector
    """Origin of the target's place that is seen, in the base, mm."""


class MoreArmViewsDocument(Document):
    """The RMS error of a registered point in a box of the base, now and after more views."""

    box_mm: tuple[Vector, Vector]
    """Least and largest x, y, z of the registered points in the base, mm."""
    points: int = Field(ge=1, le=BOX_STEPS**3)
    """Number of registered points within reach, on a grid of 4 x 4 x 4 in the box."""
    now_mm: float = Field(ge=0)
    """Error of a registered point as predicted from these views, RMS, mm."""
    after: list[PointAfterViewsDocument]
    """The same after more views."""
    further: list[FurtherArmViewDocument]
    """Views of the target where it stood, in the order of their gain."""


def more_arm_views_text(found: MoreArmViewsDocument) -> str:
    """What people read: "30 pictures more would bring a registered point from 0.42 to 0.15 mm RMS in the box"."""
    last = found.after[-1]
    corners = " to ".join(", ".join(f"{value:.0f}" for value in corner) for corner in found.box_mm)
    between = "".join(f", {one.point_mm:.3f} mm after {one.more}" for one in found.after[:-1])
    return (
        f"{last.more} pictures more would bring a registered point from {found.now_mm:.3f} to {last.point_mm:.3f} mm"
        f" RMS in the box {corners} mm ({found.points} of {BOX_STEPS**3} places within reach){between}"
    )
