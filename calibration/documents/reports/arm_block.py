"""The errors of the arm in a calibration report: two maps from above, as drawn and as built."""

from dataclasses import dataclass

from calibration.documents.more_arm_views import MoreArmViewsDocument, more_arm_views_text
from calibration.documents.reports.charts import bubble_map
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.numbers import significant


@dataclass(frozen=True)
class FieldColumn:
    """Registered points above each other at (x, y) in the base, mm, and the RMS misses of them, before and after."""

    at_mm: tuple[float, float]
    before_mm: float
    after_mm: float


@dataclass(frozen=True)
class ArmErrors:
    """The error field of an arm: `columns` of `points` registered points, RMS over all of them before and after.

    `more_views`: what further views would bring, where it was predicted.
    """

    arm: str
    points: int
    columns: tuple[FieldColumn, ...]
    before_rms_mm: float
    after_rms_mm: float
    more_views: MoreArmViewsDocument | None = None


def arm_block(found: ArmErrors) -> Markup:
    """What the maps show, both of them side by side with circles of one scale, and what more views would bring."""
    text = (
        f"The errors of the {found.arm} as built were identified from these views and are in use. At {found.points}"
        f" places around those of the views a registered point is missed by {significant(found.before_rms_mm)} mm by"
        f" the arm as drawn, and by {significant(found.after_rms_mm)} mm with its errors taken out (root mean square)."
        " Each circle: the points above each other, seen from above."
    )
    before, after = ([getattr(one, name) for one in found.columns] for name in ("before_mm", "after_mm"))
    places, largest = [one.at_mm for one in found.columns], max([*before, *after])
    maps = [
        tag("figure", bubble_map(places, values, largest, about), tag("figcaption", about))
        for values, about in (
            (before, f"Before: missed by up to {significant(max(before))} mm (x to the right, y up, in mm)."),
            (after, f"After: missed by up to {significant(max(after))} mm, the same scale."),
        )
    ]
    more = tag("p", f"{more_arm_views_text(found.more_views)}.") if found.more_views else ""
    return join(tag("p", text), tag("div", *maps, class_="columns"), more)
