"""Which stored runs belong to the chart of a calibration, and what each says."""

from dataclasses import dataclass
from math import radians, sqrt
from typing import Any

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.monitoring.control_chart import Sample, sample_of
from calibration.transforms import Array
from daemon.config.settings import CalibrationSettings
from daemon.model.records import Applied, RunRecord
from daemon.model.run_states import RunState


@dataclass(frozen=True, eq=False)
class Verified:
    """One verification of the chart."""

    run_id: str
    at: str
    sample: Sample


def belongs(run: RunRecord, applied: Applied, target_points: int) -> bool:
    """A finished verification of the calibration in force, of the fixed target, from the settings' poses.

    One with poses or a target of its own may look at something else, or from where the errors are others; one from
    before the settings' target was changed may have seen points that this one has not.
    """
    return (
        run.kind == "verify"
        and run.state is RunState.FINISHED
        and run.result is not None
        and run.result["calibration_id"] == applied.calibration_id
        and run.created_at >= applied.applied_at
        and not {"poses", "target"} & run.request.keys()
        and all(point["id"] < target_points for point in run.result["verification"]["points"])
    )


def verified(run: RunRecord, target_points_mm: Array) -> Verified:
    """What a run that `belongs` adds to the chart."""
    assert run.result is not None
    points: list[dict[str, Any]] = run.result["verification"]["points"]
    ids = [point["id"] for point in points]
    base_mm = np.array([point["base_mm"] for point in points]).transpose(1, 0, 2)
    sample = sample_of(base_mm, target_points_mm[ids], target_points_mm.mean(axis=0))
    return Verified(run.id, run.updated_at, sample)


def robot_noise_mm(document: CalibrationDocument, settings: CalibrationSettings) -> float:
    """The robot's noise at the target, three axes together: as estimated with the calibration, else as expected."""
    noise, expected = document.noise, settings.noise
    translation_mm = noise.robot_translation_mm or expected.robot_translation_mm
    rotation_deg = noise.robot_rotation_deg or expected.robot_rotation_deg
    assert document.flange_T_camera is not None
    near, far = settings.limits.distance_mm
    lever_mm = float(np.linalg.norm(document.flange_T_camera.translation_mm)) + (near + far) / 2
    return sqrt(3 * translation_mm**2 + 2 * (radians(rotation_deg) * lever_mm) ** 2)
