"""A calibrated tip as its file and in words."""

import numpy as np

from calibration.documents.tip import TipDocument
from calibration.solution import COVERAGE_FACTOR
from extensions.touch.mathematics.pivot_calibration import TipCalibration


def tip_document(found: TipCalibration, names: tuple[str, ...]) -> TipDocument:
    """The tip.json of a calibrated tip; `names` of the poses."""
    return TipDocument.model_validate(
        {
            "flange_tip_mm": found.flange_tip_mm.tolist(),
            "covariance": found.covariance.tolist(),
            "placing_sigma_mm": found.sigma_mm,
            "expanded_mm": COVERAGE_FACTOR * found.point_sigma_mm,
            "base_point_mm": found.base_point_mm.tolist(),
            "poses": [
                {"name": name, "used": bool(used), "base_residual_mm": off.tolist()}
                for name, used, off in zip(names, found.used, found.base_residuals_mm, strict=True)
            ],
        }
    )


def tip_text(tip: TipDocument) -> str:
    """A calibrated tip in a few lines."""
    x, y, z = tip.flange_tip_mm
    used = sum(pose.used for pose in tip.poses)
    lines = [
        f"tip at ({x:.3f}, {y:.3f}, {z:.3f}) mm on the flange, U = {tip.expanded_mm or 0:.3f} mm (k = 2)",
        f"  {used} of {len(tip.poses)} poses used; one placing errs by {tip.placing_sigma_mm:.3f} mm per axis",
    ]
    for pose in tip.poses:
        length_mm = float(np.linalg.norm(pose.base_residual_mm))
        lines.append(f"  pose {pose.name:<12} {length_mm:.3f} mm{'' if pose.used else '  left out: an outlier'}")
    return "\n".join(lines)
