"""Schema of GET /runs/{id}/views. Pixels from the centre of the first one; lengths mm, angles deg."""

import numpy as np

from calibration.documents.pose import PoseDocument, Vector
from calibration.kinematics.arm import Arm
from daemon.api.schemas.answer import Answer
from daemon.api.schemas.cell import MissingDocument
from daemon.cell.skeleton import skeleton_mm
from daemon.runs.run_views import Corner, RunView, RunViews


class RunViewDocument(Answer):
    """One view. `status`: "used", "corrected" or "rejected" by the run's calibration, "missed" where the target was not
    found, "taken" before there is one.

    `corners`: [id, u, v, du, dv, du_free, dv_free]: found at (u, v); predicted minus found by the robot's pose as
    reported (du, dv), and by the pose corrected by the error estimated of it; null where not known. `rms_px` and
    `rms_px_free` are their root mean squares.
    """

    index: int
    at: str | None
    base_T_flange: PoseDocument
    joints_deg: list[float] | None
    skeleton_mm: list[Vector] | None
    status: str
    reason: str | None
    missing: MissingDocument | None
    corners: list[Corner]
    rms_px: float | None
    rms_px_free: float | None
    sharpness: float | None
    camera_temperature_c: float | None
    picture: str

    @classmethod
    def of(cls, run_id: str, view: RunView, arm: Arm | None) -> "RunViewDocument":
        result = view.result
        status = "missed" if view.missing else "taken" if result is None else result.status
        joints = view.joints_rad
        return cls(
            **{**vars(view), "at": view.at or None, "missing": MissingDocument.of(view.missing)},
            base_T_flange=view.view.base_T_flange,
            joints_deg=None if joints is None else [round(float(angle), 4) for angle in np.degrees(joints)],
            skeleton_mm=skeleton_mm(arm, joints),
            status=status,
            reason=None if result is None else result.reason,
            camera_temperature_c=view.view.camera_temperature_c,
            picture=f"/runs/{run_id}/frames/{view.index}",
        )


class RunViewsDocument(Answer):
    """The views of a run, by which calibration they are predicted, and the target's outline in its own frame."""

    run_id: str
    calibration_id: str | None
    target_outline_mm: list[Vector]
    views: list[RunViewDocument]

    @classmethod
    def of(cls, run_id: str, calibration_id: str | None, found: RunViews, arm: Arm | None) -> "RunViewsDocument":
        outline = [(float(x), float(y), float(z)) for x, y, z in found.target_outline_mm]
        views = [RunViewDocument.of(run_id, view, arm) for view in found.views]
        return cls(run_id=run_id, calibration_id=calibration_id, target_outline_mm=outline, views=views)
