"""Schemas of GET /drift."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from calibration.documents.calibration import SentenceDocument
from calibration.documents.knowledge import NoiseBeliefDocument
from calibration.monitoring.cell_change import DriftChangeDocument
from calibration.monitoring.control_chart import DriftRules
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, as_it_stands, documents_of
from daemon.config.settings import DriftSettings
from daemon.drift.chart import DriftChart, DriftPointDocument, DriftReport, rules_of
from daemon.scans.scanner_acceptance import AcceptanceDocument
from daemon.store.damaged_rows import split_damaged
from daemon.store.documents import DocumentRecord


@dataclass(frozen=True)
class DriftRulesDocument(DriftRules):
    """The rules of the chart, as in [drift] of the settings."""

    __pydantic_config__: ClassVar = as_it_stands()


class DriftTouchDocument(Answer):
    """One touch test of the calibration: its largest miss with U (k = 2), and whether it was accepted."""

    id: str
    at: str
    largest_mm: float
    expanded_mm: float
    accepted: bool


class DriftScannerDocument(Answer):
    """One verification of the scanner with a sphere or a ball bar: its errors, as POST /verify gave them."""

    id: str
    at: str
    scan_id: str
    probing_form_mm: float
    probing_size_mm: float
    sphere_spacing_mm: float | None

    @classmethod
    def of_record(cls, record: DocumentRecord) -> "DriftScannerDocument":
        found = record.parsed(AcceptanceDocument)
        return cls(**vars(found), id=record.id, at=record.created_at)


@dataclass(frozen=True, kw_only=True)
class DriftDocument(DriftReport):
    """The control chart of the active calibration; "off" without one. `points`: the oldest first.

    `alarm`: a sentence, or null; `alarm_detail`: what it is made of. `scatter_limit_mm`: the largest scatter of the
    last verification that is explained by the calibration's uncertainty and the robot's noise. `touch_tests`: of the
    same calibration, the oldest first, without those that GET /touches names as damaged. `changes`: what may have
    changed, the likeliest first; empty without a known arm, the joints of the stations, or a
    verification before.
    `scanner`: the verifications of the scanner beside this camera, the oldest first, whatever was active.
    `robot_noise`: what is believed of the robot's noise after the active calibration, before the next run, with
    its origin; null without a calibration, or one of an earlier version.
    """

    __pydantic_config__: ClassVar = as_it_stands(
        standing="steady", calibration_id=EXAMPLE_ID, verifications=1, shift_mm=0.021, limit_mm=0.094, scatter_mm=0.04,
        scatter_limit_mm=0.16, alarm=None, alarm_detail=None,
        rules={"weight": 0.2, "learn": 5, "allowed_mm": 0.0, "runs_between_false_alarms": 1000.0},
        points=[{"run_id": EXAMPLE_ID, "at": EXAMPLE_AT, "standing": "steady", "shift_mm": [0.03, -0.01, 0.02],
                 "average_mm": [0.017, -0.004, 0.012], "drift_mm": 0.021, "limit_mm": 0.094, "scatter_mm": 0.04}],
        changes=[{"cause": "nothing", "chance": 0.98, "axis": None, "turned_deg": None, "shift_mm": None,
                  "turn_deg": None}],
        touch_tests=[
            {"id": EXAMPLE_ID, "at": EXAMPLE_AT, "largest_mm": 0.31, "expanded_mm": 0.24, "accepted": True}
        ],
        scanner=[{"id": EXAMPLE_ID, "at": EXAMPLE_AT, "scan_id": EXAMPLE_ID, "probing_form_mm": 0.08,
                  "probing_size_mm": 0.03, "sphere_spacing_mm": -0.02}],
        robot_noise={"robot_rotation_deg": 0.012, "robot_translation_mm": 0.11, "rotation_factor": 1.4,
                     "translation_factor": 1.5, "origin": "learnt", "arm": "IRB 1600-6/1.2"},
    )  # fmt: skip

    alarm_detail: SentenceDocument | None
    rules: DriftRulesDocument
    points: list[DriftPointDocument]
    changes: list[DriftChangeDocument]
    touch_tests: list[DriftTouchDocument]
    scanner: list[DriftScannerDocument]
    robot_noise: NoiseBeliefDocument | None

    @classmethod
    def of(
        cls,
        chart: DriftChart,
        settings: DriftSettings,
        limit: int,
        touched: Sequence[DriftTouchDocument] = (),
        accepted: Sequence[DocumentRecord] = (),
    ) -> "DriftDocument":
        report = chart.report
        return cls(
            **vars(report),
            alarm_detail=None if report.alarm is None else SentenceDocument.each_of([report.alarm])[0],
            rules=DriftRulesDocument(**vars(rules_of(settings))),
            points=list(chart.points[-limit:]),
            changes=list(chart.changes),
            touch_tests=list(touched),
            scanner=split_damaged(documents_of(DriftScannerDocument.of_record, accepted))[0],
            robot_noise=chart.robot_noise,
        )  # fmt: skip
