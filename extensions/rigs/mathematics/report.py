"""The rig.json of a joint solution, and its words."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np

from calibration.documents.calibration import FindingDocument, VerdictDocument
from calibration.documents.calibration_text import finding_line
from calibration.documents.pose import PoseDocument
from calibration.documents.rig import RelativePoseDocument, RigDocument, RigSensorDocument, RigUncertaintyDocument
from calibration.likelihood.mapped_points import point_sigmas_mm
from calibration.problem import MOUNTS
from calibration.solution import COVERAGE_FACTOR, Solution
from calibration.transforms import Array
from extensions.rigs.mathematics.rig import RigSolution

FALSE_ALARM_PROBABILITY = 1e-3
"""Probability that a sensor in agreement with the others is reported as disagreeing."""


def rig_document(rig: RigSolution, alone: Mapping[str, Solution], tolerance_mm: float) -> RigDocument:
    """The rig.json of a joint solution, beside the sensors' own solutions by name.

    Accepted when U of every sensor and of every relative pose is within the tolerance and no sensor disagrees.
    """
    seen = [sensor.points_mm() for sensor in rig.sensors]
    sensors = tuple(_sensor(rig, number, seen[number], alone[one.name]) for number, one in enumerate(rig.sensors))
    relative = []
    for a, b in combinations(range(len(rig.sensors)), 2):
        a_T_b, covariance = rig.relative(a, b)
        names, uncertainty = {"a": rig.sensors[a].name, "b": rig.sensors[b].name}, _uncertainty(covariance, seen[b])
        relative.append(RelativePoseDocument(**names, a_T_b=PoseDocument.of(a_T_b), uncertainty=uncertainty))
    findings = list(_findings(rig, sensors, relative, tolerance_mm))
    return RigDocument(
        setup=rig.setup, mount=MOUNTS[rig.setup], sensors=sensors, relative=tuple(relative),
        anchor_T_target=PoseDocument.of(rig.anchor_T_target), robot_rotation_deg=float(np.degrees(rig.robot[0])),
        robot_translation_mm=rig.robot[1], stations=rig.stations, shared_stations=rig.shared, tolerance_mm=tolerance_mm,
        verdict=VerdictDocument(accepted=all(finding.severity != "error" for finding in findings), findings=findings),
    )  # fmt: skip


def _sensor(rig: RigSolution, number: int, seen_mm: Array, alone: Solution) -> RigSensorDocument:
    expanded, probability = None, None
    if alone.mount_T_camera is not None and alone.uncertainty is not None:
        own = alone.uncertainty.covariance
        expanded = _expanded_mm(own, seen_mm)
        probability = rig.disagreement(number, alone.mount_T_camera, own)
    return RigSensorDocument(
        name=rig.sensors[number].name, views=len(rig.sensors[number].pairs),
        mount_T_sensor=PoseDocument.of(rig.mount_T_sensor[number]),
        uncertainty=_uncertainty(rig.covariance_of(number), seen_mm),
        alone_expanded_mm=expanded, probability=probability,
    )  # fmt: skip


def _expanded_mm(covariance: Array, points_mm: Array) -> float:
    return COVERAGE_FACTOR * float(point_sigmas_mm(covariance, points_mm).max())


def _uncertainty(covariance: Array, points_mm: Array) -> RigUncertaintyDocument:
    sigmas = np.sqrt(np.diagonal(covariance))
    return RigUncertaintyDocument.model_validate({
        "translation_mm": sigmas[3:].tolist(), "rotation_deg": np.degrees(sigmas[:3]).tolist(),
        "expanded_mm": _expanded_mm(covariance, points_mm), "covariance": covariance.tolist(),
    })  # fmt: skip


def _findings(
    rig: RigSolution,
    sensors: Sequence[RigSensorDocument],
    relative: Sequence[RelativePoseDocument],
    tolerance_mm: float,
) -> Iterable[FindingDocument]:
    poses = [(one.name, one.uncertainty) for one in sensors]
    poses += [(f"{one.b} in {one.a}", one.uncertainty) for one in relative]
    for name, uncertainty in poses:
        if not uncertainty.expanded_mm <= tolerance_mm:
            what = f"{name}: a measured point is uncertain by U = {uncertainty.expanded_mm:.2g} mm (k = 2)"
            yield FindingDocument(
                code="point-uncertain", severity="error", message=f"{what}; tolerance {tolerance_mm:g} mm",
                fix="add stations at which the sensors see the target, turned about several axes",
            )  # fmt: skip
    for one in sensors:
        if one.probability is not None and one.probability < FALSE_ALARM_PROBABILITY:
            yield FindingDocument(
                code="sensor-disagrees", severity="error",
                message=f"{one.name} alone contradicts the joint solution (probability {one.probability:.1g})",
                fix="check that the target stood still between the sessions, is described alike in both, and that the"
                " sensors are fixed to each other",
            )  # fmt: skip
    if rig.shared == 0:
        yield FindingDocument(
            code="no-shared-station", severity="warning",
            message="no two sensors saw the target at the same pose of the robot: its errors enter their relative pose",
            fix="take the pictures of all sensors before the arm moves on, and write the same base_T_flange into each",
        )  # fmt: skip


def rig_lines(document: RigDocument) -> Iterable[str]:
    """rig.json as lines of plain text."""
    word = "accepted" if document.verdict.accepted else "not accepted"
    yield f"{' + '.join(one.name for one in document.sensors)}  {word}"
    for one in document.sensors:
        yield _pose_line(f"{document.mount}_T_{one.name}", one.mount_T_sensor, one.uncertainty)
        if one.alone_expanded_mm is not None:
            yield f"  {'':<24} alone U {one.alone_expanded_mm:.3g} mm, {one.views} pictures"
    for pair in document.relative:
        yield _pose_line(f"{pair.a}_T_{pair.b}", pair.a_T_b, pair.uncertainty)
    yield f"  {'stations':<24} {document.stations}, {document.shared_stations} of them seen by several sensors"
    yield (
        f"  {'robot':<24} scatters by {document.robot_translation_mm:.2g} mm and {document.robot_rotation_deg:.2g} deg"
    )
    yield from (f"  {finding_line(finding)}" for finding in document.verdict.findings)


def _pose_line(name: str, pose: PoseDocument, uncertainty: RigUncertaintyDocument) -> str:
    place = ", ".join(format(value, ".3f") for value in pose.translation_mm)
    turn = ", ".join(format(value, ".6f") for value in pose.quaternion_wxyz)
    return f"  {name:<24} ({place}) mm   ({turn}) wxyz   U {uncertainty.expanded_mm:.3g} mm (k = 2)"
