"""The answers as plain text, for use with curl."""

from collections.abc import Iterable
from math import hypot
from typing import Any

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_text import accuracy_text, summary
from calibration.documents.numbers import significant
from calibration.monitoring.cell_change import DriftChangeDocument
from daemon.api.schemas.calibrations import CalibrateStatus
from daemon.api.schemas.cell import RobotDocument
from daemon.api.schemas.drift import DriftDocument
from daemon.api.schemas.health import ReadyDocument
from daemon.model.records import RunRecord
from daemon.reports.reports import MIN_SHOWN_CHANCE
from daemon.runs.run_log import prediction_text


def run_text(run: RunRecord, calibration: CalibrationDocument | None = None) -> str:
    """The state and result of a run, and what to do next."""
    return "\n".join(_run_lines(run, calibration))


def _run_lines(run: RunRecord, calibration: CalibrationDocument | None) -> Iterable[str]:
    stations = "" if run.kind == "jog" else f", station {run.station} of {run.stations}"
    yield f"{run.kind} run {run.id}: {run.state}{stations}"
    if run.planning is not None:
        yield from filter(None, (prediction_text(run.planning), run.planning.note))
        if not run.is_over and run.planning.advice:
            yield f"next: {run.planning.advice}"
    if run.cause is not None:
        yield f"why:  {run.cause.what}"
        yield f"do:   {run.cause.fix}"
    if calibration is not None:
        yield summary(f"calibration {calibration.id}", calibration)
        yield from _next_step(run, calibration)
    if run.result is not None and "verification" in run.result:
        yield from _verification_lines(run.result["verification"])
    if run.result is not None and "scan_id" in run.result:
        yield f"scan {run.result['scan_id']}: {run.result['views']} views; GET /scans/{run.result['scan_id']}/cloud"
    if run.result is not None and "joints_deg" in run.result:
        yield f"the axes stand at {', '.join(f'{angle:.2f}' for angle in run.result['joints_deg'])} deg"
    if not run.is_over and run.request.get("manual"):
        yield f"jog the arm with POST /runs/{run.id}/jog"
        yield f"take a picture with POST /runs/{run.id}/stations, end with POST /runs/{run.id}/finish"
    if not run.is_over:
        yield f"follow it with GET /runs/{run.id} or /events; stop it with POST /runs/{run.id}/abort"


def _next_step(run: RunRecord, calibration: CalibrationDocument) -> Iterable[str]:
    if run.result and run.result.get("not_applied"):
        yield run.result["not_applied"]["message"]
    if run.result and run.result.get("applied"):
        yield "it is active: POST /register uses it from now on"
    elif calibration.verdict.accepted:
        yield f"not applied yet: POST /calibrations/{calibration.id}/apply"
    else:
        yield "not accepted: put right what is marked, and calibrate again"


def _verification_lines(table: dict[str, Any]) -> Iterable[str]:
    """A table as Tab. 1 of the paper: the five points of the cross from each position, and their sigma."""
    by_id = {point["id"]: point for point in table["points"]}
    rows = [by_id[point] for point in table["cross"]]
    frame = table.get("frame", "base")  # runs stored before the camera could stand beside the robot have none
    yield f"points of the target in {frame} coordinates [mm], with calibration {table['calibration_id']}"
    for position, station in enumerate(table["stations"]):
        yield f"({chr(ord('a') + position % 26)}) Position {station}"
        yield _row("point", [str(row["id"]) for row in rows])
        for axis, name in enumerate("xyz"):
            yield _row(name, [f"{row[f'{frame}_mm'][position][axis]:.4f}" for row in rows])
    yield "standard deviation over the positions [mm]"
    for axis, name in enumerate("xyz"):
        yield _row(f"sigma {name}", [f"{row['sigma_mm'][axis]:.4f}" for row in rows])
    sigma = ", ".join(f"{name} {value:.4f}" for name, value in zip("xyz", table["sigma_mm"], strict=True))
    yield f"over all {len(table['points'])} points: {sigma} mm"
    if table.get("tolerance_mm") is not None:
        worst = table["worst_expanded_mm"]
        calibrated = "" if worst is None else f", the calibration's U at the worst point is {significant(worst)} mm"
        stated = "" if table.get("tolerance_stated", True) else " (not stated by you)"
        yield (
            f"{'within' if table['within_tolerance'] else 'NOT within'} the tolerance of {table['tolerance_mm']:g} mm"
            f"{stated}: twice the largest sigma is {significant(table['expanded_mm'])} mm{calibrated}"
        )


def _row(name: str, cells: list[str]) -> str:
    return f"  {name:<9}" + "".join(f"{cell:>13}" for cell in cells)


def status_text(status: CalibrateStatus, base_url: str) -> str:
    lines = []
    if status.current is not None and status.applied is not None:
        lines.append(f"calibration {status.current.id} is active since {status.applied.applied_at}"
                     f" (applied by {status.applied.applied_by}): {accuracy_text(status.current)}")  # fmt: skip
    else:
        lines.append("no calibration is active")
    if status.in_progress is not None:
        run = status.in_progress
        lines.append(f"{run.kind} run {run.id} is {run.state}, station {run.station} of {run.stations}")
    elif status.last_run is not None:
        run = status.last_run
        lines.append(f"the last calibration run, {run.id}, {run.state}" + (f": {run.cause.what}" if run.cause else ""))
        if (why_not := (run.result or {}).get("not_applied")) is not None:
            lines.append(f"calibration {run.id}: {why_not['message']}")
    lines += [f"not ready: {reason}" for reason in status.reasons]
    lines += [f"warning: {warning}" for warning in status.warnings]
    lines.append(f"poses: {status.poses}; applied by {status.policy}")
    lines.append(f"start:  curl -X POST -H 'Accept: text/plain' '{base_url}calibrate?wait=120'")
    return "\n".join(lines)


def ready_text(ready: ReadyDocument) -> str:
    lines = []
    for name, what in (("calibrate", ready.calibrate), ("register", ready.register_)):
        lines.append(f"{name}: {'ready' if what.ready else 'not ready'}")
        lines += [f"  {reason}" for reason in what.reasons]
    return "\n".join([*lines, *(f"warning: {warning}" for warning in ready.warnings)])


def change_text(change: DriftChangeDocument) -> str:
    """axis 2 of the arm: its zero moved by 0.020 deg (chance 97 %)"""
    chance = f"(chance {change.chance:.0%})"
    if change.axis is not None:
        return f"axis {change.axis} of the arm: its zero moved by {change.turned_deg:.3f} deg {chance}"
    if change.shift_mm is None or change.turn_deg is None:
        return f"nothing changed since the first verifications {chance}"
    what = change.cause.removesuffix("-moved")
    by, turned = hypot(*change.shift_mm), hypot(*change.turn_deg)
    return f"the {what} moved by {by:.3f} mm and turned by {turned:.3f} deg {chance}"


def drift_text(chart: DriftDocument) -> str:
    about = f" of calibration {chart.calibration_id}" if chart.calibration_id else ""
    lines = [f"drift: {chart.standing}{about}, {chart.verifications} verifications"]
    if chart.alarm is not None:
        lines.append(f"alarm: {chart.alarm}")
    if (noise := chart.robot_noise) is not None:
        levels = f"{noise.robot_translation_mm:.3g} mm, {noise.robot_rotation_deg:.2g} deg"
        factors = f"times or over {noise.translation_factor:.2g} and {noise.rotation_factor:.2g}"
        lines.append(f"robot's noise: {levels}, {factors} ({noise.origin})")
    lines += [change_text(change) for change in chart.changes if change.chance >= MIN_SHOWN_CHANCE]
    if chart.points:
        lines.append(f"{'at':<26}{'run':<24}{'drift [mm]':>11}{'limit':>8}{'scatter':>9}  ")
    for point in chart.points:
        limit = "" if point.limit_mm is None else f"{point.limit_mm:.3f}"
        numbers = f"{point.drift_mm:>11.3f}{limit:>8}{point.scatter_mm:>9.3f}"
        lines.append(f"{point.at:<26}{point.run_id:<24}{numbers}  {point.standing}")
    for touch in chart.touch_tests:
        known = f"largest miss {touch.largest_mm:.3f} mm, U = {touch.expanded_mm:.3f} mm"
        lines.append(
            f"{touch.at:<26}{'touch ' + touch.id:<30}{known}  {'accepted' if touch.accepted else 'not accepted'}"
        )
    for found in chart.scanner:
        spacing = "" if found.sphere_spacing_mm is None else f", spacing {found.sphere_spacing_mm:+.3f} mm"
        errors = f"form {found.probing_form_mm:.3f} mm, size {found.probing_size_mm:+.3f} mm{spacing}"
        lines.append(f"{found.at:<26}{'scanner ' + found.id:<30}{errors}")
    return "\n".join(lines)


def robot_text(robot: RobotDocument) -> str:
    axes = ["none" if value is None else f"{value:.3f}" for value in robot.external_axes or ()]
    pose = robot.base_T_flange
    x, y, z = pose.translation_mm
    quaternion = ", ".join(f"{q:.6f}" for q in pose.quaternion_wxyz)
    on = [name.replace("_", " ") for name in ("motors_on", "automatic", "emergency_stop", "moving", "armed",
                                              "program_running", "speed_limited") if getattr(robot, name)]  # fmt: skip
    return "\n".join([
        f"robot: {robot.detail}",
        f"flange at ({x:.3f}, {y:.3f}, {z:.3f}) mm, quaternion ({quaternion}) w first, in the {robot.frame} frame",
        *([] if robot.frame_warning is None else [f"warning: {robot.frame_warning}"]),
        f"confdata {[*robot.configuration]}",
        f"joints {', '.join(f'{angle:.3f}' for angle in robot.joints_deg)} deg",
        *([] if robot.external_axes is None else [f"external axes {', '.join(axes)}"]),
        f"{', '.join(on) or 'nothing is on'}; held by {robot.held_by or 'nobody'}",
    ])  # fmt: skip
