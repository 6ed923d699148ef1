"""arm.json: the errors of an arm as built, what they were identified from, and X with them (mm, degrees, w first)."""

from typing import Literal

import numpy as np
from pydantic import Field

from calibration.documents.arm_conditions import ArmTemperature, LoadDocument
from calibration.documents.calibration import CalibrationFindingDocument
from calibration.documents.calibration_text import finding_line
from calibration.documents.more_arm_views import Joints, MoreArmViewsDocument, more_arm_views_text
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document
from calibration.errors import GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import ArmErrorModel, Group
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.load import NO_LOAD
from calibration.problem import Setup
from calibration.solution import ArmLadderDocument


class ArmParameterDocument(Document):
    """One error of the arm in `unit`, and one standard deviation of it after the session."""

    name: str
    """Name of the error."""
    group: Group
    """zeros, links, gears, sag, rest, play or warmth."""
    axis: int = Field(ge=1, le=6)
    """Axis 1 to 6 that it belongs to."""
    unit: str
    """Of value and sigma."""
    value: float
    """The error."""
    sigma: float = Field(ge=0)
    """One standard deviation of it after the views."""


FIRST_PARAMETERS = 49
"""Number of parameters of the first version."""


class ArmErrorsDocument(Document):
    """arm.json: the errors of an arm as built, by all its views."""

    heading = "armjson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    arm: str
    """Name of the arm (`handeyed arms`)."""
    serial: str | None = None
    """Serial number of the arm; null where it is not known."""
    created_at: str
    """UTC, ISO 8601."""
    software: str
    """handeyed and its version."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    taken_up: bool
    """Whether the views show errors of the arm; all parameters are 0 otherwise."""
    log_evidence: float
    """Natural logarithm of the evidence against an arm as drawn."""
    mount_T_camera: PoseDocument
    """X identified with the arm, mm: the camera in the flange, or in the base."""
    parameters: list[ArmParameterDocument]
    """Errors of the arm; docs/arm-errors.md has the model."""
    covariance: list[list[float]]
    """Of rotation (rad), translation (mm) of mount_T_camera @ exp(.), parameters."""
    scatter_mm: float
    """Scatter of a pose about the model, one standard deviation per axis, mm."""
    scatter_deg: float
    """The same of its rotation, degrees."""
    ladder: list[ArmLadderDocument]
    """Models with the errors up to each group, the first without any."""
    views: int = Field(ge=0)
    """Number of views."""
    joints_from_poses: int = Field(default=0, ge=0)
    """Number of views whose joints were computed from their poses and confdata by the drawing."""
    places: int = Field(ge=1)
    """Number of places of the target."""
    load: LoadDocument | None = None
    """What the flange carries; null where it is not known."""
    temperature_c: ArmTemperature | None = None
    """Of the arm where the parameters hold, mean over the views, degrees Celsius; null where a view has none."""
    lowest_joints_deg: Joints
    """Least angle of axes 1 to 6 among the views, degrees: beyond them nothing was learnt."""
    highest_joints_deg: Joints
    """Greatest angle of axes 1 to 6 among the views, degrees."""
    more_views: MoreArmViewsDocument | None = None
    """What views more would bring; null where no errors were taken up, for a camera beside the robot, and for a box
    out of reach."""
    findings: list[CalibrationFindingDocument] = Field(default_factory=list)
    """Known distances that disagree with the estimate by more than both know."""

    def estimate(self) -> ArmEstimate:
        """The arm and X as numbers. Raises GeometryError for another arm's or damaged parameters.

        Later versions have further parameters, after the others: a document without them is read with these as drawn.
        """
        model = ArmErrorModel(find_arm(self.arm))
        size, covariance = 6 + len(self.parameters), np.array(self.covariance, float)
        names = [one.name for one in model.parameters]
        if [one.name for one in self.parameters] != names[: max(len(self.parameters), FIRST_PARAMETERS)]:
            raise GeometryError(f"arm.json: its parameters are not those of this version for {self.arm}: solve again")
        if covariance.shape != (size, size) or not np.all(np.isfinite(covariance)):
            raise GeometryError(f"arm.json: covariance must be {size} x {size} finite numbers")
        later = (0, len(names) - len(self.parameters))
        values = np.pad([one.value for one in self.parameters], later)
        covariance = np.pad(covariance, (later, later))
        load = NO_LOAD if self.load is None else self.load.load()
        mount_T_camera = self.mount_T_camera.transform()
        return ArmEstimate(model, values, covariance, mount_T_camera, load=load, temperature_c=self.temperature_c)


def arm_summary(document: ArmErrorsDocument) -> str:
    """What people read: whether errors were found, what each group explains, the largest ones."""
    without, *models = document.ladder
    found = "errors of the arm are taken up" if document.taken_up else "no errors of the arm show in these pictures"
    lines = [f"{document.arm}: {found} (log-evidence {document.log_evidence:+.1f})"]
    if document.lowest_joints_deg[4] * document.highest_joints_deg[4] > 0:
        lines.append(
            "  all pictures are in one posture of the wrist: some with it turned over tell more than as many others"
        )
    lines.append(f"  {'model':16} {'probability':>11} {'hold-out mm':>11}")
    lines.append(f"  {'drawing':16} {'':>11} {without.hold_out_mm:11.3f}")
    lines += [f"  {f'up to {row.up_to}':16} {row.probability:11.0%} {row.hold_out_mm:11.3f}" for row in models]
    if document.taken_up:
        sized = sorted(document.parameters, key=lambda one: -abs(one.value) / max(one.sigma, 1e-300))
        lines += [f"  {one.name:16} {one.value:11.3g} ± {one.sigma:.2g} {one.unit}" for one in sized[:5] if one.value]
    lines.append(f"  scatter about the model: {document.scatter_mm:.3f} mm, {document.scatter_deg:.4f} deg")
    lines += [f"  {finding_line(finding)}" for finding in document.findings]
    if document.more_views is not None:
        lines.append(f"  {more_arm_views_text(document.more_views)}")
    return "\n".join(lines)
