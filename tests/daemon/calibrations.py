"""A calibration document of the fake cell's truth."""

import numpy as np

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument, PointUncertaintyDocument, ViewResultDocument
from calibration.documents.external_axis import ExternalAxisDocument, FoundAxisDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.documents.target import document_of_target
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel
from daemon.model.records import AppliedCalibration, CalibrationRecord
from tests.daemon.cell_under_test import Bench
from tests.daemon.fakes import BASE_T_TARGET, BOARD, CAMERA, FLANGE_T_CAMERA, poses_around_the_target


def a_calibration(calibration_id: str, *, accepted: bool = True, solved: bool = True) -> CalibrationDocument:
    """As a run would have stored it."""
    findings = [] if accepted else [
        {"code": "axes-parallel", "severity": "error", "message": "the axes are parallel", "fix": "turn more",
         "id": "as-written", "params": {"sentence": "the axes are parallel"},
         "advice": {"id": "as-written", "params": {"sentence": "turn more"}}}
    ]  # fmt: skip
    return CalibrationDocument.model_validate(
        {
            "id": calibration_id,
            "created_at": "2026-11-21T09:00:00.000Z",
            "software": "handeyed test",
            "setup": "eye-in-hand",
            "method": "test",
            "flange_T_camera": PoseDocument.of(FLANGE_T_CAMERA) if solved else None,
            "base_T_target": PoseDocument.of(BASE_T_TARGET) if solved else None,
            "camera": {**CameraDocument.of(CAMERA).model_dump(), "source": "given"},
            "uncertainty": {"translation_mm": [0.1] * 3, "rotation_deg": [0.01] * 3, "point_mm": 0.2},
            "noise": {"image_px": 0.05, "robot_rotation_deg": None, "robot_translation_mm": None},
            "views": [],
            "observability": {
                "views_used": 3, "max_rotation_deg": 60.0, "axis_spread": 0.8, "weakest_direction": "none"
            },
            "hold_out": None,
            "target": document_of_target(BOARD),
            "verdict": {"accepted": accepted, "findings": findings},
        }
    )  # fmt: skip


def document_with_covariance() -> CalibrationDocument:
    document = a_calibration("cal-1")
    assert document.uncertainty is not None
    covariance = np.diag([1e-7] * 3 + [0.01] * 3).tolist()
    nowhere = (0.0, 0.0, 0.0)
    point = PointUncertaintyDocument(
        name="the camera", frame="camera", position_mm=nowhere, camera_mm=nowhere, sigma_mm=0.17, expanded_mm=0.34
    )
    with_covariance = {"covariance": tuple(map(tuple, covariance)), "points": (point,)}
    claimed = document.uncertainty.model_copy(update=with_covariance)
    accuracy = document.accuracy.of_uncertainty(claimed)
    return document.model_copy(update={"uncertainty": claimed, "accuracy": accuracy})


def beside(document: CalibrationDocument, axis: ExternalAxisDocument) -> CalibrationDocument:
    """The same of a cell with this axis, found as it was drawn."""
    readings = axis.zero, axis.zero + 100.0
    found = axis.model_dump() | {"readings": readings, "off_deg": 0.0, "sigma_mm": 0.1, "expanded_mm": 0.2,
                                 "covariance": np.zeros((12, 12)).tolist()}  # fmt: skip
    return document.model_copy(update={"external_axis": FoundAxisDocument.model_validate(found)})


def with_views(document: CalibrationDocument) -> CalibrationDocument:
    """The same from views with the joints of the fake robot's arm."""
    arm = find_arm("IRB 1600-6/1.45")
    views = [
        ViewResultDocument.model_validate(
            {"index": index, "image": None, "status": "used", "reprojection_px": 0.1, "base_error_mm": 0.1,
             "robot_correction": None, "reason": None, "joints_deg": np.degrees(arm.inverse(pose)[0]).tolist()}
        )
        for index, pose in enumerate(poses_around_the_target())
    ]  # fmt: skip
    return document.model_copy(update={"views": views})


async def apply_calibration(bench: Bench, calibration_id: str = "cal-1") -> None:
    """Store a calibration of the fake cell's truth, and activate it."""
    store = bench.application.store
    document = a_calibration(calibration_id)
    await store.save_calibration(CalibrationRecord(calibration_id, None, document.created_at, True, document))
    await store.apply(AppliedCalibration(calibration_id, document.created_at, "test"))


def an_arm(**errors: float) -> ArmErrorsDocument:
    """arm.json of the fake robot's arm: errors by name in the units of ArmErrorModel, and the X of `a_calibration`."""
    arm = "IRB 1600-6/1.45"
    model = ArmErrorModel(find_arm(arm))
    return ArmErrorsDocument.model_validate(
        {
            "arm": arm, "created_at": "2026-11-21T09:00:00.000Z", "software": "handeyed test",
            "setup": "eye-in-hand", "taken_up": True, "log_evidence": 10.0,
            "mount_T_camera": PoseDocument.of(FLANGE_T_CAMERA),
            "parameters": [
                {"name": one.name, "group": one.group, "axis": 1, "unit": "", "value": errors.get(one.name, 0.0),
                 "sigma": 0.0}
                for one in model.parameters
            ],
            "covariance": np.zeros((6 + len(model), 6 + len(model))).tolist(),
            "scatter_mm": 0.05, "scatter_deg": 0.002, "ladder": [], "views": 12, "places": 1,
            "lowest_joints_deg": [-90.0] * 6, "highest_joints_deg": [90.0] * 6,
        }
    )  # fmt: skip


async def apply_with_arm(
    bench: Bench,
    *,
    x_sigma_mm: float = 0.0,
    zero_2_sigma_rad: float = 0.0,
    at_c: float | None = None,
    **errors: float,
) -> None:
    """An accepted calibration with the errors of its arm, in force."""
    document, arm = document_with_covariance(), an_arm(**errors)
    zero_2 = ArmErrorModel(find_arm("IRB 1600-6/1.45")).index("zero_2")
    covariance = np.array(arm.covariance)
    covariance[3:6, 3:6] = x_sigma_mm**2 * np.eye(3)
    covariance[6 + zero_2, 6 + zero_2] = zero_2_sigma_rad**2
    arm = arm.model_copy(update={"covariance": covariance.tolist(), "temperature_c": at_c})
    record = CalibrationRecord(document.id, None, document.created_at, True, document)
    await bench.application.store.save_calibration(record, arm)
    await bench.application.store.apply(AppliedCalibration(document.id, document.created_at, "test"))
