"""The errors of the arm as a calibration report shows them."""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.arm_field import ArmFieldPointDocument, arm_field
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.reports.arm_block import ArmErrors, FieldColumn
from calibration.errors import GeometryError

STEPS = 5


def arm_in_report(calibration: CalibrationDocument, errors: ArmErrorsDocument) -> ArmErrors | None:
    """None where no errors were taken up, and where the views hold no joints, so that there is no field."""
    if not errors.taken_up:
        return None
    try:
        field = arm_field(errors, calibration, STEPS)
    except GeometryError:
        return None
    if field.before_rms_mm is None or field.after_rms_mm is None:
        return None
    return ArmErrors(
        field.arm,
        len(field.points),
        _columns(field.points),
        field.before_rms_mm,
        field.after_rms_mm,
        errors.more_views,
    )


def _columns(points: Iterable[ArmFieldPointDocument]) -> tuple[FieldColumn, ...]:
    """By the flange's place, which is the same for points above each other."""
    above = defaultdict(list)
    for point in points:
        above[point.flange_mm[:2]].append((*point.point_mm[:2], point.before_mm, point.after_mm))
    columns = []
    for rows in above.values():
        table = np.array(rows)
        x, y = table[:, :2].mean(axis=0).tolist()
        before, after = np.sqrt(np.mean(table[:, 2:] ** 2, axis=0)).tolist()
        columns.append(FieldColumn((x, y), before, after))
    return tuple(columns)
