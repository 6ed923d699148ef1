"""The table of documents with a JSON Schema, generated from their models; a field's description stands below it."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

from pydantic import BaseModel

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.plan import AssessedDocument, PlanDocument, PlannedDocument
from calibration.documents.requirement import PointsFile
from calibration.documents.rig import RigDocument
from calibration.documents.session import SessionDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchesDocument
from calibration.monitoring.comparison import ComparisonDocument
from daemon.scans.scanner_acceptance import AcceptanceDocument
from daemon.sessions.detections import DetectionsDocument
from daemon.store.backup import BackupManifestDocument
from daemon.tools.acceptance_report import RobotAcceptanceDocument
from daemon.tools.batch_registration.tasks import ManifestDocument, OutcomeDocument
from daemon.tools.setup_record import SetupRecordDocument
from registration.documents import ProfilesDocument, RegistrationReportDocument
from registration.scan_folder import ScanDocument, StitchingDocument
from tests.calibration.documents.schema_examples import (
    ACCEPTANCE,
    BACKUP,
    DETECTIONS,
    MANIFEST,
    OUTCOME,
    PLAN,
    POINTS,
    PROFILES,
    SCAN,
    SESSION,
    SETUP,
    TIP,
    TOUCHES,
)

DIALECT = "https://json-schema.org/draft/2020-12/schema"


@dataclass(frozen=True)
class FileKind:
    """A kind of file: its model, whether it is read or written, and an example of what is read."""

    model: type[BaseModel]
    mode: Literal["validation", "serialization"]
    example: Mapping[str, Any] | None = None


FILES: Mapping[str, FileKind] = MappingProxyType({
    "session": FileKind(SessionDocument, "validation", SESSION),
    "scan": FileKind(ScanDocument, "validation", SCAN),
    "profiles": FileKind(ProfilesDocument, "validation", PROFILES),
    "plan": FileKind(PlanDocument, "validation", PLAN),
    "planned": FileKind(PlannedDocument, "serialization"),
    "points": FileKind(PointsFile, "validation", POINTS),
    "tip": FileKind(TipDocument, "validation", TIP),
    "touches": FileKind(TouchesDocument, "validation", TOUCHES),
    "calibration": FileKind(CalibrationDocument, "serialization"),
    "arm": FileKind(ArmErrorsDocument, "serialization"),
    "rig": FileKind(RigDocument, "serialization"),
    "report": FileKind(RegistrationReportDocument, "serialization"),
    "manifest": FileKind(ManifestDocument, "serialization", MANIFEST),
    "outcome": FileKind(OutcomeDocument, "serialization", OUTCOME),
    "assessed": FileKind(AssessedDocument, "serialization"),
    "comparison": FileKind(ComparisonDocument, "serialization"),
    "touch-test": FileKind(TouchTestDocument, "serialization"),
    "stitching": FileKind(StitchingDocument, "serialization"),
    "scanner": FileKind(AcceptanceDocument, "serialization"),
    "detections": FileKind(DetectionsDocument, "serialization", DETECTIONS),
    "acceptance": FileKind(RobotAcceptanceDocument, "serialization", ACCEPTANCE),
    "setup": FileKind(SetupRecordDocument, "validation", SETUP),
    "backup": FileKind(BackupManifestDocument, "serialization", BACKUP),
})  # fmt: skip
"""By the name that `handeyed schema` takes."""


def schema_of(name: str) -> dict[str, Any]:
    """The JSON Schema of a kind of file; KeyError for another name."""
    kind = FILES[name]
    schema = kind.model.model_json_schema(mode=kind.mode)
    examples = {} if kind.example is None else {"examples": [dict(kind.example)]}
    return {"$schema": DIALECT, **schema, **examples}
