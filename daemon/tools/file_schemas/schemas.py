"""The table of documents with a JSON Schema, generated from their models, each field with its meaning."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

from pydantic import BaseModel

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.plan import PlanDocument, PlannedDocument
from calibration.documents.requirement import PointsFile
from calibration.documents.rig import RigDocument
from calibration.documents.session import SessionDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touches import TouchesDocument
from daemon.tools.file_schemas.examples import PLAN, POINTS, PROFILES, SCAN, SESSION, TIP, TOUCHES
from daemon.tools.file_schemas.meanings import MEANINGS
from registration.documents import ProfilesDocument, RegistrationReportDocument, ScanDocument

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
})  # fmt: skip
"""By the name that `handeyed schema` takes."""


def schema_of(name: str) -> dict[str, Any]:
    """The JSON Schema of a kind of file; KeyError for another name."""
    kind = FILES[name]
    schema = kind.model.model_json_schema(mode=kind.mode)
    for title, part in {kind.model.__name__: schema, **schema.get("$defs", {})}.items():
        for field, described in part.get("properties", {}).items():
            if (meaning := MEANINGS.get(f"{title}.{field}") or MEANINGS.get(field)) is not None:
                described["description"] = meaning
    examples = {} if kind.example is None else {"examples": [dict(kind.example)]}
    return {"$schema": DIALECT, **schema, **examples}
