"""The control chart of a calibration: its points, their evaluation, and the alarm."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Literal

import numpy as np

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.knowledge import NoiseBeliefDocument
from calibration.documents.pose import round_vector
from calibration.errors import CalibrationError
from calibration.kinematics.abb_arms import find_arm
from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene
from calibration.monitoring.cell_change import DriftChangeDocument, find_change
from calibration.monitoring.control_chart import ChartPoint, DriftRules, DriftStanding, chart, scatter_limit_mm
from calibration.monitoring.learnt_noise import learn_noise
from calibration.sentences.sentence import Sentence
from daemon.config.settings import DriftSettings, Settings
from daemon.drift.samples import ChartEntry, robot_noise_mm

log = logging.getLogger(__name__)

REPEATABILITY_MM, REPEATABILITY_RAD = 0.02, float(np.radians(0.002))
"""Of an arm at one station, per axis; where it is worse the verifications say so."""

CALIBRATE = Sentence("calibrate-or-look")

VERIFY_WARM = Sentence("verify-at-usual-temperature")

LEARNT_FROM = 10
"""The last verifications from which the robot's noise is learnt; earlier ones add little."""

MIN_OTHER_TEMPERATURE_K = 3.0
"""From which difference of the camera's temperature on an alarm names it."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class DriftReport:
    """Evaluation of the chart's last point, "off" without one. `alarm`: a sentence, None while the calibration holds.

    `shift_mm`: apparent displacement of the fixed target, moving average; `limit_mm`: its limit by chance.
    """

    standing: Literal["off", DriftStanding] = "off"
    calibration_id: str | None = None
    verifications: int = 0
    shift_mm: float = 0.0
    limit_mm: float | None = None
    scatter_mm: float = 0.0
    scatter_limit_mm: float | None = None
    alarm: str | None = None

    def event_data(self) -> dict[str, object]:
        """The fields as JSON values, for the event `drift`, in which a chart that is off stands nowhere."""
        standing = None if self.standing == "off" else self.standing
        return vars(self) | {"standing": standing, "calibration_id": self.calibration_id or ""}


@dataclass(frozen=True)
class DriftPointDocument:
    """One verification, in base: displacement of the target from its learnt position, and the moving average of that.

    `drift_mm` is the average's length, and `limit_mm` its limit by chance, null while the chart still learns.
    `camera_temperature_c`: mean over the pictures, null for a camera that does not report it. One that is out of
    tolerance is learnt from nowhere.
    """

    run_id: str
    at: str
    standing: DriftStanding
    shift_mm: Vector
    average_mm: Vector
    drift_mm: float
    limit_mm: float | None
    scatter_mm: float
    camera_temperature_c: float | None = None


@dataclass(frozen=True)
class DriftChart:
    """The points, oldest first, and their evaluation.

    `changes`: what may have changed between the first and the last of them, with chances; empty without a known arm,
    the joints of the stations, or a verification before. `robot_noise`: what is believed of it after the calibration
    and the last verifications.
    """

    report: DriftReport = field(default_factory=DriftReport)
    points: tuple[DriftPointDocument, ...] = ()
    changes: tuple[DriftChangeDocument, ...] = ()
    robot_noise: NoiseBeliefDocument | None = None


def chart_of(entries: Sequence[ChartEntry], document: CalibrationDocument, settings: Settings) -> DriftChart:
    """The chart of these verifications, oldest first."""
    if not entries:
        return DriftChart(DriftReport("learning", document.id), robot_noise=document.noise.belief)
    rules, tolerance_mm = rules_of(settings.drift), settings.calibration.verdict_limits().tolerance_mm
    entries = [
        replace(entry, sample=replace(entry.sample, within_tolerance=entry.expanded_mm <= tolerance_mm))
        for entry in entries
    ]
    drawn = chart([entry.sample for entry in entries], rules)
    last = drawn[-1]
    limit_mm = _max_scatter_mm(entries[-1], document, settings, rules)
    points = tuple(_point(entry, drawn_as) for entry, drawn_as in zip(entries, drawn, strict=True))
    report = DriftReport(
        last.standing,
        document.id,
        len(entries),
        points[-1].drift_mm,
        points[-1].limit_mm,
        points[-1].scatter_mm,
        None if limit_mm is None else round(limit_mm, 6),
        _alarm(entries[-1], tolerance_mm, last, limit_mm, _temperatures(entries, rules)),
    )
    return DriftChart(
        report, points, tuple(_changes(entries, document, settings)), _learnt_noise(entries, document, settings)
    )


def _learnt_noise(
    entries: Sequence[ChartEntry], document: CalibrationDocument, settings: Settings
) -> NoiseBeliefDocument | None:
    """What is believed of the robot's noise after the calibration and the last verifications within tolerance."""
    belief, x, target = document.noise.belief, document.mount_T_camera, document.anchor_T_target
    sure = document.uncertainty
    if (
        belief is None or x is None or target is None or document.camera is None or sure is None
        or sure.covariance is None
    ):  # fmt: skip
        return belief
    noise = ExpectedNoise(document.noise.image_px or settings.calibration.noise.image_px, 0.0, 0.0)
    scene = Scene(document.setup, settings.target, document.camera.camera(), x.transform(), target.transform(), noise)
    within = [one.seen for one in entries if one.sample.within_tolerance and one.seen is not None]
    learnt = belief.belief()
    try:
        for seen in within[-LEARNT_FROM:]:
            learnt = learn_noise(learnt, scene, np.array(sure.covariance), seen)
    except (np.linalg.LinAlgError, ArithmeticError, CalibrationError) as error:
        log.warning("nothing is learnt of the robot's noise from verifications: %s", error)
        return belief
    return NoiseBeliefDocument.of(learnt) if within else belief


def _changes(
    entries: Sequence[ChartEntry], document: CalibrationDocument, settings: Settings
) -> list[DriftChangeDocument]:
    """What may have changed between the verifications of the reference and the last one."""
    now, x = entries[-1].seen, document.mount_T_camera
    before = [entry.seen for entry in _reference(entries[:-1], settings.drift.learn) if entry.seen is not None]
    if (
        not settings.robot.model
        or settings.robot.axes != 6
        or not before
        or now is None
        or x is None
        or document.camera is None
    ):
        return []
    image_px = document.noise.image_px or settings.calibration.noise.image_px
    noise = ExpectedNoise(image_px, REPEATABILITY_RAD, REPEATABILITY_MM)
    camera, target = document.camera.camera(), settings.target
    scene = Scene(document.setup, target, camera, x.transform(), now.anchor_T_target[0], noise)
    try:
        return find_change(before, now, find_arm(settings.robot.model), scene)
    except (np.linalg.LinAlgError, CalibrationError) as error:
        log.warning("what changed since the first verifications is not known: %s", error)
        return []


def _reference(entries: Sequence[ChartEntry], learn: int) -> list[ChartEntry]:
    """Those that the chart learns from."""
    return [entry for entry in entries if entry.sample.within_tolerance][:learn]


def _point(entry: ChartEntry, drawn: ChartPoint) -> DriftPointDocument:
    """A point of the chart, rounded to 1 nm."""
    return DriftPointDocument(
        entry.run_id,
        entry.at,
        drawn.standing,
        round_vector(drawn.shift_mm),
        round_vector(drawn.average_mm),
        round(drawn.drift_mm, 6),
        round(drawn.limit_mm, 6) if isfinite(drawn.limit_mm) else None,
        round(entry.sample.scatter_mm, 6),
        entry.camera_temperature_c,
    )


def rules_of(settings: DriftSettings) -> DriftRules:
    return DriftRules(settings.weight, settings.learn, settings.allowed_mm, settings.runs_between_false_alarms)


def _max_scatter_mm(
    entry: ChartEntry, document: CalibrationDocument, settings: Settings, rules: DriftRules
) -> float | None:
    """The largest scatter that the calibration's uncertainty and the robot's noise explain; None when not known."""
    if document.uncertainty is None or entry.sample.positions < 2:
        return None
    robot_mm = robot_noise_mm(document, settings.calibration)
    return scatter_limit_mm(
        document.uncertainty.point_mm, robot_mm, entry.sample.positions, rules.false_alarm_probability
    )


def _temperatures(entries: Sequence[ChartEntry], rules: DriftRules) -> tuple[float, float] | None:
    """Of the camera in the verifications of the reference and in the last one; None where they are alike or unknown."""
    reference = [entry.camera_temperature_c for entry in _reference(entries, rules.learn)]
    known, now = [one for one in reference if one is not None], entries[-1].camera_temperature_c
    if not known or now is None or abs(now - float(np.mean(known))) < MIN_OTHER_TEMPERATURE_K:
        return None
    return float(np.mean(known)), now


def _alarm(
    entry: ChartEntry, tolerance_mm: float, last: ChartPoint, limit_mm: float | None,
    temperatures: tuple[float, float] | None,
) -> str | None:  # fmt: skip
    if not entry.sample.within_tolerance:
        found = {"expanded_mm": entry.expanded_mm, "tolerance_mm": tolerance_mm}
        return Sentence("drift-out-of-tolerance", **found, fix=CALIBRATE)
    if last.standing == "drifting" and temperatures is not None:
        before_c, now_c = temperatures
        return Sentence(
            "drift-moved-with-temperature", drift_mm=last.drift_mm, limit_mm=last.limit_mm, before_c=before_c,
            now_c=now_c, fix=VERIFY_WARM,
        )  # fmt: skip
    if last.standing == "drifting":
        return Sentence("drift-moved", drift_mm=last.drift_mm, limit_mm=last.limit_mm, fix=CALIBRATE)
    if limit_mm is not None and (scatter_mm := entry.sample.scatter_mm) > limit_mm:
        return Sentence("drift-scatter", scatter_mm=scatter_mm, limit_mm=limit_mm, fix=CALIBRATE)
    return None
